r"""A loop taken apart into a dead time and the rest: ``L(s) = e^{-sT} G(s)``.

Delays that every path from input to output meets alike turn the phase and nothing else. They are found by giving each
signal the time that the input takes to it: where all paths agree, no cycle has a delay, and shifting every state by its
own time leaves G without any. Only states between input and output count, and of these only such as the input moves
and the output shows: a mode on the imaginary axis that cancels is not in L.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import breadth_first_order

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.frequency.high_frequency import leading_terms
from susp_ctrl.delay_systems.model import (
    FoldedLoop,
    Realization,
    eigenvalues_with_uncertainty,
    fold,
    loop_response,
)

_EPSILON = float(np.finfo(float).eps)


class LoopWithDeadTime(NamedTuple):
    """``L(s) = e^{-s dead_time} G(s)``; `rest` is G, which has delays only where paths or cycles differ in them."""

    rest: FoldedLoop
    dead_time: float

    @property
    def whole(self) -> FoldedLoop:
        """L itself."""
        if self.dead_time == 0.0:
            return self.rest
        plant, delays = self.rest
        n, m = plant.n_states, plant.n_channels
        zero, one = np.zeros((1, 1)), np.ones((1, 1))
        delayed = Realization(
            plant.A,
            plant.B1,
            np.hstack([plant.B2, np.zeros((n, 1))]),
            np.zeros((1, n)),
            np.vstack([plant.C2, plant.C1]),
            zero,
            np.hstack([np.zeros((1, m)), one]),
            np.vstack([plant.D21, plant.D11]),
            np.block([[plant.D22, np.zeros((m, 1))], [plant.D12, zero]]),
        )
        return FoldedLoop(delayed, np.append(delays, self.dead_time))

    @property
    def direct(self) -> tuple[float, float] | None:
        """Gain and delay of what passes without any state, the limit at high frequency; None if it is several."""
        terms = [(float(D[0, 0]), T) for T, D in leading_terms(self.rest)[0].items() if D[0, 0] != 0.0]
        if len(terms) > 1:
            return None
        gain, delay = terms[0] if terms else (0.0, 0.0)
        return gain, delay + self.dead_time

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return L at frequencies (rad/s); at infinity what passes directly, before its delay."""
        limit = self.direct
        result = np.full(omega.size, np.nan if limit is None else limit[0], dtype=complex)
        finite = np.isfinite(omega)
        s = np.asarray(1j * omega[finite], dtype=complex)
        values = loop_response(self.rest.plant, s, self.rest.exponentials(s))[:, 0, 0]
        result[finite] = values * np.exp(-s * self.dead_time)
        return result


def without_dead_time(loop: FoldedLoop) -> LoopWithDeadTime:
    """Take apart a folded loop with one input and one output."""
    plant, delays = _between_input_and_output(loop)
    times = _times(plant, delays)
    if times is None:
        return LoopWithDeadTime(FoldedLoop(plant, delays), 0.0)
    straight = fold(plant, np.ones(delays.size), np.zeros(delays.size)).plant
    return LoopWithDeadTime(FoldedLoop(_without_hidden_modes(straight), np.zeros(0)), times)


def _connections(plant: Realization) -> np.ndarray:
    """Return which of states, delayed signals and output (rows) follows from which of them and the input."""
    n, m, whole = plant.n_states, plant.n_channels, plant.matrix != 0.0
    order = [*range(n), *range(n + 1, n + 1 + m), n]
    return whole[np.ix_(order, order)]


def _between_input_and_output(loop: FoldedLoop) -> FoldedLoop:
    """Drop states and delayed signals that the input does not reach or that do not reach the output."""
    plant, delays = loop
    n, last = plant.n_states, plant.n_states + plant.n_channels
    leads_to = _connections(plant).T
    # the last node is the input as a source and the output as an end: nothing else passes through it
    reached = breadth_first_order(leads_to, last, return_predecessors=False)
    seen = breadth_first_order(leads_to.T, last, return_predecessors=False)
    kept = np.intersect1d(reached, seen)
    states, signals = kept[kept < n], kept[(kept >= n) & (kept < last)] - n
    index = np.concatenate([states, [n], n + 1 + signals])
    part = plant.matrix[np.ix_(index, index)]
    return FoldedLoop(Realization.from_matrix(part, states.size, 1, 1), delays[signals])


