"""The half car with delayed wheel-displacement feedback, and its road, for the tests of time responses."""

from __future__ import annotations

import numpy as np

GAINS, DELAYS, LAG = (19345.0, 26150.0), (0.5530, 0.5186), 0.138


def half_car_loop(gains=GAINS, delays=DELAYS):
    import susp_ctrl as sc

    channels = [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", gain=gains[0], delay=delays[0]),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", gain=gains[1], delay=delays[1]),
    ]
    return sc.close_loop(sc.HalfCar().plant(), channels)


def relative(values, exact):
    """Largest error of the worst signal, relative to its peak."""
    peak = np.max(np.abs(exact), axis=-1)
    peak = np.where(peak > 0.0, peak, 1.0)
    return float(np.max(np.max(np.abs(values - exact), axis=-1) / peak))


def road(t, lag=0.0):
    """0.05 sin(7 t) from its arrival on."""
    late = t - lag
    return np.where(late > 0.0, 0.05 * np.sin(7.0 * late), 0.0)


def road_inputs():
    """The road under both wheels; the rear one meets it with a kink at `LAG`."""

    def rear(t):
        return road(t, LAG)

    rear.breakpoints = (LAG,)
    return {"road_front": road, "road_rear": rear}
