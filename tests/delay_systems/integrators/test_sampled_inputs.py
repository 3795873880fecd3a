"""Inputs given as samples: every sample is a kink, and the delays move it.

The same signal as a callable that announces its kinks goes through cells between all of them, another way.
"""

from __future__ import annotations

import collocation
import control
import numpy as np
import pytest
from half_car_loops import DELAYS, half_car_loop, relative

import susp_ctrl as sc


def smooth_pieces(samples, t, hold):
    """A callable that cells between its kinks resolve, so that it is not taken as samples."""

    def value(s):
        cell = np.clip(np.searchsorted(t, s, side="right") - 1, 0, t.size - 2)
        share = (s - t[cell]) / (t[cell + 1] - t[cell]) * (hold == "linear")
        return samples[cell] * (1.0 - share) + samples[cell + 1] * share

    value.breakpoints = t
    return value


def between_all_kinks(monkeypatch, run):
    """Run by cells between all kinks, without the methods for very many of them."""
    with monkeypatch.context() as patch:
        patch.setattr("susp_ctrl.delay_systems.simulation.time_response.FROM_REST", ())
        return run()


@pytest.mark.property
@pytest.mark.parametrize("hold", ["linear", "zero"])
@pytest.mark.parametrize("delays", [DELAYS, (0.0612, 0.06), (0.1, 0.13), (0.02, 5.0)])
def test_many_samples_equal_cells_between_all_kinks(hold, delays, monkeypatch):
    """Delays that are and are not whole numbers of samples; white noise and a road."""
    sys, t = half_car_loop(delays=delays), np.arange(301) * 2e-3
    rng = np.random.default_rng(3)
    samples = np.stack([rng.standard_normal(t.size) * 0.01, np.cumsum(rng.standard_normal(t.size)) * 1e-3])
    names = ("road_front", "road_rear")
    fast = sc.simulate(sys, t, dict(zip(names, samples, strict=True)), hold=hold)
    pieces = {name: smooth_pieces(u, t, hold) for name, u in zip(names, samples, strict=True)}
    slow = between_all_kinks(monkeypatch, lambda: sc.simulate(sys, t, pieces))
    last = slice(0, -1)
    assert relative(fast.outputs[:8, last], slow.outputs[:8, last]) < 1e-10
    assert relative(fast.states, slow.states) < 1e-10
    peak = np.max(np.abs(fast.outputs), axis=1)
    assert np.all(fast.error_estimate <= 1e-8 * np.maximum(peak, 1e-300))


@pytest.mark.property
def test_samples_beside_a_callable_and_a_history(monkeypatch):
    sys, t = half_car_loop(delays=(0.21, 0.1234)), np.arange(401) * 1e-3
    samples = np.cumsum(np.random.default_rng(5).standard_normal(t.size)) * 1e-3

    def run(first):
        inputs = {"road_front": first, "road_rear": lambda t: 0.01 * np.sin(9.0 * t), "force_front": 3.0}
        return sc.simulate(sys, t, inputs, history=lambda t: 1e-3 * np.cos(np.outer(np.arange(1, 9), t)))

    both = run(samples)
    pieces = between_all_kinks(monkeypatch, lambda: run(smooth_pieces(samples, t, "linear")))
    assert relative(both.outputs, pieces.outputs) < 1e-10
    np.testing.assert_allclose(both.inputs, pieces.inputs, rtol=0, atol=1e-12)


@pytest.mark.property
def test_continuation_under_samples_equals_one_run():
    sys, t = half_car_loop(), np.arange(1501) * 1e-3
    samples = np.cumsum(np.random.default_rng(5).standard_normal(t.size)) * 1e-3
    whole = sc.simulate(sys, t, {"road_front": samples})
    first = sc.simulate(sys, t[:801], {"road_front": samples[:801]})
    second = sc.simulate(sys, t[800:], {"road_front": samples[800:]}, history=first)
    assert relative(second.outputs, whole.outputs[:, 800:]) < 1e-9


@pytest.mark.property
def test_samples_into_a_defective_plant():
    A = np.diag(np.ones(3), 1) - np.eye(4)
    A1 = np.zeros((4, 4))
    A1[3, 0] = -0.5
    sys = sc.DelayLTI.from_state_delays([A, A1], [0.7], B=np.eye(4)[:, [3]])
    t = np.arange(201) * 0.02
    samples = np.random.default_rng(5).standard_normal(t.size)
    pieces = sc.simulate(sys, t, smooth_pieces(samples, t, "linear"))
    assert relative(sc.simulate(sys, t, samples).outputs, pieces.outputs) < 1e-10


@pytest.mark.property
@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_sampled_inputs_equal_the_callable_with_the_same_kinks(hold):
    sys, t = half_car_loop(delays=(0.153, 0.0861)), np.linspace(0.0, 1.0, 51)
    samples = np.random.default_rng(3).standard_normal(t.size) * 0.01

    def callable_of_samples(s):
        if hold == "linear":
            return np.interp(s, t, samples)
        return samples[np.searchsorted(t, s, side="right") - 1]

    callable_of_samples.breakpoints = t
    fine = np.linspace(0.0, 1.0, 51)
    exact = sc.simulate(sys, fine, {"road_front": samples}, hold=hold)
    reference = collocation.simulate(sys, fine, {"road_front": callable_of_samples})
    # just before the jump at the end the held input still has its old value
    last = slice(0, -1)
    assert relative(exact.outputs[:8, last], reference.outputs[:8, last]) < 1e-8


