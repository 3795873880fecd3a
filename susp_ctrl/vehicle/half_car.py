"""The half car: heave and pitch of the body over a front and a rear axle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import control
import numpy as np

from susp_ctrl.errors import InputError
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
from susp_ctrl.vehicle.quarter_car import QuarterCar
from susp_ctrl.vehicle.seat import Seat

_AXLES = ("front", "rear")


@dataclass(frozen=True, kw_only=True)
class HalfCar(TwoAxles):
    r"""Half car with four degrees of freedom q = [x_tf, x_tr, x_c, phi].

    With the suspension deflections d_f q = x_c - Lf phi - x_tf and d_r q = x_c + Lr phi - x_tr::

        M q'' + C q' + K q = d_f' f_f + d_r' f_r + [ktf x_gf, ktr x_gr, 0, 0]'
        M = diag(mtf, mtr, m, I)
        C = csf d_f' d_f + csr d_r' d_r
        K = ksf d_f' d_f + ksr d_r' d_r + diag(ktf, ktr, 0, 0)

    A positive actuator force pushes the body up and the wheel down; positive pitch lowers the front. The
    motion is about the static position, so gravity enters the static loads only.

    Parameters
    ----------
    body_mass : float
        m (kg).
    pitch_inertia : float
        I (kg m2).
    unsprung_mass_front, unsprung_mass_rear : float
        mtf, mtr (kg).
    tire_stiffness_front, tire_stiffness_rear : float
        ktf, ktr (N/m).
    spring_stiffness_front, spring_stiffness_rear : float
        ksf, ksr (N/m).
    damping_front, damping_rear : float
        csf, csr (N s/m); zero is allowed.
    axle_distance_front, axle_distance_rear : float
        Lf, Lr: from the centre of mass to the axle (m).
    seat : Seat, optional
        A seat position or a passenger; adds outputs after the usual ones.

    Raises
    ------
    InputError
        If a mass, stiffness, inertia or distance is not positive, a damping is negative, or a value is not
        finite.

    References
    ----------
    .. [1] K. Wu, C. Ren, "Control and Stability Analysis of Double Time-Delay Active Suspension Based on
       Particle Swarm Optimization", Shock and Vibration, 2020, eq. (1) and Table 1 (the defaults).

    Examples
    --------
    >>> from susp_ctrl.vehicle import HalfCar
    >>> car = HalfCar(body_mass=720)
    >>> car.plant().input_labels
    ['road_front', 'road_rear', 'force_front', 'force_rear']
    >>> round(car.axle_lag(speed=20.0), 3)
    0.138
    """

    _NON_NEGATIVE: ClassVar[frozenset[str]] = frozenset({"damping_front", "damping_rear"})
    _COMPONENTS: ClassVar[frozenset[str]] = frozenset({"seat"})

    body_mass: float = 690.0
    pitch_inertia: float = 1200.0
    unsprung_mass_front: float = 40.5
    unsprung_mass_rear: float = 45.4
    tire_stiffness_front: float = 192000.0
    tire_stiffness_rear: float = 192000.0
    spring_stiffness_front: float = 17000.0
    spring_stiffness_rear: float = 22000.0
    damping_front: float = 1500.0
    damping_rear: float = 1500.0
    axle_distance_front: float = 1.25
    axle_distance_rear: float = 1.51
    seat: Seat | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.seat is not None and not isinstance(self.seat, Seat):
            raise InputError(f"HalfCar.seat = {self.seat!r} is not allowed: a Seat or None is needed")

    @property
    def tires(self) -> tuple[Tire, ...]:
        """Front and rear tire: deflection output, stiffness, static load (N)."""
        body = np.array([self.axle_distance_rear, self.axle_distance_front]) * self.body_mass
        if self.seat is not None:
            lever = np.array(
                [self.axle_distance_rear - self.seat.position, self.axle_distance_front + self.seat.position]
            )
            body = body + lever * self.seat.passenger_mass
        unsprung = np.array([self.unsprung_mass_front, self.unsprung_mass_rear])
        loads = (body / self.wheelbase + unsprung) * GRAVITY
        stiffness = (self.tire_stiffness_front, self.tire_stiffness_rear)
        return tuple(
            Tire(f"tire_deflection_{axle}", k, float(load))
            for axle, k, load in zip(_AXLES, stiffness, loads, strict=True)
        )

    def static_loads(self) -> dict[str, float]:
        """Return the static tire loads (N) of the front and the rear axle, g = 9.81 m/s2."""
        return {axle: tire.static_load for axle, tire in zip(_AXLES, self.tires, strict=True)}

    def quarter_cars(self) -> tuple[QuarterCar, QuarterCar]:
        """Return the front and the rear quarter car with the body mass each axle carries.

        The body masses are m Lr/(Lf + Lr) and m Lf/(Lf + Lr). The half car moves exactly as these two when
        its inertia coupling vanishes, m Lf Lr = I; otherwise they are an approximation. A seat is left out.
        """
        front_share = self.axle_distance_rear / self.wheelbase
        shares = {"front": front_share, "rear": 1.0 - front_share}
        front, rear = (
            QuarterCar(
                body_mass=self.body_mass * shares[axle],
                unsprung_mass=getattr(self, f"unsprung_mass_{axle}"),
                tire_stiffness=getattr(self, f"tire_stiffness_{axle}"),
                spring_stiffness=getattr(self, f"spring_stiffness_{axle}"),
                damping=getattr(self, f"damping_{axle}"),
            )
            for axle in _AXLES
        )
        return front, rear

    def plant(self) -> control.StateSpace:
        """Return the car as a plant with named signals.

        Returns
        -------
        control.StateSpace
            Inputs road_front, road_rear (m), force_front, force_rear (N). Outputs, in this order:
            body_acceleration, pitch_acceleration, suspension_deflection_*, tire_deflection_* (wheel minus road),
            unsprung_displacement_*, body_displacement, pitch_angle, body_velocity, pitch_velocity,
            unsprung_velocity_*, suspension_velocity_*, actuator_force_* (the force input itself, so that a
            closed loop reports its total force), each * being front then rear; then those of the seat:
            seat_acceleration, and with a passenger seat_deflection, seat_displacement and seat_velocity.
            States are the coordinates and then their velocities.
        """
        seat = self.seat
        passenger = seat is not None and seat.has_passenger
        q = Coordinates(
            ("unsprung_front", "unsprung_rear", "body", "pitch", *(("passenger",) if passenger else ()))
        )
        mass = [self.unsprung_mass_front, self.unsprung_mass_rear, self.body_mass, self.pitch_inertia]
        deflections = np.array(
            [
                q.row(unsprung_front=-1, body=1, pitch=-self.axle_distance_front),
                q.row(unsprung_rear=-1, body=1, pitch=self.axle_distance_rear),
            ]
        )
        springs = [self.spring_stiffness_front, self.spring_stiffness_rear]
        dampers = [self.damping_front, self.damping_rear]
        supports = deflections
        if seat is not None and passenger:
            mass.append(seat.passenger_mass)
            supports = np.vstack([deflections, q.row(passenger=1, body=-1, pitch=-seat.position)])
            springs.append(seat.stiffness)
            dampers.append(seat.damping)
        damping, stiffness = suspension_matrices(supports, springs, dampers)
        wheels = np.array([q.row(unsprung_front=1), q.row(unsprung_rear=1)])
        road_forces = wheels.T * np.array([self.tire_stiffness_front, self.tire_stiffness_rear])
        stiffness = stiffness + road_forces @ wheels
        named = [
            ("unsprung_displacement_front", "unsprung_velocity_front"),
            ("unsprung_displacement_rear", "unsprung_velocity_rear"),
            ("body_displacement", "body_velocity"),
            ("pitch_angle", "pitch_velocity"),
        ]
        if passenger:
            named.append(("seat_displacement", "seat_velocity"))
        return state_space(
            np.array(mass),
            damping,
            stiffness,
            road_forces,
            deflections.T,
            [*_outputs(q, deflections, wheels), *_seat_outputs(q, seat)],
            coordinate_names=named,
            road_names=[f"road_{axle}" for axle in _AXLES],
            force_names=[f"force_{axle}" for axle in _AXLES],
            name="half_car",
        )


def _outputs(q: Coordinates, deflections: FloatArray, wheels: FloatArray) -> list[Output]:
    """Return the outputs of every half car, in their public order."""
    body, pitch, per_axle = q.row(body=1), q.row(pitch=1), np.eye(2)
    axles = list(enumerate(_AXLES))
    return [
        Output("body_acceleration", acceleration=body),
        Output("pitch_acceleration", acceleration=pitch),
        *(Output(f"suspension_deflection_{axle}", displacement=deflections[k]) for k, axle in axles),
        *(Output(f"tire_deflection_{axle}", displacement=wheels[k], road=-per_axle[k]) for k, axle in axles),
        *(Output(f"unsprung_displacement_{axle}", displacement=wheels[k]) for k, axle in axles),
        Output("body_displacement", displacement=body),
        Output("pitch_angle", displacement=pitch),
        Output("body_velocity", velocity=body),
        Output("pitch_velocity", velocity=pitch),
        *(Output(f"unsprung_velocity_{axle}", velocity=wheels[k]) for k, axle in axles),
        *(Output(f"suspension_velocity_{axle}", velocity=deflections[k]) for k, axle in axles),
        *(Output(f"actuator_force_{axle}", force=per_axle[k]) for k, axle in axles),
    ]


def _seat_outputs(q: Coordinates, seat: Seat | None) -> list[Output]:
    """Return the outputs a seat adds."""
    if seat is None:
        return []
    if not seat.has_passenger:
        return [Output("seat_acceleration", acceleration=q.row(body=1, pitch=seat.position))]
    passenger = q.row(passenger=1)
    return [
        Output("seat_acceleration", acceleration=passenger),
        Output("seat_deflection", displacement=q.row(passenger=1, body=-1, pitch=-seat.position)),
        Output("seat_displacement", displacement=passenger),
        Output("seat_velocity", velocity=passenger),
    ]
