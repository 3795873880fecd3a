r"""Crossing curves over two delays that are shared by several signals each: traced numerically.

On a grid of frequency and first angle :math:`\theta_1` the eigenvalues :math:`\mu_i` of

.. math:: M = P_{22} + P_{21} z_1 (I - P_{11} z_1)^{-1} P_{12}, \qquad z_1 = e^{-j\theta_1},

say which :math:`z_2 = 1/\mu_i` close the second delay: a root is on the axis where ``|mu_i| = 1``. The sign of
:math:`\prod_i (1 - |\mu_i|^2)` changes across the curve. Every edge of the grid on which it does gives a point,
polished on the exact equation, and every cell joins its points. Where a root nearly ignores the second delay, a
long piece of its curve lies in one cell and leaves a gap; such gaps are closed by following the curve from the end
that leads into them.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import elementwise

from susp_ctrl.arrays import ComplexArray, FloatArray, numbered
from susp_ctrl.delay_systems.crossings import small_gain_bands
from susp_ctrl.delay_systems.maps.crossing_plane import Axis, turns_in_range
from susp_ctrl.delay_systems.maps.segments import Segments
from susp_ctrl.delay_systems.model import CharacteristicMatrix

_ANGLES = 192
# The first look is at every third frequency and angle.
_COARSE = 3
# Largest distance of a chord from the curve, relative to the ranges, and rounds of halving to get there.
_CHORD = 2e-5
_ROUNDS = 6
# Following a curve into a gap: first and longest step (rad of any of the three phases), steps at most.
_FIRST_STEP, _LONGEST_STEP = 0.01, 0.2
_STEPS = 300


class _Blocks:
    """The loop at (frequency, angle) points: eigenvalues, and the exact point on an edge."""

    def __init__(self, loop: CharacteristicMatrix, owner: np.ndarray, delays: FloatArray) -> None:
        self.loop, self.owner, self.delays = loop, owner, delays

    def eigenvalues(self, omega: FloatArray, theta: FloatArray) -> ComplexArray:
        """Return the mu_i, shape (points, width of the second block)."""
        frequencies, index = np.unique(omega, return_inverse=True)
        P = self.loop.response(frequencies)[index]
        phase = np.where(self.owner == 0, theta[:, None], omega[:, None] * self.delays * (self.owner < 0))
        PE = P * np.exp(-1j * phase)[:, None, :]
        second = self.owner == 1
        rest = ~second
        inner = np.eye(int(rest.sum())) - PE[:, rest][:, :, rest]
        try:
            gain = np.linalg.solve(inner, PE[:, rest][:, :, second])
        except np.linalg.LinAlgError:
            # The rest alone has a root exactly here: mu is infinite, and any large number says so.
            gain = np.linalg.solve(inner + 1e-15 * np.eye(inner.shape[1]), PE[:, rest][:, :, second])
        M = PE[:, second][:, :, second] + PE[:, second][:, :, rest] @ gain
        finite = np.all(np.isfinite(M), axis=(1, 2))
        mu = np.full(M.shape[:2], np.inf + 0j)
        mu[finite] = np.linalg.eigvals(M[finite])
        return mu

    def level(self, omega: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the product whose sign changes across a curve."""
        with np.errstate(divide="ignore"):
            return np.prod(-np.tanh(np.log(np.abs(self.eigenvalues(omega, theta)))), axis=1)


