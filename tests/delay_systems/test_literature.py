"""Rows of tests/data/delay_cases.json that no other file asserts, at the tolerance of each row.

`ASSERTED` says for every quantity of the file which test asserts it, so that no row is forgotten. What was published
is compared with what the package computes: it agrees to the digits printed, or the difference is stated.
"""

from __future__ import annotations

from pathlib import Path

import control
import numpy as np
import pytest
import scipy.optimize
from delay_cases import CASES, matrices, row, rows, system

import susp_ctrl as sc

# quantity -> file and test
ASSERTED = {
    "crossing_set_omega_theta": "test_frequency_sweep.py::test_crossing_set",
    "critical_delays_up_to": "test_frequency_sweep.py::test_critical_delays",
    "critical_delays_tau1_0": "test_frequency_sweep.py::test_critical_delays",
    "unstable_root_count_intervals": "test_frequency_sweep.py::test_unstable_roots_of_every_interval",
    "unstable_root_count_intervals_tau1_0": "test_frequency_sweep.py::test_unstable_roots_of_every_interval",
    "delay_margin": "test_frequency_sweep.py::test_delay_margin",
    "stable_interval": "test_frequency_sweep.py::test_published_switches_of_the_delayed_oscillator_are_inner_bounds",
    "touch_delays": "test_frequency_sweep.py::test_tangential_touch_is_no_crossing",
    "stable_interval_tau": "test_frequency_sweep.py::test_two_delays_in_the_ratio_one_to_two",
    "crossing_omega": "test_frequency_sweep.py::test_two_delays_in_the_ratio_one_to_two",
    "unstable_root_count_at": "test_frequency_sweep.py::test_double_root_on_the_axis",
    "stability_for_equal_delays": "test_frequency_sweep.py::test_equal_delays_hide_what_independent_delays_do",
    "critical_delay_equal": "test_frequency_sweep.py::test_gu_niculescu_chen_lines",
    "critical_tau1_at_tau2_0": "test_frequency_sweep.py::test_gu_niculescu_chen_lines",
    "critical_tau2_at_tau1_0": "test_frequency_sweep.py::test_gu_niculescu_chen_lines",
    "critical_total_delay": "test_frequency_sweep.py::test_delay_margin_of_a_pi_loop_with_dead_time",
    "delay_margin_beyond_2.6": "test_frequency_sweep.py::test_delay_margin_of_a_pi_loop_with_dead_time",
    "delay_margin_beta_0.9": "test_frequency_sweep.py::test_delay_margin_beyond_the_independent_range",
    "beta_limit_delay_independent": "test_delay_independence.py::test_limit_of_a_rank_two_block",
    "rightmost_roots": "test_rightmost.py::test_literature_rightmost_roots",
    "spectral_abscissa": "test_rightmost.py::test_literature_spectral_abscissa",
    "contains_root": "test_rightmost.py::test_nep_dep1_has_a_root_at_one",
    "double_root": "test_rightmost.py::test_defective_double_root_is_kept_twice",
    "also_on_axis": "test_rightmost.py::test_defective_double_root_is_kept_twice",
    "growth_factor_per_0.1s": "test_rightmost.py::test_published_growth_factor_is_that_of_a_coarse_method",
    "delay_free_char_poly": "test_rightmost.py::test_characteristic_polynomial_without_delay",
    "hopf_omega": "test_rightmost.py::test_neuron_hopf_point",
    "unstable_root_count": "test_verdict.py::test_literature_verdicts",
    "stable_at_points": "test_argument_principle.py::test_hayes_points",
    "free_response_x0_1_0": "test_time_response.py::test_published_time_responses",
    "free_response": "test_time_response.py::test_published_time_responses",
    "step_response": "test_time_response.py::test_published_time_responses",
    "step_response_y": "test_literature.py::test_step_and_impulse_responses",
    "impulse_response_y": "test_literature.py::test_step_and_impulse_responses",
    "stable_intervals": "test_literature.py::test_two_pockets_of_stability",
    "equilibrium_for_constant_input_1": "test_literature.py::test_equilibrium_of_the_hayes_equation",
    "stability_boundary_points_a_b": "test_literature.py::test_hayes_boundary_points",
    "hopf_parameter_a21": "test_literature.py::test_hopf_parameter_of_the_neurons",
    "crossing_frequency_interval": "test_literature.py::test_crossing_frequencies_end_where_the_triangle_does",
    "crossing_curve_points": "test_literature.py::test_points_of_the_crossing_curves",
    "delay_independent": "test_literature.py::test_delay_independent_stability",
    "gain_crossover_omega": "test_literature.py::test_gain_crossover",
    "frequency_response": "test_literature.py::test_frequency_responses",
    "hinf_norm": "test_literature.py::test_hinf_norms",
    "h2_norm": "test_literature.py::test_h2_norms",
}


