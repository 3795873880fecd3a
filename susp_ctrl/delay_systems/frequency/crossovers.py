r"""All frequencies at which a loop has unit gain, or is real, with a proof that there are no others.

Both are zeros of a real function g of the frequency, ``Re S - 1/2`` or ``Im S`` (see `return_difference`). Intervals
are halved until the Taylor polynomial of g and the bound of its remainder prove one of three things: g has no zero in
the interval; g is monotone; g is convex or concave, so that it has one extremum and at most two zeros. Zeros are then
bracketed by signs. An extremum that rounding cannot tell from zero is a touch and counts as a crossover.

About zero and infinite frequency g is an even or odd power series; its leading term, once it outweighs the rest, leaves
no zero up to a lowest and beyond a highest frequency, whatever the order of the zero that g itself has there.
"""

from __future__ import annotations

from enum import Enum
from math import factorial
from typing import NamedTuple

import numpy as np
from scipy.optimize import elementwise

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.crossings import Work
from susp_ctrl.delay_systems.frequency.return_difference import Expansion, ReturnDifference

_FINEST = 4e-15
_SHARE = 0.2
_BATCH = 2048
# S, of size one or less, has no digits beyond.
_EDGE = 2e-16
# Half widths about the ends; no simple numbers, which crossovers like to be.
_RADII = 1.0347 * 2.0 ** np.arange(40.0, -80.0, -1.0)
# Cells of the frequency axis that one search may test.
CELLS = 20_000


class Condition(Enum):
    """The real function g whose zeros are searched; the last two are its stationary points where it vanishes."""

    UNIT_GAIN = ("real", 0)
    REAL_VALUE = ("imag", 0)
    STATIONARY_GAIN = ("real", 1)
    STATIONARY_PHASE = ("imag", 1)

    def of_values(self, S: np.ndarray) -> FloatArray:
        """Return g of values of S."""
        return S.real - 0.5 if self is Condition.UNIT_GAIN else S.imag

    def series(self, expansion: Expansion) -> tuple[FloatArray, FloatArray]:
        """Return the Taylor coefficients of g and their rounding, shape (points, terms)."""
        part, derivative = self.value
        series = np.array(getattr(expansion.coefficients, part))
        if derivative:
            powers = np.arange(1, expansion.order + 1)
            return powers * series[:, 1:], powers * expansion.rounding[:, 1:]
        if part == "real":
            series[:, 0] -= 0.5
        return series, expansion.rounding

    @property
    def parity(self) -> int:
        """Powers of the frequency that g has about zero: 0 even, 1 odd."""
        part, derivative = self.value
        return (part == "imag") ^ derivative

    @property
    def any_weight(self) -> bool:
        """Whether the zeros are the same for every multiple of L."""
        return self in (Condition.REAL_VALUE, Condition.STATIONARY_GAIN)

    def missed(self, order: int, expansion: Expansion, half: FloatArray) -> FloatArray:
        """Bound a derivative of what the series of g misses within `half`, given its bound within twice as much.

        By Schwarz's lemma the remainder falls with the power after the last of the series; by Cauchy's estimate its
        derivatives follow from its size a little farther out.
        """
        order = order + self.value[1]
        share = _SHARE if order else 0.0
        outer = expansion.remainder * ((1.0 + share) / 2.0) ** (expansion.order + 1)
        return outer * factorial(order) / (share * half) ** order if order else outer


class Zeros(NamedTuple):
    """Frequencies found, and whether the search proves that there are no others."""

    omega: FloatArray
    complete: bool


class Clear(NamedTuple):
    """Frequencies up to `omega` (or from it on) without a zero of g, and the sign of g there.

    `identical` where no term of the series differs from zero by more than rounding; `at_end` where g is zero at the
    end itself.
    """

    omega: float
    sign: float
    at_end: bool
    identical: bool


