"""The full car: heave, pitch and roll of the body over four wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import control
import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.vehicle.half_car import HalfCar
from susp_ctrl.vehicle.mechanics import WHEEL_FIELDS, Spring, TwoAxles


@dataclass(frozen=True, kw_only=True)
class FullCar(TwoAxles):
    """Full car with seven degrees of freedom q = [x_fl, x_fr, x_rl, x_rr, x_c, phi, theta].

    The suspension above a wheel at distance a behind the centre of mass (a = -Lf or Lr) and b to its left
    (b = B/2 or -B/2, B the track of the axle) is attached at x_c + a phi + b theta, so that its deflection is
    d q = x_c + a phi + b theta - x_wheel. With one row d per wheel and an anti-roll bar kb between the
    suspensions of each axle::

        M q'' + C q' + K q = sum d' f + kt [x_g; 0]
        M = diag(mtf, mtf, mtr, mtr, m, I, Ir)
        C = sum cs d' d
        K = sum ks d' d + sum kb (d_left - d_right)' (d_left - d_right) + diag(ktf, ktf, ktr, ktr, 0, 0, 0)

    Positive pitch lowers the front, positive roll raises the left side, a positive actuator force pushes the
    body up and the wheel down.

    Parameters
    ----------
    body_mass : float
        m, the whole body (kg).
    pitch_inertia, roll_inertia : float
        I, Ir (kg m2).
    unsprung_mass_front, unsprung_mass_rear : float
        One wheel (kg).
    tire_stiffness_front, tire_stiffness_rear : float
        One tire (N/m).
    spring_stiffness_front, spring_stiffness_rear : float
        One spring (N/m).
    damping_front, damping_rear : float
        One damper (N s/m); zero is allowed.
    anti_roll_stiffness_front, anti_roll_stiffness_rear : float
        kb: wheel force per difference of the two suspension deflections of the axle (N/m); zero is allowed.
    axle_distance_front, axle_distance_rear : float
        From the centre of mass to the axle (m).
    track_front, track_rear : float
        Distance between the wheels of an axle (m).

    Raises
    ------
    InputError
        If a mass, stiffness, inertia or distance is not positive, a damping or anti-roll stiffness is
        negative, or a value is not finite.

    Notes
    -----
    The defaults are two mirrored half cars of Table 1 (`HalfCar`): twice its body mass and pitch inertia, its
    wheels on each side. Table 1 says nothing of roll; the roll inertia 460 kg m2 and the track 1.5 m are this
    program's choice of a car of that size.
    """

    _WHEELS: ClassVar[tuple[str, ...]] = ("front_left", "front_right", "rear_left", "rear_right")
    _NON_NEGATIVE: ClassVar[frozenset[str]] = frozenset(
        {"damping_front", "damping_rear", "anti_roll_stiffness_front", "anti_roll_stiffness_rear"}
    )

    body_mass: float = 1380.0
    pitch_inertia: float = 2400.0
    roll_inertia: float = 460.0
    unsprung_mass_front: float = 40.5
    unsprung_mass_rear: float = 45.4
    tire_stiffness_front: float = 192000.0
    tire_stiffness_rear: float = 192000.0
    spring_stiffness_front: float = 17000.0
    spring_stiffness_rear: float = 22000.0
    damping_front: float = 1500.0
    damping_rear: float = 1500.0
    anti_roll_stiffness_front: float = 0.0
    anti_roll_stiffness_rear: float = 0.0
    axle_distance_front: float = 1.25
    axle_distance_rear: float = 1.51
    track_front: float = 1.5
    track_rear: float = 1.5

    @classmethod
    def from_half_car(
        cls, car: HalfCar, *, roll_inertia: float, track_front: float, track_rear: float | None = None
    ) -> Self:
        """Return the full car made of `car` and its mirror image.

        Parameters
        ----------
        car : HalfCar
            One side; a seat is left out.
        roll_inertia : float
            kg m2.
        track_front, track_rear : float
            m; the rear track equals the front one by default.

        Returns
        -------
        FullCar
        """
        shared = {
            f"{field}_{axle}": getattr(car, f"{field}_{axle}")
            for field in (*WHEEL_FIELDS, "axle_distance")
            for axle in ("front", "rear")
        }
        return cls(
            body_mass=2 * car.body_mass,
            pitch_inertia=2 * car.pitch_inertia,
            roll_inertia=roll_inertia,
            track_front=track_front,
            track_rear=track_front if track_rear is None else track_rear,
            **shared,
        )

    def _carried_masses(self) -> FloatArray:
        on_front_axle = self.body_mass * self.axle_distance_rear / self.wheelbase
        return np.repeat([on_front_axle, self.body_mass - on_front_axle], 2) / 2

    def plant(self) -> control.StateSpace:
        """Return the car as a plant with named signals.

        Returns
        -------
        control.StateSpace
            Inputs road_* (m), then force_* (N). Outputs body_acceleration, pitch_acceleration, roll_acceleration,
            suspension_deflection_*, tire_deflection_* (wheel minus road), unsprung_displacement_*,
            body_displacement, pitch_angle, roll_angle, body_velocity, pitch_velocity, roll_velocity,
            unsprung_velocity_*, suspension_velocity_*, actuator_force_*, each * being front_left,
            front_right, rear_left, rear_right. States are the coordinates and then their velocities.
        """
        behind = self._per_wheel("axle_distance") * [-1.0, -1.0, 1.0, 1.0]
        left = self._per_wheel("track") * [0.5, -0.5, 0.5, -0.5]
        return self._assembled(
            "full_car",
            {
                "body": (self.body_mass, np.ones(4)),
                "pitch": (self.pitch_inertia, behind),
                "roll": (self.roll_inertia, left),
            },
            [
                self._anti_roll_bar("front", self.track_front, self.anti_roll_stiffness_front),
                self._anti_roll_bar("rear", self.track_rear, self.anti_roll_stiffness_rear),
            ],
        )

    @staticmethod
    def _anti_roll_bar(axle: str, track: float, stiffness: float) -> Spring:
        # d_left - d_right: heave and pitch drop out
        return Spring(
            {f"unsprung_{axle}_left": -1.0, f"unsprung_{axle}_right": 1.0, "roll": track}, stiffness
        )
