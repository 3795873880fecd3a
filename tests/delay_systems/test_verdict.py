"""The stability verdict: agreement of three methods, undecided loops, what it prints and draws."""

from __future__ import annotations

import warnings
from dataclasses import replace

import control
import numpy as np
import pytest
from delay_cases import row, rows, system
from delay_oracles import dense_contour_count, shifted
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems import verdict as verdict_module
from susp_ctrl.delay_systems.crossings.crossing_search import CrossingSearch
from susp_ctrl.delay_systems.roots import rightmost as roots_module
from susp_ctrl.errors import InputError, UndecidedStabilityWarning


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("unstable_root_count"))
def test_literature_verdicts(case, row):
    """Counts of tests/data/delay_cases.json: every method that answers gives the same one."""
    verdict = sc.stability(system(case, row.get("at_delays")))
    assert verdict.unstable_roots == row["value"]
    assert verdict.stable is (row["value"] == 0)
    assert set(verdict.agreement) == {"roots", "argument principle", "sweep"}
    assert {n for n in verdict.agreement.values() if n is not None} == {row["value"]}
    assert verdict.agreement["roots"] is not None
    assert verdict.agreement["argument principle"] is not None


@pytest.mark.analytical
def test_all_three_methods_answer_for_the_half_car():
    channels = [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", 19345.0, 0.5530),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", 26150.0, 0.5186),
    ]
    verdict = sc.stability(sc.close_loop(sc.HalfCar().plant(), channels))
    assert verdict.stable is True
    assert dict(verdict.agreement) == {"roots": 0, "argument principle": 0, "sweep": 0}
    assert abs(verdict.abscissa + 1.17254) < 6e-6
    assert verdict.unstable_roots == 0


@pytest.mark.analytical
def test_stable_for_equal_delays_and_unstable_for_independent_ones():
    """Haag, Münz, Allgöwer 2009, example 6, at (tau, tau) and at (0, 2.5)."""
    assert sc.stability(system("haag6_two_delay_oscillator", [2.5, 2.5])).stable is True
    verdict = sc.stability(system("haag6_two_delay_oscillator", [0.0, 2.5]))
    assert verdict.stable is False
    assert verdict.unstable_roots == 2


@pytest.mark.analytical
@pytest.mark.parametrize("offset", [1e-2, 1e-5, 1e-8, 1e-11])
def test_both_sides_of_a_crossing(offset):
    """x' = -x(t - tau) at tau = pi/2 -+ offset."""
    assert sc.stability(system("x_prime_minus_x_delayed", [np.pi / 2 - offset])).stable is True
    assert sc.stability(system("x_prime_minus_x_delayed", [np.pi / 2 + offset])).stable is False


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("loop", "omega"),
    [
        (lambda: system("x_prime_minus_x_delayed", [np.pi / 2]), "1 rad/s"),
        (lambda: system("haag1_tangential_touch", [np.pi]), "1 rad/s"),
        (lambda: control.tf([1.0], [1.0, 0.0]), "0 rad/s"),
        (lambda: control.tf([1.0], [1.0, 0.0, 0.0]), "0 rad/s"),
        (lambda: control.tf([1.0], [1.0, 0.0, 4.0]), "2 rad/s"),
    ],
)
def test_a_root_on_the_axis_is_undecided(loop, omega):
    with pytest.warns(UndecidedStabilityWarning, match=f"near {omega}"):
        verdict = sc.stability(loop())
    assert verdict.stable is None
    assert verdict.unstable_roots is None
    assert omega in verdict.reason
    assert "undecided" in str(verdict)


