r"""Spectral discretisation of the delayed signals.

A delay is a transport line: with :math:`v(\theta, t) = z(t + \theta)` on :math:`-\tau \le \theta \le 0`,

.. math:: \partial_t v = \partial_\theta v, \qquad v(0, t) = z(t), \qquad w(t) = v(-\tau, t).

Collocation at N Chebyshev points besides the inlet makes it N ordinary states. Only the m delayed signals are
discretised, not the n states: n + m N unknowns instead of n (N + 1), and never more lines than states. The
rational function that stands for :math:`e^{-s\tau}` is accurate to many digits for :math:`|s|\tau/2` a few units
below N, in the right half plane and to the left of it as long as :math:`|e^{-s\tau}|` is moderate.

References
----------
.. [1] D. Breda, S. Maset, R. Vermiglio, "Pseudospectral differencing methods for characteristic roots of delay
   differential equations", SIAM J. Sci. Comput. 27(2), 2005.
.. [2] L. N. Trefethen, "Spectral Methods in MATLAB", SIAM, 2000, chapter 6.
"""

from __future__ import annotations

from functools import lru_cache

import control
import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.approximation.delay_bank import (
    OneDelay,
    Orders,
    channel_orders,
    with_delays_replaced,
)
from susp_ctrl.delay_systems.model import CharacteristicMatrix, DelaySystem

HIGHEST_ORDER = 400


def spectral_approximation(sys: DelaySystem, order: Orders) -> control.StateSpace:
    """Replace every delay by a transport line with `order` Chebyshev points.

    Parameters
    ----------
    sys : DelayLTI
        System with exact delays.
    order : int or sequence of int, shape (n_delays,)
        Number of points for all delays, or one for each of ``sys.delays``; 1 to 400. A delay of zero or without
        effect adds no states.

    Returns
    -------
    control.StateSpace
        Inputs and outputs as in `sys`; its states are those of `sys`, then `order` for each delayed signal.

    Raises
    ------
    InputError
        An order outside 1 to 400, or not one for each delay.

    Notes
    -----
    The characteristic roots converge faster than any power of the order [1]_, which needs to be somewhat above
    ``omega tau / 2`` at the highest frequency that matters. Unlike Padé the line is no all-pass: it damps what it
    does not resolve.

    References
    ----------
    .. [1] D. Breda, S. Maset, R. Vermiglio, SIAM J. Sci. Comput. 27(2), 2005.
    """
    sys = DelaySystem.of(sys, "sys")
    return with_delays_replaced(sys, channel_orders(sys, order, HIGHEST_ORDER), _transport_line, "line")


def discretized_matrix(K: CharacteristicMatrix, radius: float, largest: int) -> FloatArray:
    """Return a matrix whose eigenvalues approximate the roots of K, accurate up to |s| of about `radius`.

    Parameters
    ----------
    K : CharacteristicMatrix
        Characteristic matrix of the loop, with at least one delayed signal.
    radius : float
        Modulus (rad/s) up to which the delays are resolved.
    largest : int
        Order of the matrix that is not exceeded; the delays are then resolved less far.

    Notes
    -----
    There is one line for each delayed signal, or, where the signals depend on fewer combinations of the states
    (a delayed matrix of full rank, one signal with several delays), one for each combination, tapped at every
    delay.
    """
    per_signal = np.ceil(0.5 * radius * K.delays) + 6.0
    rank = np.linalg.matrix_rank(K.C) if not np.any(K.D) else K.n_channels
    per_combination = np.ceil(0.5 * radius * K.delays.max()) + 6.0
    room = max(largest - K.n_states, 4 * K.n_channels)
    if rank * per_combination < per_signal.sum():
        return _tapped_lines(K, int(rank), int(min(per_combination, room // rank)))
    if per_signal.sum() > room:
        per_signal = np.minimum(per_signal, room // K.n_channels)
    return _separate_lines(K, per_signal.astype(int))


def _separate_lines(K: CharacteristicMatrix, points: np.ndarray) -> FloatArray:
    """One line for each delayed signal, as long as its delay."""
    n, size = K.n_states, K.n_states + int(np.sum(points))
    M = np.zeros((size, size))
    M[:n, :n] = K.A
    starts = n + np.concatenate([[0], np.cumsum(points)]).astype(int)
    outlets = starts[1:] - 1
    for k, (N, tau) in enumerate(zip(points, K.delays, strict=True)):
        line, inlet, *_ = _transport_line(int(N), float(tau))
        rows = slice(starts[k], starts[k + 1])
        M[rows, rows] = line
        M[rows, :n] = inlet * K.C[k]
        M[rows, outlets] += inlet * K.D[k]
    M[:n, outlets] = K.B
    return M


def _tapped_lines(K: CharacteristicMatrix, rank: int, points: int) -> FloatArray:
    """One line for each of `rank` combinations of the states, as long as the longest delay."""
    _, values, right = np.linalg.svd(K.C, full_matrices=False)
    combinations = values[:rank, None] * right[:rank]
    mixing = np.linalg.lstsq(combinations.T, K.C.T, rcond=None)[0].T
    longest = float(K.delays.max())
    line, inlet, *_ = _transport_line(points, longest)
    n = K.n_states
    M = np.zeros((n + rank * points, n + rank * points))
    M[:n, :n] = K.A
    for tau in np.unique(K.delays):
        shared = K.delays == tau
        into_state = K.B[:, shared] @ mixing[shared]
        taps = _interpolation(points, 1.0 - 2.0 * float(tau) / longest)
        M[:n, :n] += taps[0] * into_state @ combinations
        M[:n, n:] += np.kron(into_state, taps[1:])
    M[n:, :n] = np.kron(combinations, inlet)
    M[n:, n:] = np.kron(np.eye(rank), line)
    return M


def _interpolation(degree: int, x: float) -> FloatArray:
    """Weights of the values at the Chebyshev points for the value at x, by the barycentric formula."""
    j = np.arange(degree + 1)
    distance = x - np.cos(j * np.pi / degree)
    if np.min(np.abs(distance)) < 1e-14:
        return (np.abs(distance) < 1e-14).astype(float)
    weights = np.where((j == 0) | (j == degree), 0.5, 1.0) * (-1.0) ** j / distance
    return np.asarray(weights / weights.sum())


def _transport_line(points: int, delay: float) -> OneDelay:
    """One line: from the signal that enters it to the one that leaves it."""
    D = chebyshev_differentiation(points) * (2.0 / delay)
    return OneDelay(D[1:, 1:], D[1:, :1], np.eye(1, points, points - 1), np.zeros((1, 1)))


@lru_cache(maxsize=256)
def chebyshev_differentiation(degree: int) -> FloatArray:
    """Differentiation matrix on ``cos(j pi/degree)``, j = 0 to degree.

    The differences of nodes are products of sines and the diagonal is minus the sum of its row, which keeps
    rounding small at high degree.
    """
    j = np.arange(degree + 1)
    angle = np.pi / (2.0 * degree)
    difference = 2.0 * np.sin((j[:, None] + j) * angle) * np.sin((j - j[:, None]) * angle)
    np.fill_diagonal(difference, 1.0)
    weight = np.where((j == 0) | (j == degree), 2.0, 1.0) * (-1.0) ** j
    D = (weight[:, None] / weight) / difference
    np.fill_diagonal(D, 0.0)
    np.fill_diagonal(D, -D.sum(axis=1))
    D.setflags(write=False)
    return D
