r"""Transmission zeros of square systems with delays: zeros of det H(s), found on the exact function.

The zeros of the spectral approximation are starting values; Newton with the exact logarithmic derivative

.. math:: \frac{d}{ds} \log\det H = \mathrm{tr}(H^{-1} H')

corrects them, and those that do not converge are dropped.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from susp_ctrl import validation
from susp_ctrl.delay_systems.approximation import spectral_approximation
from susp_ctrl.delay_systems.frequency.frequency_range import default_band
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.errors import InputError

_STEPS = 30
_MOST_ZEROS = 1000


class NotSquareError(InputError, NotImplementedError):
    """Zeros asked of a system with different numbers of inputs and outputs (python-control catches the latter)."""


def transmission_zeros(sys: DelaySystem, count: int = 8) -> np.ndarray:
    """Return the rightmost zeros of ``det H(s)`` by descending real part.

    Parameters
    ----------
    sys : DelayLTI
        Square system.
    count : int, optional
        Number wanted, at least 1; a complex pair is never split.

    Raises
    ------
    InputError
        Numbers of inputs and outputs differ.

    Notes
    -----
    Unlike the characteristic roots the zeros are not checked for completeness.
    """
    wanted = validation.integer("count", count, at_least=1, at_most=_MOST_ZEROS)
    if sys.ninputs != sys.noutputs:
        raise InputError(
            f"sys has {sys.ninputs} inputs and {sys.noutputs} outputs: zeros need as many of both"
        )
    longest = float(np.max(sys.folded.delays, initial=0.0))
    reach = default_band(sys)[1] / 10.0 + 2.0 * np.pi * wanted / longest if longest else 0.0
    points = int(np.clip(0.7 * reach * longest + 12, 12, 80))
    approximation = spectral_approximation(sys, points)
    if approximation.nstates == 0:
        return np.zeros(0, dtype=complex)
    starts = _invariant_zeros(approximation)
    # beyond this the approximation does not resolve the delays
    resolved = 1.2 * points / longest if longest else np.inf
    starts = starts[(starts.imag >= -1e-9 * (1.0 + np.abs(starts))) & (np.abs(starts) < resolved)]
    upper = _distinct(_newton(sys, starts))
    upper = upper[_rightmost_first(upper)]
    stands_for = np.cumsum(np.where(upper.imag > 0.0, 2, 1))
    upper = upper[: int(np.searchsorted(stands_for, wanted)) + 1]
    zeros = np.concatenate([upper, upper[upper.imag > 0.0].conj()])
    return zeros[_rightmost_first(zeros)]


def _rightmost_first(points: np.ndarray) -> np.ndarray:
    """Order by descending real part; equal ones (to rounding) by distance from the real axis, pairs together."""
    grid = 1e-8 * (1.0 + np.max(np.abs(points), initial=0.0))
    return np.lexsort((-points.imag, np.round(np.abs(points.imag) / grid), -np.round(points.real / grid)))


def _invariant_zeros(system: object) -> np.ndarray:
    """Finite generalised eigenvalues of the Rosenbrock pencil."""
    A, B, C, D = (np.asarray(getattr(system, name)) for name in "ABCD")
    n, m = A.shape[0], B.shape[1]
    pencil = np.block([[A, B], [C, D]])
    mass = scipy.linalg.block_diag(np.eye(n), np.zeros((m, m)))
    with np.errstate(all="ignore"):
        values = scipy.linalg.eigvals(pencil, mass)
    return values[np.isfinite(values) & (np.abs(values) < 1e8 * (1.0 + np.linalg.norm(A)))]


def _newton(sys: DelaySystem, s: np.ndarray) -> np.ndarray:
    """Newton on det H for all starts at once; keep those that converge to a zero of small imaginary rounding."""
    scale = 1.0 + np.abs(s)
    step = np.full(s.shape, np.inf, dtype=complex)
    origin = s
    for _ in range(_STEPS):
        with np.errstate(all="ignore"):
            slope = _logarithmic_derivative(sys, s, 1e-5 * scale)
            step = np.where(np.isfinite(slope) & (slope != 0.0), 1.0 / slope, 0.0)
        # never further than the starting values can be off
        step = step * np.minimum(1.0, 0.5 * scale / np.maximum(np.abs(step), 1e-300))
        s = s - step
    with np.errstate(all="ignore"):
        near = np.linalg.det(np.moveaxis(sys(s, squeeze=False), -1, 0))
        beside = np.linalg.det(np.moveaxis(sys(s + 1e-3 * scale, squeeze=False), -1, 0))
    zero = np.abs(near) < 1e-6 * np.abs(beside)
    kept = zero & (np.abs(s - origin) < scale) & (np.abs(step) < 1e-8 * scale)
    s = s[kept]
    return np.where(np.abs(s.imag) < 1e-9 * (1.0 + np.abs(s)), s.real + 0j, s)


def _logarithmic_derivative(sys: DelaySystem, s: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Derivative of log det H by central differences along both axes (error of order h^4).

    At a double zero H and H' vanish together, and ``tr(H^-1 H')`` is rounding; the differences keep their digits there.
    """
    offsets = h * np.array([[1.0], [1j], [-1.0], [-1j]])
    points = np.concatenate([s, (s + offsets).ravel()])
    determinants = np.linalg.det(np.moveaxis(sys(points, squeeze=False), -1, 0)).reshape(5, s.size)
    centre, around = determinants[0], determinants[1:]
    derivative = (around * np.array([[1.0], [-1j], [-1.0], [1j]])).sum(axis=0) / (4.0 * h)
    return derivative / centre


def _distinct(points: np.ndarray) -> np.ndarray:
    kept: list[complex] = []
    for point in points:
        if point.imag < 0.0:
            continue
        if all(abs(point - other) > 1e-7 * (1.0 + abs(point)) for other in kept):
            kept.append(complex(point))
    return np.array(kept, dtype=complex)
