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

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import CharacteristicMatrix

_UNIT = 64.0 * np.finfo(float).eps
# A root is settled when its last step is below this share of it.
_SETTLED = 1e-9
# Approximations nearer than this (relative) are looked at together, as are all that rounding could unite.
_NEAR = 1e-6
_VAGUE = 0.1
_CIRCLE = np.exp(2j * np.pi * (np.arange(48) + 0.5) / 48)
# Circles tried around a group, each this much wider than the one before.
_WIDER = 4.0
_MOST_CIRCLES = 30


class RefinedRoots(NamedTuple):
    """Roots with non-negative imaginary part, the last Newton step at each, and how far rounding can move it."""

    roots: ComplexArray
    residuals: FloatArray
    uncertainties: FloatArray


def refine(K: CharacteristicMatrix, starts: ComplexArray) -> RefinedRoots:
    """Return the roots that Newton finds from the starts, each as often as it occurs, spurious starts dropped.

    Every tolerance follows the root it is for: its size, and how far rounding in K can move it there. The size of
    other roots, a fast pole's say, plays no part.

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
        limits, steps = _newton(K, starts, _local_size(K, starts))
        finite = np.isfinite(limits) & np.isfinite(steps)
        limits, steps, paired = limits[finite], steps[finite], starts.imag[finite] > 0.0
        limits = np.where(limits.imag < 0.0, limits.conj(), limits)
        uncertain = _uncertainty(K, limits, steps)
        kept = steps < np.maximum(1e-2 * np.abs(limits), 10.0 * uncertain)
    limits, steps, uncertain, paired = limits[kept], steps[kept], uncertain[kept], paired[kept]
    found: list[tuple[complex, float, float]] = []
    error = np.maximum(steps, np.where(np.isfinite(uncertain), uncertain, 0.0))
    # a start that stood for a pair and met the axis stands for two roots there, or for one that rounding split
    simple = _are_simple(K, limits, steps, uncertain) & ~(paired & (limits.imag == 0.0))
    # what has no digits left says nothing about its neighbours
    reach = np.minimum(10.0 * error, _VAGUE * np.maximum(np.abs(limits), _bend(K)))
    for members in _groups(limits, reach + _NEAR * np.abs(limits)):
        if members.size == 1 and simple[members[0]]:
            found.append((limits[members[0]], steps[members[0]], uncertain[members[0]]))
        else:
            found.extend(_resolve(K, limits, steps, uncertain, members))
    if not found:
        return RefinedRoots(np.zeros(0, dtype=complex), np.zeros(0), np.zeros(0))
    roots, residuals, uncertainties = (np.array(column) for column in zip(*found, strict=True))
    roots = np.where(np.abs(roots.imag) <= uncertainties, roots.real, roots).astype(complex)
    return RefinedRoots(roots, residuals, uncertainties)


def eigenvalue_uncertainty(K: CharacteristicMatrix, eigenvalues: ComplexArray) -> FloatArray:
    """How far rounding can move each eigenvalue of A, and at least as far as the like of it lie apart."""
    with np.errstate(all="ignore"):
        error = np.minimum(_uncertainty(K, eigenvalues, np.zeros(eigenvalues.size)), 1e-3 * _bend(K))
    for members in _groups(eigenvalues, 10.0 * error + _NEAR * np.abs(eigenvalues)):
        points = eigenvalues[members]
        error[members] = max(float(np.max(error[members])), float(np.max(np.abs(points - points.mean()))))
    return error


def _bend(K: CharacteristicMatrix) -> float:
    """How far the longest delay lets one think that K changes slowly (rad/s)."""
    return 1.0 / float(K.delays.max()) if K.n_channels else K.root_bound or 1.0


def _local_size(K: CharacteristicMatrix, s: ComplexArray) -> FloatArray:
    """Size beside which something counts as small at s: of s, or the way to the nearest other, at most 1/delay."""
    gap = np.abs(s[:, None] - np.concatenate([s, s.conj()]))
    # what is this near is no other root but the same one, its double or its conjugate
    gap[gap <= 1e-3 * np.abs(s)[:, None]] = np.inf
    return np.maximum(np.abs(s), np.min(gap, axis=1, initial=_bend(K)))


def _are_simple(
    K: CharacteristicMatrix, limits: ComplexArray, steps: FloatArray, uncertain: FloatArray
) -> np.ndarray:
    """Roots that Newton has settled, that rounding moves but little, and that are not beside their conjugate."""
    size = _local_size(K, limits)
    settled = (steps <= _SETTLED * np.abs(limits)) | (
        (steps <= 4.0 * uncertain) & (uncertain <= 1e-12 * size)
    )
    alone = (limits.imag == 0.0) | (limits.imag > 10.0 * uncertain + _NEAR * np.abs(limits))
    return np.asarray(settled & alone & (uncertain <= 1e-6 * size))


def _newton(
    K: CharacteristicMatrix, starts: ComplexArray, reach: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Newton for all starts at once; returns the places after the smallest step of each, and those steps.

    A step longer than half the root and the `reach` of its start together has lost its way: it is shortened.
    """
    s = starts.astype(complex)
    best, least = s.copy(), np.full(s.size, np.inf)
    active = np.arange(s.size)
    for _ in range(25):
        step = -1.0 / _logarithmic_derivative(K, s[active])
        longest = 0.5 * np.abs(s[active]) + reach[active]
        size = np.abs(step)
        step = np.where(size > longest, step * (longest / size), step)
        size = np.where(np.isfinite(step), np.abs(step), np.inf)
        place = s[active] + step
        stalled = (size >= 0.5 * least[active]) & (least[active] <= _SETTLED * np.abs(s[active]))
        better = size < least[active]
        best[active[better]], least[active[better]] = place[better], size[better]
        s[active] = place
        noise = 4.0 * np.finfo(float).eps * np.abs(place)
        active = active[np.isfinite(step) & ~stalled & (size > noise)]
        if active.size == 0:
            break
    return best, least


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


