"""Folding: the loop as algorithms see it.

A user's system keeps zero and equal delays, zero gains and idle channels as given. Every algorithm works on
the folded loop instead, in which gains are absorbed, delay-free channels closed and idle ones dropped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model.lft import Realization, closed
from susp_ctrl.errors import InputError


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
