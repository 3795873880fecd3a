r"""Branch and bound: all roots on the axis along a line of delays, with a proof that there are no others.

Boxes in the plane of frequency and y are halved until they are excluded (`box_exclusion`) or small. What is left are
small boxes about the roots on the axis, from which Newton starts; a box near no root that was found is refined.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.crossings.axis_zeros import Zeros, polished_zeros, zero_slopes
from susp_ctrl.delay_systems.crossings.box_exclusion import BoxTest
from susp_ctrl.delay_systems.crossings.delay_line import Coordinate
from susp_ctrl.delay_systems.crossings.small_gain import Bands
from susp_ctrl.delay_systems.model import CharacteristicMatrix

# Boxes that may be tested in one search, and in all searches of one sweep.
_BOX_BUDGET = 400_000


class Work:
    """What all searches of one task may still spend, in boxes tested."""

    def __init__(self, boxes: int = _BOX_BUDGET) -> None:
        self.left = boxes
        self.spent = False


class Search(NamedTuple):
    """Zeros found and whether the search proves that there are no others."""

    zeros: Zeros
    complete: bool


def search_zeros(
    loop: CharacteristicMatrix,
    coordinate: Coordinate,
    bands: Bands,
    y_range: tuple[float, float],
    *,
    turn: float | None = None,
    latest: float = np.inf,
    lowest: float = 0.0,
    work: Work | None = None,
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
    work
        What may be spent, shared with other searches; without it a search has its own limit. When it runs out the
        zeros found so far are returned, as not complete.
    """
    work = work or Work()
    test = BoxTest(loop, coordinate)
    y_scale = (y_range[1] - y_range[0]) if turn is None else turn
    parts = 16
    g0 = (y_range[1] - y_range[0]) / (2 * parts)
    rows = y_range[0] + g0 * (2.0 * np.arange(parts) + 1.0)
    c, h = np.repeat(bands.centre, parts), np.repeat(bands.half, parts)
    y, g = np.tile(rows, bands.centre.size), np.full(c.size, g0)
    found = Zeros(np.zeros(0), np.zeros(0), np.zeros(0, dtype=int))
    for resolution in (4e-3, 4e-4, 4e-5, 4e-6):
        boxes, finished = _survivors(test, (c, h, y, g), resolution, latest, lowest, work)
        c, h, y, g = boxes
        if c.size == 0:
            return Search(found, finished)
        starts = _spread_out(c, h, y, g)
        found = polished_zeros(loop, coordinate, c[starts], y[starts], turn=turn, y_scale=y_scale)
        if turn is None:
            # A zero on the edge of the range belongs to it; one that Newton ran to outside does not.
            inside = (found.y >= y_range[0] - 1e-9 * y_scale) & (found.y <= y_range[1] + 1e-9 * y_scale)
            found = Zeros(*(part[inside] for part in found))
        if not finished:
            break
        slopes = zero_slopes(loop, coordinate, found.omega, found.y)
        unexplained = ~_explained(found, slopes, c, h, y, g, turn)
        if not np.any(unexplained):
            return Search(found, True)
    return Search(found, False)


def _survivors(
    test: BoxTest,
    boxes: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    resolution: float,
    latest: float,
    lowest: float,
    work: Work,
) -> tuple[tuple[FloatArray, FloatArray, FloatArray, FloatArray], bool]:
    """Subdivide boxes until each is excluded or smaller than `resolution`; False where the budget ran out."""
    c, h, y, g = boxes
    kept: list[tuple[FloatArray, ...]] = []
    while c.size:
        possible = (y - g < (c + h) * latest) & (c + h > lowest)
        c, h, y, g = c[possible], h[possible], y[possible], g[possible]
        if c.size == 0:
            break
        work.left -= c.size
        open_box, width, wide = test(c, h, y, g)
        c, h, y, g = c[open_box], h[open_box], y[open_box], g[open_box]
        width, wide = width[open_box], wide[open_box]
        fine = width <= resolution
        kept.append((c[fine], h[fine], y[fine], g[fine]))
        c, h, y, g, wide = (part[~fine] for part in (c, h, y, g, wide))
        if 2 * c.size > work.left:
            work.spent = True
            kept.append((c, h, y, g))
            return _joined(kept), False
        sign = np.repeat([-0.5, 0.5], c.size)
        c, h, y, g, wide = (np.tile(part, 2) for part in (c, h, y, g, wide))
        c, y = c + sign * h * wide, y + sign * g * ~wide
        h, g = np.where(wide, h / 2.0, h), np.where(wide, g, g / 2.0)
    return _joined(kept), True


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
    zeros: Zeros,
    slopes: tuple[np.ndarray, np.ndarray],
    c: FloatArray,
    h: FloatArray,
    y: FloatArray,
    g: FloatArray,
    turn: float | None,
) -> np.ndarray:
    """Tell which boxes lie near a zero that was found; `slopes` are those of the function there."""
    gap_y = y[:, None] - zeros.y
    if turn is not None:
        gap_y = gap_y - turn * np.round(gap_y / turn)
    gap_omega = c[:, None] - zeros.omega
    reach = np.hypot(gap_omega / h[:, None], gap_y / g[:, None])
    # About a touch the boxes left over reach as far as the root of their size, and about a simple zero at which
    # real and imaginary part have nearly the same direction they form a long strip: there the function is as
    # small as it varies in a box.
    near = reach <= np.where(zeros.degree == 0, 2000.0, 60.0)
    by_omega, by_y = slopes
    value = np.abs(by_omega * gap_omega + by_y * gap_y)
    small = value <= 4.0 * (np.abs(by_omega) * h[:, None] + np.abs(by_y) * g[:, None])
    return np.any(near | ((reach <= 2000.0) & small), axis=1)
