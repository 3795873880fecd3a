"""Frequency responses of all designs: Bode data and the |H| curves of eq. (6)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from susp_ctrl.arrays import FloatArray
from susp_ctrl.ride import signal_unit
from susp_ctrl.study.results import FrequencySection
from susp_ctrl.study.sections.workbench import Report, Workbench
from susp_ctrl.study.settings import FrequencySettings

_PEAK_COLUMNS = ["design", "output", "road", "omega_rad_per_s", "frequency_Hz", "gain", "unit"]


def frequency_section(bench: Workbench, settings: FrequencySettings, report: Report) -> FrequencySection:
    """Compute the frequency responses of a study.

    |H| per road *velocity* is |Y(jw)/X_g(jw)|/w, for an acceleration w |X/X_g| as in eq. (6).

    Parameters
    ----------
    bench : Workbench
    settings : FrequencySettings
    report : callable
        Told the share done.

    Returns
    -------
    FrequencySection
    """
    omega = np.geomspace(settings.omega_from, settings.omega_to, settings.points)
    roads = {"lagged": bench.lags}
    if len(bench.lags) > 1:
        roads["in phase"] = dict.fromkeys(bench.lags, 0.0)
    chosen = bench.chosen(settings.curve_designs)
    bode, peaks = {}, []
    gains: dict[str, dict[str, FloatArray]] = {road: {} for road in roads}
    for n, design in enumerate(chosen):
        bode[design.key] = bench.road_response(design.key, omega, settings.outputs)
        for road, lags in roads.items():
            gain = velocity_gain(bench, design.key, omega, settings.curve_outputs, lags)
            gains[road][design.key] = gain
            for output, curve in zip(settings.curve_outputs, gain, strict=True):
                at = partial(velocity_gain, bench, design.key, outputs=(output,), lags=lags)
                where, height = _peak(omega, curve, at)
                unit = velocity_gain_unit(output)
                peaks.append((design.key, output, road, where, where / (2 * np.pi), height, unit))
        report((n + 1) / len(chosen))
    keys = [design.key for design in chosen]
    wanted = [k for k in settings.curve_designs if k in keys] or keys
    return FrequencySection(
        omega=omega,
        lags=bench.lags,
        outputs=settings.outputs,
        bode=bode,
        curve_outputs=settings.curve_outputs,
        velocity_gain=gains["lagged"],
        velocity_gain_in_phase=gains.get("in phase"),
        curve_designs=tuple(wanted),
        peaks=pd.DataFrame(peaks, columns=_PEAK_COLUMNS),
    )


def velocity_gain(
    bench: Workbench,
    key: str,
    omega: FloatArray,
    outputs: tuple[str, ...],
    lags: dict[str, float] | None = None,
) -> FloatArray:
    """Return |H| per road velocity, shape (outputs, n)."""
    return np.abs(bench.road_response(key, omega, outputs, lags)) / omega


def velocity_gain_unit(output: str) -> str:
    """Return the unit of |H| of an output per road velocity."""
    return {"m/s2": "1/s", "rad/s2": "rad/(m s)"}.get(signal_unit(output), f"{signal_unit(output)} s/m")


def _peak(
    omega: FloatArray, curve: FloatArray, at: Callable[[FloatArray], FloatArray]
) -> tuple[float, float]:
    """Return the highest point of a curve, refined between the neighbours of the highest sample."""
    k = int(np.argmax(curve))
    where, height = float(omega[k]), float(curve[k])
    if 0 < k < omega.size - 1:
        best = minimize_scalar(
            lambda w: -at(np.array([w]))[0, 0],
            bounds=(omega[k - 1], omega[k + 1]),
            method="bounded",
            options={"xatol": 1e-10 * where},
        )
        if -best.fun > height:
            return float(best.x), float(-best.fun)
    return where, height
