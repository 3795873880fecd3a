"""The full car: heave, pitch and roll of the body over four wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import control
import numpy as np

from susp_ctrl.vehicle.half_car import HalfCar
from susp_ctrl.vehicle.mechanics import (
    GRAVITY,
    Coordinates,
    FloatArray,
    Output,
    Tire,
    TwoAxles,
    state_space,
    suspension_matrices,
)

_WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


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
            for field in (
                "unsprung_mass",
                "tire_stiffness",
                "spring_stiffness",
                "damping",
                "axle_distance",
            )
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

    @property
    def tires(self) -> tuple[Tire, ...]:
        """The four tires in the order of the plant: deflection output, stiffness, static load (N)."""
        on_front_axle = self.body_mass * self.axle_distance_rear / self.wheelbase
        front = (on_front_axle / 2 + self.unsprung_mass_front) * GRAVITY
        rear = ((self.body_mass - on_front_axle) / 2 + self.unsprung_mass_rear) * GRAVITY
        loads = (front, front, rear, rear)
        return tuple(
            Tire(f"tire_deflection_{wheel}", float(k), load)
            for wheel, k, load in zip(_WHEELS, self._per_wheel("tire_stiffness"), loads, strict=True)
        )

    def static_loads(self) -> dict[str, float]:
        """Return the static tire loads (N) of the four wheels, g = 9.81 m/s2."""
        return {wheel: tire.static_load for wheel, tire in zip(_WHEELS, self.tires, strict=True)}

    def _per_wheel(self, field: str) -> FloatArray:
        return np.repeat([getattr(self, f"{field}_front"), getattr(self, f"{field}_rear")], 2)

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
        corners = tuple(f"unsprung_{wheel}" for wheel in _WHEELS)
        q = Coordinates((*corners, "body", "pitch", "roll"))
        behind = np.repeat([-self.axle_distance_front, self.axle_distance_rear], 2)
        left = 0.5 * np.array([self.track_front, -self.track_front, self.track_rear, -self.track_rear])
        deflections = np.array(
            [
                q.row(**{corner: -1, "body": 1, "pitch": a, "roll": b})
                for corner, a, b in zip(corners, behind, left, strict=True)
            ]
        )
        damping, stiffness = suspension_matrices(
            deflections, self._per_wheel("spring_stiffness"), self._per_wheel("damping")
        )
        twist = deflections[[0, 2]] - deflections[[1, 3]]
        bars = np.array([self.anti_roll_stiffness_front, self.anti_roll_stiffness_rear])
        stiffness = stiffness + twist.T @ (bars[:, None] * twist)
        wheels = np.array([q.row(**{corner: 1}) for corner in corners])
        road_forces = wheels.T * self._per_wheel("tire_stiffness")
        inertias = np.array([self.body_mass, self.pitch_inertia, self.roll_inertia])
        return state_space(
            np.concatenate([self._per_wheel("unsprung_mass"), inertias]),
            damping,
            stiffness + road_forces @ wheels,
            road_forces,
            deflections.T,
            _outputs(q, deflections, wheels),
            coordinate_names=[
                *((f"unsprung_displacement_{wheel}", f"unsprung_velocity_{wheel}") for wheel in _WHEELS),
                ("body_displacement", "body_velocity"),
                ("pitch_angle", "pitch_velocity"),
                ("roll_angle", "roll_velocity"),
            ],
            road_names=[f"road_{wheel}" for wheel in _WHEELS],
            force_names=[f"force_{wheel}" for wheel in _WHEELS],
            name="full_car",
        )


def _outputs(q: Coordinates, deflections: FloatArray, wheels: FloatArray) -> list[Output]:
    body, pitch, roll, per_wheel = q.row(body=1), q.row(pitch=1), q.row(roll=1), np.eye(4)
    corners = list(enumerate(_WHEELS))
    return [
        Output("body_acceleration", acceleration=body),
        Output("pitch_acceleration", acceleration=pitch),
        Output("roll_acceleration", acceleration=roll),
        *(Output(f"suspension_deflection_{wheel}", displacement=deflections[k]) for k, wheel in corners),
        *(
            Output(f"tire_deflection_{wheel}", displacement=wheels[k], road=-per_wheel[k])
            for k, wheel in corners
        ),
        *(Output(f"unsprung_displacement_{wheel}", displacement=wheels[k]) for k, wheel in corners),
        Output("body_displacement", displacement=body),
        Output("pitch_angle", displacement=pitch),
        Output("roll_angle", displacement=roll),
        Output("body_velocity", velocity=body),
        Output("pitch_velocity", velocity=pitch),
        Output("roll_velocity", velocity=roll),
        *(Output(f"unsprung_velocity_{wheel}", velocity=wheels[k]) for k, wheel in corners),
        *(Output(f"suspension_velocity_{wheel}", velocity=deflections[k]) for k, wheel in corners),
        *(Output(f"actuator_force_{wheel}", force=per_wheel[k]) for k, wheel in corners),
    ]