def test_every_row_is_asserted_by_a_test_that_exists():
    assert {r["quantity"] for case in CASES.values() for r in case["expected"]} == set(ASSERTED)
    for place in ASSERTED.values():
        file, test = place.split("::")
        assert f"def {test}(" in next(Path(__file__).parent.rglob(file)).read_text("utf-8"), place


def with_signals(case, row=None):
    """The case with its inputs (delayed where the case says so) and outputs, at the delays of the row."""
    given = case | {key: row[key] for key in ("B", "C") if row and key in row}
    delays = (row or {}).get("at_delays", case["delays"])[1:]
    inputs = {"B": given["B"]}
    if "B_delays" in case:
        inputs = {"input_terms": [(given["B"], case["B_delays"][0])]}
    return sc.DelayLTI.from_state_delays(A=matrices(case), delays=delays, C=given["C"], **inputs)


def digits_of(published):
    """Half a unit is what rounding does to a printed number, a whole one what truncation does."""
    return 10.0 ** -len(str(published).partition(".")[2])


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("hinf_norm"))
def test_hinf_norms(case, row):
    """PIETOOLS prints 2.87, 0.2364 and 4.9784: right to the digits given."""
    norm, peak = sc.hinf_norm(with_signals(case, row))
    assert abs(norm - row["value"]) <= row["tolerance"]
    assert abs(peak - row["peak_omega"]) <= 1e-5 * row["peak_omega"]
    if "published" in row:
        assert abs(norm - row["published"]) <= digits_of(row["published"])
        assert row["published_agrees"]


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("h2_norm"))
def test_h2_norms(case, row):
    assert abs(sc.h2_norm(with_signals(case, row)) - row["value"]) <= row["tolerance"]


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("frequency_response"))
def test_frequency_responses(case, row):
    """Values are printed with 13 digits, which allows 5e-13 of rounding where |Re| or |Im| is above one."""
    value = np.array(row["value"])
    s = 1j * value[:, 0]
    response = with_signals(case)(s)
    if case["id"] == "julia_two_delay_loop":
        # S = 1/(1 + P1 (e^-2s + e^-3s)); the state equation gives -1/(s + 1 + e^-2s + e^-3s) = -P1 S
        lag = control.tf([1.0], [1.0, 1.0])
        sensitivity = sc.feedback(1, lag * (sc.delay(2) + sc.delay(3)))(s)
        np.testing.assert_allclose(-response * (s + 1.0), sensitivity, rtol=1e-13)
        response = sensitivity
    for found, printed in ((response.real, value[:, 1]), (response.imag, value[:, 2])):
        last_digit = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(printed), 1e-3))) - 12.0)
        assert np.all(np.abs(found - printed) <= np.maximum(row["tolerance"], 0.51 * last_digit))


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("step_response_y", "impulse_response_y"))
def test_step_and_impulse_responses(case, row):
    """MathWorks' dead-time loop; ControlSystems.jl's delayed integrator, whose printed values are exact."""
    value = np.array(row["value"])
    loop = with_signals(case)
    respond = loop.step_response if row["quantity"] == "step_response_y" else loop.impulse_response
    found = np.ravel(respond(np.append(0.0, value[:, 0])).outputs)[1:]
    assert np.max(np.abs(found - value[:, 1])) <= row["tolerance"]
    for t, y in row.get("published", []):
        assert abs(found[value[:, 0] == t][0] - y) <= row["tolerance"]


@pytest.mark.literature
def test_two_pockets_of_stability():
    """Olgac and Sipahi: printed 0.1624, 0.1859, 0.2219; the last is cut, not rounded (exact 0.22198)."""
    expected = row("ctcr_olgac_sipahi", "stable_intervals")
    found = sc.sweep_delays(system("ctcr_olgac_sipahi"), up_to=1.0).stable_intervals
    np.testing.assert_allclose(found, expected["value"], atol=expected["tolerance"], rtol=0)
    np.testing.assert_allclose(found, expected["published"], atol=1e-4, rtol=0)
    assert round(found[1][1], 4) == 0.2220


@pytest.mark.literature
def test_equilibrium_of_the_hayes_equation():
    """x' = -x - x(t - 1) + 1 rests at 1/2: the gain at zero frequency, and where the simulation ends."""
    expected = row("hayes_a-1_b-1", "equilibrium_for_constant_input_1")
    loop = sc.DelayLTI.from_state_delays(A=matrices("hayes_a-1_b-1"), delays=[1.0], B=[[1.0]], C=[[1.0]])
    assert abs(np.real(loop(0.0)) - expected["value"]) <= expected["tolerance"]
    assert expected["value"] == expected["published"]
    late = sc.simulate(loop, [0.0, 60.0], 1.0, rtol=1e-12)
    assert abs(late.outputs[-1] - expected["value"]) <= expected["tolerance"]


