"""Connected regions of a stability map, and which of their numbers independent counts confirm.

The numbers that follow from the curves are believed everywhere only if every count made, over the whole rectangle,
confirms them. Otherwise the counts speak alone: a region has a number where all counts made inside agree, and in a
region where they do not, only the cells of a lattice of counts have one whose corners agree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import scipy.ndimage

from susp_ctrl.arrays import FloatArray

# Raster on which connected regions are told apart, how many of them are counted independently, and how many
# points along each axis besides.
_RASTER = 240
_CHECKED_REGIONS = 20
_SPREAD = 4
# Where the numbers are not confirmed as a whole: regions that are looked at one by one, counts in each, and points
# of a lattice of counts along each axis.
_SINGLE_REGIONS = 40
_COUNTS_EACH = 5
_LATTICE = 17
# Irrational offsets keep the raster off the straight lines on which curves like to lie.
_OFFSET = (np.sqrt(2.0) - 1.0, np.sqrt(3.0) - 1.0)

Count = Callable[[float, float], "int | None"]


@dataclass(frozen=True, eq=False)
class Raster:
    """Points of the rectangle from `low` to `high` on which connected regions are told apart."""

    low: FloatArray
    high: FloatArray

    @cached_property
    def step(self) -> FloatArray:
        """Distance of the points along each axis."""
        return (self.high - self.low) / _RASTER

    @cached_property
    def x(self) -> FloatArray:
        """First coordinate of every point, row by row."""
        return np.tile(self._along(0), _RASTER)

    @cached_property
    def y(self) -> FloatArray:
        """Second coordinate of every point."""
        return np.repeat(self._along(1), _RASTER)

    def _along(self, axis: int) -> FloatArray:
        return np.asarray(self.low[axis] + self.step[axis] * (np.arange(_RASTER) + _OFFSET[axis]))

    def nearest(self, x: FloatArray, y: FloatArray) -> np.ndarray:
        """Return the number of the raster point next to each point."""
        places = [
            np.clip(np.rint((values - self.low[k]) / self.step[k] - _OFFSET[k]), 0, _RASTER - 1).astype(int)
            for k, values in enumerate((x, y))
        ]
        return places[1] * _RASTER + places[0]


@dataclass(frozen=True, eq=False)
class MapRegions:
    """Regions of equal number on a raster.

    Attributes
    ----------
    raster : Raster
    relative : ndarray of int
        Change of roots from the reference point to every raster point.
    labels : ndarray of int
        Region of every raster point.
    roots : ndarray of int
        Number of unstable roots at every raster point; -1 where it is not known.
    offset : int
        What has to be added to a change to give a number, where `decided`.
    decided : bool
        Whether all counts confirm the numbers.
    table : pandas.DataFrame
        One row per region.
    """

    raster: Raster
    relative: np.ndarray
    labels: np.ndarray
    roots: np.ndarray
    offset: int
    decided: bool
    table: pd.DataFrame

    def known_roots(self, x: FloatArray, y: FloatArray, relative: np.ndarray) -> np.ndarray:
        """Return the number at points with the given change: that of the region there, -1 if it is not known."""
        if self.decided:
            return self.offset + relative
        place = self.raster.nearest(x, y)
        # Beside a curve the nearest raster point may lie beyond it.
        return np.where(self.relative[place] == relative, self.roots[place], -1)


def map_regions(raster: Raster, relative: np.ndarray, other: np.ndarray, count: Count) -> MapRegions:
    """Tell regions apart and count in them.

    Parameters
    ----------
    raster : Raster
    relative, other : ndarray of int
        Change of roots from the reference point to each raster point along two different ways.
    count : callable
        Number of unstable roots at (x, y) by the argument principle; None where it cannot tell.
    """
    labels, clear = _labels(relative)
    total = int(labels.max()) + 1
    inner = np.array(scipy.ndimage.maximum_position(clear, labels, np.arange(total)))
    place = inner[:, 0] * _RASTER + inner[:, 1]
    labels, clear = labels.ravel(), clear.ravel()
    area = np.bincount(labels, minlength=total) / labels.size
    widest = np.argsort(-clear[place], kind="stable")
    counted: dict[int, int | None] = {}

    def counts_at(places: np.ndarray) -> None:
        for k in places:
            if int(k) not in counted:
                counted[int(k)] = count(float(raster.x[k]), float(raster.y[k]))

    # A region one point wide lies on a curve.
    counts_at(place[[k for k in widest if clear[place[k]] > 1.0][:_CHECKED_REGIONS]])
    even = (_RASTER * (2 * np.arange(_SPREAD) + 1)) // (2 * _SPREAD)
    spread = (even[:, None] * _RASTER + even).ravel()
    # Points spread over the whole rectangle as well: they find a curve that is missing altogether.
    counts_at(spread[clear[spread] > 2.0])
    offsets = {value - int(relative[k]) for k, value in counted.items() if value is not None}
    offset = min(offsets, default=0)
    # Along another way the same numbers must come out: a curve with a gap shows.
    decided = len(offsets) == 1 and np.array_equal(other, relative) and int(relative.min()) + offset >= 0
    if decided:
        roots = offset + relative
        of_region = roots[place]
    else:
        for k in np.argsort(-area, kind="stable")[:_SINGLE_REGIONS]:
            own = np.flatnonzero((labels == k) & (clear > 1.0))
            counts_at(own[np.linspace(0, own.size - 1, min(_COUNTS_EACH, own.size)).astype(int)])
        lattice = np.rint(np.linspace(0, _RASTER - 1, _LATTICE)).astype(int)
        counts_at((lattice[:, None] * _RASTER + lattice).ravel())
        of_region = _confirmed(labels, counted, total)
        torn = np.unique(labels[other - other[place[widest[0]]] != relative - relative[place[widest[0]]]])
        # Where the two ways differ, one of them met a gap: only the counts speak for these regions.
        few = [k for k in torn if sum(labels[p] == k for p in counted) < _COUNTS_EACH]
        of_region[few] = -1
        roots = of_region[labels]
        open_points = np.flatnonzero(roots < 0)
        roots[open_points] = _local_counts(open_points, labels, counted, lattice)
    table = pd.DataFrame(
        {
            "unstable_roots": of_region,
            "area": area,
            "x": raster.x[place],
            "y": raster.y[place],
            "counted": [-1 if (n := counted.get(int(p))) is None else n for p in place],
        }
    )
    table = table.sort_values("area", ascending=False, kind="stable").reset_index(drop=True)
    return MapRegions(raster, relative, labels, roots, offset, bool(decided), table)


def _confirmed(labels: np.ndarray, counted: dict[int, int | None], total: int) -> np.ndarray:
    """Return the number of each region in which every count gave the same; -1 for the others."""
    seen: dict[int, set[int | None]] = {}
    for place, value in counted.items():
        seen.setdefault(int(labels[place]), set()).add(value)
    roots = np.full(total, -1)
    for label, values in seen.items():
        known = {value for value in values if value is not None}
        if len(values) == 1 and known:
            roots[label] = known.pop()
    return roots


def _local_counts(
    points: np.ndarray, labels: np.ndarray, counted: dict[int, int | None], lattice: np.ndarray
) -> np.ndarray:
    """Return the number on which those corners of a point's lattice cell agree that lie in its region, else -1."""
    counts = np.full(labels.size, -2)
    for place, value in counted.items():
        counts[place] = -1 if value is None else value
    low = [
        np.clip(np.searchsorted(lattice, place, "right") - 1, 0, lattice.size - 2)
        for place in np.divmod(points, _RASTER)
    ]
    corners = np.stack([lattice[low[0] + i] * _RASTER + lattice[low[1] + j] for i in (0, 1) for j in (0, 1)])
    own = labels[corners] == labels[points]
    least = np.min(np.where(own, counts[corners], np.iinfo(int).max), axis=0)
    most = np.max(np.where(own, counts[corners], -1), axis=0)
    return np.where(least == most, most, -1)


def _labels(number: np.ndarray) -> tuple[np.ndarray, FloatArray]:
    """Return the connected region of each raster point, and its distance from any other region in points."""
    grid = number.reshape(_RASTER, _RASTER)
    labels = np.zeros(grid.shape, dtype=int)
    total = 0
    for value in np.unique(grid):
        own, found = scipy.ndimage.label(grid == value)
        labels[own > 0] = own[own > 0] + total
        total += found
    edge = np.zeros(grid.shape, dtype=bool)
    for axis in (0, 1):
        change = np.diff(labels, axis=axis) != 0
        before, after = ((slice(None, -1), slice(None)), (slice(1, None), slice(None)))
        if axis == 1:
            before, after = before[::-1], after[::-1]
        edge[before] |= change
        edge[after] |= change
    clear = scipy.ndimage.distance_transform_edt(np.pad(~edge, 1, constant_values=True))[1:-1, 1:-1]
    return labels - 1, clear
