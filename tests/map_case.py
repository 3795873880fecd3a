"""A stability map and its explorer made of plain arrays."""

from __future__ import annotations

import numpy as np
import pandas as pd

from susp_ctrl.study.results.maps import MapAxis, MapExplorer, StabilityMapCase

POINTS = 5


def map_case(
    design: str, *, key: str = "plane", crossed: bool = True, gain: bool = False
) -> StabilityMapCase:
    x = MapAxis("tau1", "delay of force_front", "s", 0.0, 0.4)
    y = MapAxis("tau2", "delay of force_rear", "s", 0.0, 0.8)
    if gain:
        y = MapAxis("gain1", "gain of force_front", "N/m", 0.0, 250e3)
    across, upward = np.linspace(x.low, x.high, 40), np.linspace(y.low, y.high, 40)
    middle = 0.5 * (y.low + y.high)
    numbers = (
        np.where(upward[:, None] > middle, 2, 0) * np.ones(40, dtype=int)
        if crossed
        else np.zeros((40, 40), int)
    )
    counts = [(0, 1, 0.5), (2, 1, 0.5)] if crossed else [(0, 1, 1.0)]
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
        x_values=across,
        y_values=upward,
        unstable_roots=numbers,
        curves=np.array([[[0.0, middle], [0.2, middle]], [[0.2, middle], [0.4, middle]]])[: 2 * crossed],
        crossing_band=(64.0, 66.0) if crossed else (np.nan, np.nan),
        regions=pd.DataFrame(
            [(n, a, 0.2, middle, n) for n, _, a in counts],
            columns=["unstable_roots", "area", "x", "y", "counted"],
        ),
        counts=pd.DataFrame(counts, columns=["unstable_roots", "regions", "area"]),
        point=(0.11, 19345.0 if gain else 0.19),
        point_roots=0,
        distance=0.21 if crossed else np.inf,
        lost_at=3.8012,
        lost_omega=63.124,
        lost_exact=True,
        confirmed=True,
        gain_limits=limits if gain else None,
    )


def map_explorer(case: StabilityMapCase) -> MapExplorer:
    x, y = np.linspace(case.x.low, case.x.high, POINTS), np.linspace(case.y.low, case.y.high, POINTS)
    real = np.linspace(-1.25, 1.75, POINTS * POINTS).reshape(POINTS, POINTS)
    times = 0.05 * np.arange(61)
    responses = np.exp(real[:, :, None] * times) * np.sin(6.0 * times)
    responses[POINTS - 1, POINTS - 1] = np.nan
    return MapExplorer(
        map=case,
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
