r"""Small gain over a box of gains: stability of every design in it, whatever its delays.

For a stable plant P without delayed feed-through around the loop, and gains :math:`|g_k| \le \bar g_k`,

.. math:: \sup_\omega \rho\bigl(|P_{22}(j\omega)|\,\mathrm{diag}(\bar g)\bigr) < 1

keeps every root in the left half plane: with :math:`|e_k| \le \bar g_k` the eigenvalues of
:math:`P_{22} E` stay inside the unit circle (Perron-Frobenius), so no root can reach the axis while the gains
grow from zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from susp_ctrl.delay_systems.lft import Realization, sample_plant

FloatArray = NDArray[np.float64]

GRID_POINTS = 3000
POINTS_PER_POLE = 300
PEAKS_REFINED = 5


@dataclass(frozen=True, eq=False)
class SmallGain:
    """Spectral radius of |P22| diag(limits) over frequency.

    Attributes
    ----------
    supremum : float
        Largest value; below 1 every delay is harmless (for a stable plant).
    omega : float
        Where it is attained (rad/s).
    grid, radius : ndarray
        The frequencies searched and the values there.
    """

    supremum: float
    omega: float
    grid: FloatArray
    radius: FloatArray


def perron_radius(matrix: FloatArray) -> FloatArray:
    """Return the spectral radius of non-negative matrices, shape (..., m, m); m = 1, 2 in closed form."""
    size = matrix.shape[-1]
    if size == 1:
        return matrix[..., 0, 0]
    if size == 2:
        middle = (matrix[..., 0, 0] + matrix[..., 1, 1]) / 2
        apart = (matrix[..., 0, 0] - matrix[..., 1, 1]) / 2
        return middle + np.sqrt(apart**2 + matrix[..., 0, 1] * matrix[..., 1, 0])
    return np.abs(np.linalg.eigvals(matrix)).max(axis=-1)


def search_small_gain(realization: Realization, limits: FloatArray, level: float) -> SmallGain:
    """Search all frequencies for the largest spectral radius of ``|P22(jw)| diag(limits)``.

    Parameters
    ----------
    realization : Realization
        The open plant; only its delayed signals count.
    limits : ndarray, shape (m,)
        Largest magnitude of each channel's gain.
    level : float
        Above the last grid frequency the radius is proven to stay below this level, by
        ``|C_i (jw - A)^-1 B_k| <= |C_i| |B_k| / (w - |A|)`` in balanced coordinates.

    Returns
    -------
    SmallGain
    """
    grid = _grid(realization, _top_frequency(realization, limits, level))

    def radius(omega: FloatArray) -> FloatArray:
        return perron_radius(np.abs(sample_plant(realization, 1j * omega).p22) * limits)

    values = radius(grid)
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1
    best, where = float(values.max()), float(grid[values.argmax()])
    for k in inner[np.argsort(-values[inner])][:PEAKS_REFINED]:
        peak = minimize_scalar(
            lambda w: -float(radius(np.array([w]))[0]),
            bounds=(grid[k - 1], grid[k + 1]),
            method="bounded",
            options={"xatol": 1e-9 * grid[k + 1]},
        )
        if -peak.fun > best:
            best, where = -float(peak.fun), float(peak.x)
    return SmallGain(best, where, grid, values)


def _top_frequency(r: Realization, limits: FloatArray, level: float) -> float:
    T, to_basis, from_basis = r.schur
    into, out = to_basis @ r.B2, r.C2 @ from_basis
    reach = np.linalg.norm(out, axis=1)[:, None] * np.linalg.norm(into, axis=0) * limits
    size = float(np.linalg.norm(T, 2)) if r.n_states else 0.0
    gap = max(size, 1.0)
    while perron_radius(np.abs(r.D22) * limits + reach / gap) >= level:
        gap *= 2.0
    return size + gap


def _grid(r: Realization, top: float) -> FloatArray:
    """Zero, a logarithmic grid, and points around every resonance as dense as it is narrow."""
    poles = r.eigenvalues[r.eigenvalues.imag > 0]
    low = min([*np.abs(r.eigenvalues), 1.0]) * 1e-2
    around = np.tan(np.linspace(-1.5, 1.5, POINTS_PER_POLE))
    bells = (poles.imag[:, None] + np.abs(poles.real)[:, None] * around).ravel()
    grid = np.concatenate([[0.0], np.geomspace(max(low, 1e-9 * top), top, GRID_POINTS), bells])
    return np.unique(grid[(grid >= 0) & (grid <= top)])
