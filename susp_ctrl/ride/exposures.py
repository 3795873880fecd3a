"""Weighted accelerations of a record, on a grid fine enough for their figures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from susp_ctrl.arrays import FloatArray
from susp_ctrl.ride.averages import MOST_TIMES, RTOL, SAMPLES_ONLY, near_hidden
from susp_ctrl.ride.comfort import Exposure, exposure
from susp_ctrl.ride.indicators import COMFORT_WEIGHTS
from susp_ctrl.ride.record import Record, warn_if_coarse
from susp_ctrl.ride.weighting import weighted_history

_FINER = 4
_COARSER = 3.0  # what the weighting lets pass is smooth: twice the step errs by four times as much
_NAMES = {"rms": "weighted", "mtvv": "mtvv", "vdv": "vdv", "crest_factor": "crest_factor"}


def exposures(record: Record) -> dict[str, Exposure]:
    """Return the comfort figures of every acceleration of a record; warn of uncertain ones.

    Every second sample tells whether all of them are enough. Where they are not, the response is computed on even grids
    ever finer, until the next one changes no figure by `RTOL`.
    """
    present = {name: values for name, values in record.signals.items() if name in COMFORT_WEIGHTS}
    if not present:
        return {}
    t, start = record.times, float(record.t[0])
    most = _COARSER * (SAMPLES_ONLY if record.at is None else 1.0)
    figures = _figures(t, present, start)
    uncertain = _changed(
        record, _figures(t[::2], {n: v[::2] for n, v in present.items()}, start), figures, most
    )
    if record.at is None or not (uncertain or np.any(near_hidden(t, record.kinks))):
        warn_if_coarse(uncertain)
        return figures
    count = int(np.ceil((t[-1] - t[0]) / np.min(np.diff(t))))
    while _FINER * count < MOST_TIMES:
        count *= _FINER
        even = np.linspace(t[0], t[-1], count + 1)
        found = record.at(even)
        coarser, figures = figures, _figures(even, {name: found[name] for name in present}, start)
        uncertain = _changed(record, coarser, figures, _COARSER)
        if not uncertain and not np.any(near_hidden(even, record.kinks)):
            break
    warn_if_coarse(uncertain)
    return figures


def _figures(t: FloatArray, signals: Mapping[str, FloatArray], start: float) -> dict[str, Exposure]:
    kept = t >= start
    if np.count_nonzero(kept) < 2:
        kept = np.ones(t.size, dtype=bool)
    return {
        name: exposure(t[kept], _weighted(t, values, COMFORT_WEIGHTS[name][0])[kept])
        for name, values in signals.items()
    }


def _changed(
    record: Record, coarser: Mapping[str, Exposure], finer: Mapping[str, Exposure], times: float
) -> list[str]:
    """Return the figures that a finer grid changed by more than so many times the error wanted."""
    return [
        f"{name}_{shown}"
        for name, figures in finer.items()
        for field, shown in _NAMES.items()
        if figures.rms > record.noise[name]
        and abs(getattr(coarser[name], field) - getattr(figures, field))
        > times * RTOL * getattr(figures, field)
    ]


def _weighted(t: FloatArray, values: FloatArray, weighting: str) -> FloatArray:
    """Return the weighted history at the same times, evenly spaced or not."""
    steps = np.diff(t)
    step = (t[-1] - t[0]) / steps.size
    if np.max(np.abs(steps - step)) <= 1e-6 * step:
        return weighted_history(values, step, weighting)
    count = int(np.ceil((t[-1] - t[0]) / np.min(steps))) + 1
    even = np.linspace(t[0], t[-1], count)
    resampled = weighted_history(CubicSpline(t, values)(even), even[1] - even[0], weighting)
    return np.asarray(CubicSpline(even, resampled)(t))
