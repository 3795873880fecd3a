"""The argument-principle count: closed forms, literature counts, traps, and a dense contour as oracle."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.special
from delay_cases import CASES, row, rows, system
from delay_oracles import dense_contour_count
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems.model.characteristic import CharacteristicMatrix
from susp_ctrl.delay_systems.model.lft import Realization
from susp_ctrl.delay_systems.roots.argument_principle import (
    ContourError,
    count_right_of,
    count_roots_right_of,
)
from susp_ctrl.errors import InputError, UndecidedStabilityWarning


def scalar(a, b, tau):
    return sc.DelayLTI.from_state_delays(A=[[[a]], [[b]]], delays=[tau])


@pytest.mark.analytical
@pytest.mark.parametrize("turns", range(6))
def test_integrator_with_delay_gains_a_pair_at_every_turn(turns):
    """x' = -x(t - tau): a pair crosses at tau = pi/2 + 2 pi k, never back."""
    critical = np.pi / 2 + 2.0 * np.pi * turns
    for offset in (1e-1, 1e-4, 1e-7, 1e-10):
        assert sc.count_unstable_roots(scalar(0.0, -1.0, critical - offset)) == 2 * turns
        assert sc.count_unstable_roots(scalar(0.0, -1.0, critical + offset)) == 2 * turns + 2


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("unstable_root_count"))
def test_literature_counts(case, row):
    """Counts of tests/data/delay_cases.json, source in each case."""
    assert sc.count_unstable_roots(system(case, row.get("at_delays"))) == row["value"]


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("unstable_root_count_intervals"))
def test_literature_counts_between_crossings(case, row):
    """Every interval of the common delay: at its middle and close to both ends."""
    several = len(case["delays"]) - 1
    # a root that touches the axis leaves it with the square of the distance
    close = 1e-3 if "degenerate" in case["tags"] else 1e-6
    for low, high, number in row["value"]:
        for share in (0.5, close, 1.0 - close):
            tau = low + share * (high - low)
            assert sc.count_unstable_roots(system(case, [tau] * several)) == number, tau


@pytest.mark.literature
def test_literature_counts_of_independent_delays():
    """Haag, Münz, Allgöwer 2009, example 6: stable on the diagonal, not on the axis tau1 = 0."""
    for low, high, number in row("haag6_two_delay_oscillator", "unstable_root_count_intervals_tau1_0")[
        "value"
    ]:
        assert (
            sc.count_unstable_roots(system("haag6_two_delay_oscillator", [0.0, 0.5 * (low + high)])) == number
        )
    for tau in (0.5, 2.5, 7.0, 40.0):
        assert sc.count_unstable_roots(system("haag6_two_delay_oscillator", [tau, tau])) == 0
    for tau, number in row("nep_dep_double", "unstable_root_count_at")["value"]:
        assert sc.count_unstable_roots(system("nep_dep_double", [tau])) == number


@pytest.mark.literature
def test_hayes_points():
    """x' = a x + b x(t - 1): stable points of the Hayes chart, and both sides of its boundary."""
    for a, b, stable in row("hayes_a-1_b-1", "stable_at_points")["value"]:
        assert (sc.count_unstable_roots(scalar(a, b, 1.0)) == 0) == bool(stable)
    for a, b in row("hayes_a-1_b-1", "stability_boundary_points_a_b")["value"]:
        assert sc.count_unstable_roots(scalar(a, b * (1.0 - 1e-9), 1.0)) == 0
        assert sc.count_unstable_roots(scalar(a, b * (1.0 + 1e-9), 1.0)) == 2


@pytest.mark.literature
def test_critical_delays_are_where_the_count_changes():
    """All single critical delays of the data file: the count differs on both sides of each by a pair."""
    cases = {
        "gkc_p192_two_state": (lambda t: [t], row("gkc_p192_two_state", "delay_margin")["value"]),
        "double_delay_oscillator_gkc": (
            lambda t: [0.5 * t, t],
            row("double_delay_oscillator_gkc", "stable_interval_tau")["value"][1],
        ),
        "gu_niculescu_chen_ex1": (
            lambda t: [t, t],
            row("gu_niculescu_chen_ex1", "critical_delay_equal")["value"],
        ),
        "matlab_pi_deadtime": (lambda t: [t], row("matlab_pi_deadtime", "critical_total_delay")["value"]),
        "nep_dep_double": (lambda t: [t], row("nep_dep_double", "delay_margin")["value"]),
    }
    for name, (pattern, critical) in cases.items():
        sides = [sc.count_unstable_roots(system(name, pattern(critical * (1.0 + e)))) for e in (-1e-9, 1e-9)]
        assert sides == [0, 2], name
    example = CASES["gu_niculescu_chen_ex1"]
    for quantity, pattern in (
        ("critical_tau1_at_tau2_0", lambda t: [t, 0.0]),
        ("critical_tau2_at_tau1_0", lambda t: [0.0, t]),
    ):
        critical = row("gu_niculescu_chen_ex1", quantity)["value"]
        sides = [
            sc.count_unstable_roots(system(example, pattern(critical * (1.0 + e)))) for e in (-1e-9, 1e-9)
        ]
        assert sides == [0, 2]


