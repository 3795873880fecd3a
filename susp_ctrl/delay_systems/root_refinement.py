r"""From approximate roots to exact ones: Newton on the characteristic matrix, multiplicities by contour integrals.

Newton's step for a zero of :math:`\det K` is :math:`-1/\mathrm{tr}(K^{-1}K')`, taken for all roots at once.
Where several approximations meet, or Newton creeps, a small circle tells how many roots there are and where their
mean lies:

.. math:: p = \frac{1}{2\pi j}\oint \mathrm{tr}(K^{-1}K')\,ds, \qquad
          \sum_i s_i^k = \frac{1}{2\pi j}\oint s^k\, \mathrm{tr}(K^{-1}K')\,ds.

A p-fold root is known to the p-th root of the rounding error only, its mean far better [1]_.

References
----------
.. [1] W.-J. Beyn, "An integral method for solving nonlinear eigenvalue problems", Linear Algebra and its
   Applications 436(10), 2012.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.delay_systems.characteristic import CharacteristicMatrix
from susp_ctrl.delay_systems.lft import ComplexArray, FloatArray

_UNIT = 64.0 * np.finfo(float).eps
# Approximations nearer than this (relative) are looked at together.
_NEAR = 1e-4
_CIRCLE = np.exp(2j * np.pi * (np.arange(48) + 0.5) / 48)


class RefinedRoots(NamedTuple):
    """Roots with non-negative imaginary part, the last Newton step at each, and how far rounding can move it."""

    roots: ComplexArray
    residuals: FloatArray
    uncertainties: FloatArray


def refine(K: CharacteristicMatrix, starts: ComplexArray) -> RefinedRoots:
    """Return the roots that Newton finds from the starts, each as often as it occurs, spurious starts dropped.

    Parameters
    ----------
    K : CharacteristicMatrix
        Characteristic matrix.
    starts : ndarray of complex
        Approximations in the closed upper half plane.
    """
    if starts.size == 0:
        return RefinedRoots(starts.astype(complex), np.zeros(0), np.zeros(0))
    with np.errstate(all="ignore"):
        limits, steps = _newton(K, starts)
    kept = np.isfinite(limits) & (steps < 1e-2 * (np.abs(limits) + _floor(K)))
    limits, steps = limits[kept], steps[kept]
    limits = np.where(limits.imag < 0.0, limits.conj(), limits)
    found: list[tuple[complex, float, float]] = []
    uncertain = _uncertainty(K, limits)
    for members in _groups(limits, _NEAR * (np.abs(limits) + _floor(K))):
        if members.size == 1 and _is_simple(K, limits, steps, uncertain, members[0]):
            found.append((limits[members[0]], steps[members[0]], uncertain[members[0]]))
        else:
            found.extend(_resolve(K, limits, steps, uncertain, members))
    if not found:
        return RefinedRoots(np.zeros(0, dtype=complex), np.zeros(0), np.zeros(0))
    roots, residuals, uncertainties = (np.array(column) for column in zip(*found, strict=True))
    roots = np.where(np.abs(roots.imag) <= uncertainties, roots.real, roots).astype(complex)
    return RefinedRoots(roots, residuals, uncertainties)


def _floor(K: CharacteristicMatrix) -> float:
    """Size below which a root counts as small: a fraction of the largest that one can be."""
    return 1e-3 * K.root_bound + 1e-300


def _is_simple(
    K: CharacteristicMatrix, limits: ComplexArray, steps: FloatArray, uncertain: FloatArray, k: int
) -> bool:
    size = abs(limits[k]) + _floor(K)
    alone = limits[k].imag == 0.0 or limits[k].imag > _NEAR * size
    return bool(alone and steps[k] <= 1e-9 * size and uncertain[k] <= 1e-6 * size)


def _newton(K: CharacteristicMatrix, starts: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """Newton for all starts at once; returns the limits and the size of the last step of each."""
    s = starts.astype(complex)
    last = np.full(s.size, np.inf)
    active = np.arange(s.size)
    for _ in range(25):
        step = -1.0 / _logarithmic_derivative(K, s[active])
        # a step longer than the root itself has lost its way: shorten it
        longest = 0.5 * np.abs(s[active]) + 100.0 * _floor(K)
        size = np.abs(step)
        step = np.where(size > longest, step * (longest / size), step)
        size = np.abs(step)
        noise = 4.0 * np.finfo(float).eps * np.abs(s[active])
        stalled = (size >= 0.5 * last[active]) & (last[active] <= 1e-9 * (np.abs(s[active]) + _floor(K)))
        moving = np.isfinite(step) & ~stalled
        s[active[moving]] += step[moving]
        last[active] = np.where(
            np.isfinite(size), np.minimum(size, np.where(stalled, last[active], size)), np.inf
        )
        active = active[moving & (size > noise)]
        if active.size == 0:
            break
    return s, last


def _logarithmic_derivative(K: CharacteristicMatrix, s: ComplexArray) -> ComplexArray:
    """tr(K^-1 K'), the logarithmic derivative of det K; infinite where K is exactly singular."""
    matrix, derivative = K.with_derivative(s)
    try:
        return np.trace(np.linalg.solve(matrix, derivative), axis1=1, axis2=2)
    except np.linalg.LinAlgError:
        usable = np.linalg.slogdet(matrix)[0] != 0.0
        values = np.full(s.size, np.inf + 0j)
        values[usable] = np.trace(np.linalg.solve(matrix[usable], derivative[usable]), axis1=1, axis2=2)
        return values


def _uncertainty(K: CharacteristicMatrix, s: ComplexArray) -> FloatArray:
    r"""First-order bound of a simple root's motion when every entry of K changes by some roundings.

    With left and right null vectors y and x it is :math:`\epsilon |y|^T M |x| / |y^H K' x|`, M the magnitudes that K
    is summed from; near the root :math:`K^{-1}` is the dyad of x and y over :math:`\mathrm{tr}(K^{-1}K')`.
    """
    # a little beside the root, where K can be inverted
    size = np.abs(s) + _floor(K)
    beside = s + 1e-7 * size
    matrix, derivative = K.with_derivative(beside)
    with np.errstate(all="ignore"):
        try:
            inverse = np.linalg.inv(matrix)
        except np.linalg.LinAlgError:
            return np.full(s.size, np.inf)
        slope = np.abs(np.trace(inverse @ derivative, axis1=1, axis2=2))
        return _UNIT * np.trace(np.abs(inverse) @ _magnitudes(K, beside), axis1=1, axis2=2) / slope


def _magnitudes(K: CharacteristicMatrix, s: ComplexArray) -> FloatArray:
    growth = np.exp(-s.real[:, None] * K.delays) * (1.0 + np.abs(s[:, None]) * K.delays)
    through = np.abs(K.C)
    if np.any(K.D):
        around = np.eye(K.n_channels) - np.abs(K.D) * growth[:, None, :]
        through = np.linalg.solve(around, np.broadcast_to(through, (s.size, *through.shape)))
    return (
        np.abs(s)[:, None, None] * np.eye(K.n_states)
        + np.abs(K.A)
        + (np.abs(K.B) * growth[:, None, :]) @ through
    )


def _groups(points: ComplexArray, reach: FloatArray) -> list[np.ndarray]:
    """Connected sets of points nearer to each other than their reach."""
    near = np.abs(points[:, None] - points) <= np.maximum(reach[:, None], reach)
    label = np.arange(points.size)
    while True:
        spread = np.min(np.where(near, label, points.size), axis=1) if points.size else label
        if np.array_equal(spread, label):
            return [np.flatnonzero(label == k) for k in np.unique(label)]
        label = spread


def _resolve(
    K: CharacteristicMatrix,
    limits: ComplexArray,
    steps: FloatArray,
    uncertain: FloatArray,
    members: np.ndarray,
) -> list[tuple[complex, float, float]]:
    """Tell a multiple root from near ones and from duplicates, by circles around them."""
    points = limits[members]
    center = complex(points.mean())
    size = abs(center) + _floor(K)
    if center.imag < 4.0 * _NEAR * size:
        center = complex(center.real)
    spread = float(np.max(np.abs(points - center)))
    others = np.delete(limits, members)
    mirrored = np.concatenate([others, others.conj(), [] if center.imag == 0.0 else points.conj()])
    free = 0.4 * float(np.min(np.abs(mirrored - center), initial=np.inf))
    for radius in (
        max(4.0 * spread, 1e-3 * size),
        max(4.0 * spread, 1e-5 * size),
        1.5 * spread + 1e-7 * size,
    ):
        radius = min(radius, free)
        if radius <= spread:
            continue
        moments = _moments(K, center, radius)
        number = round(moments[0].real) if np.isfinite(moments[0]) else -1
        if number >= 0 and abs(moments[0] - number) < 1e-6:
            break
    else:
        return []
    if number == 0:
        return []
    best = _distinct(points, steps, np.maximum(uncertain[members], steps[members]), members)
    counted = sum(1 if limits[k].imag == 0.0 or center.imag != 0.0 else 2 for k in best)
    settled = all(steps[k] <= 1e-9 * size and uncertain[k] <= 1e-6 * size for k in best)
    if counted == number and settled:
        return [(limits[k], steps[k], uncertain[k]) for k in best]
    # power sums of the roots about the centre, in units of the radius, give their polynomial (Newton's identities)
    power = moments[1 : number + 1] if number < moments.size else None
    if power is None:
        return []
    if number == 1:
        return _single(K, center + radius * complex(power[0]))
    coefficients = [1.0 + 0j]
    for k in range(1, number + 1):
        coefficients.append(-sum(coefficients[k - j] * power[j - 1] for j in range(1, k + 1)) / k)
    polynomial = np.real(coefficients) if center.imag == 0.0 else np.array(coefficients)
    roots = center + radius * np.roots(polynomial)
    mean = center + radius * complex(power[0].real if center.imag == 0.0 else power[0]) / number
    spread = float(np.max(np.abs(roots - mean)))
    tight = 10.0 * _cluster_uncertainty(K, mean, 0.1 * radius)
    inside = _moments(K, mean, tight)[0]
    if np.isfinite(inside) and abs(inside - number) < 0.05:
        # rounding cannot tell these roots apart: one root, as often as it occurs
        roots, error = np.full(number, mean), tight
    else:
        # the polynomial's roots are known to the root of its own rounding
        error = max(tight, radius * 1e-14 ** (1.0 / number))
    residual = min(spread, tight)
    return [(root, residual, error) for root in roots if root.imag >= 0.0 or center.imag != 0.0]


def _single(K: CharacteristicMatrix, start: complex) -> list[tuple[complex, float, float]]:
    """Newton from the place that a circle gives for its only root."""
    limit, step = _newton(K, np.array([start]))
    if not step[0] <= 1e-9 * (abs(limit[0]) + _floor(K)):
        return []
    root = np.where(limit.imag < 0.0, limit.conj(), limit)
    return [(complex(root[0]), float(step[0]), float(_uncertainty(K, root)[0]))]


def _distinct(points: ComplexArray, steps: FloatArray, error: FloatArray, members: np.ndarray) -> list[int]:
    """Members that are different roots: further apart than their errors; the best converged of each."""
    chosen: list[int] = []
    for k in np.argsort(steps[members]):
        position = {int(m): i for i, m in enumerate(members)}
        apart = [
            abs(points[k] - points[position[c]]) > 10.0 * (error[k] + error[position[c]]) for c in chosen
        ]
        if all(apart):
            chosen.append(int(members[k]))
    return chosen


def _moments(K: CharacteristicMatrix, center: complex, radius: float) -> ComplexArray:
    """Power sums (order 0 to 12) of the roots inside a circle, about its centre and in units of its radius."""
    with np.errstate(all="ignore"):
        values = _logarithmic_derivative(K, center + radius * _CIRCLE) * radius * _CIRCLE
    return np.array([np.mean(values * _CIRCLE**k) for k in range(13)])


def _cluster_uncertainty(K: CharacteristicMatrix, center: complex, largest: float) -> float:
    """Radius of the smallest circle that rounding in K cannot push a root through."""
    radius = largest
    identity = np.eye(K.n_states)
    while radius > 1e-13 * (abs(center) + _floor(K)):
        s = center + 0.25 * radius * _CIRCLE
        with np.errstate(all="ignore"):
            try:
                change = np.abs(np.linalg.solve(K(s), np.broadcast_to(identity, (s.size, *identity.shape))))
            except np.linalg.LinAlgError:
                return radius
            change = _UNIT * change @ _magnitudes(K, s)
        if not np.all(np.isfinite(change)) or np.max(np.abs(np.linalg.eigvals(change))) >= 1.0:
            return radius
        radius *= 0.25
    return radius
