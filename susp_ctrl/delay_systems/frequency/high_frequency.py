r"""Leading terms of a response at high frequency, as sums of delayed constants.

.. math:: H(s) = D(e^{-s\tau}) + \sum_{k \ge 1} M_k(e^{-s\tau})/s^k, \qquad M_k = \tilde C \tilde A^{k-1} \tilde B

with :math:`\tilde C = C_1 + D_{12} E (I - D_{22} E)^{-1} C_2`,
:math:`\tilde B = B_1 + B_2 E (I - D_{22} E)^{-1} D_{21}` and
:math:`\tilde A = A + B_2 E (I - D_{22} E)^{-1} C_2`. Direct paths end after finitely many delays, so D and all M_k
are finite sums :math:`\sum_a M_{ka} e^{-s T_a}`.
"""

from __future__ import annotations

import numpy as np
from scipy.special import sici

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import FoldedLoop

DelayedSum = dict[float, FloatArray]

_ORDERS = 3
# Pairs of delays that are multiplied at most for one order.
_MOST_TERMS = 1000


def leading_terms(loop: FoldedLoop) -> tuple[DelayedSum, list[DelayedSum]]:
    """Return D and ``[M_1, M_2, M_3]``, matrices by delay (s); only M_1 where the others have too many delays."""
    plant, tau = loop
    into_output, into_state, around = {0.0: plant.C1}, {0.0: plant.B1}, {0.0: plant.A}
    direct: DelayedSum = {0.0: plant.D11}
    # row k of a path: what enters the delayed signal k now and leaves it tau_k later
    paths: list[tuple[float, int, FloatArray]] = [(t, k, np.eye(tau.size)[k]) for k, t in enumerate(tau)]
    for total, last, entering in _direct_paths(paths, plant.D22, tau):
        _accumulate(into_output, total, np.outer(plant.D12[:, last], entering @ plant.C2))
        _accumulate(into_state, total, np.outer(plant.B2[:, last], entering @ plant.D21))
        _accumulate(around, total, np.outer(plant.B2[:, last], entering @ plant.C2))
        _accumulate(direct, total, np.outer(plant.D12[:, last], entering @ plant.D21))
    terms: list[DelayedSum] = []
    for order in range(_ORDERS):
        if len(into_output) * len(into_state) > _MOST_TERMS:
            return direct, terms[:1]
        terms.append(_product(into_output, into_state))
        if order + 1 < _ORDERS:
            into_state = _product(around, into_state)
    return direct, terms


def squared_tail(terms: list[DelayedSum], edge: float) -> float:
    r"""Return :math:`\int_{edge}^\infty \|\sum_k M_k/(j\omega)^k\|_F^2 d\omega` in closed form, up to omega^-4.

    .. math:: \|M_1\|^2 \omega^{-2} - 2\, \mathrm{Im}\langle M_1, M_2\rangle\, \omega^{-3}
              + (\|M_2\|^2 - 2\, \mathrm{Re}\langle M_1, M_3\rangle)\, \omega^{-4}

    each a sum over pairs of delays of the integrals of :math:`\cos(\omega T)/\omega^k` and
    :math:`\sin(\omega T)/\omega^k`.
    """
    first, *higher = terms
    total = _pairs(first, first, edge, 2)[0]
    if higher:
        second, third = higher
        total += 2.0 * _pairs(first, second, edge, 3)[1]
        total += _pairs(second, second, edge, 4)[0] - 2.0 * _pairs(first, third, edge, 4)[0]
    return total


def _pairs(one: DelayedSum, other: DelayedSum, edge: float, power: int) -> tuple[float, float]:
    """Sum the products of two delayed sums times the integrals of ``cos(omega T)`` and ``sin(omega T)``."""
    T = np.array(list(one))[:, None] - np.array(list(other))
    products = np.array([M.ravel() for M in one.values()]) @ np.array([M.ravel() for M in other.values()]).T
    cosine, sine = _integrals(np.abs(T), edge, power)
    return float((products * cosine).sum()), float((products * np.sign(T) * sine).sum())


def _integrals(T: FloatArray, edge: float, power: int) -> tuple[FloatArray, FloatArray]:
    r"""Return the integrals of ``cos(omega T) omega^-k`` and of the sine from the edge on, by parts from k = 1."""
    angle = edge * T
    si, ci = sici(angle)
    cosine, sine = np.where(T > 0.0, -ci, 0.0), np.where(T > 0.0, 0.5 * np.pi - si, 0.0)
    for k in range(2, power + 1):
        share = edge ** (1.0 - k) / (k - 1)
        cosine, sine = (
            np.cos(angle) * share - T * sine / (k - 1),
            np.sin(angle) * share + T * cosine / (k - 1),
        )
    return cosine, sine


def _product(left: DelayedSum, right: DelayedSum) -> DelayedSum:
    """Multiply two delayed sums; what is zero is left out, but for one term."""
    result: DelayedSum = {}
    for t1, A in left.items():
        for t2, B in right.items():
            _accumulate(result, t1 + t2, A @ B)
    kept = {t: M for t, M in result.items() if np.any(M != 0.0)}
    return kept or {0.0: next(iter(result.values()))}


def _direct_paths(
    paths: list[tuple[float, int, FloatArray]], D22: FloatArray, tau: FloatArray
) -> list[tuple[float, int, FloatArray]]:
    """Extend paths through the delayed signals by what passes directly from one to the next, to the end."""
    found = list(paths)
    for _ in range(tau.size):
        paths = [
            (total + tau[k], int(k), D22[k, last] * entering)
            for total, last, entering in paths
            for k in np.flatnonzero(D22[:, last])
        ]
        if not paths:
            break
        found += paths
    return found


def _accumulate(terms: DelayedSum, delay: float, matrix: FloatArray) -> None:
    """Add a term; delays equal to rounding are one."""
    for known in terms:
        if abs(known - delay) <= 1e-12 * max(known, delay):
            terms[known] = terms[known] + matrix
            return
    terms[float(delay)] = matrix