@pytest.mark.property
@pytest.mark.parametrize("hold", ["linear", "zero"])
@pytest.mark.parametrize("delays", [DELAYS, (0.1, 0.0623)])
def test_uneven_samples_equal_cells_between_all_kinks(hold, delays, monkeypatch):
    rng = np.random.default_rng(7)
    t = np.append(0.0, np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 200)))
    samples = np.cumsum(rng.standard_normal(t.size)) * 1e-3
    inputs = {"road_front": samples, "road_rear": np.roll(samples, 13)}

    def run():
        return sc.simulate(half_car_loop(delays=delays), t, inputs, hold=hold)

    fast, slow = run(), between_all_kinks(monkeypatch, run)
    last = slice(0, -1)
    assert relative(fast.outputs[:8, last], slow.outputs[:8, last]) < 1e-8
    assert np.all(fast.error_estimate[:8] <= 1e-8 * np.max(np.abs(fast.outputs[:8]), axis=1))


@pytest.mark.property
@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_measured_road_equals_cells_between_all_kinks(interpolation, monkeypatch):
    """Two wheels meet the record at times that do not fit; output times are coarser than the cells."""
    rng = np.random.default_rng(9)
    road = sc.MeasuredRoad(
        distance=np.arange(300) * 0.05,
        elevation=np.cumsum(rng.standard_normal(300)) * 1e-3,
        speed=20.0,
        interpolation=interpolation,
    )
    t = np.linspace(0.0, 0.9, 77)
    sines = sc.RandomRoad(iso_class="C", speed=20.0, seed=1, bins=20).inputs({"force_front": 0.0})
    inputs = road.inputs({"road_front": 0.0, "road_rear": 0.138}) | sines
    loop = half_car_loop(delays=(0.21, 0.1234))

    def run():
        return sc.simulate(loop, t, inputs, history=lambda t: 1e-3 * np.cos(np.outer(np.arange(1, 9), t)))

    fast, slow = run(), between_all_kinks(monkeypatch, run)
    assert relative(fast.outputs, slow.outputs) < 1e-8
    np.testing.assert_allclose(fast.inputs, slow.inputs, rtol=0, atol=1e-12)


@pytest.mark.property
def test_unstable_loop_under_samples_overflows_by_name():
    sys = sc.DelayLTI.from_state_delays([[[3.0]], [[1.0]]], [1.0], B=[[1.0]])
    t = np.linspace(0.0, 1000.0, 20001)
    with pytest.raises(OverflowError, match="unstable"):
        sc.simulate(sys, t, np.ones(t.size))


@pytest.mark.property
@pytest.mark.parametrize(
    ("grid", "hold"), [("uneven", "linear"), ("uneven", "zero"), ("2 ms", "zero"), ("10 ms", "linear")]
)
@pytest.mark.parametrize("delays", [None, (0.0, 0.0), (5e-4, 5e-4), (1e-3, 5e-4)])
def test_more_samples_than_a_hundred_on_any_loop_equal_collocation(delays, grid, hold):
    """No delay, zero delays, and delays shorter than the samples: 0.1.0 crashed in half of these."""
    rng = np.random.default_rng(1)
    times = {
        "uneven": np.append(0.0, np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 103))),
        "2 ms": np.arange(104) * 2e-3,
        "10 ms": np.arange(104) * 1e-2,
    }
    t, samples = times[grid], np.cumsum(rng.standard_normal(104)) * 1e-3
    loop = sc.HalfCar().plant() if delays is None else half_car_loop(delays=delays)
    ours, reference = (
        way(loop, t, {"road_rear": samples}, hold=hold) for way in (sc.simulate, collocation.simulate)
    )
    last = slice(0, -1)  # the held input jumps at the last time, and either value is right there
    assert relative(ours.outputs[:8, last], reference.outputs[:8, last]) < 1e-8


@pytest.mark.analytical
@pytest.mark.parametrize("pole", [0.0, -1e-6, -1e-3])
@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_uneven_samples_of_a_slow_plant_are_no_even_ones(pole, rtol):
    """x' = a x + u, u joined by lines between uneven samples: of an integrator the trapezoidal rule is exact."""
    rng = np.random.default_rng(3)
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(0.01, 0.02, 130))])
    u = np.sin(3.0 * t)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (u[1:] + u[:-1]) * np.diff(t))])
    for system in (control.ss(pole, 1.0, 1.0, 0.0), sc.delay(0.23) * control.ss(pole, 1.0, 1.0, 0.0)):
        found = sc.simulate(system, t, u, rtol=rtol)
        assert np.abs(found.states[0] - x).max() < (abs(pole) * t[-1] + 10.0 * rtol) * np.abs(x).max() + 1e-12
