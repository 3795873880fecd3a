"""From masses, dampers and springs to a plant with named signals.

    M q'' + C q' + K q = W_r x_g + W_f f,      q = [wheels, motions of the body, passenger]

A suspension between a wheel and the body is one row d with d q its deflection: it adds k d'd to K and c d'd
to C, and its actuator force f enters as d' f (a positive force pushes the body up and the wheel down). With q''
from this equation every signal is a row over [q, q', x_g, f], so the rows of q' and q'' are [A B] of the plant and
those of the outputs [C D].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import control
import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray

GRAVITY = 9.81  # m/s2
WHEEL_FIELDS = ("unsprung_mass", "tire_stiffness", "spring_stiffness", "damping")
_COORDINATE_OF_MOTION = {"body": "body_displacement", "pitch": "pitch_angle", "roll": "roll_angle"}


@dataclass(frozen=True)
class Tire:
    """One tire: the plant output that is its deflection, its stiffness (N/m) and its static load (N)."""

    deflection: str
    stiffness: float
    static_load: float


@dataclass(frozen=True)
class Spring:
    """A spring (N/m) and a damper (N s/m) with the deflection d q, d by the names of the coordinates."""

    row: Mapping[str, float]
    stiffness: float
    damping: float = 0.0


@dataclass(frozen=True)
class Output:
    """An output d q (order 0), d q' (order 1) or d q'' (order 2), d by the names of the coordinates."""

    name: str
    order: int
    row: Mapping[str, float]