def clear_below(loop: ReturnDifference, condition: Condition) -> Clear:
    """Return up to which frequency g has no zero but perhaps at zero itself."""
    return _clear(*loop.expansion_at_zero(_RADII, condition.any_weight), condition)


def clear_above(loop: ReturnDifference, condition: Condition) -> Clear:
    """Return from which frequency on g has no zero but perhaps at infinity itself; a loop without delays."""
    found = _clear(*loop.expansion_at_infinity(_RADII), condition)
    return found._replace(omega=1.0 / found.omega if found.omega else np.inf)


def _clear(expansion: Expansion, unit: float, condition: Condition) -> Clear:
    series, rounding = (part[0].copy() for part in condition.series(expansion))
    powers = np.arange(series.size)
    if not np.all(np.isfinite(series)):
        return Clear(0.0, 0.0, False, False)
    series[(powers % 2 != condition.parity) | (np.abs(series) <= rounding)] = 0.0
    if not np.any(series):
        return Clear(0.0, 0.0, True, True)
    first = int(np.flatnonzero(series)[0])
    with np.errstate(all="ignore"):
        rest = np.abs(series[first + 1 :]) @ _RADII ** powers[1 : series.size - first, None]
        missed = condition.missed(0, expansion, _RADII)
        clear = np.flatnonzero(np.abs(series[first]) > rest + missed / _RADII**first)
    radius = float(_RADII[clear[0]]) if clear.size else 0.0
    return Clear(radius * unit, float(np.sign(series[first])), first > 0, False)


def vanishes(loop: ReturnDifference, condition: Condition, omega: FloatArray) -> bool:
    """Whether g is zero to rounding at all of some frequencies."""
    expansion, _ = loop.expansion_within(omega, np.zeros(omega.size), condition.any_weight)
    series, rounding = condition.series(expansion)
    return bool(np.all(np.abs(series[:, 0]) <= rounding[:, 0]))


def zeros_between(
    loop: ReturnDifference, condition: Condition, low: float, high: float, work: Work | None = None
) -> Zeros:
    """Return all zeros of g with ``low <= omega <= high``, increasing; `work` is what cells may be tested."""
    if not 0.0 < low < high < np.inf:
        return Zeros(np.zeros(0), low >= high)
    work = work or Work(CELLS)
    edges = np.geomspace(low, high, int(np.ceil(np.log2(high / low))) + 2)
    left, right = edges[:-1], edges[1:]
    found, undecided = [np.zeros(0)], [np.zeros(0)]
    while left.size and not work.spent:
        (left, later_left), (right, later_right) = np.split(left, [_BATCH]), np.split(right, [_BATCH])
        work.left -= left.size
        work.spent = work.left < 0
        roots, open_ = _examined(loop, condition, left, right)
        found.append(roots)
        left, right = left[open_], right[open_]
        centre = 0.5 * (left + right)
        tiny = right - left <= _FINEST * centre
        undecided.append(centre[tiny])
        left, centre, right = left[~tiny], centre[~tiny], right[~tiny]
        left = np.concatenate([left, centre, later_left])
        right = np.concatenate([centre, right, later_right])
    open_points = np.concatenate(undecided)
    return Zeros(distinct(np.concatenate([*found, open_points])), left.size + open_points.size == 0)


