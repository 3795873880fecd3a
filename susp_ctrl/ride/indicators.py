"""What the name of a plant output says: its unit, and the ride indices it takes part in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from susp_ctrl import validation
from susp_ctrl.errors import InputError

_LINEAR_UNITS = {
    "acceleration": "m/s2",
    "velocity": "m/s",
    "displacement": "m",
    "deflection": "m",
    "road": "m",
    "force": "N",
}
_ANGULAR_UNITS = {"acceleration": "rad/s2", "velocity": "rad/s", "angle": "rad"}

# Weighting of each acceleration, and its multiplier (m/s2 per unit) in the comfort total.
COMFORT_WEIGHTS = {
    "body_acceleration": ("Wk", 1.0),
    "pitch_acceleration": ("We", 0.4),
    "roll_acceleration": ("We", 0.63),
    "seat_acceleration": ("Wk", 1.0),
}


class TireLike(Protocol):
    """One tire of a vehicle: the output that is its deflection, stiffness (N/m) and static load (N)."""

    @property
    def deflection(self) -> str: ...  # noqa: D102
    @property
    def stiffness(self) -> float: ...  # noqa: D102
    @property
    def static_load(self) -> float: ...  # noqa: D102


class VehicleLike(Protocol):
    """Anything with tires, such as `HalfCar`."""

    @property
    def tires(self) -> Sequence[TireLike]: ...  # noqa: D102


def checked_vehicle(vehicle: Any) -> VehicleLike:
    """Return a vehicle with tires, or say that it is none."""
    if not hasattr(vehicle, "tires"):
        raise InputError(f"vehicle is a {type(vehicle).__name__}: a vehicle with tires is needed")
    return cast(VehicleLike, vehicle)


def signal_unit(name: str) -> str:
    """Return the SI unit of a plant signal from its name, such as "rad/s2" for pitch_acceleration.

    Raises
    ------
    InputError
        If the name says nothing of its kind.
    """
    words = name.split("_")
    units = _ANGULAR_UNITS if words[0] in ("pitch", "roll") else _LINEAR_UNITS
    for word in words:
        if word in units:
            return units[word]
    raise InputError(
        f"signal {name!r} is of no known kind: its name needs one of the words "
        f"{', '.join(sorted(_LINEAR_UNITS | _ANGULAR_UNITS))}"
    )


def indicator_signals(labels: Sequence[str]) -> list[str]:
    """Return the outputs whose RMS is a ride indicator: accelerations, suspension and tire deflections, seat."""
    kinds = ("_acceleration", "suspension_deflection", "tire_deflection")
    ordered = [name for kind in kinds for name in labels if kind in name]
    return sorted(ordered, key=lambda name: name.startswith("seat"))


def seat_combination(labels: Sequence[str], seat_position: float | None) -> NDArray[np.float64] | None:
    """Return the row c with c y the acceleration of the body at `seat_position` metres behind its centre."""
    if seat_position is None:
        return None
    position = validation.number("seat_position", seat_position)
    if "seat_acceleration" in labels:
        raise InputError(
            f"seat_position = {position:g} is not allowed: the response has a seat_acceleration of its own"
        )
    row = np.zeros(len(labels))
    for name, factor in (("body_acceleration", 1.0), ("pitch_acceleration", position)):
        if name not in labels:
            raise InputError(f"seat_position = {position:g} is not allowed: the response has no {name}")
        row[labels.index(name)] = factor
    return row