@pytest.mark.literature
def test_delay_independent_limits():
    """Delay-independent stability up to beta = 0.5; at beta = 0.9 a margin of 2.886190628578 s."""
    A0, A1 = (np.array(a) for a in CASES["delay_independent_beta"]["A"])
    for beta in (0.35, 0.4999):
        for tau in (0.1, 3.0, 60.0):
            loop = sc.DelayLTI.from_state_delays(A=[A0, A1 * beta / 0.35], delays=[tau])
            assert sc.count_unstable_roots(loop) == 0
    critical = row("delay_independent_beta", "delay_margin_beta_0.9")["value"]
    sides = [
        sc.count_unstable_roots(
            sc.DelayLTI.from_state_delays(A=[A0, A1 * 0.9 / 0.35], delays=[critical * (1 + e)])
        )
        for e in (-1e-9, 1e-9)
    ]
    assert sides == [0, 2]


@pytest.mark.analytical
def test_tangential_touch_is_no_crossing():
    """Haag example 1: roots reach the axis at tau = pi (2k + 1) and turn back."""
    for touch in row("haag1_tangential_touch", "touch_delays")["value"]:
        for offset in (-1e-2, -1e-4, 1e-4, 1e-2):
            assert sc.count_unstable_roots(system("haag1_tangential_touch", [touch + offset])) == 0
    with pytest.warns(UndecidedStabilityWarning, match="near 1 rad/s"):
        assert sc.count_unstable_roots(system("haag1_tangential_touch", [np.pi])) is None


@pytest.mark.analytical
@pytest.mark.parametrize(
    "plant",
    [
        control.tf([1.0], [1.0, 0.0]),
        control.tf([1.0], [1.0, 0.0, 0.0]),
        control.tf([1.0], [1.0, 0.0, 4.0]),
        control.tf([1.0], [1.0, 1.0, 4.0, 4.0]),
    ],
)
def test_roots_on_the_axis_are_reported_not_counted(plant):
    with pytest.warns(UndecidedStabilityWarning, match="lies on the line"):
        assert sc.count_unstable_roots(plant) is None