def _times(plant: Realization, delays: FloatArray) -> float | None:
    """Return the delay common to all paths, or None where they differ.

    A node's time is that at which what enters at zero arrives there, before its own delay.
    """
    n, last = plant.n_states, plant.n_states + plant.n_channels
    own = np.concatenate([np.zeros(n), delays, [0.0]])
    connected = _connections(plant)
    order, before = breadth_first_order(connected.T, last)
    arrival = np.full(last + 1, np.nan)
    leaves = np.append(np.full(last, np.nan), 0.0)
    for node in order[1:]:
        arrival[node] = leaves[before[node]]
        leaves[node] = arrival[node] + own[node]
    to, start = np.nonzero(connected[:last])
    slack = 8.0 * _EPSILON * delays.sum()
    if np.any(np.abs(arrival[to] - leaves[start]) > slack):
        return None
    ends = leaves[np.flatnonzero(connected[last])]
    latest = float(ends.max(initial=0.0))
    return latest if np.all(latest - ends <= slack) else None


def _without_hidden_modes(plant: Realization) -> Realization:
    """Remove modes on the axis that are not controllable or not observable, one after another."""
    for _ in range(plant.n_states):
        smaller = _one_mode_less(plant)
        if smaller is None:
            break
        plant = smaller
    return plant


def _one_mode_less(plant: Realization) -> Realization | None:
    A, n = plant.A, plant.n_states
    if n == 0:
        return None
    uncertain = eigenvalues_with_uncertainty(A)[1]
    decomposed: Any = scipy.linalg.eig(A, left=True, right=True)
    values, left, right = decomposed
    slack = 64.0 * n * _EPSILON
    for k in np.flatnonzero((np.abs(values.real) <= uncertain) & (values.imag >= 0.0)):
        w, v = left[:, k].conj(), right[:, k]
        real = values[k].imag <= uncertain[k]
        if np.all(np.abs(w @ plant.B1) <= slack * (np.abs(w) @ np.abs(plant.B1))):
            return _reduced(plant, np.atleast_2d(w.real) if real else np.array([w.real, w.imag]), True)
        if np.all(np.abs(plant.C1 @ v) <= slack * (np.abs(plant.C1) @ np.abs(v))):
            return _reduced(plant, np.atleast_2d(v.real) if real else np.array([v.real, v.imag]), False)
    return None


def _reduced(plant: Realization, vectors: FloatArray, uncontrollable: bool) -> Realization:
    """Eliminate as many states as there are vectors: left eigenvectors that no input moves, or right ones unseen.

    Elimination, unlike a rotation, leaves alone what does not take part: exact zeros of other modes stay.
    """
    count = len(vectors)
    pivots = np.sort(scipy.linalg.qr(vectors, pivoting=True, mode="r")[1][:count])
    rest = np.setdiff1d(np.arange(plant.n_states), pivots)
    ratio = np.linalg.solve(vectors[:, pivots], vectors[:, rest])
    A, B, C = plant.A, plant.B1, plant.C1
    if uncontrollable:
        embed = np.zeros((plant.n_states, rest.size))
        embed[rest], embed[pivots] = np.eye(rest.size), -ratio
        A, B, C = A[rest] @ embed, B[rest], C @ embed
    else:
        A = (A[rest] - ratio.T @ A[pivots])[:, rest]
        B, C = B[rest] - ratio.T @ B[pivots], C[:, rest]
    whole = np.block([[A, B], [C, plant.D11]])
    return Realization.from_matrix(whole, rest.size, 1, 1)
