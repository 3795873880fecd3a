"""The quarter car: heave of one wheel and the body mass it carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import control
import numpy as np

from susp_ctrl.vehicle.mechanics import (
    GRAVITY,
    Coordinates,
    Output,
    Tire,
    ValidatedFields,
    state_space,
    suspension_matrices,
)


@dataclass(frozen=True, kw_only=True)
class QuarterCar(ValidatedFields):
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

    _NON_NEGATIVE: ClassVar[frozenset[str]] = frozenset({"damping"})

    body_mass: float = 377.5
    unsprung_mass: float = 40.5
    tire_stiffness: float = 192000.0
    spring_stiffness: float = 17000.0
    damping: float = 1500.0

    @property
    def tires(self) -> tuple[Tire, ...]:
        """The tire: deflection output, stiffness, static load (N)."""
        load = (self.body_mass + self.unsprung_mass) * GRAVITY
        return (Tire("tire_deflection", self.tire_stiffness, load),)

    def static_loads(self) -> dict[str, float]:
        """Return the static tire load (N), g = 9.81 m/s2."""
        return {"wheel": self.tires[0].static_load}

    def plant(self) -> control.StateSpace:
        """Return the car as a plant with named signals.

        Returns
        -------
        control.StateSpace
            Inputs road (m), force (N). Outputs body_acceleration, suspension_deflection, tire_deflection
            (wheel minus road), unsprung_displacement, body_displacement, body_velocity, unsprung_velocity,
            suspension_velocity, actuator_force. States are the coordinates and then their velocities.
        """
        q = Coordinates(("unsprung", "body"))
        deflection, wheel, body = q.row(unsprung=-1, body=1), q.row(unsprung=1), q.row(body=1)
        damping, stiffness = suspension_matrices(deflection[None, :], [self.spring_stiffness], [self.damping])
        road_forces = self.tire_stiffness * wheel[:, None]
        one = np.ones(1)
        return state_space(
            np.array([self.unsprung_mass, self.body_mass]),
            damping,
            stiffness + road_forces @ wheel[None, :],
            road_forces,
            deflection[:, None],
            [
                Output("body_acceleration", acceleration=body),
                Output("suspension_deflection", displacement=deflection),
                Output("tire_deflection", displacement=wheel, road=-one),
                Output("unsprung_displacement", displacement=wheel),
                Output("body_displacement", displacement=body),
                Output("body_velocity", velocity=body),
                Output("unsprung_velocity", velocity=wheel),
                Output("suspension_velocity", velocity=deflection),
                Output("actuator_force", force=one),
            ],
            coordinate_names=[
                ("unsprung_displacement", "unsprung_velocity"),
                ("body_displacement", "body_velocity"),
            ],
            road_names=["road"],
            force_names=["force"],
            name="quarter_car",
        )
