"""Stability maps of designs over two of their delays and gains, and the gains that each delay allows."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import pandas as pd

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import (
    FeedbackChannel,
    StabilityMap,
    close_loop,
    delay_independent_stability,
    stability_map,
)
from susp_ctrl.errors import UndecidedStabilityWarning
from susp_ctrl.study.results import Design, MapAxis, StabilityMapCase
from susp_ctrl.study.sections.workbench import Report, Workbench
from susp_ctrl.study.settings import MapSettings, gain_unit

_LIMIT_DELAYS = 161


def stability_maps(bench: Workbench, settings: MapSettings, report: Report) -> tuple[StabilityMapCase, ...]:
    """Map the number of unstable roots of every design that one entry of the study names.

    Parameters
    ----------
    bench : Workbench
    settings : MapSettings
    report : callable
        Told the share done.

    Returns
    -------
    tuple of StabilityMapCase
    """
    designs = [
        design
        for design in bench.chosen(settings.designs, passive=False)
        if settings.fits(len(design.channels))
    ]
    cases = []
    for n, design in enumerate(designs, 1):
        cases.append(_case(bench, design, settings))
        report(n / len(designs))
    return tuple(cases)


def scaled_channels(channels: Sequence[FeedbackChannel], factor: float) -> list[FeedbackChannel]:
    """Return channels with all gains multiplied."""
    return [channel.replace(gain=factor * channel.gain) for channel in channels]


def _case(bench: Workbench, design: Design, settings: MapSettings) -> StabilityMapCase:
    loop = close_loop(bench.plant, scaled_channels(design.channels, settings.gain_factor))
    first, second = settings.free
    numbers = _numbers(settings, len(design.channels))
    # The case itself says whether it is confirmed.
    with warnings.catch_warnings(action="ignore", category=UndecidedStabilityWarning):
        found = stability_map(
            loop, **{name: settings.range(name) for name in settings.free}, channels=numbers
        )
        proof = delay_independent_stability(bench.loop(design.key))
    return StabilityMapCase(
        settings.key,
        design.key,
        settings.gain_factor,
        _axis(design, settings, first),
        _axis(design, settings, second),
        found,
        proof,
        _gain_limits(found, settings) if found.mixed else None,
    )


def _numbers(settings: MapSettings, count: int) -> tuple[int, int]:
    """Return the positions of the two channels; one that the design lacks, and nothing free needs, is any other."""
    first, second = (number - 1 for number in settings.channels)
    if first >= count:
        first = next((k for k in range(count) if k != second), second)
    if second >= count:
        second = next((k for k in range(count) if k != first), first)
    return first, second


def _axis(design: Design, settings: MapSettings, name: str) -> MapAxis:
    channel = design.channels[settings.channel(name)]
    low, high = settings.range(name)
    if name.startswith("tau"):
        return MapAxis(name, f"delay of {channel.actuator}", "s", low, high)
    return MapAxis(name, f"gain of {channel.actuator}", gain_unit(str(channel.measured)), low, high)


def _gain_limits(found: StabilityMap, settings: MapSettings) -> pd.DataFrame | None:
    """Return the stable gains around zero for delays over the whole range; None if zero is not in the range."""
    gain_first = settings.free[0].startswith("gain")
    gains, delays = (found.x_range, found.y_range) if gain_first else (found.y_range, found.x_range)
    if not gains[0] <= 0.0 <= gains[1]:
        return None
    at = np.linspace(*delays, _LIMIT_DELAYS)
    column = 1 if gain_first else 0  # of the delay in the coordinates
    crossing = found.segments.roots != 0
    start, end = found.segments.start[crossing], found.segments.end[crossing]
    omega = found.segments.omega[crossing]
    zero = np.zeros_like(at)
    passive = found.unstable_roots(zero, at) if gain_first else found.unstable_roots(at, zero)
    rows = [
        _limits(tau, start[:, column], end[:, column], start[:, 1 - column], end[:, 1 - column], omega)
        if number == 0
        else (tau, np.nan, np.nan, np.nan)
        for tau, number in zip(at.tolist(), passive, strict=True)
    ]
    limits = pd.DataFrame(rows, columns=["delay_s", "gain_from", "gain_to", "omega_rad_per_s"])
    # Curves run on beyond the rectangle.
    limits.loc[limits["gain_from"] < gains[0], "gain_from"] = np.nan
    limits.loc[limits["gain_to"] > gains[1], ["gain_to", "omega_rad_per_s"]] = np.nan
    return limits


def _limits(
    tau: float, tau0: FloatArray, tau1: FloatArray, gain0: FloatArray, gain1: FloatArray, omega: FloatArray
) -> tuple[float, float, float, float]:
    """Return the delay, the nearest crossings below and above the gain zero, and the frequency of the latter."""
    met = np.flatnonzero((np.minimum(tau0, tau1) <= tau) & (tau <= np.maximum(tau0, tau1)))
    span = tau1[met] - tau0[met]
    share = np.divide(tau - tau0[met], span, out=np.zeros_like(span), where=span != 0.0)
    gain = gain0[met] + share * (gain1[met] - gain0[met])
    below, above = gain[gain < 0.0], np.flatnonzero(gain > 0.0)
    upper = above[np.argmin(gain[above])] if above.size else None
    return (
        tau,
        float(below.max()) if below.size else np.nan,
        np.nan if upper is None else float(gain[upper]),
        np.nan if upper is None else float(omega[met[upper]]),
    )