@pytest.mark.literature
def test_hayes_boundary_points():
    """a = w cot w, b = -w/sin w: the rightmost pair is +-jw; on b = -a a root is at zero."""
    expected = row("hayes_a-1_b-1", "stability_boundary_points_a_b")
    for omega, (a, b) in zip(expected["omega"], expected["value"], strict=True):
        assert abs(a - omega / np.tan(omega)) <= expected["tolerance"] * max(1.0, abs(a))
        root = sc.characteristic_roots(system("hayes_a-1_b-1", A=[np.array([[a]]), np.array([[b]])]), 2)[0]
        # the printed a and b are rounded at the 13th digit
        assert abs(abs(root.imag) - omega) <= expected["tolerance"] * max(1.0, abs(b))
        assert abs(root.real) <= expected["tolerance"] * max(1.0, abs(b))
    for a in (-3.0, -0.5, 0.9):
        zero = sc.characteristic_roots(system("hayes_a-1_b-1", A=[np.array([[a]]), np.array([[-a]])]), 2)
        assert abs(zero[0]) <= expected["tolerance"]


@pytest.mark.literature
def test_hopf_parameter_of_the_neurons():
    """DDE-BIFTOOL demo 1 prints a21 = 0.80712 and 0.78197 rad/s: the pair that meets the axis, found anew.

    There is another root, real and unstable, which a21 moves too: the pair is told by its frequency.
    """
    expected = row("neuron_three_delays", "hopf_parameter_a21")
    frequency = row("neuron_three_delays", "hopf_omega")

    def pair(a21):
        A = matrices("neuron_three_delays")
        A[1][1, 0] = a21
        roots = sc.characteristic_roots(system("neuron_three_delays", A=A), 6)
        roots = roots[roots.imag > 0.3]
        return roots[np.argmin(np.abs(roots - 0.78j))]

    found = scipy.optimize.brentq(lambda a21: pair(a21).real, 0.7, 0.9, xtol=1e-14)
    assert abs(found - expected["value"]) <= expected["tolerance"]
    assert abs(pair(found).imag - frequency["value"]) <= frequency["tolerance"]
    for number, printed in ((found, expected["published"]), (pair(found).imag, frequency["published"])):
        assert abs(number - printed) <= 0.5 * digits_of(printed)


@pytest.mark.literature
def test_crossing_frequencies_end_where_the_triangle_does():
    """s^2 + 2 s z1 + z2: a triangle of sides w^2, 2 w and 1 exists from sqrt 2 - 1 to sqrt 2 + 1."""
    expected = row("gu_niculescu_chen_ex1", "crossing_frequency_interval")
    curves = sc.stability_map(system("gu_niculescu_chen_ex1"), tau1=(0.0, 20.0), tau2=(0.0, 20.0)).curves
    np.testing.assert_allclose(
        [curves["omega"].min(), curves["omega"].max()], expected["value"], atol=expected["tolerance"], rtol=0
    )


@pytest.mark.literature
def test_points_of_the_crossing_curves():
    """Gu, Niculescu, Chen 2005, example 1: a root at j omega, and a crossing of the sweep in tau2, at each point."""
    expected = row("gu_niculescu_chen_ex1", "crossing_curve_points")
    for omega, tau1, tau2 in expected["value"]:
        roots = sc.characteristic_roots(system("gu_niculescu_chen_ex1", [tau1, tau2]), right_of=-0.05)
        assert np.min(np.abs(roots - 1j * omega)) <= expected["tolerance"]
        along = sc.sweep_delays(
            system("gu_niculescu_chen_ex1"), direction=(0, 1), start=(tau1, 0.0), up_to=1.1 * tau2
        )
        crossed = along.crossings[["tau", "omega"]].to_numpy(dtype=float)
        error = np.max(np.abs(crossed - [tau2, omega]), axis=1)
        assert error.min() <= (expected["tolerance"] if omega != 1.0 else 1e-5)


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("delay_independent"))
def test_delay_independent_stability(case, row):
    assert sc.delay_independent_stability(system(case)).stable is row["value"]


@pytest.mark.literature
def test_gain_crossover():
    """MathWorks, "Analyzing Control Systems with Delays": P C with dead time 2.6 s."""
    expected = row("matlab_pi_deadtime", "gain_crossover_omega")
    plant = control.tf([1.0, 3.0], [1.0, 0.3, 1.0])
    loop = sc.delay(2.6) * plant * control.tf([0.06, 0.06], [1.0, 0.0])
    crossings = loop.margins().gain_crossovers["omega"]
    assert len(crossings) == 1
    assert abs(crossings.iloc[0] - expected["value"]) <= expected["tolerance"]
