"""Tracing crossing curves: feasible frequency intervals, adaptive sampling, every turn of every delay.

Over a feasible interval the two branches join at its ends like the halves of a circle, so frequencies are spaced
as cosines: the curve is smooth in that parameter. Samples are added until the middle of each chord is on the curve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import elementwise

from susp_ctrl.arrays import FloatArray, numbered
from susp_ctrl.delay_systems.crossings import Bands, small_gain_bands
from susp_ctrl.delay_systems.maps.crossing_plane import Axis, CrossingPlane, turns_in_range
from susp_ctrl.delay_systems.maps.segments import Segments
from susp_ctrl.delay_systems.model import CharacteristicMatrix, around_resonances

# Largest distance of a chord from the curve, relative to the ranges, and rounds of halving to get there.
_CHORD = 2e-5
_ROUNDS = 9


def trace_curves(plane: CrossingPlane, strongest: CharacteristicMatrix, fineness: int = 1) -> Segments:
    """Return the crossing curves of a plane as oriented segments.

    `strongest` is the loop with the largest gains of the plane: where it has small gain there is no curve. With a
    higher `fineness` the first samples are closer.
    """
    bands = small_gain_bands(strongest)
    longest = max(float(plane.other_delays.max(initial=0.0)), *plane.delays)
    found = feasible_intervals(plane.excess, bands, longest, fineness)
    parts = [
        _trace(plane, low, high, k == 0 and low <= _lowest(bands), fineness)
        for k, (low, high) in enumerate(found)
    ]
    parts.append(_zero_frequency(plane))
    return Segments.joined(parts).inside(*_rectangle(plane))


def feasible_intervals(
    excess: Callable[[FloatArray], FloatArray], bands: Bands, longest: float, fineness: int = 1
) -> list[tuple[float, float]]:
    """Return the intervals in the bands on which `excess` is not negative, their ends found by bisection.

    `longest` is the longest delay in the coefficients: samples are a small part of its turn apart.
    """
    if bands.centre.size == 0:
        return []
    top, lowest = float((bands.centre + bands.half).max()), _lowest(bands)
    parts = fineness * np.clip(np.ceil(bands.half * longest / 0.04), 12, 400).astype(int)
    samples = [
        c + h * np.linspace(-1.0, 1.0, 2 * n + 1)
        for c, h, n in zip(bands.centre, bands.half, parts, strict=True)
    ]
    omega = np.concatenate([*samples, np.geomspace(lowest, top, 200 * fineness)])
    omega = np.unique(omega[omega >= lowest])
    # Ends of neighbouring bands differ by rounding; a maximum must have two true neighbours.
    omega = omega[np.append(True, np.diff(omega) > 1e-9 * omega[1:])]
    value = _finite(excess(omega))
    # An interval that lies between two samples, however narrow, has its highest value between them. Closer
    # samples about each maximum first tell apart two that are near each other.
    for _ in range(2):
        inner = _maxima(value)
        low, high = omega[inner - 1], omega[inner + 1]
        omega, value = _with(
            excess, omega, value, (low + (high - low) * np.arange(1, 20)[:, None] / 20).ravel()
        )
    inner = _maxima(value)
    if inner.size:
        omega, value = _with(excess, omega, value, _highest(excess, omega[inner - 1], omega[inner + 1]))
    inside = value >= 0.0
    change = np.flatnonzero(inside[1:] != inside[:-1])
    good = np.where(inside[change], omega[change], omega[change + 1])
    bad = np.where(inside[change], omega[change + 1], omega[change])
    for _ in range(60):
        middle = 0.5 * (good + bad)
        feasible = _finite(excess(middle)) >= 0.0 if middle.size else np.zeros(0, dtype=bool)
        good, bad = np.where(feasible, middle, good), np.where(feasible, bad, middle)
    ends = np.concatenate([omega[:1] if inside[0] else [], good, omega[-1:] if inside[-1] else []])
    return [(float(a), float(b)) for a, b in ends.reshape(-1, 2) if b > a]


def _maxima(value: FloatArray) -> np.ndarray:
    """Return the positions of maxima below zero that may reach zero between the samples.

    The excess is a tent about its highest points, as steep inside a step as beside it.
    """
    left, middle, right = value[:-2], value[1:-1], value[2:]
    rise = np.maximum(middle - left, middle - right)
    return (
        np.flatnonzero((middle < 0.0) & (middle >= left) & (middle >= right) & (middle + 4.0 * rise >= 0.0))
        + 1
    )


def _with(
    excess: Callable[[FloatArray], FloatArray], omega: FloatArray, value: FloatArray, more: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the samples with others added, in order."""
    if more.size == 0:
        return omega, value
    omega, first = np.unique(np.concatenate([omega, more]), return_index=True)
    return omega, np.concatenate([value, _finite(excess(more))])[first]