def _examined(
    loop: ReturnDifference, condition: Condition, left: FloatArray, right: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Return the zeros in those cells that can be decided, and which cells cannot."""
    centre, half = 0.5 * (left + right), 0.5 * (right - left)
    expansion, weight = loop.expansion_within(centre, half, condition.any_weight)
    series, rounding = condition.series(expansion)
    with np.errstate(all="ignore"):
        free, monotone, convex = (
            _leading(series, rounding, condition.missed(k, expansion, half), half, k) for k in range(3)
        )
    monotone &= ~free
    convex &= ~free & ~monotone
    extremum, turning = _extrema(series[convex], half[convex])
    bowl = left[convex], centre[convex] + extremum, right[convex], weight[convex]
    touches, *sides = _around_extrema(loop, condition, *(part[turning] for part in bowl))
    one_sided = monotone.copy()
    one_sided[convex] = ~turning
    whole = left[one_sided], right[one_sided], weight[one_sided]
    brackets = (np.concatenate(parts) for parts in zip(whole, *sides, strict=True))
    roots = _bracketed(loop, condition, *brackets)
    return np.concatenate([roots, touches]), ~(free | monotone | convex)


def _leading(
    series: FloatArray, rounding: FloatArray, missed: FloatArray, half: FloatArray, order: int
) -> np.ndarray:
    """Tell where a derivative of g keeps its sign in the cell."""
    terms = np.arange(order, series.shape[1])
    weight = np.array([factorial(k) / factorial(k - order) for k in terms])
    size = weight * np.abs(series[:, order:]) * half[:, None] ** (terms - order)
    noise = weight * rounding[:, order:] * half[:, None] ** (terms - order)
    return np.asarray(size[:, 0] > size[:, 1:].sum(axis=1) + noise.sum(axis=1) + missed)


def _extrema(series: FloatArray, half: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return where the slope of a convex or concave polynomial vanishes in the cell, and whether it does."""
    powers = np.arange(1, series.shape[1])

    def slope(delta: FloatArray, *coefficients: FloatArray) -> FloatArray:
        return sum(k * c * delta ** (k - 1) for k, c in zip(powers, coefficients, strict=True))  # type: ignore[return-value]

    ends = [slope(side * half, *series[:, 1:].T) for side in (-1.0, 1.0)]
    turning = ends[0] * ends[1] < 0.0
    result = np.zeros(half.size)
    if np.any(turning):
        h = half[turning]
        result[turning] = elementwise.find_root(slope, (-h, h), args=tuple(series[turning, 1:].T)).x
    return result, turning


def _around_extrema(
    loop: ReturnDifference,
    condition: Condition,
    left: FloatArray,
    middle: FloatArray,
    right: FloatArray,
    weight: FloatArray,
) -> tuple[FloatArray, tuple[FloatArray, ...], tuple[FloatArray, ...]]:
    """Return the extrema that are zero to rounding, and the left and right sides of the others."""
    series, rounding = condition.series(loop.expansion(middle, weight))
    touch = np.abs(series[:, 0]) <= rounding[:, 0]
    left, inner, right, weight = (part[~touch] for part in (left, middle, right, weight))
    return middle[touch], (left, inner, weight), (inner, right, weight)


def _bracketed(
    loop: ReturnDifference, condition: Condition, left: FloatArray, right: FloatArray, weight: FloatArray
) -> FloatArray:
    """Return the zero in each interval at whose ends g differs in sign."""
    if left.size == 0:
        return left

    def g(omega: FloatArray, of: FloatArray) -> FloatArray:
        if condition.value[1] == 0:
            return condition.of_values(loop.values(omega, of))
        return condition.series(loop.expansion(omega, of))[0][:, 0]

    at_left, at_right = g(left, weight), g(right, weight)
    change = np.flatnonzero(at_left * at_right < 0.0)
    # neighbours may see a zero on their common edge on different sides of it
    on_edge = np.concatenate([left[np.abs(at_left) <= _EDGE], right[np.abs(at_right) <= _EDGE]])
    if change.size == 0:
        return on_edge
    solved = elementwise.find_root(
        g,
        (left[change], right[change]),
        args=(weight[change],),
        tolerances={"xatol": 0.0, "xrtol": 4.0 * np.finfo(float).eps, "fatol": 0.0, "frtol": 0.0},
    )
    return np.concatenate([solved.x, on_edge])


def distinct(omega: FloatArray) -> FloatArray:
    """Return increasing frequencies, those equal to rounding once."""
    ordered = np.sort(omega)
    return ordered[np.append(True, ordered[1:] > (1.0 + 1e-13) * ordered[:-1])] if ordered.size else ordered
