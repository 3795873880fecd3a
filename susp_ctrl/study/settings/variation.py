"""What a sweep varies: factors, each one key of a study or several that move together, and how far they go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Self

import numpy as np
from scipy.special import ndtr, ndtri

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError

Value = bool | int | float | str

DISTRIBUTIONS = ("uniform", "normal")
_SIGMAS = 3.0  # a normal distribution is cut where its tolerance ends


def quantiles(low: float, high: float, distribution: str, share: FloatArray) -> FloatArray:
    """Return the values below which the given shares (0 to 1) of a distribution on [low, high] lie.

    ``"normal"`` has its mean in the middle and three standard deviations to either end, where it is cut.
    """
    if distribution == "normal":
        inside = ndtr(-_SIGMAS) + share * (ndtr(_SIGMAS) - ndtr(-_SIGMAS))
        share = (ndtri(inside) / _SIGMAS + 1.0) / 2.0
    return low + (high - low) * share


class _Interval:
    """Numbers between two ends, at even distances in a grid and by their distribution in samples."""

    low: float
    high: Any  # a number, once `Tolerance` has made one of None
    levels: int
    distribution: str

    def __post_init__(self) -> None:
        kind = type(self).__name__
        low = validation.number(f"{kind}.low", self.low)
        high = validation.number(f"{kind}.high", self.high)
        if low >= high:
            raise InputError(f"{kind}: from {low:g} to {high:g} is not allowed: the range is empty")
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)
        validation.integer(f"{kind}.levels", self.levels, at_least=2)
        validation.one_of(f"{kind}.distribution", self.distribution, DISTRIBUTIONS)

    def at(self, share: FloatArray) -> list[Value]:
        """Return the values at quantiles."""
        values: list[Value] = quantiles(self.low, self.high, self.distribution, share).tolist()
        return values

    def grid(self) -> list[Value]:
        """Return the levels of a grid."""
        values: list[Value] = np.linspace(self.low, self.high, self.levels).tolist()
        return values


@dataclass(frozen=True)
class Range(_Interval):
    """Values of a key from `low` to `high`, in its own unit.

    Parameters
    ----------
    low, high : float
        Ends, ``low < high``.
    levels : int
        Number of evenly spaced values in a grid.
    distribution : {"uniform", "normal"}
        Of samples; a normal one has its mean in the middle and three standard deviations to either end.

    Raises
    ------
    InputError
        An empty range, too few levels, an unknown distribution.
    """

    low: float
    high: float
    levels: int = 3
    distribution: str = "uniform"


@dataclass(frozen=True)
class Tolerance(_Interval):
    """Relative change of a key: the study's own value times 1 + share.

    Parameters
    ----------
    low : float
        Least share, as -0.1 for -10 %; alone, ``Tolerance(0.1)`` is +- 10 %.
    high : float, optional
        Largest share.
    levels, distribution
        As of `Range`.

    Raises
    ------
    InputError
        As `Range`.

    Examples
    --------
    >>> Tolerance(0.1)
    Tolerance(low=-0.1, high=0.1, levels=3, distribution='uniform')
    """

    low: float
    high: float | None = None
    levels: int = 3
    distribution: str = "uniform"

    def __post_init__(self) -> None:
        if self.high is None:
            size = abs(validation.number("low", self.low))
            object.__setattr__(self, "low", -size)
            object.__setattr__(self, "high", size)
        super().__post_init__()


@dataclass(frozen=True)
class Levels:
    """Given values of a key, such as road classes or seeds; samples take each equally often."""

    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        if not self.values:
            raise InputError("values = [] is not allowed: at least one value is needed")
        object.__setattr__(self, "values", tuple(plain_value(value) for value in self.values))

    def at(self, share: FloatArray) -> list[Value]:
        """Return the values at quantiles."""
        places = np.minimum((share * len(self.values)).astype(int), len(self.values) - 1)
        return [self.values[k] for k in places]

    def grid(self) -> list[Value]:
        """Return all values."""
        return list(self.values)


Spread = Range | Tolerance | Levels


@dataclass(frozen=True)
class Factor:
    """One thing that varies: a key of the study, or several keys that move together.

    Parameters
    ----------
    keys : str or sequence of str
        As in `Study.with_changes`: ``"vehicle.body_mass_kg"``,
        ``"designs[random_published].channels[1].delay_s"``.
    spread : Range, Tolerance or sequence of values
        How far. Several keys take the same relative change, or the same value.
    name : str, optional
        In tables and figures; the key by default.

    Raises
    ------
    InputError
        No key, or a spread that is none.
    """

    keys: tuple[str, ...]
    spread: Spread
    name: str = ""

    def __init__(self, keys: str | Sequence[str], spread: Any, name: str = "") -> None:
        given = (keys,) if isinstance(keys, str) else tuple(validation.sequence("keys", keys))
        if not given or not all(isinstance(key, str) and key for key in given):
            raise InputError(f"keys = {keys!r} is not allowed: a key of the study, or several, is needed")
        if len(set(given)) != len(given):
            raise InputError(f"keys = {list(given)!r} is not allowed: a key stands there twice")
        object.__setattr__(self, "keys", given)
        object.__setattr__(self, "spread", _spread(given[0], spread))
        if not isinstance(name, str):
            raise InputError(f"name = {name!r} is not allowed: a text is needed")
        object.__setattr__(self, "name", name or " & ".join(given))

    @classmethod
    def all_of(cls, factors: Mapping[Any, Any] | Sequence[Self]) -> tuple[Self, ...]:
        """Return the factors of ``{key or keys: spread}`` or of a list of factors.

        Raises
        ------
        InputError
            None at all, or a key or name that two of them share.
        """
        if isinstance(factors, Mapping):
            result = tuple(cls(keys, spread) for keys, spread in factors.items())
        else:
            result = tuple(validation.sequence("factors", factors))
            for factor in result:
                if not isinstance(factor, Factor):
                    raise InputError(f"factors: {factor!r} is not allowed: a Factor is needed")
        if not result:
            raise InputError("factors: none is given, at least one key to vary is needed")
        for what, every in (
            ("key", [key for factor in result for key in factor.keys]),
            ("name", [factor.name for factor in result]),
        ):
            twice = next((one for n, one in enumerate(every) if one in every[:n]), None)
            if twice is not None:
                raise InputError(f"factors: the {what} {twice} stands in two of them")
        return result


def plain_value(value: Any) -> Value:
    """Return a value as a study file could hold it."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (bool, str)):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real) and np.isfinite(float(value)):
        return float(value)
    raise InputError(f"value {value!r} is not allowed: a finite number, a text, true or false is needed")


def _spread(key: str, spread: Any) -> Spread:
    if isinstance(spread, (Range, Tolerance, Levels)):
        return spread
    if isinstance(spread, (str, bytes, Mapping)) or not hasattr(spread, "__iter__"):
        raise InputError(
            f"{key}: {spread!r} is not allowed: a list of values, a Range or a Tolerance is needed"
        )
    try:
        return Levels(tuple(validation.sequence("values", spread)))
    except InputError as problem:
        raise InputError(f"{key}: {problem}") from None
