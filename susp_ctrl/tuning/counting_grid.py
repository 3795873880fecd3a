"""Frequencies along which the roots of a whole box of designs are counted."""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import small_gain_of_samples
from susp_ctrl.delay_systems.model import Realization, around_resonances, sample_plant

GRID_POINTS = 3000
POINTS_PER_POLE = 300


def counting_grid(
    realization: Realization, limits: FloatArray, level: float
) -> tuple[FloatArray, FloatArray]:
    """Return frequencies from zero on and ``rho(|P22(jw)| diag(limits))`` there.

    Parameters
    ----------
    realization : Realization
        The open plant; only its delayed signals count.
    limits : ndarray, shape (m,)
        Largest magnitude of each channel's gain.
    level : float
        Above the last frequency the radius is proven to stay below this level, by
        ``|C_i (jw - A)^-1 B_k| <= |C_i| |B_k| / (w - |A|)`` in balanced coordinates.

    Returns
    -------
    grid, radius : ndarray
    """
    grid = _grid(realization, _top_frequency(realization, limits, level))
    p22 = sample_plant(realization, 1j * grid).p22
    return grid, small_gain_of_samples(p22[:, None], limits[None])


def _top_frequency(r: Realization, limits: FloatArray, level: float) -> float:
    T, to_basis, from_basis = r.schur
    into, out = to_basis @ r.B2, r.C2 @ from_basis
    reach = np.linalg.norm(out, axis=1)[:, None] * np.linalg.norm(into, axis=0) * limits
    size = float(np.linalg.norm(T, 2)) if r.n_states else 0.0
    gap = max(size, 1.0)
    while small_gain_of_samples((np.abs(r.D22) * limits + reach / gap)[None], np.ones(limits.size)) >= level:
        gap *= 2.0
    return size + gap


def _grid(r: Realization, top: float) -> FloatArray:
    """Zero, a logarithmic grid, and points around every resonance as dense as it is narrow."""
    poles = r.eigenvalues[r.eigenvalues.imag > 0]
    low = min([*np.abs(r.eigenvalues), 1.0]) * 1e-2
    bells = around_resonances(poles, np.tan(np.linspace(-1.5, 1.5, POINTS_PER_POLE)))
    grid = np.concatenate([[0.0], np.geomspace(max(low, 1e-9 * top), top, GRID_POINTS), bells])
    return np.unique(grid[(grid >= 0) & (grid <= top)])
