"""The quarter car: heave of one wheel and the body mass it carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import control
import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.vehicle.mechanics import Vehicle


@dataclass(frozen=True, kw_only=True)
class QuarterCar(Vehicle):
    """Quarter car with two degrees of freedom q = [x_t, x_b].

    With the suspension deflection s = x_b - x_t and the road x_g::

        m_t x_t'' = -k_t (x_t - x_g) + k_s s + c_s s' - f
        m_b x_b'' = -k_s s - c_s s' + f

    A positive actuator force pushes the body up and the wheel down.

    Parameters
    ----------
    body_mass, unsprung_mass : float
        m_b, m_t (kg).
    tire_stiffness, spring_stiffness : float
        k_t, k_s (N/m).
    damping : float
        c_s (N s/m); zero is allowed.

    Raises
    ------
    InputError
        If a mass or stiffness is not positive, the damping is negative, or a value is not finite.

    Notes
    -----
    The defaults are the front axle of `HalfCar` with the body mass it carries, m Lr/(Lf + Lr).
    """

    _WHEELS: ClassVar[tuple[str, ...]] = ("",)
    _NON_NEGATIVE: ClassVar[frozenset[str]] = frozenset({"damping"})

    body_mass: float = 377.5
    unsprung_mass: float = 40.5
    tire_stiffness: float = 192000.0
    spring_stiffness: float = 17000.0
    damping: float = 1500.0

    def _carried_masses(self) -> FloatArray:
        return np.array([self.body_mass])

    def plant(self) -> control.StateSpace:
        """Return the car as a plant with named signals.

        Returns
        -------
        control.StateSpace
            Inputs road (m), force (N). Outputs body_acceleration, suspension_deflection, tire_deflection
            (wheel minus road), unsprung_displacement, body_displacement, body_velocity, unsprung_velocity,
            suspension_velocity, actuator_force. States are the coordinates and then their velocities.
        """
        return self._assembled("quarter_car", {"body": (self.body_mass, [1.0])})
