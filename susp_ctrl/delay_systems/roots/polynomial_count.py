r"""Unstable roots counted on the user's own polynomials and matrices, not on a realisation.

The argument principle for :math:`\det T(s)`, T from `susp_ctrl.delay_systems.model.system_matrix`. As for the
characteristic matrix, the phase along the axis is followed in steps that cannot miss a turn: for every s of a step
around :math:`s_0`

.. math:: |T(s_0)^{-1} (T(s) - T(s_0))| \le X \quad\text{(entry by entry)}, \qquad \rho(X) < 1,

and the phase of the determinant changes by at most :math:`-\log\det(I - X)`. The terms of T(s) - T(s_0) are those of
Taylor's series, so polynomials of high degree cost no more steps than their roots ask for. Far out, with
:math:`T(s)\,\mathrm{diag}(s^{-d_j}) = T_0 + R(s)`, no root lies where :math:`\rho(|T_0^{-1}|\,|R|) < 1`.
"""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import DelayPolynomials, Points
from susp_ctrl.delay_systems.model.perron import certified_radius
from susp_ctrl.delay_systems.roots.argument_principle import (
    ContourError,
    accepted,
    phase_along_axis,
    refuse_narrow,
    unit_determinant,
    whole_number,
)

# Relative uncertainty of every term: some dozens of roundings.
_UNCERTAINTY = 64.0 * np.finfo(float).eps
# Far out the phase changes by less than this.
_FAR_PHASE = 1.0
_MOST_DOUBLINGS = 200
_MOST_POINTS = 200_000
_BATCH_NUMBERS = 500_000


def count_by_polynomials(T: DelayPolynomials) -> int:
    """Count the zeros of det T in the right half plane.

    Raises
    ------
    ContourError
        A root lies on the axis as far as rounding lets one tell, the leading terms leave the number of roots open, or
        too many steps would be needed.
    """
    if T.size == 0:
        return 0
    top, leading = _outer_radius(T)
    degrees = T.degrees
    scaled = T(np.array([1j * top]))[0] / (1j * top) ** degrees
    outer_phase = float(np.angle(np.linalg.slogdet(np.linalg.solve(leading, scaled))[0]))
    # nothing is known of where the slow roots are: steps may be as small as they can
    phase = phase_along_axis(
        lambda lower, upper: _radius(T, lower, upper, 1e-16 * top),
        lambda omega: unit_determinant(_even(T(1j * omega))[0]),
        top, max(16, _BATCH_NUMBERS // T.size**2), _MOST_POINTS,
    )  # fmt: skip
    return whole_number(0.5 * degrees.sum() + (outer_phase - phase) / np.pi)


def _outer_radius(T: DelayPolynomials) -> tuple[float, FloatArray]:
    """Return a modulus beyond which no root is unstable, and the leading coefficients of the columns."""
    n, degrees = T.size, T.degrees
    columns = np.arange(n)
    leading = T.coefficients[0][degrees, :, columns].T
    try:
        inverse = np.linalg.inv(leading)
    except np.linalg.LinAlgError:
        raise ContourError(np.nan, "the leading coefficients leave the number of roots open") from None
    # |T_0^-1| |R|, with the delayed terms of the same power at their largest, times (power of top)
    sizes = np.abs(np.tensordot(inverse, T.coefficients, axes=([1], [2]))).transpose(1, 2, 0, 3)
    powers = np.arange(sizes.shape[1])[:, None] - degrees
    undelayed_leading = powers == 0
    sizes[0] *= ~undelayed_leading[:, None, :]
    sizes = sizes.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        lower = np.where(powers < 0, np.max(sizes, axis=1), 0.0)
        start = np.exp(np.max(np.log(lower[lower > 0.0]) / -powers[lower > 0.0], initial=-np.inf))

    def nothing_beyond(top: float) -> bool:
        rest = np.sum(sizes * np.power(top, np.minimum(powers, 0))[:, None, :], axis=0)
        return certified_radius(rest) < 0.5 and bool(-np.linalg.slogdet(np.eye(n) - rest)[1] < _FAR_PHASE)

    top = 2.0 ** np.ceil(np.log2(start)) if start > 0.0 else 1.0
    for _ in range(_MOST_DOUBLINGS):
        if nothing_beyond(top):
            break
        top *= 2.0
    else:
        raise ContourError(np.nan, "the leading coefficients leave the number of roots open")
    # where a row and a column have other units than the rest the start is far too large
    for _ in range(_MOST_DOUBLINGS if start > 0.0 else 0):
        if not nothing_beyond(0.5 * top):
            break
        top *= 0.5
    return float(top), leading


def _even(matrices: Points) -> tuple[Points, FloatArray, FloatArray]:
    """Scale rows and columns to one, which leaves the phase of the determinant; return the scales as well."""
    size = np.abs(matrices)
    columns = size.max(axis=1, keepdims=True)
    columns[columns == 0.0] = 1.0
    rows = (size / columns).max(axis=2, keepdims=True)
    rows[rows == 0.0] = 1.0
    return matrices / columns / rows, rows, columns


def _radius(T: DelayPolynomials, lower: FloatArray, upper: FloatArray, least: float) -> FloatArray:
    """Bound the spectral radius of X on every step, see `accepted`."""
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    matrices, rows, columns = _even(T(1j * middle))
    # a step may end on a root by chance without the root being its business: move off it
    singular = np.linalg.slogdet(matrices)[0] == 0.0
    refuse_narrow(middle[singular], half[singular], least)
    matrices[singular] += 1e-3 * np.eye(T.size)
    inverse = np.abs(np.linalg.inv(matrices))
    rounding = inverse @ (_UNCERTAINTY * T.sizes(middle) / columns / rows)
    X = inverse @ (T.variation(middle, half) / columns / rows) + rounding
    radius = accepted(X, rounding, middle, half, least)
    radius[singular] = 2.0
    return radius
