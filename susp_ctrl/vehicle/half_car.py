"""The half car: heave and pitch of the body over a front and a rear axle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import control
import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.vehicle.mechanics import WHEEL_FIELDS, Output, Spring, TwoAxles
from susp_ctrl.vehicle.quarter_car import QuarterCar
from susp_ctrl.vehicle.seat import Seat


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

    _WHEELS: ClassVar[tuple[str, ...]] = ("front", "rear")
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

    def _carried_masses(self) -> FloatArray:
        arms = self._per_wheel("axle_distance")[::-1]  # the nearer an axle, the more it carries
        moment = arms * self.body_mass
        if self.seat is not None:
            moment = moment + (arms + self.seat.position * np.array([-1.0, 1.0])) * self.seat.passenger_mass
        return moment / self.wheelbase

    def quarter_cars(self) -> tuple[QuarterCar, QuarterCar]:
        """Return the front and the rear quarter car with the body mass each axle carries.

        The body masses are m Lr/(Lf + Lr) and m Lf/(Lf + Lr). The half car moves exactly as these two when
        its inertia coupling vanishes, m Lf Lr = I; otherwise they are an approximation. A seat is left out.
        """
        front_share = self.axle_distance_rear / self.wheelbase
        shares = {"front": front_share, "rear": 1.0 - front_share}
        front, rear = (
            QuarterCar(
                body_mass=self.body_mass * share,
                **{field: getattr(self, f"{field}_{axle}") for field in WHEEL_FIELDS},
            )
            for axle, share in shares.items()
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
        motions = {
            "body": (self.body_mass, [1.0, 1.0]),
            "pitch": (self.pitch_inertia, [-self.axle_distance_front, self.axle_distance_rear]),
        }
        seat = self.seat
        if seat is None:
            return self._assembled("half_car", motions)
        place = {"body": 1.0, "pitch": seat.position}
        if not seat.has_passenger:
            return self._assembled("half_car", motions, outputs=[Output("seat_acceleration", 2, place)])
        motions["seat"] = (seat.passenger_mass, [0.0, 0.0])
        passenger = {"seat": 1.0}
        deflection = {"seat": 1.0, "body": -1.0, "pitch": -seat.position}
        return self._assembled(
            "half_car",
            motions,
            [Spring(deflection, seat.stiffness, seat.damping)],
            [
                Output("seat_acceleration", 2, passenger),
                Output("seat_deflection", 0, deflection),
                Output("seat_displacement", 0, passenger),
                Output("seat_velocity", 1, passenger),
            ],
        )
