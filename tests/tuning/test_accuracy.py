"""J of the search, of what is returned and of the passive car against dense sweeps of the 2 x 2 loop made here."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from tuning.tuning_case import BAND, LAG, LAGS, PAIRS, WEIGHTS, road, road_psd

from susp_ctrl.errors import TooMuchWorkError
from susp_ctrl.tuning import BandMean, BandPeak, Limit, RoadRms, TuningProblem, tune
from susp_ctrl.vehicle import HalfCar

DENSE = 60_001
OBJECTIVES = {
    "road_rms": lambda: RoadRms(road(), WEIGHTS, LAGS),
    "band_mean": lambda: BandMean((1.0, 100.0), WEIGHTS, LAGS),
    "band_peak": lambda: BandPeak((1.0, 100.0), WEIGHTS, LAGS),
}


def magnitudes(car, omega, x, outputs=tuple(WEIGHTS)):
    """|outputs| per metre of road by partial fractions of the plant and the 2 x 2 loop, shape (f, outputs)."""
    plant = car.plant()
    rows = [plant.output_labels.index(name) for name in (*outputs, *(measured for measured, _ in PAIRS))]
    inputs = ("road_front", "road_rear", "force_front", "force_rear")
    columns = [plant.input_labels.index(name) for name in inputs]
    poles, modes = np.linalg.eig(plant.A)
    left, right = (plant.C @ modes)[rows], np.linalg.solve(modes, plant.B)[:, columns]
    g = np.einsum("ik,kf,kj->fij", left, 1 / (1j * omega - poles[:, None]), right)
    g = g + plant.D[np.ix_(rows, columns)]
    n = len(outputs)
    free = g[..., 0] + g[..., 1] * np.exp(-1j * omega * LAG)[:, None]
    e = np.asarray(x[:2]) * np.exp(-1j * omega[:, None] * np.asarray(x[2:]))
    loop = np.eye(2) - g[:, n:, 2:] * e[:, None, :]
    signals = np.linalg.solve(loop, free[:, n:, None])[..., 0]
    return np.abs(free[:, :n] + np.einsum("fij,fj->fi", g[:, :n, 2:], e * signals))


def dense_value(name, car, x):
    if name == "road_rms":
        omega = np.geomspace(*BAND, DENSE)
        squares = magnitudes(car, omega, x) ** 2 * road_psd(omega)[:, None]
        return np.sqrt(np.trapezoid(squares, omega, axis=0)) @ [0.7, 0.3]
    omega = np.linspace(1.0, 100.0, DENSE)
    line = magnitudes(car, omega, x) @ [0.7, 0.3] / omega
    if name == "band_mean":
        return np.trapezoid(line, omega) / 99.0
    top = omega[line.argmax()] + np.linspace(-0.01, 0.01, 2001)
    return (magnitudes(car, top, x) @ [0.7, 0.3] / top).max()


def feasible(p, count, seed=3):
    rng = np.random.default_rng(seed)
    points = p.lower + rng.random((40, p.dimension)) * (p.upper - p.lower)
    points[:, :2] *= rng.random((40, 1))
    return points[p.violations(points) == 0][:count]


@pytest.mark.analytical
@pytest.mark.parametrize("delays", [(1.0, 2.0), pytest.param((0.0, 10.0), marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["road_rms", "band_mean"])
def test_the_search_integrates_the_ripple_of_long_delays(name, delays):
    p = TuningProblem(HalfCar().plant(), PAIRS, OBJECTIVES[name](), (-34e3, 34e3), delays)
    points = feasible(p, 6)
    expected = [dense_value(name, HalfCar(), x) for x in points]
    np.testing.assert_allclose(p.values(points), expected, rtol=1e-4)
    np.testing.assert_allclose([p.accurate(x)[0] for x in points], expected, rtol=1e-7)


@pytest.mark.analytical
@pytest.mark.parametrize("damping", [15.0, 5.0])
@pytest.mark.parametrize("name", OBJECTIVES)
def test_resonances_of_a_lightly_damped_car_are_seen(name, damping):
    car = HalfCar(damping_front=damping, damping_rear=damping)
    p = TuningProblem(car.plant(), PAIRS, OBJECTIVES[name](), (-34e3, 34e3))
    idle = np.array([0.0, 0.0, 0.001, 0.001])
    expected = dense_value(name, car, idle)
    assert p.passive_value == pytest.approx(expected, rel=1e-5)
    assert p.values(idle[None])[0] == pytest.approx(expected, rel=5e-4)
    for x in feasible(p, 3):
        assert p.accurate(x)[0] == pytest.approx(dense_value(name, car, x), rel=1e-5)


@pytest.mark.analytical
@pytest.mark.slow
def test_no_error_of_the_quadrature_is_taken_for_comfort():
    """Delays of 3 to 10 s: what is returned has the value it is said to have, however sharp the loop."""
    p = TuningProblem(HalfCar().plant(), PAIRS, OBJECTIVES["road_rms"](), (-1.5e5, 1.5e5), (3.0, 10.0))
    best = tune(p, particles=12, iterations=10, polish_starts=2, seed=0)
    assert best.fun == pytest.approx(dense_value("road_rms", HalfCar(), best.x), rel=1e-6)
    assert best.passive_value == pytest.approx(dense_value("road_rms", HalfCar(), np.zeros(4)), rel=1e-6)


def test_a_limit_is_kept_by_the_accurate_value():
    """RMS stroke of a lightly damped car within its limit by a dense sweep; the search's value is not asked."""
    car, name = HalfCar(damping_front=100.0, damping_rear=100.0), "suspension_deflection_front"
    reading = RoadRms(road(), {name: 1.0}, LAGS)
    free = TuningProblem(car.plant(), PAIRS, reading, (-34e3, 34e3))
    stroke = Limit(reading, 0.8 * free.passive_value)
    p = TuningProblem(car.plant(), PAIRS, OBJECTIVES["band_mean"](), (-34e3, 34e3), limits=[stroke])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        best = tune(p, particles=12, iterations=10, polish_starts=2, seed=0)
    assert best.success
    omega = np.geomspace(*BAND, DENSE)
    squares = magnitudes(car, omega, best.x, (name,))[:, 0] ** 2 * road_psd(omega)
    assert np.sqrt(np.trapezoid(squares, omega)) <= stroke.at_most * (1.0 + 1.1e-4)
    assert best.fun == pytest.approx(dense_value("band_mean", car, best.x), rel=1e-5)


def test_more_nodes_than_allowed_are_refused():
    with pytest.raises(TooMuchWorkError, match=r"20000 frequencies.*delay_bounds"):
        TuningProblem(HalfCar().plant(), PAIRS, OBJECTIVES["road_rms"](), (-34e3, 34e3), (0.0, 1000.0))


def test_mistakes_of_the_search_are_told(monkeypatch):
    p = TuningProblem(HalfCar().plant(), PAIRS, OBJECTIVES["road_rms"](), (-34e3, 34e3))
    true = p.accurate
    monkeypatch.setattr(p, "accurate", lambda x: (true(x)[0] + 0.002 * p.passive_value, 0.0))
    with pytest.warns(RuntimeWarning, match="the search was mistaken"):
        tune(p, particles=6, iterations=2, polish_starts=0)
    monkeypatch.setattr(p, "accurate", lambda x: (true(x)[0], 2e-4))
    assert not tune(p, particles=6, iterations=2, polish_starts=0).success
