"""What a sweep computes of one variant of a study, and of what the variants are made.

Of every chosen design: the stability verdict, how far all its delays can grow together, the exact stationary RMS
values on the road, and J, their weighted sum. A pure function of the study and the changes: nothing is kept from one
variant to the next, so time and memory do not grow with their number.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from susp_ctrl.delay_systems import VERDICT_WORDS, DelayLTI, close_loop, stability, sweep_delays
from susp_ctrl.errors import InputError
from susp_ctrl.ride import signal_unit, stationary_rms
from susp_ctrl.ride.indicators import indicator_signals
from susp_ctrl.road import RandomRoad
from susp_ctrl.study.results import Design
from susp_ctrl.study.sections import Workbench, build_road, tuning_run
from susp_ctrl.study.settings import GAIN_UNITS, PASSIVE, SettingError, Study, SweepSettings, Value

VERDICT_COLUMNS = (
    "verdict",
    "abscissa",
    "unstable_roots",
    "delay_margin",
    "delay_reserve",
    "delay_searched_to",
)
END_COLUMNS = ("J", "note", "error")

Row = dict[str, Any]

_PAPER_WEIGHTS = {"body_acceleration": 0.7, "pitch_acceleration": 0.3}
# Warnings are caught for the whole process: threads of a cluster's worker take turns.
_ONE_AT_A_TIME = threading.Lock()
_SECTIONS = ("vehicle", "designs", "time", "tuning")
_RMS_RTOL = 1e-6
_AT_DESIGN = 1e-9  # a crossing so near to the design is on it


@dataclass(frozen=True)
class Question:
    """What is asked of every variant.

    Attributes
    ----------
    designs : tuple of str
        Keys of designs, or ``"passive"``.
    time : str or None
        Case whose road is met; None for an ISO 8608 road of class C.
    weights : mapping of str to float
        Of the RMS values in J.
    ray_up_to : float
        Multiple of a design's delays up to which a loss of stability is looked for.
    outputs : tuple of str
        Signals whose RMS is taken.
    retune : bool
        Whether searched designs are searched again in every variant.
    """

    designs: tuple[str, ...]
    time: str | None
    weights: Mapping[str, float]
    ray_up_to: float
    outputs: tuple[str, ...]
    retune: bool = False

    @classmethod
    def of(cls, study: Study, settings: SweepSettings) -> Question:
        """Return what the settings of a sweep ask, with what they leave open filled from the study.

        Raises
        ------
        InputError
            A road without stationary response.
        """
        tuned = [search.key for search in study.settings.tuning]
        published = [design.key for design in study.settings.designs]
        outputs = tuple(indicator_signals(list(study.plant.output_labels)))
        cases = {case.key: case for case in study.settings.time}
        time = settings.time
        if time is None:
            time = next((key for key, case in cases.items() if case.road.kind == "random"), None)
        elif cases[time].road.kind == "bump":
            raise SettingError("sweep.time", time, "a road that goes on is needed, and this one is a bump")
        weights = settings.weights or {k: w for k, w in _PAPER_WEIGHTS.items() if k in outputs}
        designs = settings.designs or tuple(published) or tuple(tuned) or (PASSIVE,)
        return cls(designs, time, dict(weights), settings.ray_up_to, outputs, settings.retune)

    @property
    def columns(self) -> list[str]:
        """Names of the numbers of one design of one variant, in order."""
        return [*VERDICT_COLUMNS, *self.outputs, *END_COLUMNS]

    @property
    def unit(self) -> dict[str, str]:
        """Unit of every number."""
        units = {output: signal_unit(output) for output in self.outputs}
        weighted = {units[output] for output in self.weights}
        return {
            "abscissa": "1/s",
            "delay_margin": "multiple of the design's delays",
            "delay_reserve": "multiple of the design's delays",
            **units,
            "J": weighted.pop() if len(weighted) == 1 else "",
        }


def lean_study(study: Study, question: Question) -> Study:
    """Return the study without what no variant needs; designs to be searched once are searched and written out.

    Parameters
    ----------
    study : Study
    question : Question

    Raises
    ------
    InputError
        A search that finds no stable design.
    """
    table = dict(study.table)
    searched = [search for search in study.settings.tuning if search.key in question.designs]
    if searched and not question.retune:
        bench = Workbench.of(study)
        found = []
        for search in searched:
            tuning_run(bench, search, lambda share: None)
            if search.key not in bench.keys:
                raise InputError(f"tuning[{search.key}]: the search found no stable design to vary")
            found.append(_as_table(bench.design(search.key)))
        table["designs"] = [*table.get("designs", []), *found]
    if not question.retune:
        table.pop("tuning", None)
    lean = {section: entry for section, entry in table.items() if section in ("name", "title", *_SECTIONS)}
    if "time" in lean:
        # Which designs a case simulates does not matter here.
        lean["time"] = [{k: v for k, v in case.items() if k != "designs"} for case in lean["time"]]
    return Study.from_table(lean, study.file)


def check_influence(question: Question, keys: list[str]) -> None:
    """Refuse keys on which nothing depends that a sweep computes.

    Raises
    ------
    InputError
        The first such key.
    """
    for key in keys:
        section = key.replace("[", ".").split(".")[0]
        if section not in _SECTIONS:
            raise InputError(
                f"{key}: nothing that a sweep computes depends on it; keys of {', '.join(_SECTIONS)} are allowed"
            )
        if section == "tuning" and not question.retune:
            raise InputError(f"{key}: searched designs are kept as found, unless retune is true")


def evaluate_variant(study: Study, question: Question, changes: Mapping[str, Value]) -> list[Row]:
    """Compute one variant of a study: one row per design, of plain numbers and texts.

    Parameters
    ----------
    study : Study
    question : Question
    changes : mapping of str to value
        As of `Study.with_changes`.

    Returns
    -------
    list of dict
        ``design`` and `Question.columns`. What could not be computed is None, and ``error`` says why: nothing is
        raised for a variant.
    """
    try:
        bench = Workbench.of(study.with_changes(changes))
        road = _road(bench, question)
    except Exception as problem:  # any variant may be impossible; the others go on
        return [_failed(question, design, problem) for design in question.designs]
    return [_row(bench, question, design, road) for design in question.designs]


def answer(study: Study, question: Question, task: tuple[int, Mapping[str, Value]]) -> tuple[int, list[Row]]:
    """Compute the variant of a task, ``(number, changes)``, and return its number and rows."""
    number, changes = task
    with _ONE_AT_A_TIME:
        return number, evaluate_variant(study, question, changes)


def failed_rows(question: Question, message: str) -> list[Row]:
    """Return the rows of a variant that was lost as a whole."""
    return [_failed(question, design, RuntimeError(message)) for design in question.designs]


def _road(bench: Workbench, question: Question) -> Any:
    for case in bench.study.settings.time:
        if case.key == question.time:
            return build_road(case.road, bench.speed)
    return RandomRoad(iso_class="C", speed=bench.speed, seed=0)


def _failed(question: Question, design: str, problem: Exception) -> Row:
    row: Row = {"design": design} | dict.fromkeys(question.columns)
    said = " ".join(str(problem).split()) or type(problem).__name__
    known = isinstance(problem, (InputError, RuntimeError))
    return row | {"note": "", "error": said if known else f"{type(problem).__name__}: {said}"}


def _row(bench: Workbench, question: Question, key: str, road: Any) -> Row:
    row: Row = {"design": key} | dict.fromkeys(question.columns)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            design = _design(bench, question, key)
            loop = close_loop(bench.plant, design.channels, name=key)
            verdict = stability(loop)
            row |= {
                "verdict": VERDICT_WORDS[verdict.stable],
                "abscissa": float(verdict.abscissa),
                "unstable_roots": None if verdict.unstable_roots is None else int(verdict.unstable_roots),
            }
            row |= _delays(loop, design, question.ray_up_to, verdict.stable)
            if verdict.stable is True:
                table = stationary_rms(loop, road, bench.lags, rtol=_RMS_RTOL, known_stable=True)
                rms = dict(zip(table["indicator"], table["value"].astype(float).tolist(), strict=True))
                row |= {name: rms[name] for name in question.outputs}
                row["J"] = sum(weight * rms[name] for name, weight in question.weights.items())
    except Exception as problem:  # any variant may be impossible; the others go on
        return _failed(question, key, problem)
    said = dict.fromkeys(" ".join(str(warning.message).split()) for warning in caught)
    return row | {"note": "; ".join(said), "error": ""}


def _design(bench: Workbench, question: Question, key: str) -> Design:
    if question.retune and key not in bench.keys:
        search = next(s for s in bench.study.settings.tuning if s.key == key)
        tuning_run(bench, search, lambda share: None)
        if key not in bench.keys:
            raise InputError(f"tuning[{key}]: the search found no stable design")
    return bench.design(key)


def _delays(loop: DelayLTI, design: Design, up_to: float, stable: bool | None) -> Row:
    """Follow the loop along the ray of its delays, from none to `up_to` times what they are."""
    own = np.array([channel.delay for channel in design.channels])
    if not np.any(own):
        proven = np.inf if stable and not design.channels else None
        return {"delay_margin": proven, "delay_reserve": proven, "delay_searched_to": proven}
    swept = sweep_delays(loop, direction=own, up_to=up_to)
    if not swept.decided:
        return {}
    margin = float(swept.delay_margin)
    later = [tau for tau in swept.crossings["tau"].tolist() if tau > 1.0 + _AT_DESIGN]
    if stable is not True:
        reserve = 0.0 if stable is False else np.nan
    elif later:
        reserve = min(later)
    else:
        reserve = np.inf if np.isposinf(margin) else np.nan
    return {
        "delay_margin": None if np.isnan(margin) else margin,
        "delay_reserve": None if np.isnan(reserve) else float(reserve),
        "delay_searched_to": np.inf if np.isposinf(margin) else up_to,
    }


def _as_table(design: Design) -> dict[str, Any]:
    """Return a design as it would stand in a study file."""
    channels = []
    for channel in design.channels:
        unit = GAIN_UNITS[signal_unit(str(channel.measured))]
        entry: dict[str, Any] = {
            "measured": str(channel.measured),
            "actuator": str(channel.actuator),
            f"gain_{unit}": float(channel.gain),
            "delay_s": float(channel.delay),
        }
        if channel.actuator_bandwidth is not None:
            entry["actuator_bandwidth_rad_per_s"] = float(channel.actuator_bandwidth)
        channels.append(entry)
    return {"key": design.key, "label": design.label, "channels": channels}
