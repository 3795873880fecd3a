r"""Branch and bound: where on the axis no root can be, proven by bounds on how fast the loop changes.

With ``T = I - P(jw) F``, ``F = E - K``, and a box ``|delta omega| <= h``, ``|delta y| <= g`` about a centre c,

.. math::

    \frac{\det T}{\det T_c} = 1 + a\,\delta\omega + b\,\delta y + r, \qquad
    a = \mathrm{tr}\,T_c^{-1} T_\omega, \quad b = \mathrm{tr}\,T_c^{-1} T_y,

and the box holds no root if the parallelogram of the linear part stays farther from zero than ``|r|`` can reach.
The remainder is bounded, entry by entry, from

.. math::

    P - P_c = \delta\omega P' + r_P, \qquad |r_P| \le \frac{h^2 \rho}{1 - h \rho} \|C R\| \|R B\|, \qquad
    R = (jcI - A)^{-1}, \; \rho = \|R\|,

from ``|e^{-jx} - 1 + jx| <= x^2/2`` and, for the orders of the determinant above the first, from
``prod(1 + k_i) - 1 - sum(k_i)`` with the row sums ``k_i`` of ``|T_c^{-1}| |T - T_c|``. K is a constant feedback
taken into the plant that keeps its poles off the axis. Frequencies at which the loop gain is small,
``rho(|P|) < 1``, are excluded for all delays at once. What is left are small boxes about the roots on the axis,
from which Newton starts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.delay_systems.crossings import Zeros, polished_zeros
from susp_ctrl.delay_systems.delay_line import Coordinate, LoopMatrices
from susp_ctrl.delay_systems.lft import ComplexArray, FloatArray

_BOX_BUDGET = 400_000


class Bands(NamedTuple):
    """Frequency intervals, as centre and half width, outside which the loop gain is proven small."""

    centre: FloatArray
    half: FloatArray


class _Local(NamedTuple):
    """P at some frequencies, its derivative, and the factors that bound the rest of its change."""

    P: ComplexArray
    slope: ComplexArray
    left: FloatArray
    right: FloatArray
    rho: FloatArray

    def rest(self, h: FloatArray) -> FloatArray:
        """Bound the change of P within h beyond the first order; infinite where P may have a pole."""
        hr = h * self.rho
        with np.errstate(all="ignore"):
            factor = np.where(hr < 1.0, h**2 * self.rho / (1.0 - hr), np.inf)
            return factor[:, None, None] * self.left[:, :, None] * self.right[:, None, :]

    def at(self, index: np.ndarray) -> _Local:
        """Return the values at some of the frequencies."""
        return _Local(*(part[index] for part in self))


def small_gain_bands(loop: LoopMatrices, margin: float = 1.0) -> Bands:
    """Return the frequency intervals that remain after excluding ``rho(|P22(jw)|) < 1 / margin``.

    An empty result proves that no root is ever on the axis at ``w >= 0``, for whatever delays and any gains
    grown up to `margin` times.
    """
    if loop.n_channels == 0 or loop.n_states == 0:
        return Bands(np.zeros(0), np.zeros(0))
    shifted, _ = _shifted(loop)
    top = frequency_bound(loop, margin)
    centre, half = (np.arange(16) + 0.5) * (top / 16), np.full(16, top / 32)
    done: list[tuple[FloatArray, FloatArray]] = []
    moved = shifted is not loop
    for _ in range(60):
        if centre.size == 0:
            break
        local = _local(loop, centre)
        gain = np.abs(local.P) + half[:, None, None] * np.abs(local.slope) + local.rest(half)
        large = ~(perron_bound(gain) * margin < 1.0)
        centre, half = centre[large], half[large]
        rho = (_local(shifted, centre) if moved else local.at(large)).rho
        fine = half * rho <= 0.2
        done.append((centre[fine], half[fine]))
        centre, half = centre[~fine], half[~fine]
        if centre.size > _BOX_BUDGET:
            break
        half = np.repeat(half / 2.0, 2)
        centre = np.repeat(centre, 2) + half * np.tile([-1.0, 1.0], centre.size)
    done.append((centre, half))
    return Bands(np.concatenate([c for c, _ in done]), np.concatenate([h for _, h in done]))


def frequency_bound(loop: LoopMatrices, margin: float = 1.0) -> float:
    """Return a frequency above which ``rho(|P22(jw)|) < 1 / margin``: no root on the axis is above it.

    For ``w > ||A||`` it holds that ``|P22(jw)| <= |D| + |C| |B| / (w - ||A||)`` with the norms of rows and
    columns, and the cycles of D have no weight.
    """
    norm = float(np.linalg.norm(loop.A, 2)) if loop.n_states else 0.0
    outer = np.outer(np.linalg.norm(loop.C, axis=1), np.linalg.norm(loop.B, axis=0))
    gap = max(1e-6 * norm, 1e-12)
    for _ in range(400):
        if perron_bound(margin * (np.abs(loop.D) + outer / gap)[None])[0] < 1.0:
            break
        gap *= 1.5
    return norm + gap


def perron_bound(matrices: FloatArray) -> FloatArray:
    """Return a rigorous upper bound, close to it, on the spectral radius of non-negative matrices."""
    if matrices.shape[-1] == 1:
        return matrices[..., 0, 0]
    if matrices.shape[-1] == 2:
        a, b, c, d = matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 0], matrices[..., 1, 1]
        with np.errstate(invalid="ignore"):
            return 0.5 * (a + d) + np.sqrt(0.25 * (a - d) ** 2 + b * c)
    # Collatz and Wielandt: the largest row sum after any diagonal scaling is an upper bound.
    with np.errstate(all="ignore"):
        return _scaled_row_sums(matrices).max(axis=-1)


class Search(NamedTuple):
    """Zeros found and whether the search proves that there are no others."""

    zeros: Zeros
    complete: bool


def search_zeros(
    loop: LoopMatrices,
    coordinate: Coordinate,
    bands: Bands,
    y_range: tuple[float, float],
    *,
    turn: float | None = None,
    latest: float = np.inf,
    lowest: float = 0.0,
) -> Search:
    """Find all zeros ``(omega, y)`` with omega in `bands` and y in `y_range`.

    Parameters
    ----------
    loop, coordinate
        The loop and the meaning of y.
    bands
        Frequencies to search.
    y_range
        Range of y.
    turn
        Period of y, if it is an angle.
    latest
        Boxes in which ``y >= omega latest`` throughout are left out (they stand for later delays).
    lowest
        Frequencies below it are left out.
    """
    shifted, K = _shifted(loop)
    y_scale = (y_range[1] - y_range[0]) if turn is None else turn
    parts = 16
    g0 = (y_range[1] - y_range[0]) / (2 * parts)
    rows = y_range[0] + g0 * (2.0 * np.arange(parts) + 1.0)
    c, h = np.repeat(bands.centre, parts), np.repeat(bands.half, parts)
    y, g = np.tile(rows, bands.centre.size), np.full(c.size, g0)
    found = Zeros(np.zeros(0), np.zeros(0), np.zeros(0, dtype=int))
    for resolution in (4e-3, 4e-4, 4e-5, 4e-6):
        boxes, finished = _survivors(shifted, K, coordinate, (c, h, y, g), resolution, latest, lowest)
        c, h, y, g = boxes
        if c.size == 0:
            return Search(found, finished)
        if not finished:
            break
        starts = _spread_out(c, h, y, g)
        found = polished_zeros(loop, coordinate, c[starts], y[starts], turn=turn, y_scale=y_scale)
        if turn is None:
            # A zero on the edge of the range belongs to it; one that Newton ran to outside does not.
            inside = (found.y >= y_range[0] - 1e-9 * y_scale) & (found.y <= y_range[1] + 1e-9 * y_scale)
            found = Zeros(*(part[inside] for part in found))
        unexplained = ~_explained(found, c, h, y, g, turn)
        if not np.any(unexplained):
            return Search(found, True)
    return Search(found, False)


def _survivors(
    loop: LoopMatrices,
    K: float,
    coordinate: Coordinate,
    boxes: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    resolution: float,
    latest: float,
    lowest: float,
) -> tuple[tuple[FloatArray, FloatArray, FloatArray, FloatArray], bool]:
    """Subdivide boxes until each is excluded or smaller than `resolution`; False where the budget ran out."""
    c, h, y, g = boxes
    kept: list[tuple[FloatArray, ...]] = []
    work = 0
    while c.size:
        work += c.size
        possible = (y - g < (c + h) * latest) & (c + h > lowest)
        c, h, y, g = c[possible], h[possible], y[possible], g[possible]
        if c.size == 0:
            break
        frequencies, index = np.unique(c, return_inverse=True)
        local = _local(loop, frequencies)
        open_box = ~_excluded(local.at(index), K, coordinate, c, h, y, g)
        c, h, y, g, index = c[open_box], h[open_box], y[open_box], g[open_box], index[open_box]
        zero = np.zeros_like(h)
        by_omega = coordinate.spread(c, y, h, zero).max(axis=1, initial=0.0) + h * local.rho[index]
        by_y = coordinate.spread(c, y, zero, g).max(axis=1, initial=0.0)
        fine = (by_omega <= resolution) & (by_y <= resolution)
        kept.append((c[fine], h[fine], y[fine], g[fine]))
        c, h, y, g, wide = c[~fine], h[~fine], y[~fine], g[~fine], (by_omega > by_y)[~fine]
        if work + 2 * c.size > _BOX_BUDGET:
            kept.append((c, h, y, g))
            return _joined(kept), False
        sign = np.repeat([-0.5, 0.5], c.size)
        c, h, y, g, wide = (np.tile(part, 2) for part in (c, h, y, g, wide))
        c, y = c + sign * h * wide, y + sign * g * ~wide
        h, g = np.where(wide, h / 2.0, h), np.where(wide, g, g / 2.0)
    return _joined(kept), True


def _excluded(
    local: _Local,
    K: float,
    coordinate: Coordinate,
    c: FloatArray,
    h: FloatArray,
    y: FloatArray,
    g: FloatArray,
) -> np.ndarray:
    """Tell which boxes are proven to hold no root."""
    E = np.exp(-1j * coordinate.phases(c, y))
    F = (E - K)[:, None, :]
    by_omega, by_y = coordinate.slopes(c, y)
    spread = coordinate.spread(c, y, h, g)
    # The part of the phase that is bilinear in both half widths is not in the slopes.
    bilinear = np.maximum(spread - h[:, None] * np.abs(by_omega) - g[:, None] * np.abs(by_y), 0.0)
    change_E = np.minimum(spread, 2.0)[:, None, :]
    rest_E = (0.5 * spread**2 + bilinear)[:, None, :]
    P, h3 = np.abs(local.P), h[:, None, None]
    rest_P = local.rest(h)
    with np.errstate(all="ignore"):
        inverse = _inverse(np.eye(P.shape[-1]) - local.P * F)
        change_P = h3 * np.abs(local.slope) + rest_P
        change = change_P * (np.abs(F) + change_E) + P * change_E
        rest = rest_P * np.abs(F) + P * rest_E + change_P * change_E
        transposed = np.swapaxes(inverse, 1, 2)
        T_omega = -local.slope * F + 1j * local.P * (by_omega * E)[:, None, :]
        T_y = 1j * local.P * (by_y * E)[:, None, :]
        a = h * np.sum(transposed * T_omega, axis=(1, 2))
        b = g * np.sum(transposed * T_y, axis=(1, 2))
        X = np.abs(inverse) @ change
        rows = _scaled_row_sums(X)
        higher = np.prod(1.0 + rows, axis=1) - 1.0 - np.sum(rows, axis=1)
        remainder = higher + np.sum(np.abs(transposed) * rest, axis=(1, 2))
        gap = np.fmax(1.0 - np.abs(a) - np.abs(b), np.fmax(_beyond(a, b), _beyond(b, a)))
        return (gap > remainder + 1e-13) | (rows.max(axis=1) < 1.0 - 1e-13)


def _scaled_row_sums(X: FloatArray) -> FloatArray:
    """Return the row sums of non-negative matrices after a diagonal scaling that makes them nearly equal.

    Neither the determinant nor the spectral radius depends on the scaling of the channels.
    """
    if X.shape[-1] == 1:
        return X[:, 0]
    x = np.ones(X.shape[:-1])
    for _ in range(6):
        x = (X @ x[..., None])[..., 0] + 1e-2 * x
        x = x / x.max(axis=-1, keepdims=True) + 1e-9
    return (X @ x[..., None])[..., 0] / x


def _beyond(a: ComplexArray, b: ComplexArray) -> FloatArray:
    """Return how far zero lies outside the strip ``1 + [-1, 1] a + [-1, 1] b`` seen along the normal of a."""
    normal = 1j * a / np.abs(a)
    return np.abs(normal.real) - np.abs((normal.conj() * b).real)


def _joined(kept: list[tuple[FloatArray, ...]]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    if not kept:
        empty = np.zeros(0)
        return empty, empty, empty, empty
    c, h, y, g = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    return c, h, y, g


def _spread_out(c: FloatArray, h: FloatArray, y: FloatArray, g: FloatArray) -> np.ndarray:
    """Return positions of boxes to start Newton from: at most some hundreds, one per neighbourhood."""
    if c.size <= 200:
        return np.arange(c.size)
    cells = np.column_stack([np.round(c / (8.0 * h.max())), np.round(y / (8.0 * g.max()))])
    return np.unique(cells, axis=0, return_index=True)[1]


def _explained(
    zeros: Zeros, c: FloatArray, h: FloatArray, y: FloatArray, g: FloatArray, turn: float | None
) -> np.ndarray:
    """Tell which boxes lie near a zero that was found."""
    gap_y = y[:, None] - zeros.y
    if turn is not None:
        gap_y = gap_y - turn * np.round(gap_y / turn)
    reach = np.hypot((c[:, None] - zeros.omega) / h[:, None], gap_y / g[:, None])
    # About a touch the boxes left over reach as far as the root of their size.
    limit = np.where(zeros.degree == 0, 2000.0, 60.0)
    return np.any(reach <= limit, axis=1)


def _shifted(loop: LoopMatrices) -> tuple[LoopMatrices, float]:
    """Return the loop with K times every channel closed, its poles off the axis, and K."""
    if loop.n_states == 0:
        return loop, 0.0

    def clearance(matrix: FloatArray) -> float:
        values = np.linalg.eigvals(matrix)
        return float(np.min(np.abs(values.real) / (np.abs(values) + 1e-3 * np.abs(values).max() + 1e-300)))

    best, best_clearance, best_K = loop, clearance(loop.A), 0.0
    if best_clearance > 1e-2:
        return loop, 0.0
    for K in (0.5, -0.5, 0.9, -0.9, 0.2, -0.2):
        around = np.linalg.inv(np.eye(loop.n_channels) - K * loop.D)
        closed = LoopMatrices(
            loop.A + K * loop.B @ around @ loop.C, loop.B @ (np.eye(loop.n_channels) + K * around @ loop.D),
            around @ loop.C, around @ loop.D,
        )  # fmt: skip
        room = clearance(closed.A)
        if room > best_clearance:
            best, best_clearance, best_K = closed, room, K
        if room > 3e-2:
            break
    return best, best_K


def _local(loop: LoopMatrices, omega: FloatArray) -> _Local:
    """Sample P and the bounds on its change at many frequencies."""
    n = loop.n_states
    with np.errstate(all="ignore"):
        resolvent = _inverse(1j * omega[:, None, None] * np.eye(n) - loop.A)
        CR, RB = loop.C @ resolvent, resolvent @ loop.B
        rho = np.linalg.norm(resolvent, axis=(1, 2))
    rho = np.where(np.isfinite(rho), rho, np.inf)
    P, slope = CR @ loop.B + loop.D, -1j * (CR @ RB)
    return _Local(P, slope, np.linalg.norm(CR, axis=2), np.linalg.norm(RB, axis=1), rho)


def _inverse(matrices: ComplexArray) -> ComplexArray:
    """Invert many matrices; a singular one gives infinite entries."""
    if matrices.shape[-1] == 1:
        with np.errstate(all="ignore"):
            return 1.0 / matrices
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        singular = np.linalg.det(matrices) == 0.0
        result = np.full_like(matrices, np.inf)
        result[~singular] = np.linalg.inv(matrices[~singular])
        return result
