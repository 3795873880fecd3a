"""Simulations on a road: every design with exact delays and with Padé, RMS values of both and of neither."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from scipy.integrate import trapezoid

from susp_ctrl.delay_systems import pade_order, simulate
from susp_ctrl.errors import InputError, UnstableSystemError
from susp_ctrl.ride import ride_indices, signal_unit, stationary_rms
from susp_ctrl.road import BumpRoad, HarmonicRoad, RandomRoad
from susp_ctrl.study.audit_schema import AuditSettings, printed_number
from susp_ctrl.study.result import Design, TimeCase
from susp_ctrl.study.schema import PASSIVE, RoadSettings, TimeSettings
from susp_ctrl.study.workbench import FloatArray, Report, Workbench, road_text

EXACT, PADE, STATIONARY = "exact", "pade", "stationary"


def time_case(
    bench: Workbench, settings: TimeSettings, audit: AuditSettings | None, report: Report
) -> TimeCase:
    """Simulate all designs of one case.

    Parameters
    ----------
    bench : Workbench
    settings : TimeSettings
    audit : AuditSettings or None
        Holds the printed numbers of this case, if there are any.
    report : callable
        Told the share done.

    Returns
    -------
    TimeCase
    """
    road = build_road(settings.road, bench.speed)
    fine = record_times(settings)
    every = round(settings.report_step / settings.step)
    designs = bench.chosen(settings.designs) if settings.designs else bench.chosen([PASSIVE])
    histories: dict[tuple[str, str], FloatArray] = {}
    orders: dict[str, tuple[int, ...]] = {}
    rms: dict[tuple[str, str], pd.Series] = {}
    indices, differences = [], []
    for n, design in enumerate(designs):
        exact = response(bench, design.key, settings, road)
        table = ride_indices(exact, settings.skip, vehicle=bench.study.vehicle)
        indices.append(table.assign(design=design.key)[["indicator", "unit", "design", "value"]])
        values = record_rows(exact, settings.outputs)
        histories[design.key, EXACT] = values[:, ::every]
        rms[design.key, EXACT] = record_rms(exact, settings)
        if design.channels:
            order = settings.pade_order or pade_order(bench.loop(design.key), settings.pade_omega)
            orders[design.key] = (order,) * len(design.channels)
            approximate = response(bench, design.key, settings, road, order)
            histories[design.key, PADE] = record_rows(approximate, settings.outputs)[:, ::every]
            rms[design.key, PADE] = record_rms(approximate, settings)
            differences += _difference(
                design.key, values, record_rows(approximate, settings.outputs), settings.outputs
            )
        rms[design.key, STATIONARY] = _stationary(bench, design, road)
        report((n + 1) / len(designs))
    times = fine[::every]
    return TimeCase(
        key=settings.key,
        label=settings.label,
        road_text=_text(settings, bench.speed),
        timepts=times,
        road_profiles={name: road.profile(times + settings.lead_in, lag) for name, lag in bench.lags.items()},
        outputs=settings.outputs,
        designs=tuple(design.key for design in designs),
        histories=histories,
        pade_orders=orders,
        rms=_rms_table(designs, rms, settings.outputs),
        indices=pd.concat(indices, ignore_index=True),
        printed=_printed(settings.key, audit),
        pade_difference=pd.DataFrame(
            differences, columns=["design", "output", "unit", "max_difference", "relative_to_peak"]
        ),
    )


def build_road(settings: RoadSettings, speed: float) -> Any:
    """Return the road of a case, met at the given speed (m/s)."""
    if settings.kind == "harmonic":
        return HarmonicRoad(settings.amplitude, settings.omega)  # type: ignore[arg-type]  # the schema demands it
    if settings.kind == "bump":
        return BumpRoad(settings.height, settings.length, speed)  # type: ignore[arg-type]
    bins = {} if settings.bins is None else {"bins": settings.bins}
    return RandomRoad(iso_class=settings.iso_class, speed=speed, seed=settings.seed or 0, **bins)


def record_times(settings: TimeSettings) -> FloatArray:
    """Return the instants of the record (s), from 0, `step` apart."""
    count = int(np.floor(settings.duration / settings.step * (1 + 1e-12)))
    times: FloatArray = settings.step * np.arange(count + 1)
    return times


def response(
    bench: Workbench, key: str, settings: TimeSettings, road: Any, order: int | None = None, *, every: int = 1
) -> Any:
    """Simulate one design on the road of a case: exact delays, or Padé of the order given.

    The run begins at rest when the front wheel meets the road; the record begins `lead_in` later.

    Returns
    -------
    control.TimeResponseData
        Its times are those of the run: the record begins at `lead_in`.
    """
    times = settings.lead_in + record_times(settings)[::every]
    inputs = road.inputs(bench.lags)
    if order is None:
        return simulate(bench.loop(key), times, inputs)
    return simulate(bench.loop(key), times, inputs, method="pade", order=order)


def stationary_indices(bench: Workbench, key: str, road: Any) -> pd.Series | None:
    """Return the RMS indices of a design without simulation; None for a road or loop that has none."""
    try:
        table = stationary_rms(bench.loop(key), road, bench.lags)
    except (UnstableSystemError, InputError):
        return None
    return table.set_index("indicator")["value"]


def _stationary(bench: Workbench, design: Design, road: Any) -> pd.Series:
    found = None if isinstance(road, BumpRoad) else stationary_indices(bench, design.key, road)
    return pd.Series(dtype=float) if found is None else found


def record_rows(simulated: Any, outputs: tuple[str, ...]) -> FloatArray:
    """Return the chosen outputs of a response, shape (outputs, n)."""
    values = np.asarray(simulated.outputs).reshape(len(simulated.output_labels), -1)
    return values[[list(simulated.output_labels).index(name) for name in outputs]]


def record_rms(simulated: Any, settings: TimeSettings) -> pd.Series:
    """Return the RMS of every output of the case over the record after `skip`, by the trapezoidal rule."""
    times = np.asarray(simulated.time)
    kept = times >= times[0] + settings.skip * (1 - 1e-12)
    squares = record_rows(simulated, settings.outputs)[:, kept] ** 2
    span = times[kept][-1] - times[kept][0]
    return pd.Series(np.sqrt(trapezoid(squares, times[kept]) / span), index=list(settings.outputs))


def _rms_table(
    designs: list[Design], rms: dict[tuple[str, str], pd.Series], outputs: tuple[str, ...]
) -> pd.DataFrame:
    rows = []
    for output in outputs:
        for design in designs:
            for method in (EXACT, PADE, STATIONARY):
                value = rms.get((design.key, method), pd.Series(dtype=float)).get(output)
                if value is None:
                    continue
                reference = rms[PASSIVE, STATIONARY if method == STATIONARY else EXACT].get(output, np.nan)
                change = np.nan if design.key == PASSIVE or not reference else 100 * (value / reference - 1)
                rows.append(
                    (output, signal_unit(output), design.key, design.role, method, float(value), change)
                )
    columns = ["indicator", "unit", "design", "role", "method", "value", "change_percent"]
    return pd.DataFrame(rows, columns=columns)


def _difference(
    key: str, exact: FloatArray, approximate: FloatArray, outputs: tuple[str, ...]
) -> list[tuple[str, str, str, float, float]]:
    largest = np.abs(approximate - exact).max(axis=1)
    peak = np.abs(exact).max(axis=1)
    relative = np.divide(largest, peak, out=np.full_like(peak, np.nan), where=peak > 0)
    return [
        (key, output, signal_unit(output), float(d), float(r))
        for output, d, r in zip(outputs, largest, relative, strict=True)
    ]


def _printed(key: str, audit: AuditSettings | None) -> pd.DataFrame | None:
    rows = [
        (row.indicator, design, printed_number(text).value)
        for table in (audit.tables if audit is not None else ())
        if table.time == key
        for row in table.rows
        for design, text in ((PASSIVE, row.passive), (table.active, row.active))
    ]
    return pd.DataFrame(rows, columns=["indicator", "design", "value"]) if rows else None


def _text(settings: TimeSettings, speed: float) -> str:
    begin = (
        f"the record begins {settings.lead_in:g} s after the car, at rest, met the road"
        if settings.lead_in
        else "the car is at rest when the front wheel meets the road at t = 0"
    )
    return f"{road_text(settings.road, speed)}; {begin}"
