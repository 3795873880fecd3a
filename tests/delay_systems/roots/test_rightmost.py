"""Characteristic roots: closed forms, the half car, literature cases, traps."""

from __future__ import annotations

import warnings

import control
import numpy as np
import oracles
import pytest
import scipy.special
from delay_cases import matrices, row, rows, system
from delay_oracles import characteristic_matrix

import susp_ctrl as sc
from susp_ctrl.delay_systems.model.characteristic import CharacteristicMatrix
from susp_ctrl.delay_systems.model.lft import Realization
from susp_ctrl.delay_systems.roots.rightmost import rightmost_roots, roots_right_of
from susp_ctrl.delay_systems.roots.root_refinement import refine
from susp_ctrl.errors import InputError

PUBLISHED = {
    # recomputed from eq. (1) by an independent program: design -> gains, delays, rightmost root
    "random": ((19345.0, 26150.0), (0.5530, 0.5186), -1.17254 + 8.54527j),
    "harmonic": ((29653.0, -4416.0), (0.3255, 0.5438), -2.24877 + 7.71738j),
}
PASSIVE = [-1.7683 + 6.3849j, -2.0801 + 7.9949j, -16.9644 + 65.5068j, -18.8010 + 68.3799j]
UNDELAYED = [-1.6223 + 6.1111j, -1.8646 + 7.5440j, -17.1799 + 69.8619j, -18.9471 + 71.8461j]


def half_car(gains, delays):
    """The loop from eq. (1), states (x_tf, x_tr, x_c, phi) and their rates."""
    at_zero = oracles.dynamic_stiffness(np.array(0.0), (0.0, 0.0)).real
    # Z(s) = M s^2 + C s + K: take the matrices from the oracle's values at s = 1 and s = -1
    plus, minus = (oracles.dynamic_stiffness(np.array(s), (0.0, 0.0)).real for s in (1.0, -1.0))
    mass, damping = 0.5 * (plus + minus) - at_zero, 0.5 * (plus - minus)
    acceleration = -np.linalg.solve(mass, np.hstack([at_zero, damping]))
    A = np.vstack([np.eye(8)[4:], acceleration])
    delayed = []
    for axle in range(2):
        unit = [0.0, 0.0]
        unit[axle] = 1.0
        fed = oracles.dynamic_stiffness(np.array(0.0), unit).real - at_zero
        A_k = np.zeros((8, 8))
        A_k[4:, :4] = -gains[axle] * np.linalg.solve(mass, fed)
        delayed.append(A_k)
    return sc.DelayLTI.from_state_delays(A=[A, *delayed], delays=delays)


def upper(roots):
    return roots[roots.imag >= 0.0]


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("a", "b", "tau"), [(0.0, -1.0, 1.0), (-1.0, -1.0, 1.0), (0.7, -2.0, 3.0), (1.0, 0.5, 0.2)]
)
def test_scalar_roots_are_branches_of_the_lambert_function(a, b, tau):
    """x' = a x + b x(t - tau): s = a + W_k(b tau e^{-a tau})/tau."""
    branches = a + scipy.special.lambertw(b * tau * np.exp(-a * tau), np.arange(-12, 13)) / tau
    expected = branches[np.argsort(-branches.real)][:9]
    found = sc.characteristic_roots(sc.DelayLTI.from_state_delays(A=[[[a]], [[b]]], delays=[tau]), count=9)
    assert len(found) in (9, 10)
    np.testing.assert_allclose(np.sort(found.real)[::-1][:9], expected.real, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(np.abs(found.imag)[:9], np.abs(expected.imag), rtol=1e-11, atol=1e-12)


@pytest.mark.analytical
def test_equal_delays_in_two_channels_act_as_one():
    """Two channels of half the gain each, with the same delay: the Lambert function again."""
    halves = sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-1.0]], [[-1.0]]], delays=[1.0, 1.0])
    expected = scipy.special.lambertw(-2.0)
    assert abs(upper(sc.characteristic_roots(halves, 1))[0] - expected) < 1e-13