def _uncertainty(K: CharacteristicMatrix, s: ComplexArray, steps: FloatArray) -> FloatArray:
    r"""First-order bound of a simple root's motion when every entry of K changes by some roundings.

    With left and right null vectors y and x it is :math:`\epsilon |y|^T M |x| / |y^H K' x|`, M the magnitudes that K
    is summed from; near the root :math:`K^{-1}` is the dyad of x and y over :math:`\mathrm{tr}(K^{-1}K')`. Beside a
    multiple root it is about the distance at which rounding scatters the members.
    """
    # a little beside the root, where K can be inverted; further off where the last step was zero by chance
    moved = _motion_beside(K, s, 1e-7 * np.abs(s) + 10.0 * steps + 1e-16 * np.linalg.norm(K.A) + 1e-300)
    unknown = ~np.isfinite(moved)
    if np.any(unknown):
        moved[unknown] = _motion_beside(K, s[unknown], 1e-7 * np.maximum(np.abs(s[unknown]), _bend(K)))
    return np.where(np.isfinite(moved), moved, np.inf)


def _motion_beside(K: CharacteristicMatrix, s: ComplexArray, offset: FloatArray) -> FloatArray:
    matrix, derivative = K.with_derivative(s + offset)
    with np.errstate(all="ignore"):
        matrix[np.linalg.slogdet(matrix)[0] == 0.0] = np.nan
        inverse = np.linalg.inv(matrix)
        slope = np.abs(np.trace(inverse @ derivative, axis1=1, axis2=2))
        moved = np.trace(np.abs(inverse) @ _magnitudes(K, s + offset), axis1=1, axis2=2) / slope
    return np.asarray(_UNIT * moved)


