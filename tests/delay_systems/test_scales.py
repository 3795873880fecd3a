"""Slow beside fast, short beside long, and roots that only rounding keeps from zero: closed forms at every scale."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.linalg import block_diag

import susp_ctrl as sc
from susp_ctrl.delay_systems.model.perron import scaled_row_sums


def states(*A, delays=None):
    """x' = A0 x + sum A_k x(t - delays_k)."""
    return sc.DelayLTI.from_state_delays(
        A=[np.atleast_2d(np.asarray(a, dtype=float)) for a in A], delays=delays or [1.0] * (len(A) - 1)
    )


@pytest.mark.analytical
@pytest.mark.parametrize("fast", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("gain", [1e-4, 1e-2, 1.0])
def test_a_fast_pole_beside_changes_no_crossing(gain, fast):
    """x' = -k x(t - tau) loses stability at pi/2k whatever else there is."""
    loop = states(np.diag([0.0, -fast]), np.diag([-gain, 0.0]))
    sweep = sc.sweep_delays(loop, up_to=4.0 / gain)
    assert sweep.delay_margin == pytest.approx(np.pi / 2 / gain, rel=1e-9)
    assert sweep.decided
    assert sweep.intervals["unstable_roots"].tolist() == [0, 2]
    assert sweep.crossings["omega"].to_numpy() == pytest.approx(gain, rel=1e-9)


@pytest.mark.analytical
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e6])
def test_a_fast_pole_coupled_in_changes_little(speed):
    """x' = -k z(t - tau), z' = f (x - z): phase pi/2 + atan(w/f) + w tau, |w| = k to second order in k/f."""
    k, f = 1e-5 * speed, 1e3 * speed
    loop = states([[0.0, 0.0], [f, -f]], [[0.0, -k], [0.0, 0.0]])
    sweep = sc.sweep_delays(loop, up_to=3.0 / k)
    w = np.sqrt(0.5 * (-(f**2) + np.sqrt(f**4 + 4 * f**2 * k**2))) if f < 1e3 * k else k
    assert sweep.delay_margin == pytest.approx((np.pi / 2 - np.arctan(w / f)) / w, rel=1e-9)
    assert sweep.decided
    assert sweep.proven


@pytest.mark.analytical
@pytest.mark.parametrize(("a", "b"), [(0.3, 0.1 + 0.2), (0.1 + 0.2, 0.3), (3.0, 3.0)])
@pytest.mark.parametrize("fast", [None, 1e6])
def test_a_root_at_zero_up_to_rounding_is_one(a, b, fast):
    """x' = a x - a x(t - tau) has s = 0 for every delay, and a second root there at tau = 1/a."""
    A0, A1 = np.array([[a]]), np.array([[-b]])
    if fast:
        A0, A1 = block_diag(A0, [[-fast]]), block_diag(A1, [[0.0]])
    sweep = sc.sweep_delays(states(A0, A1), up_to=0.9 / a)
    assert sweep.axis_roots == (0.0,)
    assert sweep.delay_margin == 0.0
    assert sweep.stable_intervals == []
    assert set(sweep.intervals["unstable_roots"]) <= {0, -1}


@pytest.mark.analytical
@pytest.mark.parametrize("slow", [1e-3, 1e-8])
def test_a_slow_stable_mode_is_no_root_at_zero(slow):
    sweep = sc.sweep_delays(states(np.diag([-slow, -1e6]), np.diag([-slow / 5, 0.0])))
    assert sweep.axis_roots == ()
    assert sweep.delay_margin == np.inf
    result = sc.delay_independent_stability(states(np.diag([-slow, -1e6]), np.diag([slow / 10, 0.0])))
    assert result.stable is True


@pytest.mark.analytical
def test_a_slow_unstable_mode_is_seen_beside_a_fast_one():
    result = sc.delay_independent_stability(states(np.diag([1e-5, -1e8]), np.diag([1e-6, 0.0])))
    assert result.stable is False


