"""Data of the stability maps of a run; see `susp_ctrl.study.results.study_run` for the conventions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems import DelayIndependence, StabilityMap


@dataclass(frozen=True)
class MapAxis:
    """One axis of a map.

    Attributes
    ----------
    name : str
        ``"tau1"``, ``"gain1"``, ``"tau2"`` or ``"gain2"``.
    text : str
        In words: ``"delay of force_front"``.
    unit : str
        ``"s"``, or that of the gain.
    low, high : float
        The range.
    """

    name: str
    text: str
    unit: str
    low: float
    high: float

    @property
    def is_delay(self) -> bool:
        """Whether a delay is free, and not a gain."""
        return self.name.startswith("tau")


@dataclass(frozen=True)
class StabilityMapCase:
    """Number of unstable roots of one design over two of its delays and gains.

    Attributes
    ----------
    key : str
        Of the map in the study, ``[a-z0-9_]+``; several designs may share it.
    design : str
        Design key.
    gain_factor : float
        All gains are this multiple of the design's (but for one that is free).
    x, y : MapAxis
    map : StabilityMap
        Curves, regions, and where the design lies; its gains times `gain_factor`.
    independence : DelayIndependence
        Of the design itself: from which multiple of its gains on some delays destabilise it.
    gain_limits : DataFrame or None
        Where a gain and a delay are free and the gain zero lies in its range: for delays over the whole range
        ``delay_s``, ``gain_from, gain_to`` (the stable gains around zero: nan where no curve was met up to the end
        of the range, and both nan where the loop is unstable at zero), ``omega_rad_per_s`` (where the upper limit
        crosses).
    """

    key: str
    design: str
    gain_factor: float
    x: MapAxis
    y: MapAxis
    map: StabilityMap
    independence: DelayIndependence
    gain_limits: pd.DataFrame | None

    @property
    def name(self) -> str:
        """Key of the map and of the design: no two maps of a run share it."""
        return f"{self.key}_{self.design}"

    @property
    def crossing_band(self) -> tuple[float, float]:
        """Lowest and highest crossing frequency on the curves (rad/s); nan without curves."""
        omega = self.map.segments.omega
        return (float(omega.min()), float(omega.max())) if omega.size else (math.nan, math.nan)

    @property
    def counts(self) -> pd.DataFrame:
        """One row per number of unstable roots: ``unstable_roots, regions, area``."""
        grouped = self.map.regions.groupby("unstable_roots")["area"]
        return pd.DataFrame({"regions": grouped.size(), "area": grouped.sum()}).reset_index()

    @property
    def stable_share(self) -> float:
        """Stable share of the rectangle."""
        return float(self.counts.loc[self.counts["unstable_roots"] == 0, "area"].sum())

    @property
    def holds_the_design(self) -> bool:
        """Whether the design lies in the rectangle."""
        ranges = (self.map.x_range, self.map.y_range)
        return all(low <= at <= high for at, (low, high) in zip(self.map.design, ranges, strict=True))

    @property
    def point_roots(self) -> int:
        """Unstable roots of the design; -1 where it lies outside of the map."""
        return int(self.map.unstable_roots(*self.map.design)) if self.holds_the_design else -1

    @property
    def distance(self) -> float:
        """From the design to the nearest curve, as `StabilityMap.distance`; nan where the design lies outside."""
        return float(self.map.distance(*self.map.design)) if self.holds_the_design else math.nan


@dataclass(frozen=True)
class MapExplorer:
    """Rightmost root and time response of a loop on a grid over a map.

    Attributes
    ----------
    case : StabilityMapCase
    x_values : ndarray, shape (n,)
    y_values : ndarray, shape (m,)
        The grid.
    roots : complex ndarray, shape (m, n)
        Rightmost root, imaginary part >= 0.
    unstable_roots : ndarray of int, shape (m, n)
        By the argument principle, -1 where it cannot tell (a root on the axis).
    output, unit : str
        What the responses show.
    road_text : str
        The road in one sentence.
    timepts : ndarray, shape (k,)
        Instants (s), equally spaced from 0.
    responses : ndarray, shape (m, n, k)
        nan where a response leaves the range of numbers.
    passive : ndarray, shape (k,)
        The same of the vehicle without control.
    """

    case: StabilityMapCase
    x_values: FloatArray
    y_values: FloatArray
    roots: ComplexArray
    unstable_roots: NDArray[np.int_]
    output: str
    unit: str
    road_text: str
    timepts: FloatArray
    responses: FloatArray
    passive: FloatArray
