"""Oriented segments of crossing curves in a plane: counting roots and distances with them.

A segment runs so that the side to its right has `roots` more unstable roots than the side to its left. The number
at a point is that of a reference point plus what is crossed on the way, up or down first, then across.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.spatial

from susp_ctrl.arrays import FloatArray, numbered

_BINS = 1024


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments from `start` to `end`, shape (n, 2), with the change of roots and the crossing frequency."""

    start: FloatArray
    end: FloatArray
    roots: np.ndarray
    omega: FloatArray

    @property
    def count(self) -> int:
        """Number of segments."""
        return self.roots.size

    def inside(self, low: FloatArray, high: FloatArray) -> Segments:
        """Return the segments whose box meets the rectangle."""
        smallest, largest = np.minimum(self.start, self.end), np.maximum(self.start, self.end)
        kept = np.all((largest >= low) & (smallest <= high), axis=1) & np.all(
            np.isfinite(smallest + largest), axis=1
        )
        return Segments(self.start[kept], self.end[kept], self.roots[kept], self.omega[kept])

    @staticmethod
    def joined(parts: list[Segments]) -> Segments:
        """Return all segments of several sets."""
        if not parts:
            return Segments(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=int), np.zeros(0))
        return Segments(
            np.concatenate([p.start for p in parts]),
            np.concatenate([p.end for p in parts]),
            np.concatenate([p.roots for p in parts]),
            np.concatenate([p.omega for p in parts]),
        )

    def crossed_across(self, x_from: float, x: FloatArray, y: FloatArray) -> np.ndarray:
        """Return the change of roots on the way from (x_from, y) to (x, y), for arrays of points."""
        return self._crossed(self.start, self.end, x_from, x, y)

    def crossed_up(self, x: float | FloatArray, y_from: float, y: FloatArray) -> np.ndarray:
        """Return the change of roots on the way from (x, y_from) to (x, y)."""
        # Mirrored at the diagonal: left and right change places.
        return self._crossed(self.end[:, ::-1], self.start[:, ::-1], y_from, y, np.full_like(y, x))

    def _crossed(
        self, start: FloatArray, end: FloatArray, x_from: float, x: FloatArray, y: FloatArray
    ) -> np.ndarray:
        result = np.zeros(x.size, dtype=int)
        if self.count == 0 or x.size == 0:
            return result
        low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
        edges = np.linspace(y.min(), y.max(), _BINS + 1)
        cell = np.clip(np.searchsorted(edges, y, side="right") - 1, 0, _BINS - 1)
        order = np.argsort(cell, kind="stable")
        bounds = np.searchsorted(cell[order], np.arange(_BINS + 1))
        first = np.clip(np.searchsorted(edges, low, side="right") - 1, 0, _BINS - 1)
        last = np.clip(np.searchsorted(edges, high, side="right") - 1, 0, _BINS - 1)
        # Spread each segment over the bins it meets.
        spans = last - first + 1
        owner, copy = numbered(spans)
        bins = first[owner] + copy
        by_bin = np.argsort(bins, kind="stable")
        owner, limits = owner[by_bin], np.searchsorted(bins[by_bin], np.arange(_BINS + 1))
        for k in np.flatnonzero(np.diff(bounds)):
            own = owner[limits[k] : limits[k + 1]]
            if own.size == 0:
                continue
            points = order[bounds[k] : bounds[k + 1]]
            a, b, weight = start[own], end[own], self.roots[own]
            levels, level = np.unique(y[points], return_inverse=True)
            for number, height in enumerate(levels):
                # Half open in y, so that a vertex on the way counts once.
                upward = (a[:, 1] <= height) & (height < b[:, 1])
                downward = (b[:, 1] <= height) & (height < a[:, 1])
                met = np.flatnonzero(upward | downward)
                if met.size == 0:
                    continue
                p, q = a[met], b[met]
                at = p[:, 0] + (height - p[:, 1]) / (q[:, 1] - p[:, 1]) * (q[:, 0] - p[:, 0])
                sorting = np.argsort(at)
                total = np.concatenate(
                    [[0], np.cumsum(np.where(upward[met], weight[met], -weight[met])[sorting])]
                )
                at = at[sorting]
                here = points[level == number] if levels.size > 1 else points
                reached = total[np.searchsorted(at, x[here], side="right")]
                result[here] = reached - total[np.searchsorted(at, x_from, side="right")]
        return result

    @cached_property
    def _pieces(self) -> tuple[scipy.spatial.cKDTree, FloatArray, FloatArray, float]:
        """Segments cut to at most a common length, and a tree of their middles."""
        length = np.linalg.norm(self.end - self.start, axis=1)
        extent = float(np.ptp(np.concatenate([self.start, self.end]), axis=0).max())
        limit = max(float(np.median(length)), extent / 400.0)
        parts = np.maximum(np.ceil(length / limit).astype(int), 1)
        owner, number = numbered(parts)
        start, step = self.start[owner], (self.end - self.start)[owner] / parts[owner, None]
        a, b = start + number[:, None] * step, start + (number[:, None] + 1.0) * step
        return scipy.spatial.cKDTree(0.5 * (a + b)), a, b, limit

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance of each point, shape (n, 2), to the nearest segment; inf without any."""
        if self.count == 0:
            return np.full(len(points), np.inf)
        tree, a, b, limit = self._pieces
        result = np.empty(len(points))
        todo = np.arange(len(points))
        neighbours = 8
        while todo.size:
            k = min(neighbours, tree.n)
            away, index = tree.query(points[todo], k=k)
            away, index = np.reshape(away, (todo.size, k)), np.reshape(index, (todo.size, k))
            best = _to_segment(points[todo, None], a[index], b[index]).min(axis=1)
            result[todo] = best
            # Any other piece has its middle beyond the last neighbour, and reaches half its length from there.
            open_point = (best > away[:, -1] - 0.5 * limit) & (k < tree.n)
            todo, neighbours = todo[open_point], neighbours * 8
        return result


def _to_segment(point: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    along = b - a
    length2 = np.sum(along**2, axis=-1)
    share = np.clip(np.sum((point - a) * along, axis=-1) / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
    return np.linalg.norm(point - a - share[..., None] * along, axis=-1)
