"""Multiple roots, and slow roots beside fast poles: nothing may vanish, and no verdict may rest on nothing found."""

import time

import numpy as np
import pytest
import scipy.special

import susp_ctrl as sc
from susp_ctrl.delay_systems import verdict as verdict_module
from susp_ctrl.delay_systems.model.characteristic import CharacteristicMatrix
from susp_ctrl.errors import UndecidedStabilityWarning

pytestmark = pytest.mark.analytical


def system(A, delays):
    return sc.DelayLTI.from_state_delays(A=[np.atleast_2d(a) for a in A], delays=delays)


def triple_root_at(g):
    """s^2 + a1 s + a0 + b e^-s with f = f' = f'' = 0 at s = g."""
    b = -2.0 * np.exp(g)
    a1 = -2.0 - 2.0 * g
    a0 = 2.0 - g * g - a1 * g
    return system([[[0.0, 1.0], [-a0, -a1]], [[0.0, 0.0], [-b, 0.0]]], [1.0])


def beside(gain, delay, pole):
    """x1' = gain x1(t - delay) beside x2' = pole x2."""
    return system([np.diag([0.0, pole]), np.diag([gain, 0.0])], [delay])


def rightmost(gain, delay):
    return complex(scipy.special.lambertw(gain * delay)) / delay


@pytest.mark.parametrize("g", [-0.5, 0.2, 0.7, -1.3])
def test_triple_root(g):
    loop = triple_root_at(g)
    verdict = sc.stability(loop)
    assert verdict.stable is (g < 0.0)
    assert verdict.unstable_roots == (3 if g > 0.0 else 0)
    assert abs(verdict.abscissa - g) < 1e-6
    assert abs(sc.spectral_abscissa(loop) - g) < 1e-6
    found = sc.characteristic_roots(loop, right_of=g - 1.0)
    assert found.size == 3
    assert np.max(np.abs(found - g)) < 1e-4


def test_double_root_at_the_origin():
    """x' = x - x(t - 1): s - 1 + e^-s = s^2/2 - ..."""
    loop = system([1.0, -1.0], [1.0])
    with pytest.warns(UndecidedStabilityWarning, match="near 0 rad/s"):
        verdict = sc.stability(loop)
    assert verdict.stable is None
    assert abs(verdict.abscissa) < 1e-7
    assert np.sum(np.abs(sc.characteristic_roots(loop, 4)) < 1e-7) == 2


@pytest.mark.parametrize("pole", [-1e4, -1e6, -1e8, -1e10])
@pytest.mark.parametrize(
    ("gain", "delay"), [(-1.0, 1.0), (-2.0, 1.0), (-1e-4, 1e4), (-1e-4, 2e4), (-30.0, 0.04)]
)
def test_slow_loop_beside_a_fast_pole(gain, delay, pole):
    loop, exact = beside(gain, delay, pole), rightmost(gain, delay)
    verdict = sc.stability(loop)
    assert verdict.stable is (exact.real < 0.0)
    assert verdict.abscissa == pytest.approx(exact.real, rel=1e-9)
    assert verdict.unstable_roots == (2 if exact.real > 0.0 else 0)
    assert sc.spectral_abscissa(loop) == pytest.approx(exact.real, rel=1e-9)


def test_slow_pole_beside_fast_ones():
    """x1' = -1e-5 x1 + 1e-6 x1(t - 1): a root at -9e-6 up to 1e-11."""
    verdict = sc.stability(system([np.diag([-1e-5, -1e8]), np.diag([1e-6, 0.0])], [1.0]))
    assert verdict.stable is True
    exact = complex(scipy.special.lambertw(1e-6 * np.exp(1e-5))).real - 1e-5
    assert verdict.abscissa == pytest.approx(exact, rel=1e-9)


def test_without_delays_a_double_slow_root_beside_a_fast_one():
    A = np.array([[-1e-3, 1.0, 0.0], [0.0, -1e-3, 0.0], [0.0, 0.0, -1e9]])
    verdict = sc.stability(system([A], []))
    assert verdict.stable is True
    assert verdict.abscissa == pytest.approx(-1e-3, rel=1e-3)


