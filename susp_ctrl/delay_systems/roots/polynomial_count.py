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

from susp_ctrl.arrays import FloatArray, numbered
from susp_ctrl.delay_systems.model import DelayPolynomials, Points, perron_bound
from susp_ctrl.delay_systems.model.perron import certified_radius
from susp_ctrl.delay_systems.roots.argument_principle import ContourError

# Relative uncertainty of every term: some dozens of roundings.
_UNCERTAINTY = 64.0 * np.finfo(float).eps
# A step is accepted below these: spectral radius of X, and largest phase change. Far out the latter is this small.
_RADIUS, _PHASE, _FAR_PHASE = 0.9, 0.95 * np.pi, 1.0
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
    turns = 0.5 * degrees.sum() + (outer_phase - _phase_along_axis(T, top)) / np.pi
    count = round(turns)
    if abs(turns - count) > 1e-3 or count < 0:
        raise ContourError(np.nan, f"the phase adds up to {turns:.6g} roots, which is no whole number")
    return count


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
    top = 2.0 ** np.ceil(np.log2(start)) if start > 0.0 else 1.0
    for _ in range(200):
        rest = np.sum(sizes * np.power(top, np.minimum(powers, 0))[:, None, :], axis=0)
        if certified_radius(rest) < 0.5 and -np.linalg.slogdet(np.eye(n) - rest)[1] < _FAR_PHASE:
            return float(top), leading
        top *= 2.0
    raise ContourError(np.nan, "the leading coefficients leave the number of roots open")


def _phase_along_axis(T: DelayPolynomials, top: float) -> float:
    """Change of the phase of det T(jw) from w = 0 to w = `top`."""
    edges = np.linspace(0.0, top, 17)
    lower, upper = edges[:-1], edges[1:]
    points = [edges]
    batch = max(16, _BATCH_NUMBERS // T.size**2)
    evaluated = 0
    while lower.size:
        parts = [slice(i, i + batch) for i in range(0, lower.size, batch)]
        radius = np.concatenate([_radius(T, lower[part], upper[part], top) for part in parts])
        done = radius <= _RADIUS
        evaluated += lower.size
        points.append(0.5 * (lower + upper)[done])
        pieces = np.clip(np.ceil(radius[~done] / (0.7 * _RADIUS)), 2, 8).astype(int)
        if evaluated + pieces.sum() > _MOST_POINTS:
            raise ContourError(float(lower[~done][0]), f"more than {_MOST_POINTS} steps would be needed")
        owner, number = numbered(pieces)
        width, start = ((upper - lower)[~done] / pieces)[owner], lower[~done][owner]
        lower, upper = start + number * width, start + (number + 1) * width
        points.append(lower)
    omega = np.unique(np.concatenate(points))
    phase = np.concatenate([_phases(T, omega[i : i + batch]) for i in range(0, omega.size, batch)])
    return float(np.angle(phase[1:] / phase[:-1]).sum())


def _phases(T: DelayPolynomials, omega: FloatArray) -> Points:
    sign = np.linalg.slogdet(_even(T(1j * omega))[0])[0]
    return np.where(sign == 0.0, 1.0, sign)


def _even(matrices: Points) -> tuple[Points, FloatArray, FloatArray]:
    """Scale rows and columns to one, which leaves the phase of the determinant; return the scales as well."""
    size = np.abs(matrices)
    columns = size.max(axis=1, keepdims=True)
    columns[columns == 0.0] = 1.0
    rows = (size / columns).max(axis=2, keepdims=True)
    rows[rows == 0.0] = 1.0
    return matrices / columns / rows, rows, columns


def _radius(T: DelayPolynomials, lower: FloatArray, upper: FloatArray, top: float) -> FloatArray:
    """Bound the spectral radius of X on every step; two where the phase could change by half a turn."""
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    matrices, rows, columns = _even(T(1j * middle))
    # a step may end on a root by chance without the root being its business: move off it
    singular = np.linalg.slogdet(matrices)[0] == 0.0
    _refuse_narrow(middle[singular], half[singular], top)
    matrices[singular] += 1e-3 * np.eye(T.size)
    inverse = np.abs(np.linalg.inv(matrices))
    rounding = inverse @ (_UNCERTAINTY * T.sizes(middle) / columns / rows)
    X = inverse @ (T.variation(middle, half) / columns / rows) + rounding
    limit = perron_bound(rounding)
    if np.any(limit > 0.5 * _RADIUS):
        worst = int(np.argmax(limit))
        raise ContourError(float(middle[worst]), _on_the_axis(middle[worst]))
    radius = perron_bound(X)
    radius[singular] = 2.0
    _refuse_narrow(middle[radius > _RADIUS], half[radius > _RADIUS], top)
    small = np.flatnonzero(radius <= _RADIUS)
    if small.size:
        largest_phase = -np.linalg.slogdet(np.eye(T.size) - X[small])[1]
        radius[small[largest_phase > _PHASE]] = 2.0 * _RADIUS
    return radius


def _refuse_narrow(middle: FloatArray, half: FloatArray, top: float) -> None:
    narrow = half < 4.0 * np.finfo(float).eps * (middle + 1e-16 * top)
    if np.any(narrow):
        raise ContourError(float(middle[narrow][0]), _on_the_axis(middle[narrow][0]))


def _on_the_axis(omega: float) -> str:
    return f"a root lies on the axis near {omega:.6g} rad/s, as far as rounding lets one tell"