def _lowest(bands: Bands) -> float:
    """Return the frequency that stands for zero."""
    return 1e-7 * float((bands.centre + bands.half).max(initial=0.0))


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), values, -1.0)


def _highest(at: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the highest of five points again and again: good enough to see a sign."""
    for _ in range(46):
        grid = low + (high - low) * np.linspace(0.0, 1.0, 5)[:, None]
        value = np.stack([_finite(at(row)) for row in grid])
        best = np.clip(np.argmax(value, axis=0), 1, 3)
        columns = np.arange(low.size)
        low, high = grid[best - 1, columns], grid[best + 1, columns]
    return 0.5 * (low + high)


def _rectangle(plane: CrossingPlane) -> tuple[FloatArray, FloatArray]:
    low, high = np.array([plane.x.low, plane.y.low]), np.array([plane.x.high, plane.y.high])
    margin = 0.5 * (high - low)
    return low - margin, high + margin


def _trace(plane: CrossingPlane, low: float, high: float, from_zero: bool, fineness: int) -> Segments:
    """Sample one feasible interval and unroll it; one that begins at zero frequency does not close there."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def frequencies(t: FloatArray) -> FloatArray:
        return np.clip(middle - half * np.cos(np.pi * t), low, high)

    poles = np.linalg.eigvals(plane.loop.A)
    resonances = around_resonances(poles, np.array([-1.0, 0.0, 1.0]))
    clusters = np.concatenate([resonances, np.geomspace(low, high, 16)])
    clusters = clusters[(clusters > low) & (clusters < high)]
    t = np.unique(
        np.concatenate(
            [np.linspace(0.0, 1.0, 32 * fineness + 1), np.arccos((middle - clusters) / half) / np.pi]
        )
    )
    u, v, side = plane.points(frequencies(t))
    for _ in range(_ROUNDS):
        between = 0.5 * (t[1:] + t[:-1])
        new = plane.points(frequencies(between))
        omega, omega_new = frequencies(t), frequencies(between)
        error = np.zeros(between.size)
        for axis, old, fresh in ((plane.x, u, new.x), (plane.y, v, new.y)):
            error = np.maximum(error, _chord_error(axis, old, fresh, omega, omega_new))
        split = error > _CHORD
        if not np.any(split):
            break
        t = np.concatenate([t, between[split]])
        order = np.argsort(t, kind="stable")
        t = t[order]
        u, v, side = (
            np.concatenate([old, fresh[:, split]], axis=1)[:, order]
            for old, fresh in zip((u, v, side), new, strict=True)
        )
    omega = frequencies(t)
    return _unrolled(plane, omega, u, v, side, from_zero)


def _chord_error(
    axis: Axis, old: FloatArray, fresh: FloatArray, omega: FloatArray, omega_new: FloatArray
) -> FloatArray:
    """Return how far the middle of each chord is from the curve, in the first and the last turn in range."""
    span = axis.high - axis.low
    if not axis.is_delay:
        clipped = np.clip((old - axis.low) / span, -1.0, 2.0)
        middle = np.clip((fresh - axis.low) / span, -1.0, 2.0)
        return np.nan_to_num(np.abs(0.5 * (clipped[:, 1:] + clipped[:, :-1]) - middle), nan=0.0).max(axis=0)
    right = fresh + _wrapped(old[:, 1:] - fresh)
    left = fresh + _wrapped(old[:, :-1] - fresh)
    result = np.zeros(omega_new.size)
    for turn in (0.0, 2.0 * np.pi * np.floor(axis.high * omega_new / (2.0 * np.pi))):
        chord = 0.5 * ((left + turn) / omega[:-1] + (right + turn) / omega[1:])
        here = (fresh + turn) / omega_new
        near = here <= axis.high + span
        result = np.maximum(result, np.nan_to_num(np.abs(chord - here) / span * near, nan=0.0).max(axis=0))
    return result


def _wrapped(angle: FloatArray) -> FloatArray:
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _unrolled(
    plane: CrossingPlane, omega: FloatArray, u: FloatArray, v: FloatArray, side: FloatArray, from_zero: bool
) -> Segments:
    """Join both branches to one chain, and repeat it for every turn of the delays."""
    if plane.x.channel != plane.y.channel:
        closing = slice(0, 0) if from_zero else slice(0, 1)
        chains = [[np.concatenate([part[0], part[1][::-1], part[0][closing]]) for part in (u, v, side)]]
        chain_omega = [np.concatenate([omega, omega[::-1], omega[closing]])]
    else:
        chains = [[part[k] for part in (u, v, side)] for k in range(len(u))]
        chain_omega = [omega] * len(u)
    return Segments.joined(
        [_repeated(plane, w, *chain) for w, chain in zip(chain_omega, chains, strict=True)]
    )


def _repeated(
    plane: CrossingPlane, omega: FloatArray, u: FloatArray, v: FloatArray, side: FloatArray
) -> Segments:
    w0, w1 = omega[:-1], omega[1:]
    direction = np.sign(w1 - w0)
    # At the joints of the branches frequency stands still, and the sense goes on from before.
    both = np.nan_to_num(side[:-1]) + np.nan_to_num(side[1:])
    sense = _carried(np.sign(both) * direction)
    ends = []
    for axis, values in ((plane.x, u), (plane.y, v)):
        first = values[:-1]
        ends.append((first, first + _wrapped(values[1:] - first) if axis.is_delay else values[1:]))
    finite = np.all([np.isfinite(end) for pair in ends for end in pair], axis=0)
    index = np.flatnonzero(finite & (sense != 0.0))
    columns: list[np.ndarray] = []
    for axis, (a, b) in zip((plane.x, plane.y), ends, strict=True):
        if axis.is_delay:
            first_turn, repeats = turns_in_range(axis, w0[index], w1[index], a[index], b[index])
        else:
            span = 2.0 * (axis.high - axis.low)
            near = (np.minimum(a, b) < axis.high + span) & (np.maximum(a, b) > axis.low - span)
            # From one side of the range to the other in one step only through infinity.
            near &= ~((np.minimum(a, b) < axis.low) & (np.maximum(a, b) > axis.high))
            first_turn, repeats = np.zeros(index.size), near[index].astype(int)
        owner, number = numbered(repeats)
        columns, index, turn = [column[owner] for column in columns], index[owner], first_turn[owner] + number
        if axis.is_delay:
            columns += [
                (a[index] + 2.0 * np.pi * turn) / w0[index],
                (b[index] + 2.0 * np.pi * turn) / w1[index],
            ]
        else:
            columns += [a[index], b[index]]
    start, end = np.column_stack([columns[0], columns[2]]), np.column_stack([columns[1], columns[3]])
    forward = sense[index] > 0.0
    return Segments(
        np.where(forward[:, None], start, end), np.where(forward[:, None], end, start),
        np.full(index.size, 2), 0.5 * (w0 + w1)[index],
    )  # fmt: skip


def _carried(sense: FloatArray) -> FloatArray:
    """Replace zeros by the value before them (or, at the beginning, after them)."""
    known = np.flatnonzero(sense != 0.0)
    if known.size == 0:
        return sense
    before = np.searchsorted(known, np.arange(sense.size), side="right") - 1
    return sense[known[np.maximum(before, 0)]]


def _zero_frequency(plane: CrossingPlane) -> Segments:
    """Return the curve on which a real root passes through zero; only gains move it."""
    if plane.x.is_delay and plane.y.is_delay:
        return Segments.joined([])
    corner = _characteristic(plane, 0.0, np.array([0.0, 1.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0, 1.0])).real
    c0, c1, c2 = corner[0], corner[1] - corner[0], corner[2] - corner[0]
    c12 = corner[3] - c0 - c1 - c2
    along = plane.x if plane.x.is_delay or not plane.y.is_delay else plane.y

    def curve(t: FloatArray) -> FloatArray:
        """Points of the curve over the delay (a straight line across the plane) or over the first gain."""
        with np.errstate(all="ignore"):
            if plane.x.is_delay:
                return np.column_stack([t, np.full_like(t, -c0 / c2)])
            if plane.y.is_delay:
                return np.column_stack([np.full_like(t, -c0 / c1), t])
            return np.column_stack([t, -(c0 + c1 * t) / (c2 + c12 * t)])

    tiny = 1e-7 * max(1.0, float(np.linalg.norm(plane.loop.A, 2)))

    def slope(t: FloatArray) -> FloatArray:
        """Derivative of the characteristic function with respect to s at s = 0."""
        points = curve(t)
        usable = np.all(np.isfinite(points), axis=1)
        result = np.full(t.size, np.nan)
        result[usable] = _characteristic(plane, 1j * tiny, *points[usable].T).imag / tiny
        return result

    t = np.linspace(along.low, along.high, 801)
    if not (plane.x.is_delay or plane.y.is_delay):
        # Steep parts: places at which the second gain takes even values.
        beyond = 0.25 * (plane.y.high - plane.y.low)
        y = np.linspace(plane.y.low - beyond, plane.y.high + beyond, 1201)
        with np.errstate(all="ignore"):
            steep = -(c0 + c2 * y) / (c1 + c12 * y)
        t = np.unique(np.concatenate([t, steep[(steep >= along.low) & (steep <= along.high)]]))
    value = slope(t)
    # Where it vanishes a second root is at zero: there a curve of pairs ends, and the sense of this one turns.
    turning = np.flatnonzero(value[1:] * value[:-1] < 0.0)
    turns = elementwise.find_root(slope, (t[turning], t[turning + 1])).x
    t = np.sort(np.concatenate([t, turns]))
    points = curve(t)
    start, end = points[:-1], points[1:]
    usable = np.all(np.isfinite(start) & np.isfinite(end), axis=1)
    middle = 0.5 * (t[1:] + t[:-1])[usable]
    start, end = start[usable], end[usable]
    sense = slope(middle)
    lowest, highest = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    # From below the range to above it in one step only through infinity.
    keep = ~((lowest <= plane.y.low) & (highest >= plane.y.high))
    # ... or the straight line of a single gain, which is sampled along the delay.
    keep |= plane.x.is_delay | plane.y.is_delay
    start, end, sense = start[keep], end[keep], sense[keep]
    x, y = 0.5 * (start + end).T
    zero = np.zeros_like(x)
    # Gradient of the characteristic function at s = 0; the normal points to the right of the segment.
    gradient = np.column_stack([
        zero if plane.x.is_delay else (c1 + c12 * y if not plane.y.is_delay else c1 + zero),
        zero if plane.y.is_delay else (c2 + c12 * x if not plane.x.is_delay else c2 + zero),
    ])  # fmt: skip
    normal = np.column_stack([(end - start)[:, 1], -(end - start)[:, 0]])
    to_right = -np.sign(np.sum(gradient * normal, axis=1)) * np.sign(sense)
    flip = to_right < 0.0
    return Segments(
        np.where(flip[:, None], end, start), np.where(flip[:, None], start, end),
        np.nan_to_num(np.abs(to_right)).astype(int), np.zeros(len(start)),
    )  # fmt: skip


def _characteristic(plane: CrossingPlane, s: complex, x: FloatArray, y: FloatArray) -> np.ndarray:
    """Return the characteristic determinant at s for arrays of parameters."""
    gains = np.ones((x.size, plane.owner.size))
    delays = np.tile(plane.other_delays, (x.size, 1))
    for k in (0, 1):
        delays[:, plane.owner == k] = plane.delays[k]
    for axis, values in ((plane.x, x), (plane.y, y)):
        target = delays if axis.is_delay else gains
        target[:, plane.owner == axis.channel] = values[:, None]
    E = gains * np.exp(-s * delays)
    loop = plane.loop
    return np.linalg.det(s * np.eye(loop.n_states) - loop.closed(E))
