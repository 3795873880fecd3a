"""From masses, dampers and springs to a plant with named signals.

    M q'' + C q' + K q = W_r x_g + W_f f,      y = P q + V q' + A q'' + D_r x_g + D_f f

A suspension between a wheel and the body is one row d with d q its deflection: it adds k d'd to K and c d'd
to C, and its actuator force f enters as d' f (a positive force pushes the body up and the wheel down).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from susp_ctrl import validation

FloatArray = NDArray[np.float64]

GRAVITY = 9.81  # m/s2


@dataclass(frozen=True)
class Tire:
    """One tire: the plant output that is its deflection, its stiffness (N/m) and its static load (N)."""

    deflection: str
    stiffness: float
    static_load: float


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
            value, name = getattr(self, field.name), f"{owner}.{field.name}"
            if field.name in self._ANY_SIGN:
                checked = validation.number(name, value)
            elif field.name in self._NON_NEGATIVE:
                checked = validation.number(name, value, at_least=0.0)
            else:
                checked = validation.number(name, value, above=0.0)
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


class TwoAxles(ValidatedFields):
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


@dataclass(frozen=True)
class Coordinates:
    """Named generalised coordinates q: turns ``{"body": 1, "pitch": -Lf}`` into a row."""

    names: tuple[str, ...]

    def row(self, **entries: float) -> FloatArray:
        """Return the row d with d q = sum of entry times coordinate."""
        result = np.zeros(len(self.names))
        for name, value in entries.items():
            result[self.names.index(name)] = value
        return result


@dataclass(frozen=True)
class Output:
    """One named output, linear in q, q', q'', the road inputs and the actuator forces."""

    name: str
    displacement: FloatArray | None = None
    velocity: FloatArray | None = None
    acceleration: FloatArray | None = None
    road: FloatArray | None = None
    force: FloatArray | None = None


def suspension_matrices(
    deflections: FloatArray, stiffness: ArrayLike, damping: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return (C, K) of springs and dampers between the coordinates.

    Parameters
    ----------
    deflections : array, shape (suspensions, coordinates)
        Row k gives the deflection of suspension k.
    stiffness, damping : array_like, length suspensions
        N/m and N s/m.
    """
    stiff = np.asarray(stiffness, dtype=float)
    damp = np.asarray(damping, dtype=float)
    return deflections.T @ (damp[:, None] * deflections), deflections.T @ (stiff[:, None] * deflections)


def state_space(
    mass: FloatArray,
    damping: FloatArray,
    stiffness: FloatArray,
    road_forces: FloatArray,
    actuator_forces: FloatArray,
    outputs: Sequence[Output],
    *,
    coordinate_names: Sequence[tuple[str, str]],
    road_names: Sequence[str],
    force_names: Sequence[str],
    name: str,
) -> control.StateSpace:
    """Assemble the plant with state [q, q'] and inputs [roads, forces].

    Parameters
    ----------
    mass : array, shape (n,)
        Diagonal of M (kg, kg m2).
    damping, stiffness : array, shape (n, n)
        C and K.
    road_forces, actuator_forces : array, shape (n, roads), (n, forces)
        W_r and W_f.
    outputs : sequence of Output
    coordinate_names : sequence of (displacement state name, velocity state name)
    road_names, force_names : sequence of str
    name : str
        Name of the plant.
    """
    n, roads, forces = mass.size, len(road_names), len(force_names)
    inputs = np.hstack([road_forces, actuator_forces])
    accelerations = np.hstack([-stiffness, -damping]) / mass[:, None]  # q'' as a function of [q, q']
    per_input = inputs / mass[:, None]
    A = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), accelerations])
    B = np.vstack([np.zeros((n, roads + forces)), per_input])

    def stacked(attribute: str, width: int) -> FloatArray:
        rows = [getattr(output, attribute) for output in outputs]
        return np.array([np.zeros(width) if row is None else row for row in rows])

    acting = stacked("acceleration", n)
    C = np.hstack([stacked("displacement", n), stacked("velocity", n)]) + acting @ accelerations
    D = np.hstack([stacked("road", roads), stacked("force", forces)]) + acting @ per_input
    return control.StateSpace(
        A,
        B,
        C,
        D,
        remove_useless_states=False,
        inputs=[*road_names, *force_names],
        outputs=[output.name for output in outputs],
        states=[name for name, _ in coordinate_names] + [name for _, name in coordinate_names],
        name=name,
    )
