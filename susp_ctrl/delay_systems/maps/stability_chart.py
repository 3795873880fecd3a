"""What `stability_map` returns: curves, regions, counts and distances at any points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NoReturn

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.maps.regions import MapRegions
from susp_ctrl.delay_systems.maps.segments import Segments
from susp_ctrl.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class StabilityMap:
    """Number of unstable roots over a rectangle of two parameters.

    Attributes
    ----------
    x_range, y_range : (float, float)
        The rectangle.
    regions : pandas.DataFrame
        ``unstable_roots`` (-1 where not known), ``area`` (share of the rectangle), ``x``, ``y`` (a point well
        inside) and ``counted`` (unstable roots counted there by the argument principle; -1 where not counted).
        Regions smaller than 1/240 of a range may be missing from the table; `unstable_roots` knows them.
    decided : bool
        Whether all numbers agree with the independent counts. If not, the counts speak alone: a region in which
        they all agree has a number; of the others only those cells of a lattice of 16 by 16 whose corners agree;
        all else is -1.
    axis_roots : tuple of float
        Frequencies of roots that lie on the imaginary axis all over the rectangle (0 for a root at s = 0); with
        any the loop is nowhere stable, and no region has a number.
    message : str
        Whether the numbers are confirmed, and if not why.
    design : (float, float)
        Where the system that was given lies.
    """

    x_label: str
    y_label: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    segments: Segments
    origin: tuple[float, float]
    found: MapRegions
    axis_roots: tuple[float, ...]
    mixed: bool
    design: tuple[float, float]

    @property
    def decided(self) -> bool:
        """Whether all numbers agree with the independent counts."""
        return self.found.decided and not self.axis_roots

    @cached_property
    def regions(self) -> pd.DataFrame:
        """Regions, the largest first."""
        table = self.found.table
        return table.assign(unstable_roots=-1) if self.axis_roots else table

    @property
    def message(self) -> str:
        """Whether the numbers are confirmed, and if not why."""
        if self.axis_roots:
            where = ", ".join(f"{omega:.6g}" for omega in self.axis_roots)
            return (
                f"nowhere stable: a root stays on the imaginary axis at {where} rad/s all over the rectangle"
            )
        if self.decided:
            return "numbers agree with independent counts"
        share = float(np.mean(self.found.roots < 0))
        return (
            "the numbers that follow from the curves and independent counts differ, "
            f"and on {100.0 * share:.3g} % of the rectangle the number is not known"
        )

    @cached_property
    def curves(self) -> pd.DataFrame:
        """The crossing curves as segments: ``x0, y0, x1, y1``, ``omega`` (rad/s) and ``roots``.

        From (x0, y0) to (x1, y1) there are `roots` more unstable roots on the right.
        """
        s = self.segments
        return pd.DataFrame(
            {
                "x0": s.start[:, 0],
                "y0": s.start[:, 1],
                "x1": s.end[:, 0],
                "y1": s.end[:, 1],
                "omega": s.omega,
                "roots": s.roots,
            }
        )

    def __bool__(self) -> NoReturn:
        """Refuse: a map is no yes or no."""
        raise ValueError("a stability map has no truth value: ask for .unstable_roots(x, y) or .decided")

    def unstable_roots(self, x: ArrayLike, y: ArrayLike) -> np.ndarray:
        """Return the number of unstable roots at points of the rectangle, -1 where not known; arrays broadcast.

        Raises
        ------
        InputError
            A point outside the rectangle.
        """
        px, py, shape = self._points(x, y)
        if self.axis_roots:
            return np.full(shape, -1)
        x0, y0 = self.origin
        change = self.segments.crossed_up(x0, y0, py) + self.segments.crossed_across(x0, px, py)
        return self.found.known_roots(px, py, change).reshape(shape)

    def distance(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Return the distance to the nearest crossing curve; arrays broadcast, inf where there is none.

        In the unit of the axes; where one axis is a gain and the other a delay, in shares of the two ranges.
        """
        px, py, shape = self._points(x, y)
        size = self._size
        return self._scaled.distance(np.column_stack([px, py]) / size).reshape(shape)

    @property
    def _size(self) -> FloatArray:
        if not self.mixed:
            return np.ones(2)
        return np.array([self.x_range[1] - self.x_range[0], self.y_range[1] - self.y_range[0]])

    @cached_property
    def _scaled(self) -> Segments:
        s = self.segments
        return Segments(s.start / self._size, s.end / self._size, s.roots, s.omega)

    def _points(self, x: ArrayLike, y: ArrayLike) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
        px, py = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        for name, values, (low, high) in (("x", px, self.x_range), ("y", py, self.y_range)):
            slack = 1e-12 * (high - low)
            if not np.all((values >= low - slack) & (values <= high + slack)):
                raise InputError(f"{name} leaves the map: values from {low:g} to {high:g} are needed")
        return px.ravel(), py.ravel(), px.shape

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the regions with their numbers of unstable roots, the curves and the design; return the axes."""
        from susp_ctrl.plotting import draw_stability_map  # loads matplotlib

        x = np.linspace(*self.x_range, 400)
        y = np.linspace(*self.y_range, 400)
        lines = np.stack([self.segments.start, self.segments.end], axis=1)
        return draw_stability_map(
            x, y, self.unstable_roots(x, y[:, None]), lines, ax,
            xlabel=self.x_label, ylabel=self.y_label, design=self.design,
        )  # fmt: skip

    def __str__(self) -> str:
        stable = float(self.regions.loc[self.regions["unstable_roots"] == 0, "area"].sum())
        head = [
            f"Stability map: {self.x_label} in {self.x_range}, {self.y_label} in {self.y_range}",
            f"  {len(self.regions)} regions, stable on {100.0 * stable:.3g} % of the rectangle; "
            + ("" if self.decided else "NOT DECIDED: ")
            + self.message,
        ]
        table = self.regions.head(8).to_string(index=False, float_format=lambda v: f"{v:.6g}")
        more = [] if len(self.regions) <= 8 else [f"  ... {len(self.regions) - 8} more"]
        return "\n".join(head + ["  " + row for row in table.splitlines()] + more)

    __repr__ = __str__