@pytest.mark.literature
def test_unstable_beside_a_double_root_on_the_axis():
    """nep_dep_double at tau = 1: a double root at 3 pi j, but two roots at 0.705 make it unstable for certain."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        verdict = sc.stability(system("nep_dep_double", [1.0]))
    assert verdict.stable is False
    assert verdict.unstable_roots == 2
    assert "imaginary axis" in verdict.reason
    for tau, number in row("nep_dep_double", "unstable_root_count_at")["value"]:
        assert sc.stability(system("nep_dep_double", [tau])).unstable_roots == number


@pytest.mark.analytical
def test_touching_roots_near_their_touch():
    """Haag example 1: abscissa of -2.6e-5 at tau = 3.1, and stable again behind the touch."""
    for expected in rows("spectral_abscissa"):
        case, given = expected.values
        if case["id"] == "haag1_tangential_touch":
            verdict = sc.stability(system(case, given["at_delays"]))
            assert verdict.stable is True
            assert abs(verdict.abscissa - given["value"]) <= given["tolerance"]


@pytest.mark.analytical
def test_without_delays_and_without_states():
    assert sc.stability(control.tf([1.0], [1.0, 1.0])).stable is True
    assert sc.stability(control.tf([1.0], [1.0, -1.0])).unstable_roots == 1
    bare = sc.stability(sc.delay(0.5))
    assert bare.stable is True
    assert bare.abscissa == -np.inf


def out_and_in(delay):
    """x'' + 0.1 x' + x = -0.5 x(t - delay): loses its stability as the delay grows, and regains it."""
    A = [[[0.0, 1.0], [-1.0, -0.1]], [[0.0, 0.0], [-0.5, 0.0]]]
    return sc.DelayLTI.from_state_delays(A, [delay])


@pytest.mark.parametrize("delay", [2.0, 5.0, 8.0])
def test_the_sweep_can_dissent(monkeypatch, delay):
    """With every tendency flipped the verdict is undecided and names the sweep: it is a witness of its own."""
    loop = out_and_in(delay)
    honest = sc.stability(loop)
    assert honest.stable is not None
    assert honest.agreement["sweep"] == honest.unstable_roots
    ways = CrossingSearch.ways

    def flipped(search):
        return [lambda way=way: replace(found := way(), degree=-found.degree) for way in ways(search)]

    monkeypatch.setattr(CrossingSearch, "ways", flipped)
    with pytest.warns(UndecidedStabilityWarning, match="sweep"):
        verdict = sc.stability(loop)
    assert verdict.stable is None
    assert verdict.agreement["sweep"] != honest.unstable_roots
    assert f"sweep {verdict.agreement['sweep']}" in verdict.reason


@pytest.mark.parametrize("method", ["_count", "_count_by_sweep"])
def test_methods_that_differ_give_no_answer(monkeypatch, method):
    """One method forced to a wrong count: the verdict must be undecided, whatever the others say."""
    monkeypatch.setattr(verdict_module, method, lambda *arguments: 4)
    assert sc.spectral_abscissa(system("x_prime_minus_x_delayed", [1.0])) < 0.0
    with pytest.warns(UndecidedStabilityWarning, match="differ"):
        verdict = sc.stability(system("x_prime_minus_x_delayed", [1.0]))
    assert verdict.stable is None
    assert 4 in verdict.agreement.values()


