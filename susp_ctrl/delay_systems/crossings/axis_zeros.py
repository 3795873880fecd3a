r"""Crossings of the imaginary axis: finding them exactly, polishing them, and their direction.

Where every delay is a multiple of one, ``M(s)`` maps the unit-delayed signals to themselves and a root lies on
the axis where an eigenvalue of ``M(jw)`` has modulus one. M is real, so then

.. math:: \det\bigl(I - M(s) \otimes M(-s)\bigr) = 0, \qquad s = j\omega,

which is an ordinary eigenvalue problem of size ``2 n r`` (for one signal the Hamiltonian test of ``|M| = 1``).
It is the matrix pencil test of [1]_ in the r delayed signals instead of the n states.

The number of roots that cross at a point is the degree of ``det W`` around it (see `delay_line`): the sign of
its Jacobian at a simple crossing, else the winding number along a small rectangle, which also settles touches
and multiple roots.

References
----------
.. [1] J. Chen, G. Gu, C. N. Nett, "A new method for computing delay margins for stability of linear delay
   systems", Systems & Control Letters 26, 1995.
"""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.crossings.delay_line import Coordinate, axis_matrix, axis_size
from susp_ctrl.delay_systems.model import CharacteristicMatrix, balancing

# Below this (relative) Jacobian a crossing counts as degenerate: it is refined as such and its degree measured.
_DEGENERATE = 1e-5
_RESIDUAL = 1e-12
_EPSILON = float(np.finfo(float).eps)


class Zeros(NamedTuple):
    """Points (omega, y) of the axis with a root, and the net number of roots crossing to the right there."""

    omega: FloatArray
    y: FloatArray
    degree: np.ndarray


def unit_chain(loop: CharacteristicMatrix, multiples: FloatArray) -> CharacteristicMatrix:
    """Replace each delay of k units by k unit delays in series."""
    lengths = multiples.astype(int)
    last = np.cumsum(lengths) - 1
    first = last - lengths + 1
    r = int(lengths.sum())
    B, C, D = np.zeros((loop.n_states, r)), np.zeros((r, loop.n_states)), np.zeros((r, r))
    B[:, last], C[first], D[np.ix_(first, last)] = loop.B, loop.C, loop.D
    for head, tail in zip(first, last, strict=True):
        links = np.arange(head, tail)
        D[links + 1, links] = 1.0
    return CharacteristicMatrix(loop.A, B, C, D, np.ones(r))


def crossing_frequencies(chain: CharacteristicMatrix) -> tuple[FloatArray, float]:
    """Return candidates ``omega > 0`` where an eigenvalue of ``M(jw)`` may have modulus one.

    None is missed above the second number returned: below it eigenvalues cannot be told from zero.
    """
    n, r = chain.n_states, chain.n_channels
    if n == 0 or r == 0:
        return np.zeros(0), 0.0
    one, size = np.eye(r), r * r
    forward = [np.kron(m, one) for m in (chain.A, chain.B, chain.C, chain.D)]
    mirrored = [np.kron(one, m) for m in (-chain.A, -chain.B, chain.C, chain.D)]
    zero = np.zeros((n * r, size))
    into = np.block([[zero, forward[1]], [mirrored[1], zero]])
    around = np.block([[np.eye(size), -forward[3]], [-mirrored[3], np.eye(size)]])
    out = scipy.linalg.block_diag(forward[2], mirrored[2])
    loop = scipy.linalg.block_diag(forward[0], mirrored[0]) + into @ np.linalg.solve(around, out)
    values, floor = _graded_eigenvalues(loop)
    # A k-fold root on the axis is split by rounding to the power 1/k: the test is wide, and the polishing that
    # follows decides. It is relative to the eigenvalue: slow modes beside fast ones are told apart as well.
    size_of = np.abs(values)
    width = 1e-3 * np.maximum(size_of, np.minimum(1e-2 * size_of.max(initial=0.0), 10.0 * size_of))
    near = (np.abs(values.real) <= width) & (values.imag > 0.0)
    return np.unique(values.imag[near]), floor


