"""Bounds on the spectral radius of non-negative matrices, after Perron and Frobenius.

For any x > 0 the largest of ``(M x)_i / x_i`` is not below it (Collatz and Wielandt), and near it where x is near the
Perron vector. What bounds the size of complex matrices entry by entry bounds their spectral radius in this way.
"""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model.rounding import balancing


def perron_bound(matrices: FloatArray) -> FloatArray:
    """Return a rigorous upper bound, close to it, on the spectral radius of non-negative matrices."""
    if matrices.shape[-1] == 1:
        return matrices[..., 0, 0]
    if matrices.shape[-1] == 2:
        a, b, c, d = matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 0], matrices[..., 1, 1]
        with np.errstate(invalid="ignore"):
            return 0.5 * (a + d) + np.sqrt(0.25 * (a - d) ** 2 + b * c)
    # Collatz and Wielandt: the largest row sum after any diagonal scaling is an upper bound.
    with np.errstate(all="ignore"):
        return scaled_row_sums(matrices).max(axis=-1)


def scaled_row_sums(X: FloatArray) -> FloatArray:
    """Return the row sums of non-negative matrices after a diagonal scaling that makes them nearly equal.

    Neither the determinant nor the spectral radius depends on the scaling of the channels.
    """
    if X.shape[-1] == 1:
        return X[:, 0]
    if X.shape[-1] == 2:
        # The Perron vector in closed form, as the sum of its two expressions.
        room = perron_bound(X)
        x = np.stack([X[..., 0, 1] + (room - X[..., 1, 1]), X[..., 1, 0] + (room - X[..., 0, 0])], axis=-1)
        x = np.maximum(x, 1e-12 * room[..., None] + 1e-300)
        x = x / x.max(axis=-1, keepdims=True) + 1e-9
        return (X @ x[..., None])[..., 0] / x
    x = np.ones(X.shape[:-1])
    for _ in range(6):
        image = (X @ x[..., None])[..., 0]
        # the share kept damps what alternates and keeps x positive; all of it follows the size of X
        x = image / np.maximum(image.max(axis=-1, keepdims=True), 1e-300) + 1e-2 * x
    return (X @ x[..., None])[..., 0] / x


# A bound that is not zero is at least this: below, products leave the range of numbers.
_LEAST = 1e-290


def certified_radius(M: FloatArray) -> float:
    """Return a number not below the spectral radius of a non-negative matrix, within about one percent of it.

    It is infinite where entries or sums of them leave the range of numbers.
    """
    n = M.shape[0]
    if not np.all(np.isfinite(M)):
        return np.inf
    units = balancing(M)
    M = M / units[:, None] * units
    with np.errstate(over="ignore", invalid="ignore"):
        candidate = 1.01 * float(np.max(np.abs(np.linalg.eigvals(M)))) + 1e-6 * float(np.linalg.norm(M) / n)
        if candidate == 0.0:
            return 0.0
        candidate = max(candidate, _LEAST)
        while candidate < np.inf:
            # x > 0 with M x < candidate x certifies the bound (Collatz and Wielandt)
            x = np.linalg.solve(candidate * np.eye(n) - M, np.ones(n))
            if np.all(x > 0) and np.all(M @ x < candidate * x):
                break
            candidate *= 1.1
    return candidate