@pytest.mark.analytical
def test_rank_two_delayed_matrix_with_known_modes():
    """A1 of rank two in a rotated basis: two Lambert functions side by side."""
    angle = 0.6
    Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    A0, A1 = Q @ np.diag([-0.5, -1.0]) @ Q.T, Q @ np.diag([-2.0, -0.3]) @ Q.T
    branches = np.concatenate(
        [
            a + scipy.special.lambertw(b * 1.3 * np.exp(-1.3 * a), np.arange(-6, 6)) / 1.3
            for a, b in ((-0.5, -2.0), (-1.0, -0.3))
        ]
    )
    expected = branches[branches.real > -2.0]
    found = sc.characteristic_roots(sc.DelayLTI.from_state_delays(A=[A0, A1], delays=[1.3]), right_of=-2.0)
    assert found.size == expected.size
    assert np.max(np.min(np.abs(found[:, None] - expected), axis=1)) < 1e-11


@pytest.mark.literature
def test_half_car_passive_and_undelayed_roots():
    """Recomputed from eq. (1) by an independent program, four decimals."""
    for gains, expected in (((0.0, 0.0), PASSIVE), ((19345.0, 26150.0), UNDELAYED)):
        found = upper(sc.characteristic_roots(half_car(gains, (0.0, 0.0))))
        np.testing.assert_allclose(found, expected, atol=6e-5)


@pytest.mark.literature
@pytest.mark.parametrize("design", PUBLISHED)
def test_half_car_with_published_delays(design):
    """From eq. (1), five decimals; every root a zero of the 4x4 oracle; the package's own car agrees."""
    gains, delays, rightmost = PUBLISHED[design]
    found = sc.characteristic_roots(half_car(gains, delays), count=20)
    assert abs(found[0] - rightmost) < 6e-6
    singular = np.linalg.svd(oracles.dynamic_stiffness(found, gains, delays), compute_uv=False)
    assert np.all(singular[:, -1] < 1e-11 * singular[:, 0])
    channels = [
        sc.FeedbackChannel(f"unsprung_displacement_{axle}", f"force_{axle}", gains[k], delays[k])
        for k, axle in enumerate(("front", "rear"))
    ]
    loop = sc.close_loop(sc.HalfCar().plant(), channels)
    np.testing.assert_allclose(sc.characteristic_roots(loop, count=20), found, rtol=1e-10)


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("rightmost_roots"))
def test_literature_rightmost_roots(case, row):
    """Roots of tests/data/delay_cases.json (source in each case), at the tolerance of the row."""
    expected = np.array([complex(*z) for z in row["value"]])
    number = int(np.sum(np.where(expected.imag > 0.0, 2, 1)))
    found = upper(sc.characteristic_roots(system(case, row.get("at_delays")), number))
    assert np.max(np.abs(found[: expected.size] - expected)) <= row["tolerance"]


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("spectral_abscissa"))
def test_literature_spectral_abscissa(case, row):
    """Spectral abscissae of tests/data/delay_cases.json, at the tolerance of the row."""
    delays = [[tau] for tau in row["at_tau"]] if "at_tau" in row else [row["at_delays"]]
    for tau, expected in zip(delays, np.atleast_1d(row["value"]), strict=True):
        assert abs(sc.spectral_abscissa(system(case, tau)) - expected) <= row["tolerance"]


@pytest.mark.literature
def test_nep_dep1_has_a_root_at_one():
    """Gallery problem nep_dep1: one eigenvalue equal to one."""
    found = sc.characteristic_roots(system("nep_dep1"), right_of=0.0)
    assert np.min(np.abs(found - 1.0)) <= row("nep_dep1", "contains_root")["tolerance"]
    assert found.size == row("nep_dep1", "unstable_root_count")["value"]


