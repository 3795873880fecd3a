"""A seat on the half car: a point of the body, or a passenger on a spring and a damper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from susp_ctrl.errors import InputError
from susp_ctrl.vehicle.mechanics import ValidatedFields


@dataclass(frozen=True, kw_only=True)
class Seat(ValidatedFields):
    """A seat at x_c + position phi, rigid or carrying a passenger.

    A rigid seat (passenger_mass = 0) only adds the output ``seat_acceleration`` = x_c'' + position phi''.
    With a passenger p the plant gets one more degree of freedom, s = x_p - x_c - position phi being the
    deflection::

        m_p x_p'' = -k s - c s',        m x_c'' = ... + k s + c s',      I phi'' = ... + position (k s + c s')

    and ``seat_acceleration`` is the passenger's x_p''.

    Parameters
    ----------
    position : float
        Distance behind the centre of mass (m), negative in front of it.
    passenger_mass : float
        kg; 0 means a rigid seat.
    stiffness, damping : float
        Seat and cushion (N/m, N s/m); used with a passenger only.

    Raises
    ------
    InputError
        If a value is not allowed, or a passenger sits on a seat without stiffness.
    """

    _NON_NEGATIVE: ClassVar[frozenset[str]] = frozenset({"passenger_mass", "stiffness", "damping"})
    _ANY_SIGN: ClassVar[frozenset[str]] = frozenset({"position"})

    position: float
    passenger_mass: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.passenger_mass > 0 and self.stiffness == 0:
            raise InputError(
                "Seat.stiffness = 0 is not allowed with a passenger_mass: a number greater than 0 is needed"
            )

    @property
    def has_passenger(self) -> bool:
        """Whether the seat adds a degree of freedom."""
        return self.passenger_mass > 0
