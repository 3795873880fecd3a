r"""Where a delayed wheel-displacement feedback cancels the suspension force at one frequency, in closed form.

On each axle the force on the body is :math:`(k_s + j\omega c_s)(x_t - x_s) + g e^{-j\omega\tau} x_t`. With the body
at rest (x_s = 0) it vanishes for

.. math:: g e^{-j\omega\tau} = -(k_s + j\omega c_s),

that is :math:`|g| = \sqrt{k_s^2 + \omega^2 c_s^2}` and one delay per sign of g and period: the body stands still
whatever the roads do, so every objective that weighs body motion at this frequency is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from susp_ctrl.study.settings import PairSettings

_MEASURED, _ACTUATOR = "unsprung_displacement", "force"


def cancelling_feedback(
    vehicle: Any, pairs: Sequence[PairSettings], omega: float
) -> list[list[tuple[float, float]]] | None:
    """Return, for each pair, every (gain, delay) inside its bounds that cancels the suspension force.

    Parameters
    ----------
    vehicle : HalfCar, QuarterCar or FullCar
    pairs : sequence of PairSettings
        Feedback paths with their bounds.
    omega : float
        Frequency (rad/s).

    Returns
    -------
    list of list of (gain, delay), or None
        Gain in N/m, delay in s, by increasing delay. None where the pairs are not the wheel-displacement feedback
        of every wheel, each to its own actuator: the closed form does not apply.
    """
    wheels = [tire.deflection.removeprefix("tire_deflection") for tire in vehicle.tires]
    own = {(_MEASURED + wheel, _ACTUATOR + wheel): wheel for wheel in wheels}
    given = [(pair.measured, pair.actuator) for pair in pairs]
    if sorted(given) != sorted(own) or any(pair.actuator_bandwidth for pair in pairs):
        return None
    solutions = []
    for pair, place in zip(pairs, given, strict=True):
        axle = "_".join(own[place].split("_")[:2])  # a full car has one spring rate per axle
        stiffness = getattr(vehicle, f"spring_stiffness{axle}") + 1j * omega * getattr(
            vehicle, f"damping{axle}"
        )
        solutions.append(_inside(pair, stiffness, omega))
    return solutions


def _inside(pair: PairSettings, stiffness: complex, omega: float) -> list[tuple[float, float]]:
    found = []
    for gain in (abs(stiffness), -abs(stiffness)):
        if not pair.gain_from <= gain <= pair.gain_to:
            continue
        # g e^{-j w tau} = -stiffness: the angle w tau is that of -g/stiffness.
        angle = float(np.angle(-gain / stiffness))
        period = 2 * np.pi
        first = np.ceil((omega * pair.delay_from - angle) / period)
        last = np.floor((omega * pair.delay_to - angle) / period)
        found += [
            (float(gain), float((angle + period * turn) / omega)) for turn in np.arange(first, last + 1)
        ]
    return sorted(found, key=lambda solution: solution[1])
