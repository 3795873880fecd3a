"""Frequency responses of all designs: Bode data and the |H| curves of eq. (6)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from susp_ctrl.ride import signal_unit
from susp_ctrl.study.results.study_run import FrequencySection
from susp_ctrl.study.sections.workbench import FloatArray, Report, Workbench
from susp_ctrl.study.settings.study import FrequencySettings


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
    in_phase = dict.fromkeys(bench.lags, 0.0) if len(bench.lags) > 1 else None
    chosen = bench.chosen(settings.curve_designs)
    bode, lagged, together, peaks = {}, {}, {}, []
    for n, design in enumerate(chosen):
        bode[design.key] = bench.road_response(design.key, omega, settings.outputs)
        lagged[design.key] = velocity_gain(bench, design.key, omega, settings.curve_outputs)
        peaks += _peaks(bench, design.key, omega, lagged[design.key], settings.curve_outputs, None)
        if in_phase is not None:
            together[design.key] = velocity_gain(bench, design.key, omega, settings.curve_outputs, in_phase)
            peaks += _peaks(bench, design.key, omega, together[design.key], settings.curve_outputs, in_phase)
        report((n + 1) / len(chosen))
    keys = [design.key for design in chosen]
    wanted = [k for k in settings.curve_designs if k in keys] or keys
    return FrequencySection(
        omega=omega,
        lags=bench.lags,
        outputs=settings.outputs,
        bode=bode,
        curve_outputs=settings.curve_outputs,
        velocity_gain=lagged,
        velocity_gain_in_phase=together if in_phase is not None else None,
        curve_designs=tuple(wanted),
        peaks=pd.DataFrame(peaks),
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


def _peaks(
    bench: Workbench,
    key: str,
    omega: FloatArray,
    gain: FloatArray,
    outputs: tuple[str, ...],
    lags: dict[str, float] | None,
) -> list[dict[str, object]]:
    """Return the highest point of every curve, refined between the neighbours of the highest sample."""
    rows: list[dict[str, object]] = []
    for row, output in zip(gain, outputs, strict=True):
        k = int(np.argmax(row))
        where, height = float(omega[k]), float(row[k])
        if 0 < k < omega.size - 1:
            best = minimize_scalar(
                lambda w, name=output: -velocity_gain(bench, key, np.array([w]), (name,), lags)[0, 0],
                bounds=(omega[k - 1], omega[k + 1]),
                method="bounded",
                options={"xatol": 1e-10 * where},
            )
            if -best.fun > height:
                where, height = float(best.x), float(-best.fun)
        rows.append(
            {
                "design": key,
                "output": output,
                "road": "lagged" if lags is None else "in phase",
                "omega_rad_per_s": where,
                "frequency_Hz": where / (2 * np.pi),
                "gain": height,
                "unit": velocity_gain_unit(output),
            }
        )
    return rows