def _graded_eigenvalues(matrix: FloatArray) -> tuple[ComplexArray, float]:
    """Return the eigenvalues, small ones beside large ones too, and a size up to which some may be missing.

    The digits of the small ones, which rounding of the large ones takes, are those of the largest eigenvalues of
    the inverse.
    """
    units = balancing(matrix)
    balanced = matrix / units[:, None] * units
    values: ComplexArray = scipy.linalg.eigvals(balanced, check_finite=False).astype(complex)
    scale = float(np.linalg.norm(balanced))
    if np.all(np.abs(values) > 1e-6 * scale):
        return values, 0.0
    # One that is zero is mostly double, and rounding splits it to the root of its size.
    lost = np.sqrt(_EPSILON * values.size) * scale
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
            inverse = scipy.linalg.inv(balanced)
    except np.linalg.LinAlgError:
        return values, lost
    if not np.linalg.norm(inverse) * scale * values.size * _EPSILON < 1.0:
        return values, lost
    mirrored = scipy.linalg.eigvals(inverse, check_finite=False)
    large = float(np.abs(mirrored).max())
    # Half way between the smallest and the largest both have the same number of digits.
    middle = np.sqrt(scale / large)
    order = np.argsort(np.abs(values))
    small = int(np.sum(np.abs(values) < middle))
    chosen = np.argsort(-np.abs(mirrored))[:small]
    return np.concatenate([1.0 / mirrored[chosen], values[order[small:]]]), 0.0


def unit_moduli(chain: CharacteristicMatrix, omega: FloatArray) -> ComplexArray:
    """Return the r values z with ``det(I - z M(jw)) = 0``, shape (frequencies, r); infinite where mu = 0."""
    with np.errstate(all="ignore"):
        return np.asarray(1.0 / np.linalg.eigvals(chain.response(omega)), dtype=complex)


def chain_zeros(
    chain: CharacteristicMatrix, loop: CharacteristicMatrix, coordinate: Coordinate
) -> tuple[Zeros, float]:
    """Find the zeros (omega, theta) for delays that are multiples of one; all above the frequency returned."""
    candidates, floor = crossing_frequencies(chain)
    if candidates.size == 0:
        return Zeros(np.zeros(0), np.zeros(0), np.zeros(0, dtype=int)), floor
    # Beside a pole of M the eigenvalues are still finite to the digits that a starting point needs.
    z = unit_moduli(chain, candidates * (1.0 + 1e-12))
    with np.errstate(divide="ignore"):
        row, branch = np.nonzero(np.abs(np.log(np.abs(z))) < 0.5)
    omega, theta = candidates[row], -np.angle(z[row, branch])
    return polished_zeros(loop, coordinate, omega, theta, turn=2.0 * np.pi), floor


def polished_zeros(
    loop: CharacteristicMatrix,
    coordinate: Coordinate,
    omega: FloatArray,
    y: FloatArray,
    turn: float | None = None,
    y_scale: float = 1.0,
) -> Zeros:
    """Polish starting points by Newton, drop the false and the double ones, and measure each degree."""
    omega, y, residual, sharpness = _newton(loop, coordinate, omega, y, y_scale)
    good = (residual < _RESIDUAL) & (omega > 0.0)
    omega, y, sharpness = omega[good], y[good], sharpness[good]
    w_scale = float(np.abs(omega).max(initial=0.0)) or 1.0

    def distances(k: Any, others: np.ndarray) -> FloatArray:
        gap = y[others] - y[k]
        if turn is not None:
            gap = gap - turn * np.round(gap / turn)
        return np.hypot((omega[others] - omega[k]) / w_scale, gap / y_scale)

    reach = _attainable(loop, coordinate, omega, y)

    def same(k: Any, others: np.ndarray) -> np.ndarray:
        """Closer than Newton can tell: two roots that meet at s = 0 leave little of the digits of omega."""
        gap = y[others] - y[k]
        if turn is not None:
            gap = gap - turn * np.round(gap / turn)
        far = np.maximum(np.abs(omega[others] - omega[k]) / reach[0][k], np.abs(gap) / reach[1][k])
        return np.asarray((distances(k, others) < 1e-9) | (far < 1.0))

    kept: list[int] = []
    special: list[int] = []
    for k in np.argsort(-np.abs(sharpness), kind="stable"):
        if np.any(same(k, np.array(kept, dtype=int))):
            continue
        if abs(sharpness[k]) < _DEGENERATE:
            # Newton stops with half the digits here: what is left around a refined point is the same point.
            if np.any(distances(k, np.array(special, dtype=int)) < 1e-5):
                continue
            refined = _fold_point(loop, coordinate, omega[k], y[k], w_scale, y_scale)
            if refined is not None:
                omega[k], y[k] = refined
                special.append(int(k))
        kept.append(int(k))
    if turn is not None:
        y = np.mod(y, turn)
    chosen = np.array(sorted(kept, key=lambda k: (y[k], omega[k])), dtype=int)
    omega, y, sharpness = omega[chosen], y[chosen], sharpness[chosen]
    degree = np.sign(sharpness).astype(int)
    multiple = _nullity(loop, coordinate, omega, y) > 1
    for k in np.flatnonzero((np.abs(sharpness) < _DEGENERATE) | multiple):
        others = np.delete(np.arange(omega.size), k)
        size = min(1e-3, 0.3 * float(distances(k, others).min(initial=1.0)))
        measured = winding(loop, coordinate, omega[k], y[k], size * w_scale, size * y_scale)
        degree[k] = degree[k] if measured is None else measured
    return Zeros(omega, y, degree)


