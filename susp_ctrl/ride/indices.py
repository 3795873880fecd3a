"""Ride indices of a simulated response."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.interpolate import CubicSpline

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.ride.comfort import exposure, mean_square
from susp_ctrl.ride.extremes import Signals, extremes
from susp_ctrl.ride.indicators import (
    COMFORT_WEIGHTS,
    VehicleLike,
    checked_vehicle,
    indicator_signals,
    seat_combination,
    signal_unit,
)
from susp_ctrl.ride.weighting import weighted_history

Row = tuple[str, float, str]
Limits = Mapping[str, tuple[float, float]]

_RATE_STEP = 1.0 / 32.0  # half the difference that stands for a derivative, in sampling steps


def ride_indices(
    response: Any,
    skip: float = 0.0,
    *,
    vehicle: VehicleLike | None = None,
    seat_position: float | None = None,
    stroke_limit: float | None = None,
) -> pd.DataFrame:
    """Return the ride indices of a time response, RMS values first.

    Parameters
    ----------
    response : control.TimeResponseData
        Of a vehicle with the output names of `HalfCar.plant`, any subset of them; one input trace.
    skip : float
        Time (s) cut off the start of the record, such as a transient. Weighting filters run over the whole
        record from rest, so that their own transient is cut off too.
    vehicle : HalfCar or another vehicle, optional
        Adds the tire loads.
    seat_position : float, optional
        Adds ``seat_acceleration`` = x_c'' + position phi'' at this distance (m) behind the centre of mass.
    stroke_limit : float, optional
        Suspension travel (m) to either side; adds the share of it that is used.

    Returns
    -------
    pandas.DataFrame
        Columns ``indicator``, ``value``, ``unit``; an indicator that is an output's name is that output's
        RMS.

        * RMS of every acceleration, suspension deflection and tire deflection, in the order of the response;
        for the
          half car these are the six indicators of [1]_;
        * ``*_peak``: largest magnitude of each of them;
        * for every acceleration ``*_weighted`` (RMS weighted by Wk, rotations by We), ``*_mtvv``, ``*_vdv``,
          ``*_crest_factor``, ``*_mtvv_ratio`` = MTVV/a_w and ``*_vdv_ratio`` = VDV/(a_w T^(1/4)), and
          ``comfort_total`` = sqrt(a_w^2 + (0.4 m pitch_w)^2 + (0.63 m roll_w)^2) with heave at the seat where
          there is one, else at the centre of mass;
        * with `vehicle`, for every tire ``tire_load*`` (RMS of the dynamic load -k_t times its deflection),
          ``*_min`` and ``*_max`` of the total load, ``load_coefficient*`` = RMS/static and ``lift_off*`` (1
          if the total load ever falls to zero);
        * with `stroke_limit`, ``suspension_deflection*_stroke_use`` = peak/limit;
        * for every actuator ``actuator_force*`` (RMS), ``*_peak``, ``*_rate_peak``, and with the suspension
          velocity ``actuator_power*_mean`` and ``*_peak`` of f times that velocity, positive where the
          actuator drives the suspension.

        Peaks, least and largest loads and rates of a response of `simulate` are those of the exact solution between
        the samples; of any other response, those of its samples. Figures of weighted accelerations are of samples.
        MTVV and what follows from it is nan in records shorter than 1 s, ratios are nan for a car at rest.

    Raises
    ------
    InputError
        If the response is no time response of one trace, is not finite, has none of the outputs, or skip
        leaves fewer than two samples.

    References
    ----------
    .. [1] K. Wu, C. Ren, "Control and Stability Analysis of Double Time-Delay Active Suspension Based on
       Particle Swarm Optimization", Shock and Vibration, 2020, Tables 2 and 3.
    .. [2] ISO 2631-1:1997, Mechanical vibration and shock - Evaluation of human exposure to whole-body
    vibration.
    """
    t, signals = _checked_response(response)
    skip = validation.number("skip", skip, at_least=0.0)
    limit = None if stroke_limit is None else validation.number("stroke_limit", stroke_limit, above=0.0)
    labels = list(signals)
    if vehicle is not None:
        checked_vehicle(vehicle)
    seat = seat_combination(labels, seat_position)
    if seat is not None:
        signals["seat_acceleration"] = seat @ np.array([signals[name] for name in labels])
    kept = t >= t[0] + skip * (1 - 1e-12)
    if np.count_nonzero(kept) < 2:
        raise InputError(
            f"skip = {skip:g} is not allowed: less than the record of {t[-1] - t[0]:g} s is needed"
        )
    record = {name: values[kept] for name, values in signals.items()}
    indicators = indicator_signals(list(record))
    if not indicators:
        raise InputError(
            f"response has outputs {', '.join(labels)}: "
            "an acceleration or a suspension or tire deflection is needed"
        )
    limits = _limits(response, t[kept], record, labels, seat)
    rows = [(name, _rms(t[kept], record[name]), signal_unit(name)) for name in indicators]
    rows += [(f"{name}_peak", _peak(limits[name]), signal_unit(name)) for name in indicators]
    rows += _comfort_rows(t, signals, kept)
    if vehicle is not None:
        rows += _tire_rows(t[kept], record, limits, vehicle)
    if limit is not None:
        rows += [
            (f"{name}_stroke_use", _peak(limits[name]) / limit, "-")
            for name in record
            if name.startswith("suspension_deflection")
        ]
    rows += _actuator_rows(t[kept], record, limits)
    return pd.DataFrame(rows, columns=["indicator", "value", "unit"])


def compare_indices(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Set tables of ride indices side by side, each with its change against the first in percent.

    Parameters
    ----------
    tables : mapping of name to DataFrame
        Results of `ride_indices` or `stationary_rms`; the first is the reference, usually the passive car.

    Returns
    -------
    pandas.DataFrame
        Columns ``indicator``, ``unit``, one per name, and ``<name>_change`` (percent) for all but the first;
        nan where the reference is zero. Rows are the indicators of the first table that all tables have.

    Raises
    ------
    InputError
        If there is no table.
    """
    for name, table in validation.mapping("tables", tables).items():
        if not isinstance(table, pd.DataFrame) or not {"indicator", "value", "unit"} <= set(table.columns):
            raise InputError(f"tables[{name!r}] is no table of ride_indices or stationary_rms")
    columns = {name: table.set_index("indicator")["value"] for name, table in tables.items()}
    reference_name, reference = next(iter(columns.items()))
    shared = [name for name in reference.index if all(name in column.index for column in columns.values())]
    units = tables[reference_name].set_index("indicator")["unit"]
    result = pd.DataFrame({"indicator": shared, "unit": [units[name] for name in shared]})
    base = reference[shared].to_numpy(dtype=float)
    for name, column in columns.items():
        result[name] = column[shared].to_numpy(dtype=float)
    for name in list(columns)[1:]:
        with np.errstate(divide="ignore", invalid="ignore"):
            change = 100 * (result[name].to_numpy() - base) / np.abs(base)
        result[f"{name}_change"] = np.where(base != 0, change, np.nan)
    return result


