"""Extremes of a record sampled coarsely are those of a fine one."""

from __future__ import annotations

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
