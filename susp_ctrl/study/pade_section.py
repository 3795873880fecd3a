"""Padé approximations of several orders against the exact delays, on the roads of the study."""

from __future__ import annotations

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import compare_pade, pade_order
from susp_ctrl.study.result import PadeCase
from susp_ctrl.study.schema import PadeSettings, TimeSettings
from susp_ctrl.study.time_section import build_road, record_rms, record_rows, response
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
        recommended_order=tuple(pade_order(loop, settings.omega_to) for _ in bench.design(key).channels),
    )


def _words(stable: pd.Series) -> list[str]:
    return ["stable" if value else "unstable" for value in stable]


def _errors_in_time(
    bench: Workbench, key: str, settings: PadeSettings, case: TimeSettings, report: Report
) -> dict[str, list[float]]:
    """Simulate every order; a run that leaves all bounds has an infinite error."""
    road = build_road(case.road, bench.speed)
    every = round(case.report_step / case.step)
    exact = response(bench, key, case, road, every=every)
    row = case.outputs.index(_SHOWN) if _SHOWN in case.outputs else 0
    history, rms = record_rows(exact, case.outputs)[row], record_rms(exact, case)
    errors: dict[str, list[float]] = {"time_error": [], "rms_error": []}
    for n, order in enumerate(settings.orders):
        in_time, in_rms = np.inf, np.inf
        try:
            approximate = response(bench, key, case, road, order, every=every)
        except OverflowError:
            pass
        else:
            values = record_rows(approximate, case.outputs)[row]
            in_time = float(np.abs(values - history).max() / np.abs(history).max())
            in_rms = float((record_rms(approximate, case) / rms - 1).abs().max())
        errors["time_error"].append(in_time)
        errors["rms_error"].append(in_rms)
        report(0.3 + 0.7 * (n + 1) / len(settings.orders))
    return errors
