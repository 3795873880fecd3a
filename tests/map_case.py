"""A stability map and its explorer made of plain arrays."""

from __future__ import annotations

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import DelayIndependence, StabilityMap
from susp_ctrl.delay_systems.maps.regions import Raster, map_regions
from susp_ctrl.delay_systems.maps.segments import Segments
from susp_ctrl.study.results.maps import MapAxis, MapExplorer, StabilityMapCase

POINTS = 5


def map_case(
    design: str, *, key: str = "plane", crossed: bool = True, gain: bool = False
) -> StabilityMapCase:
    x = MapAxis("tau1", "delay of force_front", "s", 0.0, 0.4)
    y = MapAxis("tau2", "delay of force_rear", "s", 0.0, 0.8)
    if gain:
        y = MapAxis("gain1", "gain of force_front", "N/m", 0.0, 250e3)
    middle = 0.5 * (y.low + y.high)
    # right of a segment, which runs to the left, is up: two more roots there
    ends = np.array([[[0.4, middle], [0.2, middle]], [[0.2, middle], [0.0, middle]]])[: 2 * crossed]
    frequencies = np.array([64.0, 66.0])[: 2 * crossed]
    segments = Segments(ends[:, 0], ends[:, 1], np.full(len(ends), 2), frequencies)
    raster = Raster(np.array([x.low, y.low]), np.array([x.high, y.high]))
    change = np.where((raster.y > middle) & crossed, 2, 0)
    regions = map_regions(raster, change, change, lambda _, upward: 2 if crossed and upward > middle else 0)
    limits = pd.DataFrame(
        {
            "delay_s": [0.0, 0.2, 0.4],
            "gain_from": np.nan,
            "gain_to": [np.nan, 130e3, 125e3],
            "omega_rad_per_s": 65.0,
        }
    )
    return StabilityMapCase(
        key=key,
        design=design,
        gain_factor=5.5 if crossed and not gain else 1.0,
        x=x,
        y=y,
        map=StabilityMap(
            x_label="delay 1 (s)",
            y_label="gain 1" if gain else "delay 2 (s)",
            x_range=(x.low, x.high),
            y_range=(y.low, y.high),
            segments=segments,
            origin=(0.0, 0.0),
            found=regions,
            axis_roots=(),
            mixed=gain,
            design=(0.11, 72.5e3 if gain else 0.19),
        ),
        independence=DelayIndependence(True, 3.8012, 63.124, 1.0 / 3.8012, 63.124, True, None, "exact"),
        gain_limits=limits if gain else None,
    )


def map_explorer(case: StabilityMapCase) -> MapExplorer:
    x, y = np.linspace(case.x.low, case.x.high, POINTS), np.linspace(case.y.low, case.y.high, POINTS)
    real = np.linspace(-1.25, 1.75, POINTS * POINTS).reshape(POINTS, POINTS)
    times = 0.05 * np.arange(61)
    responses = np.exp(real[:, :, None] * times) * np.sin(6.0 * times)
    responses[POINTS - 1, POINTS - 1] = np.nan
    return MapExplorer(
        case=case,
        x_values=x,
        y_values=y,
        roots=real + 6.0j + np.arange(POINTS) * 1j,
        unstable_roots=np.where(real > 0, 2, 0),
        output="body_acceleration",
        unit="m/s2",
        road_text="bump of 0.05 m height and 1 m length, 20 m/s",
        timepts=times,
        responses=responses,
        passive=np.exp(-2.0 * times) * np.sin(8.0 * times),
    )
