r"""Time averages of a record between its samples.

The trapezoidal rule on samples h apart is nearly exact where the record is fine: what every second and every third
sample alone would give differs from it by more than its own error, so the samples tell whether they are enough. A
feature that ends before the next sample leaves no trace in them, but announces itself by kinks. Where either asks for
it, the response is computed between the samples and integrated by Simpson's rule in cells that are cut in four until
halving them changes nothing [1]_.

References
----------
.. [1] P. J. Davis, P. Rabinowitz, "Methods of Numerical Integration", 2nd ed., Academic Press, 1984, chapter 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from susp_ctrl.arrays import FloatArray

Signals = Mapping[str, FloatArray]

RTOL = 1e-4
"""Relative error wanted of an RMS value and of the comfort figures."""
COARSER = 2.0  # a rule on every second sample errs by three times as much, at a jump by twice as much
MOST_TIMES = 400_000
SAMPLES_ONLY = 10.0  # times the tolerance that is let pass where nothing can be done
_STRIDES = (2, 3)  # two equal samples of a pulse look alike to every second one
_SEEN = 4.0  # samples between two kinks that show what is between them
_MOST_PASSES = 16
_MARK = 0.5  # of its equal part of the tolerance that a cell may use up


class Averages(NamedTuple):
    """Averages by name, and the names of those that are less certain than wanted."""

    means: dict[str, float]
    doubtful: list[str]


def averages(
    t: FloatArray,
    record: Signals,
    evaluate: Callable[[FloatArray], Signals] | None,
    kinks: FloatArray,
    noise: Mapping[str, float],
    lenience: float = 1.0,
) -> Averages:
    """Return the time average of every signal, to twice `RTOL` of that of its magnitude.

    Parameters
    ----------
    t : ndarray
        Times of the record (s).
    record : mapping of name to ndarray
        Signals at these times.
    evaluate : callable or None
        Times to the same signals there; None where only the samples are known.
    kinks : ndarray
        Times at which the signals may have kinks.
    noise : mapping of name to float
        Averages up to which a signal is rounding.
    lenience : float
        Times the tolerance by which samples may seem wrong before they are not trusted.
    """
    names, values = list(record), np.array(list(record.values()))
    span = float(t[-1] - t[0])
    total = trapezoid(values, t)
    allowed = 2.0 * RTOL * trapezoid(np.abs(values), t) + span * np.array([noise[name] for name in names])
    most = COARSER * allowed * (SAMPLES_ONLY if evaluate is None else lenience)
    coarse = _strided_error(t, values, total) > most
    doubtful = [name for name, bad in zip(names, coarse, strict=True) if bad]
    if evaluate is not None:
        cells = np.ones(t.size - 1, dtype=bool) if doubtful else near_hidden(t, kinks)
        if np.any(cells):
            within = kinks[(kinks > t[0]) & (kinks < t[-1])]
            total, sure = _refined(t, values, cells, within, evaluate, allowed)
            doubtful = [name for name, good in zip(names, sure, strict=True) if not good]
    return Averages(dict(zip(names, (total / span).tolist(), strict=True)), doubtful)


def near_hidden(t: FloatArray, kinks: FloatArray) -> NDArray[np.bool_]:
    """Return which cells between samples meet two kinks so close together that the samples miss what is between."""
    cells = np.zeros(t.size - 1, dtype=bool)
    known = np.unique(kinks)
    place = np.clip(np.searchsorted(t, known) - 1, 0, cells.size - 1)
    for k in np.flatnonzero(np.diff(known) < _SEEN * np.diff(t)[place[:-1]]):
        if known[k + 1] > t[0] and known[k] < t[-1]:
            cells[max(place[k] - 1, 0) : place[k + 1] + 2] = True
    return cells


def _strided_error(t: FloatArray, values: FloatArray, total: FloatArray) -> FloatArray:
    """Return how far the integrals over every second or third sample are from those over all."""
    error = np.zeros(total.shape)
    for stride in _STRIDES:
        for first in range(stride):
            picked = np.unique(np.concatenate([[0], np.arange(first, t.size, stride), [t.size - 1]]))
            error = np.maximum(error, np.abs(trapezoid(values[:, picked], t[picked]) - total))
    return error


def _refined(
    t: FloatArray,
    values: FloatArray,
    cells: NDArray[np.bool_],
    kinks: FloatArray,
    evaluate: Callable[[FloatArray], Signals],
    allowed: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the integrals, marked cells by Simpson's rule, and which of them have the error allowed."""
    steps = np.diff(t)
    done = 0.5 * (values[:, :-1] + values[:, 1:])[:, ~cells] @ steps[~cells]
    place = np.clip(np.searchsorted(t, kinks) - 1, 0, cells.size - 1)
    edges = np.unique(np.concatenate([t, kinks[cells[place]]]))
    open_cells = cells[np.clip(np.searchsorted(t, 0.5 * (edges[:-1] + edges[1:])) - 1, 0, cells.size - 1)]
    a, b = edges[:-1][open_cells], edges[1:][open_cells]
    certain, spent = np.zeros(allowed.shape), 0
    for left in reversed(range(_MOST_PASSES)):
        points = a[:, None] + (b - a)[:, None] * (np.arange(5) / 4)
        points[:, 4] = b
        times, where = np.unique(points, return_inverse=True)
        spent += times.size
        f = np.array(list(evaluate(times).values()))[:, where.reshape(points.shape)]
        once = f[:, :, [0, 2, 4]] @ np.array([1.0, 4.0, 1.0]) * (b - a) / 6
        twice = f @ np.array([1.0, 4.0, 2.0, 4.0, 1.0]) * (b - a) / 12
        error = np.abs(twice - once)
        sure = certain + np.sum(error, axis=1) <= allowed
        more = np.any(error > _MARK * allowed[:, None] / a.size, axis=0) & ~np.all(sure)
        if left == 0 or not np.any(more) or spent + 16 * np.count_nonzero(more) > MOST_TIMES:
            break
        done = done + np.sum(twice[:, ~more], axis=1)
        certain = certain + np.sum(error[:, ~more], axis=1)
        a, b = points[more, :4].ravel(), points[more, 1:].ravel()
    return done + np.sum(twice, axis=1), sure


def close_kinks(response: Any, t: FloatArray) -> FloatArray:
    """Return the times of announced kinks so close together that samples at t miss what is between."""
    found = getattr(response, "close_kinks", None)
    return (
        np.zeros(0) if found is None or t.size < 2 else np.asarray(found(_SEEN * float(np.max(np.diff(t)))))
    )
