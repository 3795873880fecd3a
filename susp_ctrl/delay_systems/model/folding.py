"""Folding: the loop as algorithms see it.

A user's system keeps zero and equal delays, zero gains and idle channels as given. Every algorithm works on
the folded loop instead, in which gains are absorbed, delay-free channels closed and idle ones dropped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model.lft import Realization, closed, loop_response
from susp_ctrl.delay_systems.model.rounding import balancing
from susp_ctrl.errors import InputError

# Points of the circle on which a limit is taken, and the share that terms of a pole may have there by rounding.
_CIRCLE = 16
_NO_POLE = 1e-9


class FoldedLoop(NamedTuple):
    """The loop as algorithms see it: unit gains, every delay positive, every channel at work."""

    plant: Realization
    delays: FloatArray

    def exponentials(self, s: ComplexArray) -> ComplexArray:
        """Return ``e^{-s tau_k}``, shape (*s.shape, channels)."""
        # points are contiguous in memory, as in a sampled plant
        return np.moveaxis(np.exp(-np.multiply.outer(self.delays, np.asarray(s))), 0, -1)


def fold(plant: Realization, gains: FloatArray, delays: FloatArray) -> FoldedLoop:
    """Absorb the gains, drop channels without effect and close the channels without delay.

    Raises
    ------
    InputError
        The delay-free channels form an algebraic loop without a solution.
    """
    n_rows, n_columns = plant.n_states + plant.n_outputs, plant.n_states + plant.n_inputs
    whole = plant.matrix
    whole[:, n_columns:] *= gains
    at_work = np.any(whole[:, n_columns:] != 0.0, axis=0)
    instant = at_work & (delays == 0.0)
    kept = np.flatnonzero(at_work & ~instant)
    rows, columns = (
        np.append(np.arange(n_rows), n_rows + kept),
        np.append(np.arange(n_columns), n_columns + kept),
    )
    folded = whole[np.ix_(rows, columns)]
    if np.any(instant):
        ends, starts = n_columns + np.flatnonzero(instant), n_rows + np.flatnonzero(instant)
        around = whole[np.ix_(starts, ends)]
        if np.linalg.cond(np.eye(starts.size) - around) > 1e14:
            raise InputError(
                "the channels without delay form an algebraic loop with unit gain: no solution exists"
            )
        folded = closed(folded, whole[np.ix_(rows, ends)], whole[np.ix_(starts, columns)], around)
    return FoldedLoop(plant.rebuilt(folded), delays[kept])


def response_at(loop: FoldedLoop, s: ComplexArray) -> ComplexArray:
    """Return the response at points s, shape (points, outputs, inputs), with its limit where a pole cancels.

    An integrator before ``1 - e^{-s tau}`` has no pole: its matrix is singular at zero, its response is not.
    """
    values = loop_response(loop.plant, s, loop.exponentials(s))
    for k in np.flatnonzero(~np.isfinite(values).all(axis=(1, 2))):
        limit = _limit(loop, s[k])
        values[k] = values[k] if limit is None else limit
    real = (s.imag == 0.0)[:, None, None] & np.isfinite(values)
    return np.where(real, values.real, values) if np.any(real) else values


def _limit(loop: FoldedLoop, at: complex) -> ComplexArray | None:
    """Return the mean over a small circle if Laurent's coefficients there show no pole, by Cauchy's formula."""
    away = np.abs(loop.plant.eigenvalues - at)
    turns = 1.0 / loop.delays.max() if loop.delays.size else np.inf
    radius = 1e-3 * float(min(np.min(away[away > 1e-6 * away.max(initial=0.0)], initial=np.inf), turns))
    if not 0.0 < radius < np.inf:
        return None
    circle = radius * np.exp(2j * np.pi * (np.arange(_CIRCLE) + 0.5) / _CIRCLE)
    values = loop_response(loop.plant, at + circle, loop.exponentials(at + circle))
    size = np.abs(values).max(axis=0)
    orders = (circle / radius) ** np.arange(1, _CIRCLE // 2)[:, None]
    principal = np.abs(np.tensordot(orders, values, axes=1)) / _CIRCLE
    if not np.all(np.isfinite(values)) or np.any(principal > _NO_POLE * size):
        return None
    mean: ComplexArray = values.mean(axis=0)
    return mean


def direct_paths(D22: FloatArray) -> FloatArray:
    """Return ``(I - |D22|)^-1``, all direct paths from one delayed signal to another: a series that ends.

    It bounds ``(I - D22 E)^-1`` entry by entry for all ``|E| <= 1``.
    """
    power = np.abs(D22)
    total = np.eye(D22.shape[0]) + power
    for _ in range(D22.shape[0] - 2):  # nilpotent: no direct path leads around the loop
        power = power @ np.abs(D22)
        total = total + power
    return total


def loop_balancing(whole: FloatArray, n: int) -> FloatArray:
    """Return powers of two, units of states and signals in which ``[[A, B], [C, D]]`` has even magnitudes.

    The unit of time does not matter: rows of rates are divided by the loop's own rate first, since beside the numbers
    without unit small rates would not count and large ones alone would.
    """
    size = np.abs(whole)
    size[:n] /= loop_rate(whole, n)
    return balancing(size)


def loop_rate(whole: FloatArray, n: int) -> float:
    """Return a power of two near the largest rate that ``[[A, B], [C, D]]`` can have (rad/s), one if it has none."""
    size = np.abs(whole)
    rates = size[:n, :n] + size[:n, n:] @ direct_paths(size[n:, n:]) @ size[n:, :n]
    largest = float(np.abs(np.linalg.eigvals(rates)).max(initial=0.0))
    return float(2.0 ** np.round(np.log2(largest))) if largest > 0.0 else 1.0
