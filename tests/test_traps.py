"""The known traps of linear systems with delays: each has a test, here or where `TRAPS` says."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import control as ct
import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
from half_car_loops import half_car_loop
from tuning.tuning_case import problem

import susp_ctrl as sc

HERE = Path(__file__).parent
# trap -> tests
TRAPS = {
    "Padé through polynomials has wrong time responses": [
        "delay_systems/approximation/test_pade.py::test_half_car_time_response_reaches_the_phasor_solution",
        "delay_systems/approximation/test_pade.py::test_time_response_of_a_delayed_smooth_pulse",
        "delay_systems/approximation/test_pade.py::test_poles_are_the_scaled_bessel_poles",
        "test_traps.py::test_pade_as_a_cascade_delays_a_pulse_at_high_order",
    ],
    "low Padé orders misread wheel hop and verdicts, and are warned of": [
        "delay_systems/approximation/test_pade.py::test_low_order_misreads_the_wheel_hop_root",
        "delay_systems/approximation/test_pade.py::test_low_order_warns_when_the_band_is_given",
        "delay_systems/test_comparison.py::test_low_orders_give_wrong_verdicts_in_both_directions",
        "delay_systems/simulation/test_time_response.py::test_low_order_warns_with_the_order_needed",
    ],
    "a step sampled on a grid is a ramp": ["test_traps.py::test_a_sampled_step_is_a_ramp_unless_it_is_held"],
    "python-control's functions on a system with delays": [
        "delay_systems/test_python_control.py::test_frequency_response_is_exact_data_with_names",
        "delay_systems/test_python_control.py::test_nyquist_response_counts_the_encirclements",
        "delay_systems/test_python_control.py::test_singular_values_of_python_control_are_exact",
        "delay_systems/test_python_control.py::test_no_conversion_loses_the_delay_silently",
        "delay_systems/test_python_control.py::test_zeros_of_quasi_polynomials",
        "delay_systems/test_connections.py::test_single_loop_operations",
        "test_traps.py::test_a_system_with_delays_is_no_state_space",
    ],
    "plots draw where they are told, defaults of python-control stay, imports are light": [
        "test_traps.py::test_plots_leave_the_current_figure_alone",
        "test_traps.py::test_imports_change_no_default_of_python_control",
        "plotting/test_drawing.py::test_no_setting_of_the_user_is_changed",
        "test_public_names.py::test_a_bare_import_loads_no_heavy_library",
    ],
    "sweep: roots at zero, touches, double roots, no A0, zero and equal delays, the highest frequency": [
        "delay_systems/crossings/test_frequency_sweep.py::test_root_at_zero_for_every_delay",
        "delay_systems/crossings/test_frequency_sweep.py::test_root_on_the_axis_at_the_start",
        "delay_systems/crossings/test_frequency_sweep.py::test_tangential_touch_is_no_crossing",
        "delay_systems/crossings/test_frequency_sweep.py::test_double_root_on_the_axis",
        "delay_systems/crossings/test_frequency_sweep.py::test_two_equal_integrators_cross_twice_at_once",
        "delay_systems/crossings/test_frequency_sweep.py::test_integrator_crosses_at_odd_quarter_turns",
        "test_traps.py::test_zero_and_equal_delays_in_a_sweep",
    ],
    "spurious eigenvalues at large delays": [
        "delay_systems/roots/test_rightmost.py::test_spurious_starts_are_dropped_and_duplicates_merged",
        "delay_systems/roots/test_rightmost.py::test_large_delay_roots_are_not_spurious",
    ],
    "the delay margin is the least over all crossovers": [
        "delay_systems/test_python_control.py::"
        "test_delay_margin_is_the_least_over_all_crossovers_not_that_of_the_smallest_phase_margin",
    ],
    "norms of unstable systems, H2 with a direct feedthrough": [
        "delay_systems/frequency/test_norms.py::test_unstable_and_undecided_systems_are_refused",
        "delay_systems/frequency/test_norms.py::test_h2_is_infinite_with_direct_feedthrough",
        "test_traps.py::test_h2_from_force_to_body_acceleration_is_infinite",
    ],
    "many local minima, slow convergence of the ring, optimum on the lower bound": [
        "tuning/test_swarm.py::test_ring_finds_a_narrow_deep_basin_beside_a_broad_shallow_one",
        "tuning/test_tuner.py::test_best_known_value_in_48_of_50_seeds",
        "tuning/test_tuner.py::test_harmonic_optimum_is_the_closed_form",
        "test_traps.py::test_delays_of_a_search_begin_at_a_millisecond",
    ],
    "stability inside the search": [
        "tuning/test_feasibility.py::test_small_gain_of_the_papers_box",
        "tuning/test_feasibility.py::test_count_of_the_wide_box_against_the_winding_of_the_oracle",
        "tuning/test_tuner.py::test_no_unstable_design_is_returned_from_the_wide_box",
        "tuning/test_tuner.py::test_a_design_the_verdict_refuses_is_passed_over",
    ],
    "road spectra wrong by factors": [
        "road/test_roads.py::test_class_means_of_iso_8608",
        "road/test_roads.py::test_band_rms_in_closed_form",
        "road/test_roads.py::test_welch_psd_of_the_profile_lies_on_its_class",
        "road/test_other_roads.py::test_filtered_noise_lies_on_its_class",
    ],
    "oracles that are not independent": ["test_traps.py::test_oracles_use_nothing_of_the_package"],
}


@pytest.mark.parametrize("trap", TRAPS)
def test_every_trap_has_its_tests(trap):
    for place in TRAPS[trap]:
        file, test = place.split("::")
        assert f"def {test}(" in (HERE / file).read_text("utf-8"), place


@pytest.mark.analytical
def test_pade_as_a_cascade_delays_a_pulse_at_high_order():
    """A pure delay of 0.55 s at order 30: through polynomials the response is wrong with most builds of numpy."""
    t = np.linspace(0.0, 5.0, 2501)
    pulse = np.exp(-((t - 1.5) ** 2) / (2 * 0.2**2))
    expected = np.exp(-((t - 2.05) ** 2) / (2 * 0.2**2))
    ours = ct.forced_response(sc.delay(0.55).pade(30), t, pulse).outputs
    assert np.abs(ours - expected).max() < 1e-4


@pytest.mark.analytical
def test_a_sampled_step_is_a_ramp_unless_it_is_held():
    """y' = u(t - 1/2), a step at t = 1: the sampled one begins a sample earlier and is half a sample ahead."""
    loop = sc.delay(0.5) * ct.tf([1.0], [1.0, 0.0])
    t = np.arange(31) * 0.1
    samples = (t >= 1.0 - 1e-9).astype(float)

    def step(time):
        return (time >= 1.0).astype(float)

    step.breakpoints = (1.0,)
    exact = np.clip(t - 1.5, 0.0, None)
    late = t > 1.55
    np.testing.assert_allclose(sc.simulate(loop, t, step).outputs, exact, atol=1e-11)
    np.testing.assert_allclose(sc.simulate(loop, t, samples, hold="zero").outputs, exact, atol=1e-11)
    ramp = sc.simulate(loop, t, samples, hold="linear").outputs
    np.testing.assert_allclose(ramp[late], exact[late] + 0.05, atol=1e-11)