def _checked_response(response: Any) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the times and every output by name."""
    try:
        t = validation.array("response.time", response.time, finite=False)
        outputs = validation.array("response.y", response.y, finite=False)
        labels = list(response.output_labels)
    except AttributeError:
        raise InputError(f"response = {response!r} is not allowed: a time response is needed") from None
    if outputs.ndim == 3:
        if outputs.shape[1] != 1:
            raise InputError(f"response has {outputs.shape[1]} input traces: one is needed")
        outputs = outputs[:, 0]
    if not (np.all(np.isfinite(outputs)) and np.all(np.isfinite(t))):
        raise InputError("response is not allowed: finite outputs are needed (did the simulation diverge?)")
    return t, dict(zip(labels, outputs, strict=True))


def _rms(t: FloatArray, values: FloatArray) -> float:
    return float(np.sqrt(mean_square(t, values)))


def _peak(limits: tuple[float, float]) -> float:
    return max(abs(limits[0]), abs(limits[1]))


def _limits(
    response: Any, t: FloatArray, record: Signals, labels: list[str], seat: FloatArray | None
) -> Limits:
    """Return least and largest value of all signals, powers and force rates; exact where the response can tell."""
    rates = {name: np.gradient(record[name], t) for name in _forces(record)}
    evaluate: Callable[[FloatArray], FloatArray] | None = getattr(response, "at", None)
    if evaluate is None:
        return extremes(t, _with_actuators(record, rates), None)
    late = _RATE_STEP * float(np.min(np.diff(t)))

    def signals(times: FloatArray) -> dict[str, FloatArray]:
        found = _checked_response(response.at(times))[1]
        if seat is not None:
            found["seat_acceleration"] = seat @ np.array([found[name] for name in labels])
        return {name: found[name] for name in record}

    def shown(times: FloatArray) -> Signals:
        before, after = np.maximum(times - late, t[0]), np.minimum(times + late, t[-1])
        every = np.unique(np.concatenate([times, before, after] if rates else [times]))
        found = signals(every)
        here, early, later = (np.searchsorted(every, some) for some in (times, before, after))
        slopes = {name: (found[name][later] - found[name][early]) / (after - before) for name in rates}
        return _with_actuators({name: values[here] for name, values in found.items()}, slopes)

    return extremes(t, _with_actuators(record, rates), shown)


def _forces(record: Signals) -> list[str]:
    return [name for name in record if name.startswith("actuator_force")]


def _with_actuators(record: Signals, rates: Signals) -> Signals:
    """Return the signals, and the power and the rate of every actuator's force."""
    shown = dict(record)
    for name in _forces(record):
        axle = name.removeprefix("actuator_force")
        shown[f"{name}_rate"] = rates[name]
        if f"suspension_velocity{axle}" in record:
            shown[f"actuator_power{axle}"] = record[name] * record[f"suspension_velocity{axle}"]
    return shown