def _attainable(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return how far apart in omega and in y two points can be that the residual takes for one simple zero."""
    by_omega, by_y = zero_slopes(loop, coordinate, omega, y)
    turned = np.abs(np.imag(np.conj(by_omega) * by_y))
    accepted = 2.0 * _RESIDUAL * axis_size(loop, omega)
    plain = turned > 0.0
    reach = (np.full(omega.size, 1e-300), np.full(omega.size, 1e-300))
    for part, slope in zip(reach, (by_y, by_omega), strict=True):
        part[plain] = np.maximum(accepted[plain] * np.abs(slope[plain]) / turned[plain], 1e-300)
    return reach


def winding(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: float, y: float, h: float, g: float
) -> int | None:
    """Return the degree of ``det W`` on the rectangle omega +- h, y +- g; None where its edge meets a zero."""
    # Along the edge in four straight pieces, the steps halved where the phase turns fast: beside a touch it
    # turns within a tiny part of the edge.
    edge = np.linspace(0.0, 4.0, 128, endpoint=False)
    sign = _edge_sign(loop, coordinate, edge, omega, y, h, g)
    for _ in range(40):
        if np.any(sign == 0.0):
            return None
        steps = np.angle(np.roll(sign, -1) / sign)
        coarse = np.abs(steps) > 0.8
        if not np.any(coarse):
            return int(np.rint(steps.sum() / (2.0 * np.pi)))
        if edge.size > 20_000:
            break
        ends = np.append(edge[1:], 4.0)
        middle = 0.5 * (edge + ends)[coarse]
        edge = np.append(edge, middle)
        sign = np.append(sign, _edge_sign(loop, coordinate, middle, omega, y, h, g))
        order = np.argsort(edge, kind="stable")
        edge, sign = edge[order], sign[order]
    return None


def _edge_sign(
    loop: CharacteristicMatrix,
    coordinate: Coordinate,
    edge: FloatArray,
    omega: float,
    y: float,
    h: float,
    g: float,
) -> ComplexArray:
    """Return the phase factor of ``det W`` at places 0..4 along the edge of a rectangle, counterclockwise."""
    side, t = np.floor(edge).astype(int) % 4, 2.0 * (edge - np.floor(edge)) - 1.0
    one = np.ones_like(t)
    x = np.choose(side, [t, one, -t, -one])
    z = np.choose(side, [-one, t, one, -t])
    return np.linalg.slogdet(axis_matrix(loop, coordinate, omega + h * x, y + g * z)[0])[0]


def _newton(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: FloatArray, y: FloatArray, y_scale: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Newton on the smallest singular value; return points, residuals and the relative Jacobian."""
    omega, y = omega.astype(float).copy(), y.astype(float).copy()
    best = [omega.copy(), y.copy(), np.full(omega.size, np.inf), np.zeros(omega.size)]
    active = np.arange(omega.size)
    for _ in range(40):
        if active.size == 0:
            break
        w_scale = np.maximum(np.abs(omega[active]), 1e-300)
        W, W_omega, W_y = axis_matrix(loop, coordinate, omega[active], y[active])
        left, values, right = np.linalg.svd(W)
        u, v = left[:, :, -1].conj()[:, None, :], right[:, -1, :].conj()[:, :, None]
        sigma = values[:, -1]
        by_omega, by_y = (u @ W_omega @ v)[:, 0, 0], (u @ W_y @ v)[:, 0, 0]
        a, b = by_omega * w_scale, by_y * y_scale
        natural = _norms(W_omega) * w_scale * _norms(W_y) * y_scale
        cross = (a.conj() * b).imag
        residual = sigma / axis_size(loop, omega[active])
        better = residual < best[2][active]
        chosen = active[better]
        best[0][chosen], best[1][chosen] = omega[chosen], y[chosen]
        best[2][chosen] = residual[better]
        best[3][chosen] = (cross / np.maximum(natural, 1e-300))[better]
        # Damped least squares: a full Newton step away from degenerate points, a bounded one near them.
        aa, bb, ab = np.abs(a) ** 2, np.abs(b) ** 2, (a.conj() * b).real
        damping = 1e-14 * (aa + bb) + 1e-300
        det = (aa + damping) * (bb + damping) - ab**2
        ra, rb = -sigma * a.real, -sigma * b.real
        dx = (ra * (bb + damping) - rb * ab) / det
        dy = (rb * (aa + damping) - ra * ab) / det
        limit = np.minimum(1.0, 0.3 / np.maximum(np.hypot(dx, dy), 1e-300))
        omega[active] += limit * dx * w_scale
        y[active] += limit * dy * y_scale
        moving = (np.hypot(dx, dy) > 1e-15) & (better | (best[2][active] > 1e-14)) & np.isfinite(dx)
        active = active[moving & (omega[active] > 0.0)]
    return best[0], best[1], best[2], best[3]


def zero_slopes(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: FloatArray, y: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the derivatives, with respect to omega and y, of the singular value that vanishes at each zero."""
    if omega.size == 0:
        return np.zeros(0, dtype=complex), np.zeros(0, dtype=complex)
    W, W_omega, W_y = axis_matrix(loop, coordinate, omega, y)
    left, _, right = np.linalg.svd(W)
    u, v = left[:, :, -1].conj()[:, None, :], right[:, -1, :].conj()[:, :, None]
    return (u @ W_omega @ v)[:, 0, 0], (u @ W_y @ v)[:, 0, 0]


def _norms(matrices: ComplexArray) -> FloatArray:
    return np.linalg.norm(matrices, axis=(1, 2))


def _nullity(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: FloatArray, y: FloatArray
) -> np.ndarray:
    """Return the dimension of the null space of W at each point."""
    if omega.size == 0:
        return np.zeros(0, dtype=int)
    values = np.linalg.svd(axis_matrix(loop, coordinate, omega, y)[0], compute_uv=False)
    return np.sum(values < 1e-8 * axis_size(loop, omega)[:, None], axis=1)


def _fold_point(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: float, y: float, w_scale: float, y_scale: float
) -> tuple[float, float] | None:
    """Refine a degenerate zero: there the Jacobian vanishes and so does one component of the bordered scalar.

    Newton on W alone keeps half the digits at such a point; this system is regular there.
    """
    W = axis_matrix(loop, coordinate, np.array([omega]), np.array([y]))[0][0]
    left, _, right = np.linalg.svd(W)
    size = W.shape[0]
    frame = np.zeros((size + 1, size + 1), dtype=complex)
    frame[:size, size] = left[:, -1]
    frame[size, :size] = right[-1]
    unit = np.zeros(size + 1)
    unit[-1] = 1.0

    def scalar(x: FloatArray) -> tuple[complex, complex, complex]:
        here, by_omega, by_y = (m[0] for m in axis_matrix(loop, coordinate, x[:1] * w_scale, x[1:] * y_scale))
        frame[:size, :size] = here
        column, row = np.linalg.solve(frame, unit), np.linalg.solve(frame.T, unit)
        slope = [-(row[:size] @ m @ column[:size]) for m in (by_omega * w_scale, by_y * y_scale)]
        return column[size], slope[0], slope[1]

    _, a, b = scalar(np.array([omega / w_scale, y / y_scale]))
    turn = (a if abs(a) > abs(b) else b).conjugate()
    weight = 1.0 / max(abs(a), abs(b)) ** 2

    def equations(x: FloatArray) -> FloatArray:
        g, g_omega, g_y = scalar(x)
        return weight * np.array([(turn * g).real, (g_omega.conjugate() * g_y).imag])

    x, best, best_size = np.array([omega / w_scale, y / y_scale]), None, np.inf
    for _ in range(8):
        value = equations(x)
        if np.abs(value).max() < best_size:
            best, best_size = x.copy(), float(np.abs(value).max())
        step = 1e-5
        jacobian = np.column_stack(
            [(equations(x + step * e) - equations(x - step * e)) / (2.0 * step) for e in np.eye(2)]
        )
        if not np.all(np.isfinite(jacobian)) or np.linalg.cond(jacobian) > 1e10:
            break
        change = np.linalg.solve(jacobian, -value)
        if np.abs(change).max() > 1e-3:
            break
        x = x + change
        if np.abs(change).max() < 1e-15:
            break
    if best is None:
        return None
    refined = best[0] * w_scale, best[1] * y_scale
    values = np.linalg.svd(axis_matrix(loop, coordinate, *np.array(refined))[0][0], compute_uv=False)
    # Two crossings closer than about 1e-6 (relative) are one touch; farther ones stay two crossings.
    return refined if values[-1] < 1e-13 * axis_size(loop, np.array(refined[:1]))[0] else None