def test_a_system_with_delays_is_no_state_space():
    """Arithmetic of python-control's own classes would drop the delays."""
    loop = half_car_loop()
    assert isinstance(loop, ct.LTI)
    assert not isinstance(loop, ct.StateSpace | ct.TransferFunction | ct.FrequencyResponseData)


@pytest.mark.parametrize("name", ["bode_plot", "nyquist_plot", "nichols_plot", "singular_values_plot"])
def test_plots_leave_the_current_figure_alone(name):
    current = plt.figure()
    try:
        drawn = getattr(sc.delay(0.5) * ct.tf([1.0], [1.0, 0.3, 1.0]), name)()
        assert not current.axes
        assert all(axes.figure is not current for axes in np.ravel(drawn.axes))
    finally:
        plt.close("all")


def test_results_draw_into_the_axes_given():
    current = plt.figure()
    try:
        loop = sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-0.5]], [[-0.5]]], delays=[1.0, 1.0])
        for result in (sc.stability(loop), sc.sweep_delays(loop), sc.stability_map(loop)):
            ax = matplotlib.figure.Figure().subplots()
            assert result.plot(ax) is ax
        assert not current.axes
    finally:
        plt.close("all")


def test_imports_change_no_default_of_python_control():
    code = (
        "import control; before = dict(control.config.defaults)\n"
        "import susp_ctrl as sc; [getattr(sc, name) for name in sc.__all__]\n"
        "loop = sc.feedback(sc.delay(0.5) * control.tf([1.0], [1.0, 0.0]))\n"
        "loop.bode_plot(); sc.stability(loop)\n"
        "assert dict(control.config.defaults) == before"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.analytical
def test_zero_and_equal_delays_in_a_sweep():
    """x' = -(x(t - t1) + x(t - t2))/2 crosses at pi/2 along t1 = t2; with one delay zero the loop is another one."""
    halves = sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-0.5]], [[-0.5]]], delays=[1.0, 1.0])
    assert sc.sweep_delays(halves, up_to=3.0).delay_margin == pytest.approx(np.pi / 2, rel=1e-11)
    uneven = sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-0.3]], [[-0.7]]], delays=[1.0, 1.0])
    # t1 = 0: jw + 0.3 + 0.7 e^{-jw tau} = 0, so that w^2 = 0.49 - 0.09 and cos(w tau) = -3/7
    expected = np.arccos(-3.0 / 7.0) / np.sqrt(0.4)
    sweep = sc.sweep_delays(uneven, direction=(0, 1), up_to=5.0)
    assert sweep.delay_margin == pytest.approx(expected, rel=1e-11)
    assert sc.count_unstable_roots(uneven.with_delays([0.0, 1.001 * expected])) == 2
    assert sc.stability(uneven.with_delays([0.0, 0.999 * expected])).stable is True


