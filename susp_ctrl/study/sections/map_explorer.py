"""What a click on a stability map shows: rightmost root and time response, computed beforehand on a grid."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import DelayLTI, characteristic_roots, close_loop, count_unstable_roots, simulate
from susp_ctrl.errors import UndecidedStabilityWarning
from susp_ctrl.ride import signal_unit
from susp_ctrl.study.results import MapExplorer, StabilityMapCase, StudyRun
from susp_ctrl.study.sections.maps import scaled_channels
from susp_ctrl.study.sections.time import build_road, record_times
from susp_ctrl.study.sections.workbench import Report, road_text
from susp_ctrl.study.settings import MapSettings

# Of the responses: far below what a picture shows.
_RTOL = 1e-5


def map_explorers(run: StudyRun, report: Report | None = None) -> Mapping[str, MapExplorer]:
    """Compute rightmost roots and responses for the maps of a run that ask for it.

    Parameters
    ----------
    run : StudyRun
    report : callable, optional
        Told the share done.

    Returns
    -------
    mapping of str to MapExplorer
        By the name of the map; maps without any crossing curve are left out.
    """
    settings = {entry.key: entry for entry in run.study.settings.stability_maps}
    asked = [c for c in run.stability_maps if settings[c.key].explorer is not None and c.map.segments.count]
    told = report or (lambda share: None)
    found: dict[str, MapExplorer] = {}
    for case in asked:

        def of_all(share: float, before: int = len(found)) -> None:
            told((before + share) / len(asked))

        found[case.name] = _explorer(run, case, settings[case.key], of_all)
    return found


def _explorer(run: StudyRun, case: StabilityMapCase, entry: MapSettings, report: Report) -> MapExplorer:
    plant, lags, settings = run.study.plant, run.study.lags, entry.explorer
    assert settings is not None
    loop = close_loop(plant, scaled_channels(run.design(case.design).channels, case.gain_factor))
    speed = run.study.settings.vehicle.speed
    inputs = build_road(settings.road, speed).inputs(lags)
    output = settings.output or plant.output_labels[0]
    row = loop.output_labels.index(output)
    times = record_times(settings.duration, settings.step)
    x = np.linspace(case.x.low, case.x.high, settings.points)
    y = np.linspace(case.y.low, case.y.high, settings.points)
    roots = np.empty((y.size, x.size), dtype=complex)
    counts = np.empty((y.size, x.size), dtype=int)
    responses = np.empty((y.size, x.size, times.size))
    with warnings.catch_warnings(action="ignore", category=UndecidedStabilityWarning):  # -1 says it
        for i, upward in enumerate(y.tolist()):
            for j, across in enumerate(x.tolist()):
                here = _at(loop, entry, across, upward)
                rightmost = characteristic_roots(here, count=1)[0]
                roots[i, j] = complex(rightmost.real, abs(rightmost.imag))
                number = count_unstable_roots(here)
                counts[i, j] = -1 if number is None else number
                responses[i, j] = _response(here, times, inputs, row)
            report((i + 1) / y.size)
    return MapExplorer(
        case=case,
        x_values=x,
        y_values=y,
        roots=roots,
        unstable_roots=counts,
        output=output,
        unit=signal_unit(output),
        road_text=road_text(settings.road, speed),
        timepts=times,
        responses=responses,
        passive=_response(close_loop(plant, ()), times, inputs, row),
    )


def _at(loop: DelayLTI, entry: MapSettings, x: float, y: float) -> DelayLTI:
    """Return the loop with the free numbers set."""
    gains, delays = loop.gains.copy(), loop.delays.copy()
    for name, value in zip(entry.free, (x, y), strict=True):
        (delays if name.startswith("tau") else gains)[entry.channel(name)] = value
    return loop.with_gains(gains).with_delays(delays)


def _response(loop: DelayLTI, times: FloatArray, inputs: Any, row: int) -> FloatArray:
    try:
        return np.asarray(simulate(loop, times, inputs, rtol=_RTOL).y[row])
    except OverflowError:
        return np.full(times.size, np.nan)