def _comfort_rows(t: FloatArray, signals: Mapping[str, FloatArray], kept: NDArray[np.bool_]) -> Iterator[Row]:
    present = {name: COMFORT_WEIGHTS[name] for name in signals if name in COMFORT_WEIGHTS}
    weighted_rms = {}
    for name, (weighting, _) in present.items():
        figures = exposure(t[kept], _weighted(t, signals[name], weighting)[kept])
        unit = signal_unit(name)
        weighted_rms[name] = figures.rms
        yield f"{name}_weighted", figures.rms, unit
        yield f"{name}_mtvv", figures.mtvv, unit
        yield f"{name}_vdv", figures.vdv, unit.replace("s2", "s1.75")
        yield f"{name}_crest_factor", figures.crest_factor, "-"
        yield f"{name}_mtvv_ratio", figures.mtvv_ratio, "-"
        yield f"{name}_vdv_ratio", figures.vdv_ratio, "-"
    yield from comfort_total(weighted_rms)


def comfort_total(weighted_rms: Mapping[str, float]) -> Iterator[Row]:
    """Give the row of the comfort total where heave is known."""
    heave = "seat_acceleration" if "seat_acceleration" in weighted_rms else "body_acceleration"
    if heave not in weighted_rms:
        return
    parts = [heave, *(name for name in ("pitch_acceleration", "roll_acceleration") if name in weighted_rms)]
    total = np.sqrt(sum((COMFORT_WEIGHTS[name][1] * weighted_rms[name]) ** 2 for name in parts))
    yield "comfort_total", float(total), "m/s2"


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


def _tire_rows(t: FloatArray, record: Signals, limits: Limits, vehicle: VehicleLike) -> Iterator[Row]:
    for tire in vehicle.tires:
        if tire.deflection not in record:
            continue
        wheel = tire.deflection.removeprefix("tire_deflection")
        rms = tire.stiffness * _rms(t, record[tire.deflection])
        least, most = limits[tire.deflection]
        lowest = tire.static_load - tire.stiffness * most
        yield f"tire_load{wheel}", rms, "N"
        yield f"tire_load{wheel}_min", lowest, "N"
        yield f"tire_load{wheel}_max", tire.static_load - tire.stiffness * least, "N"
        yield f"load_coefficient{wheel}", rms / tire.static_load, "-"
        yield f"lift_off{wheel}", float(lowest <= 0), "-"


def _actuator_rows(t: FloatArray, record: Signals, limits: Limits) -> Iterator[Row]:
    for name in _forces(record):
        axle, force = name.removeprefix("actuator_force"), record[name]
        yield name, _rms(t, force), "N"
        yield f"{name}_peak", _peak(limits[name]), "N"
        yield f"{name}_rate_peak", _peak(limits[f"{name}_rate"]), "N/s"
        velocity = record.get(f"suspension_velocity{axle}")
        if velocity is not None:
            power = force * velocity
            yield f"actuator_power{axle}_mean", float(trapezoid(power, t) / (t[-1] - t[0])), "W"
            yield f"actuator_power{axle}_peak", _peak(limits[f"actuator_power{axle}"]), "W"