@pytest.mark.analytical
def test_more_unstable_roots_than_can_be_computed(monkeypatch):
    """x' = -2 x - 3 x(t - 100): crossings every 2 pi/sqrt(5), 72 unstable roots; only some may be computed."""
    monkeypatch.setattr(roots_module, "_LARGEST_SIZE", 40)
    omega = np.sqrt(5.0)
    # -3 e^{-jwt} = jw + 2 at w = sqrt(5): wt = pi - atan(w/2) modulo 2 pi, all crossings to the right
    expected = 2 * int((100.0 * omega - (np.pi - np.arctan(omega / 2.0))) // (2.0 * np.pi) + 1)
    verdict = sc.stability(sc.DelayLTI.from_state_delays(A=[[[-2.0]], [[-3.0]]], delays=[100.0]))
    assert verdict.stable is False
    assert verdict.unstable_roots == expected == 72
    assert 0 < verdict.agreement["roots"] < expected
    assert "not the same number" in verdict.reason


def test_one_method_alone_is_not_enough(monkeypatch):
    monkeypatch.setattr(verdict_module, "_count", lambda *arguments: None)
    monkeypatch.setattr(verdict_module, "_count_by_sweep", lambda *arguments: None)
    with pytest.warns(UndecidedStabilityWarning, match="cannot tell"):
        assert sc.stability(system("x_prime_minus_x_delayed", [1.0])).stable is None


def test_truth_value_is_refused_and_fields_are_frozen():
    verdict = sc.stability(system("x_prime_minus_x_delayed", [1.0]))
    with pytest.raises(ValueError, match="stable"):
        bool(verdict)
    with pytest.raises(AttributeError):
        verdict.stable = False
    with pytest.raises(TypeError):
        verdict.agreement["roots"] = 1


def test_printed_and_drawn():
    verdict = sc.stability(system("x_prime_minus_x_delayed", [1.6]))
    text = str(verdict)
    assert text.startswith("unstable: 2 roots")
    assert "argument principle 2" in text
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    assert verdict.plot(ax) is ax
    drawn = ax.lines[0].get_xydata()
    np.testing.assert_allclose(drawn[:, 0] + 1j * drawn[:, 1], verdict.roots)


def test_what_is_no_system_is_refused():
    with pytest.raises(InputError, match="sys"):
        sc.stability(3j)


def random_loop(seed):
    """1 to 6 states, 1 to 3 delays, stable and unstable; every third one moved close to its boundary."""
    random = np.random.default_rng(seed)
    n, m = random.integers(1, 7), random.integers(1, 4)
    A = [random.normal(size=(n, n)) - random.choice([0.0, 1.0, 2.5]) * np.eye(n)]
    for _ in range(m):
        rank = random.integers(1, n + 1)
        factor = 10.0 ** random.uniform(-1.0, 0.2) / np.sqrt(n * rank)
        A.append(factor * random.normal(size=(n, rank)) @ random.normal(size=(rank, n)))
    delays = 10.0 ** random.uniform(-1.5, 0.5, m)
    if seed % 3:
        return A, delays, None
    abscissa = sc.spectral_abscissa(sc.DelayLTI.from_state_delays(A=A, delays=delays))
    side, distance = random.choice([-1.0, 1.0]), 10.0 ** random.uniform(-14.0, -1.0)
    return shifted(A, delays, abscissa + side * distance), delays, -side * distance


def check_verdict(seed):
    A, delays, abscissa = random_loop(seed)
    loop = sc.DelayLTI.from_state_delays(A=A, delays=delays)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UndecidedStabilityWarning)
        verdict = sc.stability(loop)
    if abscissa is None:
        try:
            expected = dense_contour_count(A, delays)
        except AssertionError:
            return
        assert verdict.unstable_roots == expected
    elif verdict.stable is None:
        assert abs(abscissa) < 1e-8, verdict
    else:
        assert verdict.stable == (abscissa < 0.0), verdict
        assert abs(verdict.abscissa - abscissa) < 1e-9


@pytest.mark.property
@settings(max_examples=50)
@given(st.integers(0, 2**31 - 1))
def test_random_verdicts(seed):
    """Three methods and a dense contour, or a boundary that is known; no wrong verdict, none left open needlessly."""
    check_verdict(seed)


@pytest.mark.property
@pytest.mark.slow
@settings(max_examples=2000)
@given(st.integers(2**31, 2**32 - 1))
def test_many_random_verdicts(seed):
    check_verdict(seed)


@pytest.mark.property
def test_the_sweep_abstains_when_its_work_is_spent(monkeypatch):
    """Work is bounded, and the verdict says so; with enough of it the sweep answers."""
    A, delays, _ = random_loop(4)
    loop = sc.DelayLTI.from_state_delays(A=A, delays=delays)
    answered = sc.stability(loop)
    assert answered.agreement["sweep"] == answered.unstable_roots
    monkeypatch.setattr(verdict_module, "_SWEEP_WORK", 1)
    abstained = sc.stability(loop)
    assert abstained.agreement["sweep"] is None
    assert "sweep cannot tell" in abstained.reason
    assert abstained.unstable_roots == answered.unstable_roots


@pytest.mark.analytical
@pytest.mark.parametrize("order", [6, 7, 10, 12])
def test_a_root_of_high_multiplicity_far_from_the_axis_is_decided(order):
    """(s + 1)^m: rounding spreads the root, and a certified count says that it is not on the axis."""
    verdict = sc.stability(control.tf([1.0], np.poly([-1.0] * order)))
    assert verdict.stable
    assert verdict.abscissa == pytest.approx(-1.0, abs=0.02)
