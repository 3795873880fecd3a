"""Unstable roots by the winding number of det(sI - A0 - sum A_k e^{-s tau_k}), on the matrices as they are.

Independent of the package: no realisation, no bounds. The phase is followed on a grid that is refined until no step
turns by more than a fraction of a radian, halves included; the outer radius follows from norms.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

_TURN = 0.35
_FINEST = 60


def unstable_roots(A, delays):
    """Return the number of roots in the right half plane."""
    A = [np.asarray(matrix, dtype=float) for matrix in A]
    tau = np.asarray(delays, dtype=float)
    n = A[0].shape[0]
    # states in even units, for the norms only matter here; one unit of time
    sizes = sum(np.abs(matrix) for matrix in A)
    scale = np.diag(scipy.linalg.matrix_balance(sizes, permute=False)[1])
    A = [matrix / scale[:, None] * scale for matrix in A]
    top = 2.0 * n * sum(np.linalg.norm(matrix, 2) for matrix in A) + 1e-300
    grid = np.unique(np.concatenate([[0.0], np.geomspace(1e-14 * top, top, 1500), np.linspace(0, top, 400)]))
    if tau.size and tau.max() > 0:
        slow = np.arange(0.0, min(top, 3.0 * max(np.linalg.norm(m, 2) for m in A)), 0.5 / tau.max())
        grid = np.unique(np.concatenate([grid, slow[:20000]]))
    phase = _phase(A, tau, grid)
    for _ in range(_FINEST):
        turn = np.abs(np.angle(phase[1:] / phase[:-1]))
        wide = np.flatnonzero(turn > _TURN)
        wide = wide[np.diff(grid)[wide] > 4e-16 * grid[wide + 1]]
        if not wide.size:
            break
        middle = 0.5 * (grid[wide] + grid[wide + 1])
        grid = np.insert(grid, wide + 1, middle)
        phase = np.insert(phase, wide + 1, _phase(A, tau, middle))
    else:
        raise ArithmeticError("a root on the axis")
    along = np.angle(phase[1:] / phase[:-1]).sum()
    # beyond the top det K behaves as s^n; its phase there differs from n pi/2 by less than a quarter turn
    outer = np.angle(phase[-1] / 1j**n)
    turns = 0.5 * n + (outer - along) / np.pi
    if not abs(turns - np.rint(turns)) < 1e-6:
        raise ArithmeticError(f"{turns} roots")
    return round(turns)


def _phase(A, tau, omega):
    result = np.empty(omega.size, dtype=complex)
    for start in range(0, omega.size, 4000):
        w = omega[start : start + 4000]
        K = 1j * w[:, None, None] * np.eye(A[0].shape[0]) - A[0]
        for matrix, delay in zip(A[1:], tau, strict=True):
            K = K - matrix * np.exp(-1j * w * delay)[:, None, None]
        result[start : start + 4000] = np.linalg.slogdet(K)[0]
    return result
