"""Folding: the loop as algorithms see it, and the refusal of neutral loops.

A user's system keeps zero and equal delays, zero gains and idle channels as given. Every algorithm works on
the folded loop instead, in which gains are absorbed, delay-free channels closed and idle ones dropped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from susp_ctrl.delay_systems.model.lft import ComplexArray, FloatArray, Realization
from susp_ctrl.errors import InputError, NeutralLoopError


class FoldedLoop(NamedTuple):
    """The loop as algorithms see it: unit gains, every delay positive, every channel at work."""

    plant: Realization
    delays: FloatArray

    def exponentials(self, s: ComplexArray) -> ComplexArray:
        """Return ``e^{-s tau_k}``, shape (*s.shape, channels)."""
        return np.exp(-np.asarray(s)[..., None] * self.delays)


def fold(plant: Realization, gains: FloatArray, delays: FloatArray) -> FoldedLoop:
    """Absorb the gains, drop channels without effect and close the channels without delay.

    Raises
    ------
    InputError
        The delay-free channels form an algebraic loop without a solution.
    """
    column = np.vstack([plant.B2, plant.D12, plant.D22]) * gains
    at_work = np.any(column != 0.0, axis=0)
    instant = at_work & (delays == 0.0)
    kept = at_work & ~instant
    B2, D12, D22 = plant.B2 * gains, plant.D12 * gains, plant.D22 * gains
    if not np.any(instant):
        closed = (plant.A, plant.B1, B2[:, kept], plant.C1, plant.C2[kept])
        direct = (plant.D11, D12[:, kept], plant.D21[kept], D22[np.ix_(kept, kept)])
        return FoldedLoop(Realization(*closed, *direct), delays[kept])
    around = np.eye(int(instant.sum())) - D22[np.ix_(instant, instant)]
    if np.linalg.cond(around) > 1e14:
        raise InputError(
            "the channels without delay form an algebraic loop with unit gain: no solution exists"
        )
    from_state = np.linalg.solve(around, plant.C2[instant])
    from_input = np.linalg.solve(around, plant.D21[instant])
    from_delayed = np.linalg.solve(around, D22[np.ix_(instant, kept)])
    to_state, to_output, to_delayed = B2[:, instant], D12[:, instant], D22[np.ix_(kept, instant)]
    return FoldedLoop(
        Realization(
            plant.A + to_state @ from_state,
            plant.B1 + to_state @ from_input,
            B2[:, kept] + to_state @ from_delayed,
            plant.C1 + to_output @ from_state,
            plant.C2[kept] + to_delayed @ from_state,
            plant.D11 + to_output @ from_input,
            D12[:, kept] + to_output @ from_delayed,
            plant.D21[kept] + to_delayed @ from_input,
            D22[np.ix_(kept, kept)] + to_delayed @ from_delayed,
        ),
        delays[kept],
    )


def refuse_neutral(loop: FoldedLoop) -> None:
    """Raise unless ``det(I - D22 E) = 1`` for all delays: no direct path leads around the loop.

    Only signals that lie on a common cycle of non-zero entries matter, one set of them at a time: a chain of direct
    paths, however large its entries, is no loop.
    """
    D22 = loop.plant.D22
    if not np.any(D22):
        return
    _, component = connected_components(D22 != 0.0, directed=True, connection="strong")
    for k in np.unique(component):
        members = component == k
        if np.any(D22[np.ix_(members, members)]) and _feeds_around(D22[np.ix_(members, members)]):
            raise NeutralLoopError(
                "the loop is neutral: a delayed signal feeds through directly around the loop (for example "
                "delayed acceleration feedback), so no delay is too small to destabilise it; give the channel an "
                "actuator_bandwidth, which makes it retarded"
            )


def _feeds_around(D: FloatArray) -> bool:
    """Tell whether cycles have more weight than rounding.

    The determinant is one for every E exactly when every cycle of D has zero weight, which random points of the
    torus tell apart from any other polynomial in E. Scaling the signals evens the entries and changes no cycle.
    """
    channels = D.shape[0]
    _, (scale, _) = scipy.linalg.matrix_balance(np.abs(D), permute=False, separate=True)
    even = D * scale / scale[:, None]
    phases = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (8, channels))
    determinant = np.linalg.det(np.eye(channels) - even * np.exp(1j * phases)[:, None, :])
    size = np.linalg.det(np.eye(channels) + np.abs(even)) if channels < 12 else 1.0 + np.abs(even).sum()
    return bool(np.any(np.abs(determinant - 1.0) > 1e-12 * max(1.0, abs(size))))
