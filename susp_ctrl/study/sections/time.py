"""Simulations on a road: every design with exact delays and with Padé, RMS values of both and of neither."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import DelayLTI, pade_order, simulate
from susp_ctrl.delay_systems.approximation import HIGHEST_ORDER
from susp_ctrl.errors import InputError, PadeOrderWarning, UnstableSystemError
from susp_ctrl.ride import ride_indices, signal_unit, stationary_rms
from susp_ctrl.ride.averages import Signals, averages, close_kinks
from susp_ctrl.ride.extremes import extremes
from susp_ctrl.ride.record import warn_if_coarse
from susp_ctrl.road import BumpRoad, HarmonicRoad, RandomRoad
from susp_ctrl.study.results import Design, TimeCase
from susp_ctrl.study.sections.workbench import Report, Workbench, road_text
from susp_ctrl.study.settings import PASSIVE, AuditSettings, RoadSettings, TimeSettings, printed_number

EXACT, PADE, STATIONARY = "exact", "pade", "stationary"
_THINNED = 1e3  # times the tolerance by which the samples of a thinned record may seem wrong
_ROUNDING = 1e-10  # of the largest output of a record


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
    every = round(settings.report_step / settings.step)
    designs = bench.chosen(settings.designs) if settings.designs else bench.chosen([PASSIVE])
    orders: dict[str, tuple[int, ...]] = {}
    records: dict[tuple[str, str], Record] = {}
    stationary: dict[str, pd.Series] = {}
    indices: list[pd.DataFrame] = []
    for n, design in enumerate(designs):
        exact = records[design.key, EXACT] = record(bench, design.key, settings, road)
        indices.append(exact.indices.assign(design=design.key))
        if design.channels:
            order = settings.pade_order or band_order(bench.loop(design.key), settings.pade_omega)
            orders[design.key] = (order,) * len(design.channels)
            with warnings.catch_warnings():
                if settings.pade_order is None:
                    # The band is the one that the study asks for.
                    warnings.simplefilter("ignore", PadeOrderWarning)
                records[design.key, PADE] = record(bench, design.key, settings, road, order, indexed=False)
        stationary[design.key] = stationary_indices(bench, design.key, road)
        report((n + 1) / len(designs))
    times = record_times(settings.duration, settings.step)[::every]
    return TimeCase(
        key=settings.key,
        label=settings.label,
        road_text=_text(settings, bench.speed),
        timepts=times,
        road_profiles={name: road.profile(times + settings.lead_in, lag) for name, lag in bench.lags.items()},
        outputs=settings.outputs,
        designs=tuple(design.key for design in designs),
        histories={which: found.outputs[:, ::every] for which, found in records.items()},
        pade_orders=orders,
        rms=_rms_table(designs, records, stationary, settings.outputs),
        indices=pd.concat(indices, ignore_index=True)[["indicator", "unit", "design", "value"]],
        printed=_printed(settings.key, audit),
        pade_difference=_differences(designs, records, settings),
    )


def build_road(settings: RoadSettings, speed: float) -> Any:
    """Return the road of a case, met at the given speed (m/s)."""
    if settings.kind == "harmonic":
        return HarmonicRoad(settings.amplitude, settings.omega)  # type: ignore[arg-type]  # the schema demands it
    if settings.kind == "bump":
        return BumpRoad(settings.height, settings.length, speed)  # type: ignore[arg-type]
    bins = {} if settings.bins is None else {"bins": settings.bins}
    return RandomRoad(iso_class=settings.iso_class, speed=speed, seed=settings.seed or 0, **bins)


def record_times(duration: float, step: float) -> FloatArray:
    """Return the instants of a record (s), from 0, `step` apart."""
    count = int(np.floor(duration / step * (1 + 1e-12)))
    return np.asarray(step * np.arange(count + 1), dtype=np.float64)


@dataclass(frozen=True)
class Record:
    """A simulated record: outputs, shape (outputs, n), RMS by output, ride indices; nan where the run overflowed.

    `at` gives the outputs at any times of the record; None where the run overflowed.
    """

    outputs: FloatArray
    rms: pd.Series
    indices: pd.DataFrame
    at: Callable[[FloatArray], FloatArray] | None


def record(
    bench: Workbench,
    key: str,
    settings: TimeSettings,
    road: Any,
    order: int | None = None,
    *,
    every: int = 1,
    indexed: bool = True,
) -> Record:
    """Simulate one design on the road of a case: exact delays, or Padé of the order given.

    The run begins at rest when the front wheel meets the road; the record begins `lead_in` later and takes every
    `every`-th instant; ride indices are computed where `indexed`. An unstable loop may leave the range of numbers: the
    record is nan then.
    """
    times = record_times(settings.duration, settings.step)[::every]
    method: dict[str, Any] = {} if order is None else {"method": "pade", "order": order}
    indices = pd.DataFrame(columns=["indicator", "value", "unit"])
    try:
        response = simulate(bench.loop(key), settings.lead_in + times, road.inputs(bench.lags), **method)
        rows = [response.output_labels.index(name) for name in settings.outputs]
        values = np.asarray(response.y)[rows]
        if not np.all(np.isfinite(values)):
            raise OverflowError
        if indexed:
            indices = ride_indices(response, settings.skip, vehicle=bench.study.vehicle)
        latest = float(response.time[-1])
        at = lambda t: np.asarray(response.at(np.minimum(settings.lead_in + t, latest)).y)[rows]  # noqa: E731
    except OverflowError:
        values = np.full((len(settings.outputs), times.size), np.nan)
        return Record(values, _rms(times, values, settings, None, kinks=np.zeros(0)), indices, None)
    kinks = close_kinks(response, times) - settings.lead_in
    # a thinned record is only held against another one like it
    lenience = 1.0 if every == 1 else _THINNED
    return Record(values, _rms(times, values, settings, at, kinks, lenience), indices, at)


def band_order(loop: DelayLTI, omega: float) -> int:
    """Return the Padé order that the band up to omega (rad/s) needs, or the highest there is."""
    try:
        return pade_order(loop, omega)
    except InputError:
        return HIGHEST_ORDER


def stationary_indices(bench: Workbench, key: str, road: Any) -> pd.Series:
    """Return the RMS indices of a design without simulation; none for a bump or a loop that is not stable."""
    if not isinstance(road, BumpRoad):
        try:
            return stationary_rms(bench.loop(key), road, bench.lags).set_index("indicator")["value"]
        except UnstableSystemError:
            pass
    return pd.Series(dtype=float)


def _rms(
    times: FloatArray,
    values: FloatArray,
    settings: TimeSettings,
    at: Callable[[FloatArray], FloatArray] | None,
    kinks: FloatArray,
    lenience: float = 1.0,
) -> pd.Series:
    """Return the RMS of every output over the record after `skip`, between the samples too; nan without `at`."""
    if at is None:
        return pd.Series(np.nan, index=list(settings.outputs))
    kept = times >= settings.skip * (1 - 1e-12)

    def squares(outputs: FloatArray) -> Signals:
        return dict(zip(settings.outputs, outputs**2, strict=True))

    noise = float((_ROUNDING * np.max(np.abs(values))) ** 2)
    found = averages(
        times[kept],
        squares(values[:, kept]),
        lambda t: squares(at(t)),
        kinks,
        dict.fromkeys(settings.outputs, noise),
        lenience,
    )
    warn_if_coarse([f"RMS {name}" for name in found.doubtful])
    return pd.Series({name: float(np.sqrt(mean)) for name, mean in found.means.items()})


def _rms_table(
    designs: list[Design],
    records: dict[tuple[str, str], Record],
    stationary: dict[str, pd.Series],
    outputs: tuple[str, ...],
) -> pd.DataFrame:
    rms = {which: found.rms for which, found in records.items()}
    rms |= {(key, STATIONARY): values for key, values in stationary.items()}
    rows = []
    for output, design, method in product(outputs, designs, (EXACT, PADE, STATIONARY)):
        value = rms[design.key, method].get(output) if (design.key, method) in rms else None
        if value is None:
            continue
        reference = rms[PASSIVE, STATIONARY if method == STATIONARY else EXACT].get(output, np.nan)
        change = np.nan if design.key == PASSIVE or not reference else 100 * (value / reference - 1)
        unit = signal_unit(output)
        rows.append((output, unit, design.key, design.role, method, float(value), float(change)))
    columns = ["indicator", "unit", "design", "role", "method", "value", "change_percent"]
    return pd.DataFrame(rows, columns=columns)


def _differences(
    designs: list[Design], records: dict[tuple[str, str], Record], settings: TimeSettings
) -> pd.DataFrame:
    """Return the largest difference between Padé and exact delays, and its share of the exact peak."""
    rows, times = [], record_times(settings.duration, settings.step)
    for design in designs:
        if (design.key, PADE) not in records:
            continue
        largest, peaks = _largest(times, records[design.key, PADE], records[design.key, EXACT])
        for output, difference, peak in zip(settings.outputs, largest, peaks, strict=True):
            relative = difference / peak if peak > 0.0 else np.nan
            rows.append((design.key, output, signal_unit(output), difference, relative))
    return pd.DataFrame(rows, columns=["design", "output", "unit", "max_difference", "relative_to_peak"])


def _largest(times: FloatArray, approximate: Record, exact: Record) -> FloatArray:
    """Return the largest magnitude of every output's difference, and of the exact output, shape (2, outputs).

    Both are looked for together: each look between the samples simulates the whole record again.
    """
    first, second = approximate.at, exact.at

    def signals(approximated: FloatArray, of_exact: FloatArray) -> dict[str, FloatArray]:
        both = np.concatenate([approximated - of_exact, of_exact])
        return {str(number): values for number, values in enumerate(both)}

    found = extremes(
        times,
        signals(approximate.outputs, exact.outputs),
        None if first is None or second is None else (lambda t: signals(first(t), second(t))),
    )
    return np.array([max(abs(low), abs(high)) for low, high in found.values()]).reshape(2, -1)


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