def trace_blocks(
    loop: CharacteristicMatrix, owner: np.ndarray, delays: FloatArray, x: Axis, y: Axis, fineness: int = 1
) -> Segments:
    """Return the crossing curves over the first (`owner` 0) and the second delay (`owner` 1).

    `owner` -1 marks channels of other delays, fixed at `delays`; the grid is `fineness` times finer than usual.
    """
    bands = small_gain_bands(loop)
    if bands.centre.size == 0:
        return Segments.joined([])
    blocks = _Blocks(loop, owner, delays)
    omega = _frequencies(bands.centre, bands.half, max(x.high, y.high), fineness)
    theta = np.linspace(0.0, 2.0 * np.pi, _ANGLES * fineness + 1)
    W, T = np.meshgrid(omega, theta + 1e-7, indexing="ij")
    positive = _signs(blocks, W, T)
    positive[:, -1] = positive[:, 0]
    along_omega = np.argwhere(positive[1:] != positive[:-1])
    along_theta = np.argwhere(positive[:, 1:] != positive[:, :-1])
    first = _edge_points(blocks, W, T, along_omega, np.array([1, 0]))
    second = _edge_points(blocks, W, T, along_theta, np.array([0, 1]))
    number_omega = np.full((W.shape[0] - 1, W.shape[1]), -1)
    number_omega[tuple(along_omega.T)] = np.arange(len(along_omega))
    number_theta = np.full((W.shape[0], W.shape[1] - 1), -1)
    number_theta[tuple(along_theta.T)] = np.arange(len(along_theta)) + len(along_omega)
    points = np.vstack([first, second])
    edges = np.stack(
        [number_omega[:, :-1], number_theta[1:], number_omega[:, 1:], number_theta[:-1]], axis=-1
    )
    scale = np.array([max(x.high, y.high), 1.0, 1.0])
    points, pairs = _gaps_closed(blocks, points, _joined(edges, points), scale, (omega[0], omega[-1]))
    return _unrolled(blocks, points, pairs, x, y)


def _signs(blocks: _Blocks, W: FloatArray, T: FloatArray) -> np.ndarray:
    """Tell where the level is positive: first on a coarse grid, then in the cells that a curve may enter.

    In those some ``log |mu_i|`` at a corner is no larger than twice what it changes by from corner to corner. The
    other cells have the sign of their corners, unless it changes from one point to the next: then both are looked at.
    """
    rows, columns = (np.unique(np.append(np.arange(0, size, _COARSE), size - 1)) for size in W.shape)
    coarse = np.ix_(rows, columns)
    mu = blocks.eigenvalues(W[coarse].ravel(), T[coarse].ravel()).reshape(rows.size, columns.size, -1)
    with np.errstate(divide="ignore"):
        sizes = np.sort(np.log(np.abs(mu)), axis=2)
    corners = [sizes[i : i + rows.size - 1, j : j + columns.size - 1] for i in (0, 1) for j in (0, 1)]
    with np.errstate(invalid="ignore"):
        change = np.max(corners, axis=0) - np.min(corners, axis=0)
        near = np.any(~(np.min(np.abs(corners), axis=0) > 2.0 * change), axis=2)
    (r0, r1), (c0, c1) = _cells_beside(rows, W.shape[0]), _cells_beside(columns, W.shape[1])
    asked = np.any([near[np.ix_(r, c)] for r in (r0, r1) for c in (c0, c1)], axis=0)
    outside = np.sum(sizes > 0.0, axis=2) % 2 == 0
    positive = outside[np.ix_(r1, c1)]
    known = np.zeros_like(positive)
    while np.any(asked):
        positive[asked] = blocks.level(W[asked], T[asked]) > 0.0
        known |= asked
        asked = np.zeros_like(positive)
        for here, there in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
            changes = positive[here] != positive[there]
            asked[here] |= changes
            asked[there] |= changes
        asked &= ~known
    return positive


