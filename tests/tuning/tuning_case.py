"""The tuning tests' common example: Table 1 car, its road, and J recomputed from the 4 x 4 oracle."""

from __future__ import annotations

import numpy as np
from oracles import ride_response

from susp_ctrl.road import RandomRoad
from susp_ctrl.tuning import BandMean, BandPeak, Harmonic, RoadRms, TuningProblem
from susp_ctrl.vehicle import HalfCar

SPEED = 20.0
LAG = (1.25 + 1.51) / SPEED
LAGS = {"road_front": 0.0, "road_rear": LAG}
WEIGHTS = {"body_acceleration": 0.7, "pitch_acceleration": 0.3}
PAIRS = [("unsprung_displacement_front", "force_front"), ("unsprung_displacement_rear", "force_rear")]
PAPER_BOX = [(-34000.0, 34000.0), (-44000.0, 44000.0)]
BAND = (2 * np.pi * SPEED * 0.011, 2 * np.pi * SPEED * 2.83)


def road():
    return RandomRoad(iso_class="C", speed=SPEED)


def objective(name):
    return {
        "harmonic": lambda: Harmonic(7.0, WEIGHTS, LAGS),
        "band_mean": lambda: BandMean((1.0, 100.0), WEIGHTS, LAGS),
        "band_peak": lambda: BandPeak((1.0, 100.0), WEIGHTS, LAGS),
        "road_rms": lambda: RoadRms(road(), WEIGHTS, LAGS),
    }[name]()


def problem(name, gain_bounds=PAPER_BOX, **settings):
    return TuningProblem(
        HalfCar().plant(), pairs=PAIRS, objective=objective(name), gain_bounds=gain_bounds, **settings
    )


def magnitudes(omega, x):
    """|body acceleration|, |pitch acceleration| per metre of road, from eq. (1), shape (f, 2)."""
    h = ride_response(1j * np.asarray(omega), tuple(x[:2]), tuple(x[2:]))[..., :2, :]
    return np.abs(h[..., 0] + h[..., 1] * np.exp(-1j * np.asarray(omega) * LAG)[:, None])


def eq6(omega, x):
    """J(w) = (0.7 |X_c''| + 0.3 |phi''|)/w per metre of road, shape (f,)."""
    return magnitudes(omega, x) @ [0.7, 0.3] / omega


def road_psd(omega, unevenness=256e-6):
    """ISO 8608 class C at 20 m/s: G_d(n0) n0^2 v / f^2 in m2/Hz, here per rad/s."""
    f = omega / (2 * np.pi)
    return unevenness * 0.1**2 * SPEED / f**2 / (2 * np.pi)


def road_sigmas(x, points=20000):
    """Standard deviations of the two accelerations by a fine trapezoidal rule in log frequency."""
    omega = np.geomspace(*BAND, points)
    integrand = magnitudes(omega, x) ** 2 * (road_psd(omega) * omega)[:, None]
    return np.sqrt(np.trapezoid(integrand, np.log(omega), axis=0))


def random_designs(count, seed, gain=(34000.0, 44000.0), delay=(0.001, 1.0)):
    rng = np.random.default_rng(seed)
    gains = rng.uniform(-1.0, 1.0, (count, 2)) * np.asarray(gain)
    return np.hstack([gains, rng.uniform(*delay, (count, 2))])