@pytest.mark.literature
def test_defective_double_root_is_kept_twice():
    """Gallery problem nep_dep_double: a double root at 3 pi j, and 4.5 pi j also on the axis."""
    found = sc.characteristic_roots(system("nep_dep_double"), count=8)
    assert np.sum(np.abs(found - 3j * np.pi) < row("nep_dep_double", "double_root")["tolerance"]) == 2
    assert np.sum(np.abs(found + 3j * np.pi) < 1e-6) == 2
    assert np.sum(np.abs(found - 4.5j * np.pi) < row("nep_dep_double", "also_on_axis")["tolerance"]) == 1


@pytest.mark.literature
def test_published_growth_factor_is_that_of_a_coarse_method():
    """hayes: 0.94118937 is printed (first-order semi-discretisation); exact is exp(0.1 Re s), 1.1e-4 larger."""
    expected = row("hayes_a-1_b-1", "growth_factor_per_0.1s")
    factor = np.exp(0.1 * sc.spectral_abscissa(system("hayes_a-1_b-1")))
    assert abs(factor - expected["value"]) <= expected["tolerance"]
    assert abs(factor - expected["published"]) > 1e-5


@pytest.mark.literature
def test_characteristic_polynomial_without_delay():
    """MathWorks, "Analyzing Control Systems with Delays": 1, 0.36, 1.24, 0.18."""
    expected = row("matlab_pi_deadtime", "delay_free_char_poly")
    roots = sc.characteristic_roots(system("matlab_pi_deadtime", [0.0]))
    np.testing.assert_allclose(np.poly(roots).real, expected["value"], atol=expected["tolerance"])


@pytest.mark.literature
def test_neuron_hopf_point():
    """DDE-BIFTOOL demo 1: at a21 = 0.807123 a pair lies on the axis at 0.781965 rad/s."""
    case, omega = "neuron_three_delays", row("neuron_three_delays", "hopf_omega")
    a21 = row(case, "hopf_parameter_a21")["value"]
    A = matrices(case)
    A[1][1, 0] = a21
    root = upper(sc.characteristic_roots(system(case, A=A), 4))
    nearest = root[np.argmin(np.abs(root - 1j * omega["value"]))]
    assert abs(nearest.imag - omega["value"]) <= omega["tolerance"]
    assert abs(nearest.real) < 1e-9


@pytest.mark.analytical
def test_without_delays_the_roots_are_the_eigenvalues():
    plant = control.StateSpace(np.diag([-1.0, -2.0, 0.5]), np.zeros((3, 1)), np.zeros((1, 3)), 0)
    np.testing.assert_allclose(sc.characteristic_roots(plant), [0.5, -1.0, -2.0])
    np.testing.assert_allclose(sc.characteristic_roots(plant, count=1), [0.5])
    np.testing.assert_allclose(sc.characteristic_roots(plant, right_of=-1.5), [0.5, -1.0])
    assert sc.characteristic_roots(sc.delay(0.3)).size == 0
    assert sc.spectral_abscissa(sc.delay(0.3)) == -np.inf


@pytest.mark.analytical
def test_delays_outside_any_loop_move_no_root():
    """Input delay, and a delayed signal that cancels: the roots are those of A, all of them and no others."""
    behind = sc.delay(0.4) * control.tf([1.0], [1.0, 3.0, 2.0])
    np.testing.assert_allclose(sc.characteristic_roots(behind), [-1.0, -2.0], atol=1e-12)
    A, rotation = np.diag([-1.0, -2.0]), np.array([[1.0, 2.0], [-1.0, 1.0]])
    nilpotent = rotation @ np.array([[0.0, 1.0], [0.0, 0.0]]) @ np.linalg.inv(rotation)
    hidden = sc.DelayLTI.from_state_delays(
        A=[rotation @ A @ np.linalg.inv(rotation), nilpotent], delays=[1.0]
    )
    np.testing.assert_allclose(sc.characteristic_roots(hidden), [-1.0, -2.0], atol=1e-9)
    np.testing.assert_allclose(sc.characteristic_roots(hidden, right_of=-1.5), [-1.0], atol=1e-9)


