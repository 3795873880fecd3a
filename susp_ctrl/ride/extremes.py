"""Extremes of a record between its samples.

The largest sample of a signal of frequency omega falls short of its peak by up to ``(omega h)^2/8`` of it, h the
sampling step: 6 % at nine samples a period. A simulated response can be computed at any times, so it is asked again
around each sample that may stand next to the largest value, `_FINER` times as densely, and a parabola does the rest.
Where much is gained so, the samples were too far apart to trust, and the whole record is computed more densely.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from susp_ctrl.arrays import FloatArray

_FINER = 16
_CANDIDATES = 8  # local maxima that are looked at
_NEARLY = 0.02  # part of the range by which a local maximum of the samples may be below the largest
_COARSE = (
    3e-3  # of the range that may be gained between samples before the whole record is computed more densely
)
_DENSER, _MOST_TIMES = 4, 400_000
_MOST_GAIN = 1e-3  # of the range that a parabola may add: a larger one spans a jump

Signals = Mapping[str, FloatArray]


def extremes(
    t: FloatArray, record: Signals, evaluate: Callable[[FloatArray], Signals] | None
) -> dict[str, tuple[float, float]]:
    """Return the least and the largest value of every signal of a record.

    Parameters
    ----------
    t : ndarray
        Times of the record (s).
    record : mapping of name to ndarray
        Signals at these times.
    evaluate : callable or None
        Times to the same signals there; None where only the samples are known.
    """
    found = {name: (float(np.min(values)), float(np.max(values))) for name, values in record.items()}
    if evaluate is None or t.size < 3:
        return found
    around = [_around(t, sign * values) for values in record.values() for sign in (-1.0, 1.0)]
    times = np.unique(np.concatenate(around))
    if times.size == 0:
        return found
    coarse = False
    for name, values in evaluate(times).items():
        low, high = found[name]
        gain = _MOST_GAIN * (high - low)
        found[name] = min(low, -top(times, -values, gain)), max(high, top(times, values, gain))
        coarse |= max(low - found[name][0], found[name][1] - high) > _COARSE * (high - low)
    if coarse and t.size * _DENSER <= _MOST_TIMES:
        # samples so far apart may have passed over the largest value altogether
        share = np.arange(_DENSER) / _DENSER
        dense = np.append((t[:-1, None] + np.diff(t)[:, None] * share).ravel(), t[-1])
        return extremes(dense, evaluate(dense), evaluate)
    return found


def _around(t: FloatArray, values: FloatArray) -> FloatArray:
    """Return dense times around the samples that may be next to the largest value."""
    rest = np.concatenate([[-np.inf], values, [-np.inf]])
    tops = np.flatnonzero((values >= rest[:-2]) & (values >= rest[2:]))
    before, after = np.maximum(tops - 1, 0), np.minimum(tops + 1, t.size - 1)
    bend = 2.0 * values[tops] - values[before] - values[after]
    gain = np.divide((values[after] - values[before]) ** 2, 8.0 * bend, out=0.0 * bend, where=bend > 0.0)
    reach = float(np.ptp(values))
    likely = values[tops] + gain >= np.max(values) - _NEARLY * reach
    if reach == 0.0:
        return np.zeros(0)
    order = np.argsort((values[tops] + gain)[likely])[::-1][:_CANDIDATES]
    share = np.arange(_FINER + 1) / _FINER
    pairs = np.concatenate([np.stack([before, tops], axis=1), np.stack([tops, after], axis=1)])
    chosen = np.flatnonzero(likely)[order]
    a, b = pairs[np.concatenate([chosen, chosen + tops.size])].T
    return np.asarray((t[a][:, None] + (t[b] - t[a])[:, None] * share).ravel())


def top(t: FloatArray, values: FloatArray, most: float = np.inf) -> float:
    """Return the largest value of a curve through samples, by the parabola through the three around the largest."""
    k = int(np.argmax(values))
    largest = float(values[k])
    if not 0 < k < t.size - 1:
        return largest
    (a, b), (c, d) = t[[k - 1, k + 1]] - t[k], values[[k - 1, k + 1]] - largest
    # c = p a + q a^2, d = p b + q b^2; a < 0 < b
    q = (d / b - c / a) / (b - a)
    p = c / a - q * a
    gain = -p * p / (4.0 * q) if q < 0.0 else 0.0
    return largest + gain if gain <= most else largest
