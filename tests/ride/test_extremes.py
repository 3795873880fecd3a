"""Extremes of a record sampled coarsely are those of a fine one."""

from __future__ import annotations

import control
import numpy as np
import pytest
from half_car_loops import half_car_loop

import susp_ctrl as sc
from susp_ctrl.ride.extremes import extremes

CAR = sc.HalfCar()
EXTREME = ("_peak", "_min", "_max")


def indices(loop, step, **options):
    road = sc.RandomRoad(iso_class="C", speed=20.0, seed=4)
    t = np.arange(0.0, 3.0 + 0.5 * step, step)
    response = sc.simulate(loop, t, road.inputs({"road_front": 0.0, "road_rear": 0.138}))
    table = sc.ride_indices(response, 0.5, vehicle=CAR, **options).set_index("indicator")["value"]
    return table[[name for name in table.index if name.endswith(EXTREME)]], response


@pytest.mark.property
@pytest.mark.parametrize("loop", [CAR.plant, half_car_loop])
def test_coarse_record_has_the_extremes_of_a_fine_one(loop):
    coarse, response = indices(loop(), 4e-3, seat_position=0.7)
    fine, _ = indices(loop(), 1e-4, seat_position=0.7)
    np.testing.assert_allclose(coarse, fine, rtol=2e-4, atol=1e-9)
    response.at = None  # its samples alone are too coarse
    sampled = sc.ride_indices(response, 0.5, vehicle=CAR).set_index("indicator")["value"]
    assert sampled["tire_load_rear_min"] > coarse["tire_load_rear_min"] + 1.0


@pytest.mark.analytical
def test_largest_value_of_a_wave_and_of_a_jump():
    t = np.arange(40) * 0.17
    found = extremes(t, {"wave": np.sin(t + 0.3)}, lambda t: {"wave": np.sin(t + 0.3)})["wave"]
    np.testing.assert_allclose(found, (-1.0, 1.0), rtol=1e-6)
    step = lambda t: {"step": np.where(t > 3.0, 1.0 - 0.01 * t, 0.0)}  # noqa: E731
    low, high = extremes(t, step(t), step)["step"]
    assert low == 0.0
    assert 0.9695 < high <= 0.97  # no parabola over the jump


@pytest.mark.analytical
@pytest.mark.parametrize("step", [0.1, 0.05, 0.01])
def test_peaks_of_coarse_records_are_those_of_dense_ones(step):
    """Signals of up to 10 Hz, sampled up to twice a period: against the same record every 0.5 ms."""
    car = sc.HalfCar()
    channel = sc.FeedbackChannel("unsprung_displacement_front", "force_front", 19345.0, 0.5530)
    inputs = sc.RandomRoad(speed=20.0, seed=1).inputs({"road_front": 0.0, "road_rear": car.axle_lag(20.0)})
    loop = sc.close_loop(car.plant(), channel)
    coarse = sc.simulate(loop, np.arange(0.0, 4.0 + step / 2, step), inputs)
    found = sc.ride_indices(coarse).set_index("indicator")["value"]
    dense = coarse.at(np.arange(0.0, 4.0, 5e-4))
    for name in ("body_acceleration", "pitch_acceleration", "tire_deflection_front", "tire_deflection_rear"):
        largest = np.abs(dense.y[list(dense.output_labels).index(name)]).max()
        assert found[f"{name}_peak"] == pytest.approx(largest, rel=2e-3)


@pytest.mark.parametrize("length", [0.05, 0.005])
@pytest.mark.parametrize("step", [0.01, 0.002])
def test_means_of_a_short_bump_are_those_of_a_fine_record(length, step):
    """A cleat between two samples, and its echo by the feedback, count in every mean."""
    loop = sc.close_loop(
        sc.QuarterCar().plant(), [sc.FeedbackChannel("tire_deflection", "force", -3e4, 0.05)]
    )
    road = sc.BumpRoad(0.02, length, 20.0).inputs({"road": 0.0})
    t = np.arange(0.0, 1.2 + 0.5 * step, step)
    coarse = sc.ride_indices(sc.simulate(loop, t, road)).set_index("indicator")["value"]
    kinks = np.concatenate([np.linspace(a, a + length / 20.0, 401) for a in (0.0, 0.05, 0.1)])
    fine = np.unique(np.concatenate([np.linspace(0.0, 1.2, 4801), kinks]))
    exact = sc.simulate(loop, fine, road)
    y = dict(zip(exact.output_labels, np.asarray(exact.y).reshape(len(exact.output_labels), -1), strict=True))
    for name in ("body_acceleration", "tire_deflection", "suspension_deflection", "actuator_force"):
        expected = np.sqrt(np.trapezoid(y[name] ** 2, fine) / 1.2)
        assert coarse[name] == pytest.approx(expected, rel=3e-4), name
    power = np.trapezoid(y["actuator_force"] * y["suspension_velocity"], fine) / 1.2
    assert coarse["actuator_power_mean"] == pytest.approx(power, rel=2e-3)


def test_samples_too_far_apart_are_called_so():
    t = np.linspace(0.0, 2.0, 201)
    spike = np.where(np.abs(t - 1.0) < 1e-9, 1.0, 0.0)
    response = control.TimeResponseData(t, spike[None], output_labels=["tire_deflection"], issiso=False)
    with pytest.warns(RuntimeWarning, match="record is too coarse for RMS tire_deflection"):
        sc.ride_indices(response)