@pytest.mark.analytical
def test_h2_from_force_to_body_acceleration_is_infinite():
    """The force accelerates the body at once; its displacement it moves twice integrated."""
    loop = half_car_loop()
    assert sc.h2_norm(loop["body_acceleration", "force_front"]) == np.inf
    assert np.isfinite(sc.h2_norm(loop["body_displacement", "force_front"]))
    assert np.isfinite(sc.hinf_norm(loop["body_acceleration", "force_front"])[0])


def test_delays_of_a_search_begin_at_a_millisecond():
    search = problem("harmonic")
    assert search.lower[2:].tolist() == [0.001, 0.001]
    assert search.upper[2:].tolist() == [1.0, 1.0]


def test_oracles_use_nothing_of_the_package():
    for file in ("oracles.py", "delay_oracles.py"):
        tree = ast.parse((HERE / file).read_text("utf-8"))
        imported = {
            name
            for node in ast.walk(tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for name in ([alias.name for alias in node.names] + [getattr(node, "module", None) or ""])
        }
        assert not [name for name in imported if "susp_ctrl" in name]


@pytest.mark.parametrize("size", [1.1e40, 1e160, 1e308])
def test_numbers_whose_products_have_no_range_are_refused(size):
    """Larger gains and entries once ended in the linear algebra, or in no end."""
    loop = sc.DelayLTI.from_state_delays(
        A=[[[-1.0, 1.0], [0.0, -2.0]], [[0.0, 0.0], [0.5, 0.0]]], delays=[0.3]
    )
    for call in (
        lambda: loop.with_gains([size]),
        lambda: sc.root_locus(loop, "gains", [size]),
        lambda: sc.DelayLTI.from_state_delays(A=[[[-size]], [[1.0]]], delays=[0.3]),
        lambda: loop * size,
    ):
        with pytest.raises(sc.InputError, match=r"at most 1e[+]40 is needed"):
            call()