@pytest.mark.analytical
@pytest.mark.parametrize("up_to", [1e-6, 1.0, 100.0])
def test_a_tiny_margin_is_found_on_a_long_line(up_to):
    """x'' + c x' + x + x(t - tau): |1 - w^2 + jcw| = 1 near w = sqrt 2, lost at tau = c to first order."""
    c = 1e-7
    sweep = sc.sweep_delays(states([[0.0, 1.0], [-1.0, -c]], [[0.0, 0.0], [-1.0, 0.0]]), up_to=up_to)
    assert sweep.delay_margin == pytest.approx(c, rel=1e-6)
    assert sweep.stable_intervals[0] == (0.0, pytest.approx(c, rel=1e-6))


@pytest.mark.analytical
def test_a_tie_at_zero_frequency_and_elsewhere_is_not_decided():
    """|P(jw)|^2 = 1/(1 + w^2 (w^2 - 1)^2) is one at w = 0 and at w = 1, where the loop has a root on the axis."""
    squared = np.roots([-1.0, 0.0, -2.0, 0.0, -1.0, 0.0, 1.0])
    p = np.real(np.poly(squared[squared.real < 0.0]))
    A0, A1 = np.zeros((3, 3)), np.zeros((3, 3))
    A0[0, 1] = A0[1, 2] = 1.0
    A0[2] = -p[::-1][:3]
    A1[2, 0] = -1.0
    result = sc.delay_independent_stability(states(A0, A1))
    assert result.margin == pytest.approx(1.0, rel=1e-12)
    assert result.stable is None


@pytest.mark.analytical
def test_a_limit_at_zero_frequency_only_is_stable():
    """x' = -x - x(t - tau): |P| = 1 at w = 0 only, where the sign is the wrong one."""
    assert sc.delay_independent_stability(states([[-1.0]], [[-1.0]])).stable is True


@pytest.mark.analytical
@pytest.mark.parametrize(("b", "c"), [(2.0, -2.0), (0.9, -0.9), (2.0, -1.5), (-0.7, 0.6)])
def test_two_delays_of_opposite_gains(b, c):
    """x' = -x + b x(t - tau1) + c x(t - tau2), b + c < 1: stable for all delays only if |b| + |c| <= 1."""
    assert sc.delay_independent_stability(states([[-1.0]], [[b]], [[c]], delays=[1.0, 2.0])).stable is False
    scaled = 0.99 / (abs(b) + abs(c))
    inner = states([[-1.0]], [[scaled * b]], [[scaled * c]], delays=[1.0, 2.0])
    assert sc.delay_independent_stability(inner).stable is True


@pytest.mark.analytical
def test_opposite_gains_of_two_states_and_of_six_delays():
    """Eigenvalues of the delayed part at delays half a turn apart are 2 rho(A1) > 1: unstable for some."""
    three = [
        np.outer([1.0, 0.5], [0.6, 0.4]),
        -np.outer([1.0, 0.5], [0.6, 0.4]),
        np.outer([0.1, 0.1], [0.1, 0.0]),
    ]
    assert sc.delay_independent_stability(states(-np.eye(2), *three, delays=[1.0, 2.0, 3.0])).stable is False
    full = np.array([[0.9, 0.3], [0.1, 0.8]])
    assert sc.delay_independent_stability(states(-np.eye(2), full, -full, delays=[1.0, 2.0])).stable is False
    six = [[[0.9]], [[-0.9]]] * 3
    assert sc.delay_independent_stability(states([[-1.0]], *six, delays=[1.0, 2, 3, 4, 5, 6])).stable is False


@pytest.mark.analytical
def test_results_have_no_truth_value():
    sweep = sc.sweep_delays(states([[0.0]], [[-1.0]]))
    with pytest.raises(ValueError, match="stable_intervals"):
        bool(sweep)
    mapped = sc.stability_map(states([[-1.0]], [[-0.4]], [[-0.3]], delays=[1.0, 2.0]))
    with pytest.raises(ValueError, match="unstable_roots"):
        bool(mapped)


