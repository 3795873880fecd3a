"""Run a study: from settings to one data object."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Collection
from dataclasses import fields, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from susp_ctrl import __version__, validation
from susp_ctrl.ride import signal_unit
from susp_ctrl.study.audit import Computed, audit_section, check_substitutions
from susp_ctrl.study.results import PadeCase, Provenance, StabilityMapCase, StudyRun, VehicleSection
from susp_ctrl.study.sections import (
    Report,
    Workbench,
    frequency_section,
    headlines,
    pade_case,
    pade_verdicts,
    stability_maps,
    stability_section,
    time_case,
    tuning_run,
)
from susp_ctrl.study.settings import (
    PAPER_SYMBOLS,
    PadeSettings,
    Study,
    StudySettings,
    parameter_unit,
    readable,
)
from susp_ctrl.vehicle import HalfCar

Progress = Callable[[str, float], None]

# Rough share of the time of each stage, for the progress display only.
_WEIGHTS = {
    "tuning": 2.0,
    "frequency": 0.5,
    "stability": 4.0,
    "stability_maps": 0.5,
    "time": 4.0,
    "pade": 4.0,
    "audit": 0.5,
}
SECTIONS = tuple(_WEIGHTS)


def compute_study(
    study: Study, progress: Progress | None = None, sections: Collection[str] | None = None
) -> StudyRun:
    """Run a study.

    Parameters
    ----------
    study : Study
        From `load_study`.
    progress : callable, optional
        Called as ``progress(stage, fraction)`` with the stage in words and the share of the whole run done, 0 to 1.
    sections : collection of str, optional
        Restrict the run to some of ``tuning, frequency, stability, stability_maps, time, pade, audit``; all that the
        study has by default. Without ``tuning`` the tuned designs are left out everywhere.

    Returns
    -------
    StudyRun

    Raises
    ------
    InputError
        An unknown section; a setting that only shows to be impossible while running.

    Notes
    -----
    Deterministic: equal studies on equal versions and machines give equal numbers, `Provenance.duration` excepted.
    """
    started = time.perf_counter()
    wanted = SECTIONS if sections is None else [validation.one_of("sections", s, SECTIONS) for s in sections]
    bench, whole = Workbench.of(study), study.settings
    left_out: dict[str, Any] = {
        f.name: f.default for f in fields(whole) if f.name in SECTIONS and f.name not in wanted
    }
    settings = replace(whole, **left_out)
    if settings.audit is not None:
        check_substitutions(study)
    stages = _Stages(settings, progress)

    tuning = tuple(
        tuning_run(bench, search, stages.next(f"tuning: {search.label}", "tuning"))
        for search in settings.tuning
    )
    frequency = stability = verdicts = audit = None
    if settings.frequency is not None:
        report = stages.next("frequency responses", "frequency")
        frequency = frequency_section(bench, settings.frequency, report)
    if settings.stability is not None:
        stability = stability_section(bench, settings.stability, stages.next("stability", "stability"))
    maps: list[StabilityMapCase] = []
    for entry in settings.stability_maps:
        report = stages.next(f"stability map: {entry.key.replace('_', ' ')}", "stability_maps")
        maps += stability_maps(bench, entry, report)
    time_cases = tuple(
        time_case(bench, case, whole.audit, stages.next(f"simulation: {case.label}", "time"))
        for case in settings.time
    )
    pade: list[PadeCase] = []
    if settings.pade is not None:
        cases = {case.key: case for case in whole.time}
        for key, case in settings.pade.cases.items():
            if key in bench.keys:
                report = stages.next(f"Padé: {bench.design(key).label}", "pade")
                pade.append(pade_case(bench, key, settings.pade, cases[case], report))
        if settings.pade.verdicts:
            verdicts = pade_verdicts(bench, settings.pade)
    if settings.audit is not None:
        computed = Computed(frequency, tuning, stability, time_cases)
        audit = audit_section(bench, settings.audit, computed, stages.next("audit", "audit"))
    stages.done()
    return StudyRun(
        study=study,
        provenance=_provenance(study, time.perf_counter() - started),
        vehicle=_vehicle(study),
        designs=tuple(bench.designs),
        signal_units={
            name: signal_unit(name) for name in (*bench.plant.input_labels, *bench.plant.output_labels)
        },
        frequency=frequency,
        tuning=tuning,
        stability=stability,
        time=time_cases,
        pade=tuple(pade),
        audit=audit,
        headlines=headlines(bench, tuning, stability, time_cases, audit, tuple(pade), verdicts),
        pade_verdicts=verdicts,
        stability_maps=tuple(maps),
    )


class _Stages:
    """Turns the progress of each stage into that of the whole run."""

    def __init__(self, settings: StudySettings, progress: Progress | None) -> None:
        self._progress = progress or (lambda stage, fraction: None)
        self._total = sum(weight * _number(settings, name) for name, weight in _WEIGHTS.items()) or 1.0
        self._before, self._weight = 0.0, 0.0

    def next(self, name: str, section: str) -> Report:
        """Begin a stage; the result takes the share of it that is done."""
        self._before += self._weight
        self._weight = _WEIGHTS[section] / self._total
        before, weight = self._before, self._weight
        self._progress(name, before)
        return lambda share: self._progress(name, before + weight * min(max(share, 0.0), 1.0))

    def done(self) -> None:
        """Say that everything is computed."""
        self._progress("computed", 1.0)


def _number(settings: StudySettings, section: str) -> int:
    """Return how many stages a section has."""
    given = getattr(settings, section)
    if isinstance(given, PadeSettings):
        return len(given.cases)
    return len(given) if isinstance(given, tuple) else int(given is not None)


def _provenance(study: Study, duration: float) -> Provenance:
    versions = {"python": platform.python_version(), "susp_ctrl": __version__}
    versions |= {name: version(name) for name in ("control", "numpy", "scipy", "pandas")}
    seeds = {search.key: search.seed for search in study.settings.tuning}
    seeds |= {
        f"time.{case.key}": case.road.seed for case in study.settings.time if case.road.seed is not None
    }
    return Provenance(Path(study.file).name, study.sha256, versions, seeds, duration)


def _vehicle(study: Study) -> VehicleSection:
    car = study.vehicle
    symbols = PAPER_SYMBOLS if isinstance(car, HalfCar) else {}
    parameters = [
        (name, symbols.get(name, ""), float(value), readable(parameter_unit(name)))
        for name, value in vars(car).items()
        if isinstance(value, (int, float))
    ]
    return VehicleSection(
        kind=study.settings.vehicle.kind,
        parameters=pd.DataFrame(parameters, columns=["parameter", "symbol", "value", "unit"]),
        static_loads=pd.DataFrame(car.static_loads().items(), columns=["wheel", "load_N"]),
        speed=study.settings.vehicle.speed,
        lags=study.lags,
        inputs=tuple(study.plant.input_labels),
        outputs=tuple(study.plant.output_labels),
    )
