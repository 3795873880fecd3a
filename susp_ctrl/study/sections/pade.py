"""Padé approximations of several orders against the exact delays, on the roads of the study."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import DelayLTI, characteristic_roots, compare_pade
from susp_ctrl.errors import PadeOrderWarning
from susp_ctrl.study.results.pade import PadeCase
from susp_ctrl.study.sections.pade_cost import pade_cost
from susp_ctrl.study.sections.time import band_order, build_road, record
from susp_ctrl.study.sections.workbench import FloatArray, Report, Workbench
from susp_ctrl.study.settings.simulation import PadeSettings, TimeSettings

_SHOWN = "body_acceleration"  # the output of the time error, where the case has it
_MOST_ROOTS = 256  # searched for the wheel hop


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
    report(0.2)
    hop_errors, hop_root = _wheel_hop(loop, road_to_outputs, settings)
    report(0.3)
    in_time, indicators = _errors_in_time(bench, key, settings, case, report)
    errors = pd.DataFrame(
        {
            "order": table["order"],
            "frequency_error": table["frequency_error"],
            "root_error": table["rightmost_root_error"],
            **hop_errors,
            "time_error": in_time,
            "rms_error": indicators.drop(columns="order").max(axis=1),
        }
    )
    rightmost = characteristic_roots(loop, 1)
    sizes = {
        "root_error": abs(rightmost[0]) if rightmost.size else np.nan,
        "wheel_hop_root_error": abs(hop_root) if hop_root is not None else np.nan,
    }
    all_errors = errors if not settings.by_indicator else errors.merge(indicators, on="order")
    return PadeCase(
        design=key,
        time_case=case.key,
        table=errors.assign(
            stable=_words(table["stable"]),
            spectral_frequency_error=table["spectral_frequency_error"],
            spectral_root_error=table["spectral_rightmost_root_error"],
            spectral_stable=_words(table["spectral_stable"]),
        ),
        band=band,
        recommended_order=tuple(band_order(loop, settings.omega_to) for _ in bench.design(key).channels),
        wheel_hop_band=settings.wheel_hop,
        wheel_hop_root=hop_root,
        indicators=indicators if settings.by_indicator else None,
        met=_met(all_errors, sizes, settings.tolerances) if settings.tolerances else None,
        cost=None if not settings.cost_repeats else pade_cost(bench, key, settings, case, omega),
    )


def _words(stable: pd.Series) -> list[str]:
    return ["stable" if value else "unstable" for value in stable]


def _wheel_hop(
    loop: DelayLTI, road_to_outputs: DelayLTI, settings: PadeSettings
) -> tuple[dict[str, list[float]], complex | None]:
    """Return the errors in the band of the wheel hop, and the rightmost exact root in it."""
    band = settings.wheel_hop
    if band is None:
        return {}, None
    frequency = compare_pade(road_to_outputs, settings.orders, np.linspace(*band, settings.points))
    exact = _rightmost_in(loop, band)
    distances = [
        float(np.abs(np.linalg.eigvals(loop.pade(order).A) - exact).min()) if exact is not None else np.nan
        for order in settings.orders
    ]
    errors = {
        "wheel_hop_frequency_error": list(frequency["frequency_error"]),
        "wheel_hop_root_error": distances,
    }
    return errors, exact


def _rightmost_in(loop: DelayLTI, band: tuple[float, float]) -> complex | None:
    """Return the rightmost characteristic root whose imaginary part lies in a band, None if none is found."""
    count = 8
    while count <= _MOST_ROOTS:
        roots = characteristic_roots(loop, count)
        inside = roots[(roots.imag >= band[0]) & (roots.imag <= band[1])]
        if inside.size:
            return complex(inside[np.argmax(inside.real)])
        if roots.size < count:
            return None
        count *= 2
    return None


def _errors_in_time(
    bench: Workbench, key: str, settings: PadeSettings, case: TimeSettings, report: Report
) -> tuple[list[float], pd.DataFrame]:
    """Simulate every order; a run that leaves all bounds has an infinite error."""
    road = build_road(case.road, bench.speed)
    every = round(case.report_step / case.step)
    exact = record(bench, key, case, road, every=every)
    row = case.outputs.index(_SHOWN) if _SHOWN in case.outputs else 0
    peak = np.abs(exact.outputs[row]).max()
    in_time: list[float] = []
    in_rms: list[FloatArray] = []
    for n, order in enumerate(settings.orders):
        with warnings.catch_warnings():
            # Orders that are too low are the subject of the table.
            warnings.simplefilter("ignore", PadeOrderWarning)
            found = record(bench, key, case, road, order, every=every)
        error = np.abs(found.outputs[row] - exact.outputs[row]).max() / peak
        in_time.append(float(error) if np.isfinite(error) else np.inf)
        relative = np.abs(found.rms / exact.rms - 1).to_numpy(dtype=float)
        in_rms.append(np.where(np.isfinite(relative), relative, np.inf))
        report(0.3 + 0.6 * (n + 1) / len(settings.orders))
    indicators = pd.DataFrame(np.array(in_rms), columns=list(case.outputs))
    indicators.insert(0, "order", list(settings.orders))
    return in_time, indicators


def _met(errors: pd.DataFrame, sizes: dict[str, float], tolerances: tuple[float, ...]) -> pd.DataFrame:
    """Return for every error the lowest order from which on all orders keep a tolerance."""
    rows = []
    for name in errors.columns.drop("order"):
        relative = (errors[name] / sizes.get(name, 1.0)).to_numpy()
        for tolerance in tolerances:
            # Behind the last order that fails: one below it that happens to be right is luck.
            failing = np.flatnonzero(~(relative <= tolerance))
            first = int(failing[-1]) + 1 if failing.size else 0
            order = float(errors["order"].iloc[first]) if first < relative.size else np.nan
            rows.append((name, tolerance, order))
    return pd.DataFrame(rows, columns=["error", "tolerance", "order"])
