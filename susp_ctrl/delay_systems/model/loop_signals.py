r"""The delayed signals of a loop: which of them are one, which are in a loop at all, and which make it neutral.

With the signals eliminated the loop is ``[[A, B], [C, D]]``, ``w = E z``. Two signals of the same delay are one
where their rows of ``[C, D]`` are multiples of each other, or their columns of ``[B; D]``: a Smith predictor sends
one control signal through the delay of the plant and through that of its model. A signal from which no chain of
transfers :math:`P_{kl} = D_{kl} + C_k (sI - A)^{-1} B_l` leads back to itself moves no root, nor do signals with
:math:`\det(I - P E) = 1`. Where terms cancel, both are so called only if at more points than a numerator can have
zeros nothing is left but what a relative change :math:`\epsilon` of every entry makes of it,

.. math:: |\delta P_{kl}| \le \epsilon \, \bigl(|D_{kl}| + |C_k R| \, (|s| I + |A|) \, |R B_l|\bigr),
   \qquad R = (sI - A)^{-1},

with :math:`\epsilon` the rounding of the sums themselves. The points lie beside every pole, so that a slow transfer is
not measured by the rounding of a fast one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model.folding import FoldedLoop
from susp_ctrl.delay_systems.model.perron import scaled_row_sums
from susp_ctrl.delay_systems.model.rounding import balancing, rounding_of_sums
from susp_ctrl.errors import NeutralLoopError

Points = NDArray[np.complexfloating[Any, Any]]

# Share of its terms that rounding may take of a sum which is to be told from zero.
_TELLING = 1e-6


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
    scale = balancing(np.abs(D))
    even = D * scale / scale[:, None]
    phases = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (8, channels))
    determinant = np.linalg.det(np.eye(channels) - even * np.exp(1j * phases)[:, None, :])
    size = np.linalg.det(np.eye(channels) + np.abs(even)) if channels < 12 else 1.0 + np.abs(even).sum()
    return bool(np.any(np.abs(determinant - 1.0) > 1e-12 * max(1.0, abs(size))))


def shared_lines(whole: FloatArray, n: int, delays: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unite signals of the same delay that are multiples of each other, or that act in the same direction.

    Where more signals than states are left of one delay, as many as states stand for them.

    Parameters
    ----------
    whole : ndarray, shape (n + m, n + m)
        ``[[A, B], [C, D]]``.
    n : int
        Number of states.
    delays : ndarray, shape (m,)
        Delay of each signal.
    """
    if np.unique(delays).size == delays.size:
        return whole, delays
    for turned in (False, True):
        # a signal that goes into several lines; then, in the transposed loop, lines that end in one place
        whole, delays = _united(whole.T if turned else whole, n, delays)
        whole = whole.T if turned else whole
    return _as_many_as_states(whole, n, delays)


