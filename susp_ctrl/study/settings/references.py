"""What one part of a study says of another: signals of the plant, keys of designs and of time cases."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import control

from susp_ctrl.delay_systems import FeedbackChannel, close_loop
from susp_ctrl.errors import InputError
from susp_ctrl.study.settings.audit import AuditSettings
from susp_ctrl.study.settings.fields import SettingError, nearest
from susp_ctrl.study.settings.maps import check_maps
from susp_ctrl.study.settings.study import StudySettings
from susp_ctrl.study.settings.variants import check_sweep
from susp_ctrl.study.settings.vehicle import PASSIVE, feedback_channels


def check_references(study: StudySettings) -> None:
    """Check signals against the plant, loops for a solution, and keys of designs and cases against those there are.

    Raises
    ------
    SettingError
        The first one that leads nowhere, with the nearest that exists.
    """
    plant = study.vehicle.build().plant()
    outputs, actuators = list(plant.output_labels), [n for n in plant.input_labels if n.startswith("force")]
    published = _unique("designs", [d.key for d in study.designs])
    tuned = _unique("tuning", [t.key for t in study.tuning])
    cases = _unique("time", [t.key for t in study.time])
    for k in tuned:
        if k in published or k == PASSIVE:
            raise SettingError(f"tuning[{k}].key", k, "this key is taken by another design")
    designs = [*published, *tuned]

    for design in study.designs:
        _check_channels(f"designs[{design.key}].channels", design.channels, outputs, actuators)
        _check_loop(f"designs[{design.key}].channels", plant, feedback_channels(design.channels))
    if study.frequency is not None:
        _among("frequency.outputs", study.frequency.outputs, outputs)
        _among("frequency.curve_outputs", study.frequency.curve_outputs, outputs)
        _among("frequency.curve_designs", study.frequency.curve_designs, [PASSIVE, *designs])
    for tuning in study.tuning:
        place = f"tuning[{tuning.key}]"
        _check_channels(f"{place}.pairs", tuning.pairs, outputs, actuators)
        _check_loop(f"{place}.pairs", plant, [pair.widest for pair in tuning.pairs])
        for name in tuning.weights:
            if name not in outputs:
                raise SettingError(f"{place}.weights.{name}", tuning.weights[name], nearest(name, outputs))
        _among(f"{place}.compare", tuning.compare, designs)
    if study.stability is not None:
        _among("stability.designs", study.stability.designs, designs)
        _check_channels("stability.box", study.stability.box, outputs, actuators)
    measured = {entry.key: [c.measured for c in entry.channels] for entry in study.designs}
    measured |= {search.key: [pair.measured for pair in search.pairs] for search in study.tuning}
    check_maps(study.stability_maps, measured, outputs)
    for case in study.time:
        _among(f"time[{case.key}].designs", case.designs, designs)
        _among(f"time[{case.key}].outputs", case.outputs, outputs)
    if study.pade is not None:
        for design_key, case_key in study.pade.cases.items():
            if design_key not in designs:
                raise SettingError(
                    f"pade.cases.{design_key}", case_key, f"no such design, {nearest(design_key, designs)}"
                )
            _among(f"pade.cases.{design_key}", [case_key], cases)
        _among("pade.verdicts", study.pade.verdicts, designs)
    if study.audit is not None:
        _check_audit(study.audit, study, designs, outputs, cases)
    if study.sweep is not None:
        check_sweep(study.sweep, outputs, [PASSIVE, *designs], cases)


def _check_audit(
    audit: AuditSettings, study: StudySettings, designs: list[str], outputs: list[str], cases: list[str]
) -> None:
    tuned = [t.key for t in study.tuning]
    for n, table in enumerate(audit.tables, 1):
        place = f"audit.tables[{n}]"
        _among(f"{place}.time", [table.time], cases)
        case = next(c for c in study.time if c.key == table.time)
        _among(f"{place}.active", [table.active], list(case.designs))
        for m, row in enumerate(table.rows, 1):
            _among(f"{place}.rows[{m}].indicator", [row.indicator], list(case.outputs))
    for n, roots in enumerate(audit.roots, 1):
        _among(f"audit.roots[{n}].design", [roots.design], designs)
        if roots.substitutions and study.vehicle.kind != "half_car":
            raise SettingError(
                f"audit.roots[{n}].substitutions", study.vehicle.kind, "only a half_car has them"
            )
    for n, interval in enumerate(audit.intervals, 1):
        _among(f"audit.intervals[{n}].design", [interval.design], designs)
    for n, peak in enumerate(audit.peaks, 1):
        _among(f"audit.peaks[{n}].design", [peak.design], [PASSIVE, *designs])
        _among(f"audit.peaks[{n}].output", [peak.output], outputs)
    for n, optimum in enumerate(audit.optima, 1):
        _among(f"audit.optima[{n}].published", [optimum.published], [d.key for d in study.designs])
        _among(f"audit.optima[{n}].tuned", [optimum.tuned], tuned)


def _check_channels(place: str, channels: Iterable[Any], outputs: list[str], actuators: list[str]) -> None:
    for n, channel in enumerate(channels, 1):
        for name, allowed in (("measured", outputs), ("actuator", actuators)):
            value = getattr(channel, name)
            if value not in allowed:
                raise SettingError(f"{place}[{n}].{name}", value, nearest(value, allowed))


def _check_loop(place: str, plant: control.StateSpace, channels: Iterable[FeedbackChannel]) -> None:
    """Refuse loops that are neutral or have no solution."""
    paths = list(channels)
    try:
        close_loop(plant, paths)
    except InputError as problem:
        raise SettingError(place, [str(path.measured) for path in paths], str(problem)) from None


def _unique(place: str, keys: list[str]) -> list[str]:
    for n, k in enumerate(keys):
        if k in keys[:n]:
            raise SettingError(f"{place}[{k}].key", k, "every key may be used only once")
    return keys


def _among(place: str, given: Iterable[str], allowed: list[str]) -> None:
    for value in given:
        if value not in allowed:
            raise SettingError(
                place, value, nearest(value, allowed) if allowed else "there is none in this study"
            )