@pytest.mark.analytical
def test_weakly_coupled_delays_have_roots_far_to_the_left():
    """x' = -x + b x(t - 1), b = 1e-6: a real root near -1 and the branches W_k(b e) - 1 far from it."""
    found = sc.characteristic_roots(sc.DelayLTI.from_state_delays(A=[[[-1.0]], [[1e-6]]], delays=[1.0]), 3)
    branches = scipy.special.lambertw(1e-6 * np.e, np.arange(-4, 5)) - 1.0
    np.testing.assert_allclose(found.real, np.sort(branches.real)[::-1][:3], rtol=1e-9)


@pytest.mark.analytical
@pytest.mark.parametrize("weak", [1e-18, 1e-140])
def test_coupling_below_rounding_is_admitted(weak):
    """The next roots lie where no discretisation finds them: a warning, and the first root all the same."""
    loop = sc.DelayLTI.from_state_delays(A=[[[-1.0]], [[weak]]], delays=[1.0])
    with pytest.warns(RuntimeWarning, match="may be missing"):
        found = sc.characteristic_roots(loop, 3)
    assert abs(found[0] + 1.0) < 1e-12
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert abs(sc.spectral_abscissa(loop) + 1.0) < 1e-12


@pytest.mark.analytical
@pytest.mark.parametrize("tiny", [1e-16, 1e-12, 1e-7])
def test_tiny_delay_beside_a_long_one(tiny):
    """x' = -x(t - tiny) - 0.5 x(t - 1): the first order in the tiny delay is x' (1 - tiny) = ..."""
    found = sc.characteristic_roots(
        sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-1.0]], [[-0.5]]], delays=[tiny, 1.0]), 5
    )
    branches = scipy.special.lambertw(-0.5 * np.e, np.arange(-4, 5)) - 1.0
    assert np.max(np.min(np.abs(found[:, None] - branches), axis=1)) < 30.0 * tiny + 1e-11


@pytest.mark.analytical
def test_roots_that_the_delay_cannot_reach_are_kept():
    """An unstable mode beside a stable delayed loop, coupled to it in one direction only."""
    A0 = np.array([[-1.0, 0.7], [0.0, 0.3]])
    loop = sc.DelayLTI.from_state_delays(A=[A0, [[-0.5, 0.0], [0.0, 0.0]]], delays=[1.0])
    found = sc.characteristic_roots(loop, 3)
    branch = -1.0 + scipy.special.lambertw(-0.5 * np.e)
    assert abs(found[0] - 0.3) < 1e-13
    assert abs(found[1] - branch) < 1e-12


@pytest.mark.analytical
def test_identical_subsystems_give_double_roots():
    """Two copies of one loop: every root twice (not defective)."""
    loop = sc.DelayLTI.from_state_delays(A=[np.zeros((2, 2)), -np.eye(2)], delays=[1.0])
    found = sc.characteristic_roots(loop, 8)
    single = scipy.special.lambertw(-1.0, [0, 1])
    np.testing.assert_allclose(
        upper(found), np.repeat(np.where(single.imag < 0, single.conj(), single), 2), atol=1e-10
    )


@pytest.mark.analytical
def test_nilpotent_feedthrough_between_delayed_signals():
    """w1 enters z2 directly: the loop delay is tau1 + tau2. x' = -x(t - 0.3 - 0.7)."""
    plant = Realization(
        A=[[0.0]], B1=np.zeros((1, 0)), B2=[[0.0, -1.0]], C1=np.zeros((0, 1)), C2=[[1.0], [0.0]],
        D11=np.zeros((0, 0)), D12=np.zeros((0, 2)), D21=np.zeros((2, 0)), D22=[[0.0, 0.0], [1.0, 0.0]],
    )  # fmt: skip
    loop = sc.DelayLTI(plant, [0.3, 0.7])
    expected = upper(
        sc.characteristic_roots(sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-1.0]]], delays=[1.0]))
    )
    np.testing.assert_allclose(upper(sc.characteristic_roots(loop)), expected, rtol=1e-11)


