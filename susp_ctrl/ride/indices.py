"""Ride indices of a simulated response."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl import validation
from susp_ctrl.errors import InputError
from susp_ctrl.ride.exposures import exposures
from susp_ctrl.ride.indicators import (
    COMFORT_WEIGHTS,
    VehicleLike,
    checked_vehicle,
    indicator_signals,
    seat_combination,
    signal_unit,
)
from susp_ctrl.ride.record import Limits, Record

Row = tuple[str, float, str]


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
        the samples; of any other response, those of its samples. Means of every kind (RMS, mean power, weighted
        figures) are taken from the samples where these are close enough together, which what every second and third
        of them alone would give tells. Where they are not, or announced kinks lie closer together than they, a
        response of `simulate` is computed between them until the means are good to 1e-4. MTVV and what follows from
        it is nan in records shorter than 1 s, ratios are nan for a car at rest.

    Raises
    ------
    InputError
        If the response is no time response of one trace, is not finite, has none of the outputs, or skip
        leaves fewer than two samples.

    Warns
    -----
    RuntimeWarning
        The record is too coarse for the means named: more than 400 000 times would be needed for 1e-4, or nothing is
        known between the samples and these are not good to 1e-3.

    References
    ----------
    .. [1] K. Wu, C. Ren, "Control and Stability Analysis of Double Time-Delay Active Suspension Based on
       Particle Swarm Optimization", Shock and Vibration, 2020, Tables 2 and 3.
    .. [2] ISO 2631-1:1997, Mechanical vibration and shock - Evaluation of human exposure to whole-body
    vibration.
    """
    skip = validation.number("skip", skip, at_least=0.0)
    limit = None if stroke_limit is None else validation.number("stroke_limit", stroke_limit, above=0.0)
    if vehicle is not None:
        checked_vehicle(vehicle)
    record = Record(response, skip, lambda labels: seat_combination(labels, seat_position))
    indicators = indicator_signals(list(record.kept))
    if not indicators:
        raise InputError(
            f"response has outputs {', '.join(record.labels)}: "
            "an acceleration or a suspension or tire deflection is needed"
        )
    limits, means = record.limits(), record.averages([*indicators, *record.forces])
    rms = {name: float(np.sqrt(means[name])) for name in (*indicators, *record.forces)}
    rows = [(name, rms[name], signal_unit(name)) for name in indicators]
    rows += [(f"{name}_peak", _peak(limits[name]), signal_unit(name)) for name in indicators]
    rows += _comfort_rows(record)
    if vehicle is not None:
        rows += _tire_rows(rms, limits, vehicle)
    if limit is not None:
        rows += [
            (f"{name}_stroke_use", _peak(limits[name]) / limit, "-")
            for name in record.kept
            if name.startswith("suspension_deflection")
        ]
    rows += _actuator_rows(rms, means, limits)
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


def _peak(limits: tuple[float, float]) -> float:
    return max(abs(limits[0]), abs(limits[1]))


def _comfort_rows(record: Record) -> Iterator[Row]:
    weighted_rms = {}
    for name, figures in exposures(record).items():
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


def _tire_rows(rms: Mapping[str, float], limits: Limits, vehicle: VehicleLike) -> Iterator[Row]:
    for tire in vehicle.tires:
        if tire.deflection not in rms:
            continue
        wheel = tire.deflection.removeprefix("tire_deflection")
        load = tire.stiffness * rms[tire.deflection]
        least, most = limits[tire.deflection]
        lowest = tire.static_load - tire.stiffness * most
        yield f"tire_load{wheel}", load, "N"
        yield f"tire_load{wheel}_min", lowest, "N"
        yield f"tire_load{wheel}_max", tire.static_load - tire.stiffness * least, "N"
        yield f"load_coefficient{wheel}", load / tire.static_load, "-"
        yield f"lift_off{wheel}", float(lowest <= 0), "-"


def _actuator_rows(rms: Mapping[str, float], means: Mapping[str, float], limits: Limits) -> Iterator[Row]:
    for name in (name for name in rms if name.startswith("actuator_force")):
        axle = name.removeprefix("actuator_force")
        yield name, rms[name], "N"
        yield f"{name}_peak", _peak(limits[name]), "N"
        yield f"{name}_rate_peak", _peak(limits[f"{name}_rate"]), "N/s"
        if f"actuator_power{axle}" in means:
            yield f"actuator_power{axle}_mean", means[f"actuator_power{axle}"], "W"
            yield f"actuator_power{axle}_peak", _peak(limits[f"actuator_power{axle}"]), "W"
