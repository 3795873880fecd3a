"""Searches for gains and delays, compared with the passive car, the published designs and the closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl.arrays import FloatArray
from susp_ctrl.ride import signal_unit
from susp_ctrl.road import RandomRoad
from susp_ctrl.study.results import Design, TuningRun
from susp_ctrl.study.sections.cancellation import cancelling_feedback
from susp_ctrl.study.sections.frequency import velocity_gain
from susp_ctrl.study.sections.workbench import Report, Workbench
from susp_ctrl.study.settings import PASSIVE, TuningSettings, gain_unit
from susp_ctrl.tuning import BandMean, BandPeak, Harmonic, RoadRms, TuningProblem, tune


def tuning_run(bench: Workbench, settings: TuningSettings, report: Report) -> TuningRun:
    """Search one design, add it to the workbench and compare it.

    Parameters
    ----------
    bench : Workbench
        Gets the design found; none is added if no stable design was found.
    settings : TuningSettings
    report : callable
        Told the share done.

    Returns
    -------
    TuningRun
    """
    problem = _problem(bench, settings)
    chosen = {name: getattr(settings, name) for name in ("particles", "iterations", "topology", "seed")}
    best = tune(problem, **chosen, progress=lambda _, share: report(0.99 * share))
    objective = _objective_text(bench, settings)
    if best.success:
        reference = f"found here: {objective}"
        bench.add(Design(settings.key, settings.label, "tuned", tuple(best.channels), reference))
    found = np.asarray(best.x, dtype=float) if best.success else np.full(problem.dimension, np.nan)
    report(1.0)
    return TuningRun(
        key=settings.key,
        label=settings.label,
        objective=settings.objective,
        objective_text=objective,
        unit=_objective_unit(settings),
        settings=chosen,
        bounds=_bounds(settings, found),
        history=best.history,
        value=float(best.fun),
        swarm_value=float(best.swarm_fun),
        comparison=_comparison(bench, settings, problem),
        closed_form=_closed_form(bench, settings, found),
        detuning=_detuning(bench, settings),
        message=str(best.message),
    )


def _problem(bench: Workbench, settings: TuningSettings) -> TuningProblem:
    return TuningProblem(
        bench.plant,
        pairs=[(pair.measured, pair.actuator) for pair in settings.pairs],
        objective=_objective(bench, settings),
        gain_bounds=[(pair.gain_from, pair.gain_to) for pair in settings.pairs],
        delay_bounds=[(pair.delay_from, pair.delay_to) for pair in settings.pairs],
        actuator_bandwidth=[pair.actuator_bandwidth for pair in settings.pairs],
        decay_rate=settings.decay_rate,
        delay_tolerance=settings.delay_tolerance,
    )


def _objective(bench: Workbench, settings: TuningSettings) -> Any:
    weights, lags = dict(settings.weights), bench.lags
    if settings.objective == "harmonic":
        return Harmonic(settings.omega, weights, lags)  # type: ignore[arg-type]  # the schema demands it
    if settings.objective == "road_rms":
        return RoadRms(RandomRoad(iso_class=settings.iso_class, speed=bench.speed), weights, lags)
    band = (settings.omega_from, settings.omega_to)
    kind = BandMean if settings.objective == "band_mean" else BandPeak
    return kind(band, weights, lags)  # type: ignore[arg-type]  # the schema demands a band


def _objective_text(bench: Workbench, settings: TuningSettings) -> str:
    terms = " + ".join(f"{weight:g} {output}" for output, weight in settings.weights.items())
    if settings.objective == "road_rms":
        return (
            f"weighted standard deviations {terms} on an ISO 8608 road of class {settings.iso_class} "
            f"at {bench.speed:g} m/s"
        )
    where = {
        "harmonic": f"at {settings.omega} rad/s",
        "band_mean": f"mean over {settings.omega_from} to {settings.omega_to} rad/s",
        "band_peak": f"largest over {settings.omega_from} to {settings.omega_to} rad/s",
    }[settings.objective]
    return f"|H| per road velocity, {terms}, {where}, wheels lagged at {bench.speed:g} m/s"


def _objective_unit(settings: TuningSettings) -> str:
    units = {signal_unit(output) for output, weight in settings.weights.items() if weight}
    if len(units) != 1:
        return ""
    unit = units.pop()
    return unit if settings.objective == "road_rms" else f"{unit} per m/s"


def _bounds(settings: TuningSettings, found: FloatArray) -> pd.DataFrame:
    pairs = list(enumerate(settings.pairs, 1))
    rows = [(f"g{n}", pair.gain_from, pair.gain_to, gain_unit(pair.measured)) for n, pair in pairs]
    rows += [(f"tau{n}", pair.delay_from, pair.delay_to, "s") for n, pair in pairs]
    return pd.DataFrame(rows, columns=["parameter", "lower", "upper", "unit"]).assign(found=found)


def _comparison(bench: Workbench, settings: TuningSettings, problem: TuningProblem) -> pd.DataFrame:
    passive = problem.passive_value
    rows = []
    for design in bench.chosen([*settings.compare, settings.key]):
        value = passive if design.key == PASSIVE else _value(bench, settings, problem, design)
        rows.append((design.key, design.role, value, value / passive))
    return pd.DataFrame(rows, columns=["design", "role", "objective_value", "ratio_to_passive"])


def _value(bench: Workbench, settings: TuningSettings, problem: TuningProblem, design: Design) -> float:
    """Return J of a design, which may feed back other signals than the search does."""
    pairs = tuple((str(c.measured), str(c.actuator)) for c in design.channels)
    gains, delays = [c.gain for c in design.channels], [c.delay for c in design.channels]
    widths = [c.actuator_bandwidth for c in design.channels]
    own = [pair.actuator_bandwidth for pair in settings.pairs]
    if pairs != tuple(problem.pairs) or widths != own:
        problem = TuningProblem(
            bench.plant,
            pairs=pairs,
            objective=_objective(bench, settings),
            gain_bounds=[(gain, gain) for gain in gains],
            delay_bounds=[(delay, delay) for delay in delays],
            actuator_bandwidth=widths,
        )
    return problem.accurate([*gains, *delays])[0]


def _closed_form(bench: Workbench, settings: TuningSettings, found: FloatArray) -> pd.DataFrame | None:
    if settings.objective != "harmonic" or settings.omega is None:
        return None
    solutions = cancelling_feedback(bench.study.vehicle, settings.pairs, settings.omega)
    if solutions is None:
        return None
    rows, m = [], len(settings.pairs)
    for pair, options, gain, delay in zip(settings.pairs, solutions, found[:m], found[m:], strict=True):
        distances = [abs(g - gain) + abs(tau - delay) * abs(g) for g, tau in options]
        nearest = int(np.argmin(distances)) if distances and np.all(np.isfinite(found)) else -1
        rows += [
            {
                "measured": pair.measured,
                "actuator": pair.actuator,
                "gain": g,
                "delay_s": tau,
                "found_gain": gain,
                "found_delay_s": delay,
                "gain_difference": gain - g,
                "delay_difference_s": delay - tau,
                "is_found": n == nearest,
            }
            for n, (g, tau) in enumerate(options)
        ]
    return pd.DataFrame(rows)


def _detuning(bench: Workbench, settings: TuningSettings) -> pd.DataFrame | None:
    if settings.objective != "harmonic" or settings.omega is None:
        return None
    factors = np.array(settings.detuning)
    omega = factors * settings.omega
    outputs, weights = tuple(settings.weights), np.array(list(settings.weights.values()))
    columns: dict[str, FloatArray] = {"frequency_factor": factors, "omega_rad_per_s": omega}
    for design in bench.chosen([*settings.compare, settings.key]):
        columns[design.key] = weights @ velocity_gain(bench, design.key, omega, outputs)
    return pd.DataFrame(columns)