def test_reach_of_the_right_half_plane_ignores_fast_stable_poles():
    """x' = -x(t - 1): |s| <= 1 for Re s >= 0, whatever stands beside it; and no root may lie beyond the reach."""
    for pole in (-1.0, -1e3, -1e9):
        K = CharacteristicMatrix.of(beside(-1.0, 1.0, pole).folded)
        assert 1.0 <= K.right_reach < 1.2
    random = np.random.default_rng(0)
    for _ in range(30):
        n = random.integers(1, 5)
        A = [random.normal(size=(n, n)) * 10.0 ** random.uniform(-1, 2, (n, 1)) for _ in range(3)]
        loop = system(A, random.uniform(0.0, 0.4, 2))
        reach = CharacteristicMatrix.of(loop.folded).right_reach
        unstable = sc.characteristic_roots(loop, right_of=0.0)
        assert np.all(np.abs(unstable) <= reach)


def test_a_missed_rightmost_root_leaves_no_loop_stable(monkeypatch):
    """Roots with the rightmost pair cut off: none is unstable, yet the verdict must find where the pair is."""
    loop = system([0.0, -1.0], [1.0])

    def without_first_pair(original):
        def found(*arguments):
            roots = original(*arguments)
            cut = {name: getattr(roots, name)[2:] for name in ("roots", "residuals", "uncertainties")}
            return roots._replace(complete=False, **cut)

        return found

    monkeypatch.setattr(verdict_module, "roots_near_axis", without_first_pair(verdict_module.roots_near_axis))
    assert sc.stability(loop).abscissa == pytest.approx(rightmost(-1.0, 1.0).real, rel=1e-9)
    monkeypatch.setattr(verdict_module, "rightmost_roots", without_first_pair(verdict_module.rightmost_roots))
    verdict = sc.stability(loop)  # counts alone find where the missing pair is
    assert verdict.agreement["roots"] is None
    assert verdict.abscissa == pytest.approx(rightmost(-1.0, 1.0).real, rel=1e-6)


def test_fast_poles_and_many_unstable_roots_cost_little():
    """Fast poles need no resolved delay, and of 15916 unstable roots only the rightmost are computed."""
    loops = [beside(-1.0, 1.0, -1e5), beside(-1.0, 1.0, -1e8)]
    sc.stability(loops[0])
    started = time.process_time()
    for loop in loops:
        sc.stability(loop)
    assert time.process_time() - started < 0.4
    loop = system([0.0, -1e4], [5.0])
    started = time.process_time()
    verdict = sc.stability(loop)
    assert time.process_time() - started < 5.0
    assert verdict.stable is False
    assert verdict.unstable_roots == 2 * int((5e4 - np.pi / 2.0) // (2.0 * np.pi) + 1)
    assert verdict.abscissa == pytest.approx(rightmost(-1e4, 5.0).real, rel=1e-9)


@pytest.mark.parametrize("size", [1e-13, 1e-11, 1e-9, 1e-6, 1e-3])
def test_nearly_triple_root(size):
    """Entries moved by `size` move a triple root by about its cube root: no more, and no root is lost."""
    random = np.random.default_rng(5)
    for g in (-0.6, -0.9, 0.5):
        e = 1.0 + size * random.normal(size=3)
        b, a1 = -2.0 * np.exp(g), -2.0 - 2.0 * g
        a0 = 2.0 - g * g - a1 * g
        loop = system([[[0.0, 1.0], [-a0 * e[0], -a1 * e[1]]], [[0.0, 0.0], [-b * e[2], 0.0]]], [1.0])
        verdict = sc.stability(loop)
        assert verdict.stable is (g < 0.0)
        assert verdict.unstable_roots == (3 if g > 0.0 else 0)
        assert abs(verdict.abscissa - g) < 10.0 * size ** (1.0 / 3.0) + 1e-4
