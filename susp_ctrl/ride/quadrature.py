"""Adaptive quadrature of several spectra at once, all panels of a round in one evaluation."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_FIRST_PANELS = 40
_MOST_EVALUATIONS = 100_000  # of each integrand; bounds time and memory for spectra that are not smooth


class Integral(NamedTuple):
    """Integrals, their estimated relative errors, and the number of evaluations per integrand."""

    value: FloatArray
    relative_error: FloatArray
    evaluations: int


def integrate_spectra(
    density: Callable[[FloatArray], FloatArray],
    band: tuple[float, float],
    rtol: float,
    *,
    floor: Callable[[FloatArray], FloatArray] | None = None,
) -> Integral:
    """Integrate non-negative spectra over a band of frequencies.

    Every panel holds 8 Gauss-Legendre nodes and is compared with its two halves; panels whose difference
    matters for any of the spectra are halved again. The panels start evenly spaced in the logarithm of the
    frequency.

    Parameters
    ----------
    density : callable
        Frequencies, shape (points,), to spectra, shape (spectra, points).
    band : (float, float)
        Lower limit (may be 0) and upper limit.
    rtol : float
        Relative error asked of each integral.
    floor : callable, optional
        Like `density`: spectra whose integrals are so small that the error need not be smaller.

    Returns
    -------
    Integral
        The error is the sum of the differences of the panels kept, an upper estimate for smooth spectra,
        relative to the value or to floor/rtol, whichever is larger. It is larger than `rtol` where 100 000
        evaluations were not enough.
    """
    low, high = band
    first = low if low > 0 else 1e-5 * high
    edges = np.geomspace(first, high, _FIRST_PANELS + 1)
    if low <= 0:
        edges = np.concatenate([[low], edges])
    left, right = edges[:-1], edges[1:]
    coarse = _panels(density, left, right)
    evaluations = _NODES.size * left.size
    total = np.zeros(coarse.shape[0])
    error = np.zeros_like(total)
    smallest = np.zeros_like(total) if floor is None else np.sum(_panels(floor, left, right), axis=1) / rtol
    while left.size:
        middle = (left + right) / 2
        halves = _panels(density, np.concatenate([left, middle]), np.concatenate([middle, right]))
        evaluations += 2 * _NODES.size * left.size
        lower, upper = np.split(halves, 2, axis=1)
        fine = lower + upper
        difference = np.abs(fine - coarse)
        # a panel may err by its share of what the whole may
        allowed = rtol * np.maximum(total + np.sum(fine, axis=1), smallest) / (4 * _FIRST_PANELS)
        split = np.any(difference > allowed[:, None], axis=0)
        if evaluations + 4 * _NODES.size * np.count_nonzero(split) > _MOST_EVALUATIONS:
            split[:] = False
        total += np.sum(fine[:, ~split], axis=1)
        error += np.sum(difference[:, ~split], axis=1)
        coarse = np.concatenate([lower[:, split], upper[:, split]], axis=1)
        left, right = (
            np.concatenate([left[split], middle[split]]),
            np.concatenate([middle[split], right[split]]),
        )
    scale = np.maximum(total, smallest)
    relative = np.divide(error, scale, out=np.zeros_like(total), where=scale > 0)
    return Integral(total, relative, evaluations)


def _panels(density: Callable[[FloatArray], FloatArray], left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the Gauss-Legendre integral of every spectrum over every panel, shape (spectra, panels)."""
    half = (right - left) / 2
    points = (left + right)[:, None] / 2 + half[:, None] * _NODES
    values = density(points.ravel()).reshape(-1, *points.shape)
    return np.asarray((values @ _WEIGHTS) * half)
