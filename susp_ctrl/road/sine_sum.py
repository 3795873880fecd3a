r"""Fast evaluation of sum_i a_i sin(omega_i t + phi_i) at many times.

The direct sum costs one sine per line and time. Here the time axis is cut into blocks of width W with
omega_max W / 2 = 10 rad. In every block the sum is a band-limited function, which its values at M = 38
Chebyshev nodes give everywhere to rounding error: the Chebyshev coefficients of e^{i z x} are Bessel
functions, and J_38(10) < 1e-18. At the nodes T_b + d_m, shared by all blocks,

    sin(omega (T_b + d_m) + phi) = sin(omega T_b + phi) cos(omega d_m) + cos(omega T_b + phi) sin(omega d_m)

is two matrix products. Then each time costs M multiplications whatever the number of lines.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from susp_ctrl.arrays import FloatArray

_HALF_WIDTH = 10.0  # omega_max times half a block (rad)
_NODES = 38
_TIMES_AT_ONCE = 16384  # bounds the working memory to some tens of MB for some hundreds of lines


def sine_sum(t: FloatArray, omegas: FloatArray, amplitudes: FloatArray, phases: FloatArray) -> FloatArray:
    """Return sum_i amplitudes_i sin(omegas_i t + phases_i) for times of any shape.

    Parameters
    ----------
    t : ndarray
        Times (s).
    omegas, amplitudes, phases : ndarray, shape (lines,)
        rad/s (positive), any unit, rad.

    Returns
    -------
    ndarray
        Of the shape of `t`; the error is a few rounding errors of the amplitudes' sum and of omega t.
    """
    flat = np.ravel(t)
    result = np.empty(flat.size)
    for start in range(0, flat.size, _TIMES_AT_ONCE):
        part = slice(start, start + _TIMES_AT_ONCE)
        result[part] = _evaluate(flat[part], omegas, amplitudes, phases)
    return result.reshape(np.shape(t))


def _evaluate(t: FloatArray, omegas: FloatArray, amplitudes: FloatArray, phases: FloatArray) -> FloatArray:
    half = _HALF_WIDTH / np.max(omegas)
    blocks, member = np.unique(np.floor(t / (2 * half)), return_inverse=True)
    if 2 * blocks.size >= t.size:  # sparse times: the blocks would cost more than the direct sum
        return np.sin(np.multiply.outer(t, omegas) + phases) @ amplitudes
    centres = (2 * blocks + 1) * half
    angle = np.pi * (np.arange(_NODES) + 0.5) / _NODES
    at_node = np.multiply.outer(omegas, half * np.cos(angle))
    at_centre = np.multiply.outer(centres, omegas) + phases
    values = np.sin(at_centre) @ (amplitudes[:, None] * np.cos(at_node))
    values += np.cos(at_centre) @ (amplitudes[:, None] * np.sin(at_node))
    to_coefficients = 2 / _NODES * np.cos(np.multiply.outer(np.arange(_NODES), angle))
    to_coefficients[0] /= 2
    coefficients = to_coefficients @ values.T  # (degree, block)
    return _clenshaw(coefficients, member, (t - centres[member]) / half)


def _clenshaw(coefficients: FloatArray, member: NDArray[np.intp], x: FloatArray) -> FloatArray:
    """Return sum_k coefficients[k, member] T_k(x)."""
    ahead, behind = np.zeros_like(x), np.zeros_like(x)
    for row in coefficients[:0:-1]:
        ahead, behind = row[member] + 2 * x * ahead - behind, ahead
    return coefficients[0][member] + x * ahead - behind
