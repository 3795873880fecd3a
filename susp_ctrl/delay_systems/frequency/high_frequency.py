r"""Leading terms of a response at high frequency, as sums of delayed constants.

.. math:: H(s) = D(e^{-s\tau}) + M(e^{-s\tau})/s + O(s^{-2}), \qquad M = \tilde C \tilde B

with :math:`\tilde C = C_1 + D_{12} E (I - D_{22} E)^{-1} C_2` and
:math:`\tilde B = B_1 + B_2 E (I - D_{22} E)^{-1} D_{21}`. Direct paths end after finitely many delays, so D and M
are finite sums :math:`\sum_a M_a e^{-s T_a}`.
"""

from __future__ import annotations

import numpy as np
from scipy.special import sici

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import FoldedLoop

DelayedSum = dict[float, FloatArray]


def leading_terms(loop: FoldedLoop) -> tuple[DelayedSum, DelayedSum]:
    """Return D and M of the expansion, as matrices by delay (s)."""
    plant, tau = loop
    into_output, into_state = {0.0: plant.C1}, {0.0: plant.B1}
    direct: DelayedSum = {0.0: plant.D11}
    # row k of a path: what enters the delayed signal k now and leaves it tau_k later
    paths: list[tuple[float, int, FloatArray]] = [(t, k, np.eye(tau.size)[k]) for k, t in enumerate(tau)]
    for total, last, entering in _direct_paths(paths, plant.D22, tau):
        _accumulate(into_output, total, np.outer(plant.D12[:, last], entering @ plant.C2))
        _accumulate(into_state, total, np.outer(plant.B2[:, last], entering @ plant.D21))
        _accumulate(direct, total, np.outer(plant.D12[:, last], entering @ plant.D21))
    first: DelayedSum = {}
    for t1, C in into_output.items():
        for t2, B in into_state.items():
            _accumulate(first, t1 + t2, C @ B)
    return direct, {t: M for t, M in first.items() if np.any(M != 0.0)} or {0.0: plant.C1 @ plant.B1}


def squared_tail(first: DelayedSum, edge: float) -> float:
    r"""Return :math:`\int_{edge}^\infty \|M\|_F^2/\omega^2 d\omega` in closed form.

    .. math:: \int_\Omega^\infty \frac{\cos \omega T}{\omega^2} d\omega
              = \frac{\cos \Omega T}{\Omega} - T \left(\frac{\pi}{2} - \mathrm{Si}(\Omega T)\right)
    """
    taus = np.array(list(first))
    flat = np.array([M.ravel() for M in first.values()])
    products = flat @ flat.T
    T = np.abs(taus[:, None] - taus)
    integrals = np.cos(edge * T) / edge - T * (0.5 * np.pi - sici(edge * T)[0])
    return float((products * integrals).sum())


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