class ValidatedFields:
    """Mixin of frozen dataclasses whose plain fields are numbers: limits checked on construction.

    A field is positive unless the dataclass names it in `_NON_NEGATIVE` or in `_ANY_SIGN`; a field in
    `_COMPONENTS` is not a number and checks itself.
    """

    _NON_NEGATIVE: ClassVar[frozenset[str]] = frozenset()
    _ANY_SIGN: ClassVar[frozenset[str]] = frozenset()
    _COMPONENTS: ClassVar[frozenset[str]] = frozenset()

    def __post_init__(self) -> None:
        owner = type(self).__name__
        for field in fields(self):  # type: ignore[arg-type]  # every subclass is a dataclass
            if field.name in self._COMPONENTS:
                continue
            limits = {"at_least": 0.0} if field.name in self._NON_NEGATIVE else {"above": 0.0}
            if field.name in self._ANY_SIGN:
                limits = {}
            checked = validation.number(f"{owner}.{field.name}", getattr(self, field.name), **limits)
            object.__setattr__(self, field.name, checked)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with the given fields changed, validated again.

        Raises
        ------
        InputError
            If a name is no field, or a value is not allowed.
        """
        known = [field.name for field in fields(self)]  # type: ignore[arg-type]
        for name in changes:
            validation.one_of(f"field of {type(self).__name__}", name, known)
        current = {name: getattr(self, name) for name in known}
        return type(self)(**{**current, **changes})


class Vehicle(ValidatedFields, ABC):
    """Base of the vehicles: wheels named by `_WHEELS`, on each of them a suspension, on these the body.

    The fields of `WHEEL_FIELDS` are given once for each axle, as ``damping_front``; a wheel takes those of its axle,
    the first word of its name. The only wheel of a quarter car has no name.
    """

    _WHEELS: ClassVar[tuple[str, ...]]

    @property
    def tires(self) -> tuple[Tire, ...]:
        """The tires in the order of the plant: deflection output, stiffness, static load (N)."""
        loads = (self._carried_masses() + self._per_wheel("unsprung_mass")) * GRAVITY
        return tuple(
            Tire(_named("tire_deflection", wheel), float(stiffness), float(load))
            for wheel, stiffness, load in zip(
                self._WHEELS, self._per_wheel("tire_stiffness"), loads, strict=True
            )
        )

    def static_loads(self) -> dict[str, float]:
        """Return the static tire loads (N) by wheel, g = 9.81 m/s2."""
        return {
            wheel or "wheel": tire.static_load for wheel, tire in zip(self._WHEELS, self.tires, strict=True)
        }

    @abstractmethod
    def _carried_masses(self) -> FloatArray:
        """Return the mass (kg) above each suspension at standstill."""

    def _per_wheel(self, field: str) -> FloatArray:
        return np.array([getattr(self, _named(field, wheel.partition("_")[0])) for wheel in self._WHEELS])

    def _by_wheel(self, signal: str, rows: FloatArray) -> dict[str, FloatArray]:
        return {_named(signal, wheel): row for wheel, row in zip(self._WHEELS, rows, strict=True)}

    def _assembled(
        self,
        name: str,
        motions: Mapping[str, tuple[float, ArrayLike]],
        springs: Sequence[Spring] = (),
        outputs: Sequence[Output] = (),
    ) -> control.StateSpace:
        """Return the plant with state [q, q'] and inputs [roads, forces].

        Parameters
        ----------
        name : str
            Name of the plant.
        motions : mapping of name to (inertia, levers)
            The coordinates after those of the wheels (named unsprung_*): mass or inertia (kg, kg m2), and how far
            the upper end of each suspension moves with it. "body", "pitch" and "roll" have outputs.
        springs : sequence of Spring
            Others than the suspensions.
        outputs : sequence of Output
            After the usual ones.
        """
        names = [*(_named("unsprung", wheel) for wheel in self._WHEELS), *motions]
        w, n = len(self._WHEELS), len(names)
        wheels = np.eye(w, n)
        levers = np.array([lever for _, lever in motions.values()], dtype=float).T
        deflections = np.hstack([np.zeros((w, w)), levers]) - wheels
        supports = np.vstack([deflections, *(_row(spring.row, names) for spring in springs)])
        damping = _between(supports, [*self._per_wheel("damping"), *(s.damping for s in springs)])
        stiffness = _between(
            supports, [*self._per_wheel("spring_stiffness"), *(s.stiffness for s in springs)]
        )
        road_forces = wheels.T * self._per_wheel("tire_stiffness")
        stiffness += road_forces @ wheels
        mass = np.array([*self._per_wheel("unsprung_mass"), *(inertia for inertia, _ in motions.values())])

        q, velocity, road, force = np.split(np.eye(2 * n + 2 * w), [n, 2 * n, 2 * n + w])
        acceleration = np.hstack([-stiffness, -damping, road_forces, deflections.T]) / mass[:, None]
        body = {motion: k for k, motion in enumerate(names) if motion in _COORDINATE_OF_MOTION}
        signals = {
            **{f"{motion}_acceleration": acceleration[k] for motion, k in body.items()},
            **self._by_wheel("suspension_deflection", deflections @ q),
            **self._by_wheel("tire_deflection", q[:w] - road),
            **self._by_wheel("unsprung_displacement", q[:w]),
            **{_COORDINATE_OF_MOTION[motion]: q[k] for motion, k in body.items()},
            **{f"{motion}_velocity": velocity[k] for motion, k in body.items()},
            **self._by_wheel("unsprung_velocity", velocity[:w]),
            **self._by_wheel("suspension_velocity", deflections @ velocity),
            **self._by_wheel("actuator_force", force),
        }
        for output in outputs:
            signals[output.name] = _row(output.row, names) @ (q, velocity, acceleration)[output.order]
        A, B = np.split(np.vstack([velocity, acceleration]), [2 * n], axis=1)
        C, D = np.split(np.array(list(signals.values())), [2 * n], axis=1)
        return control.StateSpace(
            A,
            B,
            C,
            D,
            remove_useless_states=False,
            inputs=[_named(kind, wheel) for kind in ("road", "force") for wheel in self._WHEELS],
            outputs=list(signals),
            states=[
                *(_named("unsprung_displacement", wheel) for wheel in self._WHEELS),
                *(_COORDINATE_OF_MOTION.get(motion, f"{motion}_displacement") for motion in motions),
                *(_named("unsprung_velocity", wheel) for wheel in self._WHEELS),
                *(f"{motion}_velocity" for motion in motions),
            ],
            name=name,
        )


class TwoAxles(Vehicle):
    """Mixin of vehicles with a front and a rear axle."""

    axle_distance_front: float
    axle_distance_rear: float

    @property
    def wheelbase(self) -> float:
        """Distance between the axles, Lf + Lr (m)."""
        return self.axle_distance_front + self.axle_distance_rear

    def axle_lag(self, speed: float) -> float:
        """Return the time (Lf + Lr)/v after which the rear axle meets the road of the front axle.

        Parameters
        ----------
        speed : float
            v (m/s), positive.

        Returns
        -------
        float
            Seconds.

        Raises
        ------
        InputError
            If the speed is not a positive number.
        """
        return self.wheelbase / validation.number("speed", speed, above=0.0)


def _named(signal: str, wheel: str) -> str:
    return f"{signal}_{wheel}" if wheel else signal


def _row(entries: Mapping[str, float], names: Sequence[str]) -> FloatArray:
    return np.array([entries.get(name, 0.0) for name in names])


def _between(rows: FloatArray, factors: ArrayLike) -> FloatArray:
    """Return sum k d'd over the rows d and their factors k."""
    return rows.T @ (np.asarray(factors, dtype=float)[:, None] * rows)
