r"""Frequencies at which a response should be sampled: where its features lie, densely where it moves fast."""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.delay_systems.roots import characteristic_roots

_MOST_POINTS = 20_000


def default_band(sys: DelaySystem) -> tuple[float, float]:
    """Return full decades (rad/s) around the rightmost roots, the plant's poles and the inverse delays."""
    loop = sys.folded
    sizes = np.abs(np.concatenate([loop.plant.eigenvalues, characteristic_roots(sys, 8), 1.0 / loop.delays]))
    sizes = sizes[sizes > 1e-8 * np.max(sizes, initial=0.0)]
    if sizes.size == 0:
        return 0.1, 10.0
    return 10.0 ** (np.floor(np.log10(sizes.min())) - 1.0), 10.0 ** (np.ceil(np.log10(sizes.max())) + 1.0)


def default_frequencies(sys: DelaySystem) -> FloatArray:
    """Return frequencies for a plot of the whole response: the default band, adaptively sampled."""
    return sampled_band(sys, *default_band(sys), step=0.1)


def sampled_band(
    sys: DelaySystem, lowest: float, highest: float, step: float = 0.2, most: int = _MOST_POINTS
) -> FloatArray:
    """Return frequencies between which no entry of the response moves by more than a fraction of its size.

    Parameters
    ----------
    sys : DelayLTI
        The system.
    lowest, highest : float
        Ends of the band (rad/s), positive.
    step : float, optional
        Largest change between neighbours relative to the larger of both; entries below 1e-3 of their peak are
        held to that floor instead.
    most : int, optional
        Refinement ends at this number of points.

    Returns
    -------
    ndarray of float
        Increasing frequencies (rad/s).
    """
    omega = np.geomspace(lowest, highest, 200)
    # no fewer than some points per turn of the longest delay, as far as the limit goes
    longest = float(np.max(sys.folded.delays, initial=0.0))
    if longest > 0.0:
        linear = np.arange(lowest, highest, max(0.7 / longest, 4.0 * (highest - lowest) / most))
        omega = np.union1d(omega, linear)
    values = _flat_response(sys, omega)
    for _ in range(12):
        size = np.abs(values)
        floor = 1e-3 * np.max(np.where(np.isfinite(size), size, 0.0), axis=1, keepdims=True)
        pair = np.maximum(np.maximum(size[:, :-1], size[:, 1:]), floor)
        with np.errstate(invalid="ignore"):
            moved = np.abs(np.diff(values, axis=1)) > step * pair
        coarse = np.flatnonzero(np.any(moved, axis=0))
        if coarse.size == 0 or omega.size + coarse.size > most:
            break
        middle = np.sqrt(omega[coarse] * omega[coarse + 1])
        omega = np.insert(omega, coarse + 1, middle)
        values = np.insert(values, coarse + 1, _flat_response(sys, middle), axis=1)
    return omega


def _flat_response(sys: DelaySystem, omega: FloatArray) -> np.ndarray:
    return np.asarray(sys(1j * omega, squeeze=False)).reshape(sys.noutputs * sys.ninputs, omega.size)