def _cells_beside(edges: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells before and after every line of the fine grid; the same for a line inside a cell."""
    lines = np.arange(size)
    before, after = (np.searchsorted(edges, lines, side) - 1 for side in ("left", "right"))
    return np.clip(before, 0, edges.size - 2), np.clip(after, 0, edges.size - 2)


def _joined(edges: np.ndarray, points: FloatArray) -> np.ndarray:
    """Join the points of each cell to pieces of curves; return pairs of point numbers.

    Where two curves pass each other (with different second angles), both may leave a cell through one edge, on
    which the sign does not change then. Such a cell holds two points that do not belong together, and so does
    its neighbour beyond that edge: their four points are joined by their second angles.
    """
    z = np.exp(1j * points[:, 2])
    cells = edges.reshape(-1, 4)
    met = np.sum(cells >= 0, axis=1)
    two = np.sort(cells[met == 2], axis=1)[:, 2:]
    apart = np.abs(z[two[:, 0]] - z[two[:, 1]]) > 0.4
    pairs = [two[~apart]]
    stray = {
        divmod(int(k), edges.shape[1]): two[apart][n] for n, k in enumerate(np.flatnonzero(met == 2)[apart])
    }
    groups = [cell[[0, 1, 2, 3]] for cell in cells[met == 4]]
    for (row, column), own in stray.items():
        for place in ((row + 1, column), (row, (column + 1) % edges.shape[1])):
            if place in stray:
                groups.append(np.concatenate([own, stray[place]]))
    for group in groups:
        ways = [group[list(way)].reshape(2, 2) for way in ((0, 1, 2, 3), (0, 2, 1, 3), (0, 3, 1, 2))]
        apart_by = [float(np.abs(z[way[:, 0]] - z[way[:, 1]]).sum()) for way in ways]
        pairs.append(ways[int(np.argmin(apart_by))])
    return np.vstack(pairs)


def _gaps_closed(
    blocks: _Blocks, points: FloatArray, pairs: np.ndarray, scale: FloatArray, band: tuple[float, float]
) -> tuple[FloatArray, np.ndarray]:
    """Follow the curve from every end that leads into a gap until it meets an end that leads out of one."""
    loose = np.bincount(pairs.ravel(), minlength=len(points))[pairs] == 1
    piece, side = np.nonzero(loose)
    if piece.size < 2:
        return points, pairs
    ends, others = pairs[piece, side], pairs[piece, 1 - side]
    ahead = (
        np.sum(_turned(points[ends] - points[others]) * scale**2 * _tangent(blocks, points[ends]), axis=1) > 0
    )
    targets, number = ends[~ahead], ends[ahead]
    here, step = points[number], np.full(number.size, _FIRST_STEP)
    for _ in range(_STEPS):
        if not number.size or not targets.size:
            break
        direction = _unit(_tangent(blocks, here) * scale)
        there = _projected(blocks, here + step[:, None] * direction / scale, scale)
        moved = (there - here) * scale
        length = np.linalg.norm(moved, axis=1)
        straight = np.minimum(
            np.sum(direction * _unit(moved), axis=1),
            np.sum(direction * _unit(_tangent(blocks, there) * scale), axis=1),
        )
        good = (straight > 0.97) & (length < 2.0 * step)
        step = np.where(good, np.minimum(1.5 * step, _LONGEST_STEP), 0.5 * step)
        away = _turned(points[targets] - here[:, None]) * scale
        distance = np.linalg.norm(away, axis=2)
        nearest = np.argmin(distance, axis=1)
        # The end is met if the step would pass it: it lies ahead, and no farther than the step.
        met = good & (np.min(distance, axis=1) < 1.05 * length)
        pairs = np.vstack([pairs, np.column_stack([number[met], targets[nearest[met]]])])
        on = good & ~met & (there[:, 0] > band[0]) & (there[:, 0] < band[1])
        fresh = len(points) + np.arange(int(on.sum()))
        points = np.vstack([points, there[on]])
        pairs = np.vstack([pairs, np.column_stack([number[on], fresh])])
        here, number = here.copy(), number.copy()
        here[on], number[on] = there[on], fresh
        kept = on | (~good & (step > 1e-4 * _FIRST_STEP))
        here, number, step = here[kept], number[kept], step[kept]
    return points, pairs


def _turned(difference: FloatArray) -> FloatArray:
    """Return differences of (omega, theta1, theta2) with the angles taken the short way round."""
    result = difference.copy()
    result[..., 1:] = (result[..., 1:] + np.pi) % (2.0 * np.pi) - np.pi
    return result


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors of length one."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def _frequencies(centre: FloatArray, half: FloatArray, longest: float, fineness: int) -> FloatArray:
    """Frequencies in the bands, close enough for the resonances and for the turns of the delays."""
    parts = fineness * np.clip(np.ceil(2.0 * half * longest / 0.15), 8, 400).astype(int)
    grid = [c + h * np.linspace(-1.0, 1.0, n + 1) for c, h, n in zip(centre, half, parts, strict=True)]
    top = float((centre + half).max())
    omega = np.unique(np.concatenate([*grid, np.geomspace(1e-4 * top, top, 60 * fineness)]))
    omega = omega[omega >= 1e-4 * top]
    return omega[np.append(True, np.diff(omega) > 1e-9 * omega[1:])]


def _edge_points(
    blocks: _Blocks, W: FloatArray, T: FloatArray, edges: np.ndarray, step: np.ndarray
) -> FloatArray:
    """Find the zero of the level along each edge; return omega, theta1, theta2 of the nearest eigenvalue."""
    if len(edges) == 0:
        return np.zeros((0, 3))
    a, b = tuple(edges.T), tuple((edges + step).T)
    low = np.column_stack([W[a], T[a]])
    high = np.column_stack([W[b], T[b]])

    def along(share: FloatArray, *ends: FloatArray) -> FloatArray:
        w0, t0, w1, t1 = (end.ravel() for end in ends)
        s = share.ravel()
        return blocks.level(w0 + s * (w1 - w0), t0 + s * (t1 - t0)).reshape(share.shape)

    bracket = np.zeros(len(low)), np.ones(len(low))
    place = elementwise.find_root(along, bracket, args=(*low.T, *high.T), tolerances={"xatol": 1e-10}).x
    point = low + place[:, None] * (high - low)
    mu = blocks.eigenvalues(*point.T)
    with np.errstate(divide="ignore"):
        nearest = np.argmin(np.abs(np.log(np.abs(mu))), axis=1)
    return np.column_stack([point, np.angle(mu[np.arange(len(mu)), nearest])])


def _unrolled(blocks: _Blocks, points: FloatArray, pairs: np.ndarray, x: Axis, y: Axis) -> Segments:
    """Orient each piece and repeat it for every turn of both delays."""
    a, b = points[pairs[:, 0]], points[pairs[:, 1]]
    b = a + _turned(b - a)
    flip = np.sum((b - a) * _tangent(blocks, 0.5 * (a + b)), axis=1) < 0.0
    a[flip], b[flip] = b[flip].copy(), a[flip].copy()
    a, b = _refined(blocks, a, b, x, y)
    columns: list[np.ndarray] = []
    index = np.arange(len(a))
    for place, axis in ((1, x), (2, y)):
        w0, w1, u, v = a[index, 0], b[index, 0], a[index, place], b[index, place]
        first, repeats = turns_in_range(axis, w0, w1, u, v)
        owner, number = numbered(repeats)
        columns, index = [column[owner] for column in columns], index[owner]
        turn = 2.0 * np.pi * (first[owner] + number)
        columns += [(a[index, place] + turn) / a[index, 0], (b[index, place] + turn) / b[index, 0]]
    return Segments(
        np.column_stack([columns[0], columns[2]]), np.column_stack([columns[1], columns[3]]),
        np.full(index.size, 2), 0.5 * (a[index, 0] + b[index, 0]),
    )  # fmt: skip


def _refined(
    blocks: _Blocks, a: FloatArray, b: FloatArray, x: Axis, y: Axis
) -> tuple[FloatArray, FloatArray]:
    """Halve each piece until its middle is on the curve, as far as one sees it in the plane of the delays."""
    longest = np.array([max(x.high, y.high), 1.0, 1.0])
    done: list[tuple[FloatArray, FloatArray]] = []
    for _ in range(_ROUNDS):
        if len(a) == 0:
            break
        middle = 0.5 * (a + b)
        point = _projected(blocks, middle, longest)
        apart = np.linalg.norm((point - middle) * longest, axis=1)
        # A step that long leads to another curve.
        usable = np.isfinite(apart) & (apart < 0.3 * np.linalg.norm((b - a) * longest, axis=1))
        split = usable & (_bend(a, b, point, x, y) > _CHORD)
        done.append((a[~split], b[~split]))
        a, b = (
            np.concatenate([a[split], point[split]]), np.concatenate([point[split], b[split]])
        )  # fmt: skip
    done.append((a, b))
    return np.concatenate([p for p, _ in done]), np.concatenate([q for _, q in done])


def _bend(a: FloatArray, b: FloatArray, point: FloatArray, x: Axis, y: Axis) -> FloatArray:
    """Return how far a point is from the chord in shares of the ranges, in the first and the last turn in sight."""
    result = np.zeros(len(a))
    for share in (0.0, 1.0):
        places = []
        for place, axis in ((1, x), (2, y)):
            turn = (
                2.0 * np.pi * np.floor((axis.low + share * (axis.high - axis.low)) * a[:, 0] / (2.0 * np.pi))
            )
            places.append([(p[:, place] + turn) / p[:, 0] / (axis.high - axis.low) for p in (a, b, point)])
        (x0, x1, xp), (y0, y1, yp) = places
        dx, dy = x1 - x0, y1 - y0
        length = np.maximum(np.hypot(dx, dy), 1e-300)
        result = np.maximum(result, np.abs(dx * (yp - y0) - dy * (xp - x0)) / length)
    return result


def _projected(blocks: _Blocks, points: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the nearest points of the curve, by Newton steps of least length."""
    points = points.copy()
    for _ in range(3):
        value, gradient = _function(blocks, points)
        J = np.stack([gradient.real, gradient.imag], axis=1) / scale
        with np.errstate(all="ignore"):
            G = J @ np.swapaxes(J, 1, 2)
            det = G[:, 0, 0] * G[:, 1, 1] - G[:, 0, 1] ** 2
            weights = -value[:, None] * np.column_stack([G[:, 1, 1], -G[:, 0, 1]]) / det[:, None]
            step = np.einsum("pki,pk->pi", J, weights) / scale
        points += np.where(np.isfinite(step), step, np.nan)
        points = np.where(np.isfinite(points), points, 1.0)
    return points


def _tangent(blocks: _Blocks, points: FloatArray) -> FloatArray:
    """Return the direction of the curve in (omega, theta1, theta2) along which more roots lie to the right.

    It is the cross product of the gradients of real and imaginary part of the characteristic function; angles
    in place of delays leave the sense unchanged.
    """
    gradient = _function(blocks, points)[1]
    return np.cross(gradient.real, gradient.imag)


def _function(blocks: _Blocks, points: FloatArray) -> tuple[FloatArray, ComplexArray]:
    """Return the smallest singular value of ``I - P E``, which is real, and its derivatives as of u* (I - P E) v."""
    P = blocks.loop.response(points[:, 0])
    n, m = blocks.loop.n_states, blocks.loop.n_channels
    owner, fixed = blocks.owner, np.where(blocks.owner < 0, blocks.delays, 0.0)
    phase = np.where(owner == 0, points[:, 1:2], np.where(owner == 1, points[:, 2:3], points[:, :1] * fixed))
    E = np.exp(-1j * phase)
    T = np.eye(m) - P * E[:, None, :]
    left, values, right = np.linalg.svd(T)
    u, v = left[:, :, -1].conj(), right[:, -1, :].conj()
    resolvent = np.linalg.inv(1j * points[:, 0, None, None] * np.eye(n) - blocks.loop.A)
    slope = -1j * blocks.loop.C @ resolvent @ resolvent @ blocks.loop.B
    Ev = E * v

    def derivative(matrix: ComplexArray, vector: ComplexArray) -> ComplexArray:
        return np.einsum("pi,pij,pj->p", u, matrix, vector)

    by_omega = -derivative(slope, Ev) + 1j * derivative(P, fixed * Ev)
    by_first, by_second = 1j * derivative(P, (owner == 0) * Ev), 1j * derivative(P, (owner == 1) * Ev)
    return values[:, -1], np.stack([by_omega, by_first, by_second], axis=1)