@pytest.mark.analytical
def test_derivative_of_the_characteristic_matrix():
    """K' against a central difference, with feedthrough between delayed signals."""
    random = np.random.default_rng(4)
    K = CharacteristicMatrix(
        random.normal(size=(3, 3)), random.normal(size=(3, 3)), random.normal(size=(3, 3)),
        np.triu(random.normal(size=(3, 3)), 1), np.array([0.3, 0.7, 1.1]),
    )  # fmt: skip
    s = random.normal(size=5) + 1j * random.normal(size=5)
    _, slope = K.with_derivative(s)
    np.testing.assert_allclose(slope, (K(s + 1e-6) - K(s - 1e-6)) / 2e-6, rtol=1e-7, atol=1e-8)


@pytest.mark.analytical
@pytest.mark.parametrize("line", [-1.5, -3.0, -4.0])
def test_all_roots_right_of_a_line(line):
    """x' = -x(t - 1): the branches of the Lambert function with real part above the line, none else."""
    branches = scipy.special.lambertw(-1.0, np.arange(-120, 121))
    expected = branches[branches.real > line]
    found = sc.characteristic_roots(system("x_prime_minus_x_delayed", [1.0]), right_of=line)
    assert found.size == expected.size
    np.testing.assert_allclose(np.sort(found.real), np.sort(expected.real), rtol=1e-10)


def test_order_pairs_and_residuals():
    """Descending real parts, whole pairs, residuals at rounding level, uncertainties that hold."""
    K = CharacteristicMatrix.of(half_car(*PUBLISHED["random"][:2]).folded)
    for count in range(1, 12):
        found = rightmost_roots(K, count)
        assert found.complete
        assert found.roots.size in (count, count + 1)
        assert np.all(np.diff(found.roots.real) <= 0.0)
        np.testing.assert_array_equal(np.sort_complex(found.roots), np.sort_complex(found.roots.conj()))
        assert np.max(found.residuals) < 1e-10
    line = roots_right_of(K, float(found.roots[-1].real) - 1e-6)
    np.testing.assert_allclose(line.roots, found.roots, rtol=1e-10)


def test_spurious_starts_are_dropped_and_duplicates_merged():
    K = CharacteristicMatrix.of(system("x_prime_minus_x_delayed", [1.0]).folded)
    truth = complex(scipy.special.lambertw(-1.0, 0))
    starts = np.array([truth + 0.05, truth - 0.03j, truth + 0.01 + 0.02j])
    refined = refine(K, starts)
    assert refined.roots.size == 1
    assert abs(refined.roots[0] - truth) < 1e-14
    assert refined.uncertainties[0] < 1e-12


@pytest.mark.literature
def test_large_delay_roots_are_not_spurious():
    """A delay of 50 time constants: the abscissa of the scalar and the two-state case (closed form, W0)."""
    loop = sc.DelayLTI.from_state_delays(A=[[[-2.0]], [[1.0]]], delays=[50.0])
    expected = -2.0 + float(scipy.special.lambertw(50.0 * np.exp(100.0)).real) / 50.0
    found = sc.characteristic_roots(loop, 21)
    assert abs(found[0] - expected) < 1e-12
    K = characteristic_matrix([[[-2.0]], [[1.0]]], [50.0], found)
    assert np.max(np.abs(K)) < 1e-9


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"count": 0}, "count"),
        ({"count": 2.5}, "count"),
        ({"count": 3, "right_of": -1.0}, "only one"),
        ({"right_of": np.nan}, "right_of"),
        ({"right_of": -9.0}, "at most 1000"),
        ({"right_of": -1e4}, "right_of"),
    ],
)
def test_bad_input_is_named(arguments, words):
    with pytest.raises(InputError, match=words):
        sc.characteristic_roots(system("x_prime_minus_x_delayed", [1.0]), **arguments)


def test_what_is_no_system_is_refused():
    with pytest.raises(InputError, match="sys"):
        sc.characteristic_roots("half car")