@pytest.mark.property
@pytest.mark.parametrize("delays", [(1e-6, 1e3), pytest.param((0.1, 1e3), marks=pytest.mark.slow)])
def test_a_sweep_over_hundreds_of_turns_gives_up_in_time(delays):
    """Some hundred crossings beside each other: not proven, and said so, within a second or two of work."""
    A0, A1, A2 = [[0, 1], [-1, -0.2]], [[0, 0], [0.3, 0.1]], [[0, 0], [-0.2, 0.3]]
    begin = time.process_time()
    sweep = sc.sweep_delays(states(A0, A1, A2, delays=[1.0, 1.0]), direction=delays, up_to=1.0)
    assert time.process_time() - begin < 4.0
    assert not sweep.proven
    assert "did not prove" in sweep.message
    if not sweep.decided:
        assert set(sweep.intervals["unstable_roots"]) == {-1}
        assert np.isnan(sweep.delay_margin)


@pytest.mark.property
@pytest.mark.parametrize("seed", [2, pytest.param(0, marks=pytest.mark.slow)])
def test_incommensurate_delays_are_proven(seed):
    """Where real and imaginary part have nearly the same direction boxes are left over in long strips."""
    rng = np.random.default_rng(seed)
    A0 = rng.standard_normal((6, 6)) - 2.0 * np.eye(6)
    blocks = [2.0 * np.outer(rng.standard_normal(6), rng.standard_normal(6)) for _ in range(3)]
    direction = np.array([1.0, np.sqrt(2.0), np.pi / 4])
    sweep = sc.sweep_delays(states(A0, *blocks), direction=direction, up_to=10.0)
    assert sweep.proven
    assert sweep.decided
    for tau, omega in sweep.crossings[["tau", "omega"]].to_numpy():
        E = np.exp(-1j * omega * tau * direction)
        K = 1j * omega * np.eye(6) - A0 - np.tensordot(E, blocks, axes=1)
        assert np.linalg.svd(K, compute_uv=False)[-1] < 1e-11 * np.linalg.norm(K)


@pytest.mark.property
@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((2, 2)),
        np.eye(2),
        [[0.0, 3.0], [0.0, 0.0]],
        [[1.0, 2.0], [1e-9, 1.0]],
        [[2.0, 0.0], [5.0, 2.0]],
    ],
)
def test_scaled_row_sums_bound_the_spectral_radius(matrix):
    """The largest is an upper bound of the spectral radius, and a close one (defective matrices: nearly)."""
    X = np.asarray(matrix, dtype=float)[None]
    largest = scaled_row_sums(X).max()
    radius = np.abs(np.linalg.eigvals(X[0])).max()
    assert radius * (1 - 1e-12) <= largest <= radius * (1 + 1e-6) + 1e-5


@pytest.mark.analytical
@pytest.mark.parametrize("weight", [-1e-310, 5e-324, 1e-200, -1e-100, 1e-30])
def test_feedback_that_is_next_to_nothing_changes_nothing_and_ends(weight):
    """x' = -x + w x(t - 1): the root -1 to rounding, whatever is asked."""
    loop = sc.DelayLTI.from_state_delays([[[-1.0]], [[weight]]], [1.0], B=[[1.0]], C=[[1.0]])
    verdict = sc.stability(loop)
    assert verdict.stable
    assert verdict.abscissa == pytest.approx(-1.0, rel=1e-12)
    assert sc.sweep_delays(loop).delay_margin == np.inf
    assert sc.h2_norm(loop) == pytest.approx(np.sqrt(0.5), rel=1e-9)
    assert sc.characteristic_roots(loop, 1) == pytest.approx([-1.0])


def test_delays_below_the_range_of_products_are_refused():
    for make in (
        lambda: sc.delay(5e-324),
        lambda: sc.delay([1.0, 1e-40]),
        lambda: sc.FeedbackChannel(0, 0, 1.0, 1e-31),
    ):
        with pytest.raises(sc.InputError, match="zero or at least 1e-30 is needed"):
            make()