def _magnitudes(K: CharacteristicMatrix, s: ComplexArray) -> FloatArray:
    growth = np.exp(-s.real[:, None] * K.delays) * (1.0 + np.abs(s[:, None]) * K.delays)
    sizes = CharacteristicMatrix(np.abs(K.A), np.abs(K.B), np.abs(K.C), np.abs(K.D), K.delays)
    return np.abs(s)[:, None, None] * np.eye(K.n_states) + sizes.closed(growth)


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
    scatter = float(
        np.max(np.maximum(steps[members], np.where(uncertain[members] < 1e300, uncertain[members], 0.0)))
    )
    center = complex(points.mean())
    if center.imag <= 10.0 * scatter + 4.0 * _NEAR * abs(center):
        center = complex(center.real)
    spread = float(np.max(np.abs(points - center)))
    others = np.delete(limits, members)
    mirrored = np.concatenate([others, others.conj(), [] if center.imag == 0.0 else points.conj()])
    free = 0.4 * float(np.min(np.abs(mirrored - center), initial=max(abs(center), _bend(K))))
    smallest = 4.0 * max(spread, steps[members].min(), uncertain[members].min(), 1e-15 * abs(center))
    counted = _best_circle(K, center, smallest, free)
    if counted is None:
        return []
    radius, number, moments = counted
    best = _distinct(points, steps, np.maximum(uncertain[members], steps[members]), members)
    told = sum(1 if limits[k].imag <= uncertain[k] or center.imag != 0.0 else 2 for k in best)
    settled = all(
        steps[k] <= max(_SETTLED * abs(limits[k]), 4.0 * uncertain[k]) and uncertain[k] <= 1e-3 * radius
        for k in best
    )
    if told == number and settled:
        return [(limits[k], steps[k], uncertain[k]) for k in best]
    # power sums of the roots about the centre, in units of the radius, give their polynomial (Newton's identities)
    power = moments[1 : number + 1] if number < moments.size else None
    if power is None:
        return []
    if number == 1:
        return _single(K, center + radius * complex(power[0]), radius)
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


def _best_circle(
    K: CharacteristicMatrix, center: complex, smallest: float, free: float
) -> tuple[float, int, ComplexArray] | None:
    """Radius, number of roots and moments of a circle around the fewest roots that can be counted, if there is one.

    On a circle no wider than the scatter rounding spoils the integral, on one that passes another root its
    quadrature fails: both show in a number that is not whole. Of the circles with the same number the one with the
    most accurate moments is taken.
    """
    if free < 0.25 * smallest:  # another root is nearer than the members are to each other
        return None
    radius = min(smallest, free)
    best: tuple[float, int, ComplexArray] | None = None
    least = np.inf
    for _ in range(_MOST_CIRCLES):
        moments = _moments(K, center, radius)
        number = round(moments[0].real) if np.isfinite(moments[0]) else 0
        error = abs(moments[0] - number)
        if best is not None and number != best[1]:
            break
        if number >= 1 and error < 1e-6 and error * radius < least:
            best, least = (radius, number, moments), error * radius
        elif best is not None and radius > 100.0 * best[0]:
            break
        if radius >= free:
            break
        radius = min(_WIDER * radius, free)
    return best


def _single(K: CharacteristicMatrix, start: complex, radius: float) -> list[tuple[complex, float, float]]:
    """Newton from the place that a circle gives for its only root."""
    with np.errstate(all="ignore"):
        limit, step = _newton(K, np.array([start]), np.array([radius]))
    root = np.where(limit.imag < 0.0, limit.conj(), limit)
    uncertain = float(_uncertainty(K, root, step)[0])
    if step[0] > max(_SETTLED * abs(limit[0]), 4.0 * uncertain) or not abs(limit[0] - start) < radius:
        return []
    return [(complex(root[0]), float(step[0]), uncertain)]


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
    while radius > max(1e-13 * abs(center), 1e-16 * largest):
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
