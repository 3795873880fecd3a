"""Data of the stability maps of a run; see `susp_ctrl.study.results.study_run` for the conventions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from susp_ctrl.arrays import ComplexArray, FloatArray


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
    x_values : ndarray, shape (n,)
    y_values : ndarray, shape (m,)
        Values along the axes of `unstable_roots`.
    unstable_roots : ndarray of int, shape (m, n)
        Number of unstable roots; -1 where it is not known.
    curves : ndarray, shape (k, 2, 2)
        Crossing curves as segments: segment, end, coordinate. With a point on one a root lies on the axis.
    crossing_band : (float, float)
        Lowest and highest crossing frequency on the curves (rad/s); nan without curves.
    regions : DataFrame
        One row per connected region: ``unstable_roots, area`` (share of the rectangle), ``x, y`` (a point well
        inside), ``counted`` (unstable roots there by the argument principle, -1 where not counted).
    counts : DataFrame
        One row per number of unstable roots: ``unstable_roots, regions, area``.
    point : (float, float)
        Where the design lies; its gains times `gain_factor`.
    point_roots : int
        Unstable roots there; -1 where the design lies outside of the map.
    distance : float
        From the design to the nearest curve, in the unit of the axes, or in shares of the ranges where one axis
        is a gain and the other a delay; inf without curves, nan where the design lies outside.
    lost_at : float
        Multiple of the design's gains at which some delays first destabilise it (a lower bound if not `lost_exact`).
    lost_omega : float
        At this frequency (rad/s).
    lost_exact : bool
    confirmed : bool
        Whether independent counts in the regions agree with the curves.
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
    x_values: FloatArray
    y_values: FloatArray
    unstable_roots: NDArray[np.int_]
    curves: FloatArray
    crossing_band: tuple[float, float]
    regions: pd.DataFrame
    counts: pd.DataFrame
    point: tuple[float, float]
    point_roots: int
    distance: float
    lost_at: float
    lost_omega: float
    lost_exact: bool
    confirmed: bool
    gain_limits: pd.DataFrame | None

    @property
    def name(self) -> str:
        """Key of the map and of the design: no two maps of a run share it."""
        return f"{self.key}_{self.design}"

    @property
    def stable_share(self) -> float:
        """Stable share of the rectangle."""
        return float(self.counts.loc[self.counts["unstable_roots"] == 0, "area"].sum())


@dataclass(frozen=True)
class MapExplorer:
    """Rightmost root and time response of a loop on a grid over a map.

    Attributes
    ----------
    map : StabilityMapCase
        The map.
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

    map: StabilityMapCase
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
