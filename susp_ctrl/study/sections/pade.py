"""Padé approximations of several orders against the exact delays: errors, verdicts on stability, and cost in time."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import (
    VERDICT_WORDS,
    DelayLTI,
    characteristic_roots,
    compare_pade,
    simulate,
    spectral_abscissa,
    stability,
)
from susp_ctrl.errors import PadeOrderWarning
from susp_ctrl.study.results import PadeCase
from susp_ctrl.study.sections.time import band_order, build_road, record, record_times
from susp_ctrl.study.sections.workbench import Report, Workbench
from susp_ctrl.study.settings import PadeSettings, TimeSettings

_SHOWN = "body_acceleration"  # the output of the time error, where the case has it
_MOST_ROOTS = 256  # searched for the wheel hop
_ROOTS = 8  # exact roots whose cost is measured; an approximation always gives all of its own


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
            stable=table["stable"].map(VERDICT_WORDS),
            spectral_frequency_error=table["spectral_frequency_error"],
            spectral_root_error=table["spectral_rightmost_root_error"],
            spectral_stable=table["spectral_stable"].map(VERDICT_WORDS),
        ),
        band=band,
        recommended_order=tuple(band_order(loop, settings.omega_to) for _ in bench.design(key).channels),
        wheel_hop_band=settings.wheel_hop,
        wheel_hop_root=hop_root,
        indicators=indicators if settings.by_indicator else None,
        met=_met(all_errors, sizes, settings.tolerances) if settings.tolerances else None,
        cost=_cost(bench, key, settings, case, omega) if settings.cost_repeats else None,
    )


def pade_verdicts(bench: Workbench, settings: PadeSettings) -> pd.DataFrame:
    """Set what every order says about the stability of some designs beside the exact verdict.

    Parameters
    ----------
    bench : Workbench
    settings : PadeSettings
        `verdicts` names the designs, `orders` the orders.

    Returns
    -------
    DataFrame
        As `StudyRun.pade_verdicts`.
    """
    rows = []
    for key in settings.verdicts:
        if key not in bench.keys:
            continue  # a design of a search that was not run
        loop = bench.loop(key)
        exact, abscissa = stability(loop).stable, spectral_abscissa(loop)
        for order in settings.orders:
            rightmost = float(np.linalg.eigvals(loop.pade(order).A).real.max())
            says = rightmost < 0.0
            rows.append(
                (key, order, VERDICT_WORDS[says], rightmost, VERDICT_WORDS[exact], abscissa, says is exact)
            )
    columns = ["design", "order", "pade_says", "pade_abscissa", "exact", "exact_abscissa", "right"]
    return pd.DataFrame(rows, columns=columns)


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
    found = list(frequency["frequency_error"])
    return {"wheel_hop_frequency_error": found, "wheel_hop_root_error": distances}, exact


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
    exact = record(bench, key, case, road, every=every, indexed=False)
    row = case.outputs.index(_SHOWN) if _SHOWN in case.outputs else 0
    peak = np.abs(exact.outputs[row]).max()
    in_time: list[float] = []
    in_rms: list[FloatArray] = []
    for n, order in enumerate(settings.orders):
        # Orders that are too low are the subject of the table.
        with warnings.catch_warnings(action="ignore", category=PadeOrderWarning):
            found = record(bench, key, case, road, order, every=every, indexed=False)
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


# --- cost ---------------------------------------------------------------------------------------------------------


def _cost(
    bench: Workbench, key: str, settings: PadeSettings, case: TimeSettings, omega: FloatArray
) -> pd.DataFrame:
    """Measure simulation, roots and frequency response with exact delays and with every order.

    Each time is the best of `settings.cost_repeats` runs and begins with the loop as the user has it: building the
    approximation is a part of its cost.
    """
    loop = bench.loop(key)
    times = case.lead_in + record_times(case.duration, case.step)
    inputs = build_road(case.road, bench.speed).inputs(bench.lags)

    def measured(order: int, states: int, *tasks: Callable[[], object]) -> tuple[float, ...]:
        return order, states, *(_best(task, settings.cost_repeats) for task in tasks)

    def of_order(order: int) -> tuple[float, ...]:
        return measured(
            order,
            loop.pade(order).nstates,
            lambda: _simulate_pade(loop, times, inputs, order),
            lambda: np.linalg.eigvals(loop.pade(order).A),
            lambda: loop.pade(order).frequency_response(omega),
        )

    exact = measured(
        0,
        loop.realization.n_states,
        lambda: simulate(loop, times, inputs),
        lambda: characteristic_roots(loop, _ROOTS),
        lambda: loop.frequency_response(omega),
    )
    with warnings.catch_warnings(action="ignore", category=PadeOrderWarning):
        rows = [exact, *map(of_order, settings.orders)]
    table = pd.DataFrame(rows, columns=["order", "states", "simulation_s", "roots_s", "frequency_s"])
    for name in ("simulation", "roots", "frequency"):
        table[f"{name}_ratio"] = table[f"{name}_s"] / table[f"{name}_s"].iloc[0]
    return table


def _simulate_pade(loop: DelayLTI, times: FloatArray, inputs: Any, order: int) -> None:
    # An order that makes the loop unstable costs what it costs until it overflows.
    with suppress(OverflowError):
        simulate(loop, times, inputs, method="pade", order=order)


def _best(task: Callable[[], object], repeats: int) -> float:
    durations = []
    for _ in range(repeats):
        started = time.perf_counter()
        task()
        durations.append(time.perf_counter() - started)
    return min(durations)