def _united(whole: FloatArray, n: int, delays: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Let one signal stand for all of its delay whose rows are multiples of its row: their columns are added."""
    whole = whole.copy()
    kept = np.ones(delays.size, dtype=bool)
    for k in np.flatnonzero(_has_parallel(whole[n:], delays)):
        if not kept[k]:
            continue
        row = whole[n + k]
        pivot = int(np.argmax(np.abs(row)))
        others = np.flatnonzero(kept & (delays == delays[k]) & (np.arange(delays.size) > k))
        if others.size == 0 or row[pivot] == 0.0:
            continue
        ratio = whole[n + others, pivot] / row[pivot]
        multiple = np.all(
            np.abs(whole[n + others] - ratio[:, None] * row)
            <= 4.0 * np.finfo(float).eps * np.abs(ratio[:, None] * row),
            axis=1,
        )
        own, factors = np.append(n + k, n + others[multiple]), np.append(1.0, ratio[multiple])
        total, size = whole[:, own] @ factors, np.abs(whole[:, own]) @ np.abs(factors)
        whole[:, n + k] = np.where(np.abs(total) <= rounding_of_sums(own.size) * size, 0.0, total)
        kept[others[multiple]] = False
    chosen = np.append(np.arange(n), n + np.flatnonzero(kept))
    return whole[np.ix_(chosen, chosen)], delays[kept]


def _has_parallel(rows: FloatArray, delays: FloatArray) -> np.ndarray:
    """Tell which rows may be multiples of another of the same delay."""
    length = np.linalg.norm(rows, axis=1)
    unit = rows / np.where(length > 0.0, length, 1.0)[:, None]
    parallel = (np.abs(unit @ unit.T) > 1.0 - 1e-9) & (delays[:, None] == delays)
    np.fill_diagonal(parallel, False)
    return np.asarray(np.any(parallel, axis=1))


def _as_many_as_states(whole: FloatArray, n: int, delays: FloatArray) -> tuple[FloatArray, FloatArray]:
    kinds, group = np.unique(delays, return_inverse=True)
    shared = [np.flatnonzero(group == k) for k in range(kinds.size)]
    if np.any(whole[n:, n:]) or all(own.size <= n for own in shared):
        return whole, delays
    B, C, owner = [], [], []
    for k, own in enumerate(shared):
        into, out = whole[:n, n + own], whole[n + own, :n]
        wide = own.size > n
        B.append(into @ out if wide else into)
        C.append(np.eye(n) if wide else out)
        owner += [k] * C[-1].shape[0]
    m = len(owner)
    return np.block([[whole[:n, :n], np.hstack(B)], [np.vstack(C), np.zeros((m, m))]]), kinds[owner]


def signals_in_a_chain(whole: FloatArray, n: int) -> np.ndarray:
    """Return the delayed signals that a chain of non-zero entries of ``[[A, B], [C, D]]`` leads back to."""
    return np.flatnonzero(_on_a_cycle(whole != 0.0)[n:])


def signals_in_a_loop(whole: FloatArray, n: int, delays: FloatArray) -> np.ndarray:
    """Return the delayed signals that move roots: a chain of transfers leads back to them, and not in vain.

    A set of signals on common loops moves no root where ``det(I - P E) = 1`` for all s and E. Delays of the same
    sum may cancel each other there, so E is drawn on the line ``e^{-j nu tau_k}``.
    """
    m = delays.size
    if m == 0:
        return np.arange(0)
    points = _generic_points(np.linalg.eigvals(whole[:n, :n]))
    turns = np.random.default_rng(0).uniform(1.0, 50.0, points.size) / delays.max()
    connected, moving = whole[n:, n:] != 0.0, np.zeros(m, dtype=bool)
    for s, nu in zip(points, turns, strict=True):  # mostly the first point settles it
        P, error = _transfers(whole, n, complex(s))
        connected = connected | (np.abs(P) > error)
        _, component = connected_components(connected, directed=True, connection="strong")
        for k in np.unique(component[~moving]):
            own = np.flatnonzero(component == k)
            if own.size > 1 or connected[own[0], own[0]]:
                around = np.ix_(own, own)
                turned = np.any(moving[own]) or _turns(
                    P[around], error[around], np.exp(-1j * nu * delays[own])
                )
                moving[own] |= turned
        if np.all(moving):
            break
    return np.flatnonzero(moving)


def _generic_points(poles: NDArray[Any]) -> NDArray[Any]:
    """Return points at all scales of the poles and beside each, none of them a pole."""
    moduli = np.sort(np.abs(poles))[::-1]
    slow = 0.1 * float(np.min(moduli, where=moduli != 0.0, initial=np.inf))
    size = np.where(moduli == 0.0, slow if np.isfinite(slow) else 1.0, moduli)
    beside = size[np.argsort(np.argsort(-np.abs(poles)))] * 0.1 + 1j * poles.imag
    return np.concatenate([(0.6 + 0.8j) * size, beside, 2.0 * size])


def _transfers(whole: FloatArray, n: int, s: complex) -> tuple[Points, FloatArray]:
    """Return the transfers between the signals at s, and how far rounding may move each."""
    A, B, C, D = whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
    try:
        R: Points = np.linalg.inv(s * np.eye(n) - A)
    except np.linalg.LinAlgError:
        return np.ones(D.shape, dtype=complex), np.zeros(D.shape)
    out, into = C @ R, R @ B
    changed = np.abs(out) @ ((abs(s) * np.eye(n) + np.abs(A)) @ np.abs(into))
    terms = np.abs(D) + np.abs(C) @ np.abs(R) @ np.abs(B)
    error = rounding_of_sums(n) * (np.abs(D) + changed)
    # where rounding leaves too few digits nothing is called zero
    return out @ B + D, np.where(error <= _TELLING * terms, error, 0.0)


def _turns(P: Points, error: FloatArray, E: Points) -> bool:
    """Tell whether ``det(I - P E)`` differs from one by more than rounding."""
    M = P * E
    with np.errstate(all="ignore"):
        # by eigenvalues, so that a small gain keeps its digits beside the one
        excess = abs(np.expm1(np.sum(np.log1p(-np.linalg.eigvals(M)))))
        rows = scaled_row_sums(np.stack([np.abs(M), np.abs(M) + error]))
        terms, beyond = np.expm1(np.sum(np.log1p(rows), axis=1))
        unknown = beyond - terms + rounding_of_sums(E.size) * terms
    return bool(excess > unknown or not unknown <= _TELLING * min(1.0, float(rows[0].max())))


def _on_a_cycle(connected: np.ndarray) -> np.ndarray:
    """Tell which nodes of a directed graph lead back to themselves."""
    _, component = connected_components(connected, directed=True, connection="strong")
    return np.asarray((np.bincount(component)[component] > 1) | np.diag(connected))