@pytest.mark.analytical
def test_poles_of_the_open_plant_on_the_axis_do_no_harm():
    """Double integrator under delayed rate and displacement feedback; undamped oscillator likewise."""
    plant = control.ss(
        [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), 0, inputs=["u"], outputs=["x", "v"]
    )
    for delay, expected in ((0.1, 0), (1.0, 2)):
        channels = [sc.FeedbackChannel("x", "u", -1.0, delay), sc.FeedbackChannel("v", "u", -1.5, delay)]
        loop = sc.close_loop(plant, channels)
        assert sc.count_unstable_roots(loop) == expected
        A = [[[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [-1.0, -1.5]]]
        assert dense_contour_count(A, [delay]) == expected


@pytest.mark.analytical
def test_counts_without_delay_and_without_states():
    plant = control.ss(np.diag([2.0, 1.0, -3.0]), np.zeros((3, 1)), np.zeros((1, 3)), 0)
    assert sc.count_unstable_roots(plant) == 2
    assert count_roots_right_of(plant, 1.5) == 1
    assert count_roots_right_of(plant, -4.0) == 3
    assert sc.count_unstable_roots(sc.delay(1.0)) == 0


@pytest.mark.analytical
def test_narrow_resonances_are_not_overlooked():
    """Many lightly damped modes, some of them unstable by 1e-7 of their frequency, beside a delayed loop."""
    frequencies = np.linspace(3.0, 90.0, 12)
    signs = np.where(np.arange(12) % 3 == 0, 1.0, -1.0)
    blocks = [
        np.array([[s * 1e-7 * w, w], [-w, s * 1e-7 * w]]) for w, s in zip(frequencies, signs, strict=True)
    ]
    A0 = np.zeros((25, 25))
    for k, block in enumerate(blocks):
        A0[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    A1 = np.zeros((25, 25))
    A1[24, 24] = -1.0
    loop = sc.DelayLTI.from_state_delays(A=[A0, A1], delays=[20.0])
    beside = sc.count_unstable_roots(scalar(0.0, -1.0, 20.0))
    assert beside == 6
    assert sc.count_unstable_roots(loop) == 2 * 4 + beside


@pytest.mark.analytical
def test_long_delays_and_strong_gains():
    """x' = a x + b x(t - tau) with |b| > |a|: roots cross at w = sqrt(b^2 - a^2), all in one direction."""
    a, b, tau = -1.0, -40.0, 30.0
    omega = np.sqrt(b * b - a * a)
    angle = np.arccos(-a / b) % (2.0 * np.pi)
    first = angle / omega if b * np.sin(angle) * -1.0 > 0 else (2.0 * np.pi - angle) / omega
    expected = 2 * int(np.floor((tau - first) / (2.0 * np.pi / omega)) + 1)
    assert sc.count_unstable_roots(scalar(a, b, tau)) == expected


@pytest.mark.analytical
@pytest.mark.parametrize("line", [0.0, -0.5, -1.5, 0.2])
@pytest.mark.parametrize("gain", [-1.2, -2.5, -8.0])
def test_nilpotent_feedthrough_counts_as_the_sum_of_delays(line, gain):
    """A chain of two delayed signals around an integrator is one delay of 1 s; lines left and right of the axis."""
    chain = Realization(
        A=[[0.0]], B1=np.zeros((1, 0)), B2=[[0.0, gain]], C1=np.zeros((0, 1)), C2=[[1.0], [0.0]],
        D11=np.zeros((0, 0)), D12=np.zeros((0, 2)), D21=np.zeros((2, 0)), D22=[[0.0, 0.0], [1.0, 0.0]],
    )  # fmt: skip
    branches = scipy.special.lambertw(gain, np.arange(-60, 61))
    assert count_roots_right_of(sc.DelayLTI(chain, [0.35, 0.65]), line) == np.sum(branches.real > line)


@pytest.mark.literature
def test_published_interval_lies_inside_the_exact_one():
    """delayed_oscillator_gkc_p193: (0.100174, 1.71785) is printed; exact is 5.7e-6 lower and 8.2e-6 higher."""
    exact = row("delayed_oscillator_gkc_p193", "stable_interval")
    low, high = exact["value"]
    for tau, stable in ((low - 1e-8, False), (low + 1e-8, True), (high - 1e-8, True), (high + 1e-8, False)):
        assert (sc.count_unstable_roots(system("delayed_oscillator_gkc_p193", [tau])) == 0) is stable
    shortfall = np.abs(np.array(exact["published"]) - exact["value"])
    np.testing.assert_allclose(shortfall, [5.7e-6, 8.2e-6], atol=1e-7)


def test_a_line_through_a_root_raises_inside():
    K = CharacteristicMatrix.of(scalar(0.0, -1.0, np.pi / 2).folded)
    with pytest.raises(ContourError) as problem:
        count_right_of(K, 0.0)
    assert abs(problem.value.omega - 1.0) < 1e-6


@pytest.mark.parametrize("line", [np.nan, np.inf, "axis"])
def test_bad_line_is_named(line):
    with pytest.raises(InputError, match="line"):
        count_roots_right_of(scalar(0.0, -1.0, 1.0), line)


@pytest.mark.property
@settings(max_examples=60)
@given(st.integers(0, 2**31 - 1))
def test_counts_equal_a_dense_contour(seed):
    """Random systems with roots not too near to the axis for a fixed grid."""
    random = np.random.default_rng(seed)
    n, m = random.integers(1, 5), random.integers(1, 4)
    A = [random.normal(size=(n, n)) * random.choice([0.5, 1.0, 2.0]) for _ in range(m + 1)]
    delays = random.uniform(0.05, 3.0, m)
    try:
        expected = dense_contour_count(A, delays)
    except AssertionError:
        return
    assert sc.count_unstable_roots(sc.DelayLTI.from_state_delays(A=A, delays=delays)) == expected
