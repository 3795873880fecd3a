"""Padé approximations of several orders against the exact delays, on the roads of the study."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import compare_pade
from susp_ctrl.errors import PadeOrderWarning
from susp_ctrl.study.result import PadeCase
from susp_ctrl.study.simulation_schema import PadeSettings, TimeSettings
from susp_ctrl.study.time_section import band_order, build_road, record
from susp_ctrl.study.workbench import Report, Workbench

_SHOWN = "body_acceleration"  # the output of the time error, where the case has it


def pade_case(
    bench: Workbench, key: str, settings: PadeSettings, case: TimeSettings, report: Report
) -> PadeCase:
    """Compare Padé approximations of one design with its exact delays.

    Parameters
    ----------
    bench : Workbench
    key : str
        Design.
    settings : PadeSettings
    case : TimeSettings
        The road and record for the errors in time.
    report : callable
        Told the share done.

    Returns
    -------
    PadeCase
    """
    loop = bench.loop(key)
    band = (settings.omega_from, settings.omega_to)
    omega = np.geomspace(*band, settings.points)
    # Only what the road does to the outputs of the study: forces from outside are no part of it.
    road_to_outputs = loop[list(case.outputs), list(bench.lags)]
    table = compare_pade(road_to_outputs, settings.orders, omega)
    report(0.3)
    errors = _errors_in_time(bench, key, settings, case, report)
    return PadeCase(
        design=key,
        time_case=case.key,
        table=pd.DataFrame(
            {
                "order": table["order"],
                "frequency_error": table["frequency_error"],
                "root_error": table["rightmost_root_error"],
                **errors,
                "stable": _words(table["stable"]),
                "spectral_frequency_error": table["spectral_frequency_error"],
                "spectral_root_error": table["spectral_rightmost_root_error"],
                "spectral_stable": _words(table["spectral_stable"]),
            }
        ),
        band=band,
        recommended_order=tuple(band_order(loop, settings.omega_to) for _ in bench.design(key).channels),
    )


def _words(stable: pd.Series) -> list[str]:
    return ["stable" if value else "unstable" for value in stable]


def _errors_in_time(
    bench: Workbench, key: str, settings: PadeSettings, case: TimeSettings, report: Report
) -> dict[str, list[float]]:
    """Simulate every order; a run that leaves all bounds has an infinite error."""
    road = build_road(case.road, bench.speed)
    every = round(case.report_step / case.step)
    exact = record(bench, key, case, road, every=every)
    row = case.outputs.index(_SHOWN) if _SHOWN in case.outputs else 0
    peak = np.abs(exact.outputs[row]).max()
    errors: dict[str, list[float]] = {"time_error": [], "rms_error": []}
    for n, order in enumerate(settings.orders):
        with warnings.catch_warnings():
            # Orders that are too low are the subject of the table.
            warnings.simplefilter("ignore", PadeOrderWarning)
            found = record(bench, key, case, road, order, every=every)
        in_time = np.abs(found.outputs[row] - exact.outputs[row]).max() / peak
        in_rms = np.abs(found.rms / exact.rms - 1).max(skipna=False)
        errors["time_error"].append(float(in_time) if np.isfinite(in_time) else np.inf)
        errors["rms_error"].append(float(in_rms) if np.isfinite(in_rms) else np.inf)
        report(0.3 + 0.7 * (n + 1) / len(settings.orders))
    return errors
