"""What one part of a study says of another: signals of the plant, keys of designs and of time cases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import control

from susp_ctrl.delay_systems import FeedbackChannel, close_loop
from susp_ctrl.errors import InputError, NeutralLoopError
from susp_ctrl.ride import signal_unit
from susp_ctrl.ride.indicators import indicator_signals
from susp_ctrl.study.settings.audit import AuditSettings
from susp_ctrl.study.settings.fields import MISSING, SettingError, nearest
from susp_ctrl.study.settings.maps import MapSettings
from susp_ctrl.study.settings.study import StudySettings
from susp_ctrl.study.settings.variants import SweepSettings, indicator_limits
from susp_ctrl.study.settings.vehicle import GAIN_UNITS, PASSIVE, feedback_channels


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
        _check_weights(f"{place}.weights", tuning.weights, outputs)
        _among(f"{place}.compare", tuning.compare, designs)
    if study.stability is not None:
        _among("stability.designs", study.stability.designs, designs)
        _check_channels("stability.box", study.stability.box, outputs, actuators)
    measured = {part.key: [c.measured for c in part.channels] for part in study.designs}
    measured |= {part.key: [pair.measured for pair in part.pairs] for part in study.tuning}
    _unique("stability_maps", [entry.key for entry in study.stability_maps])
    for entry in study.stability_maps:
        _check_map(entry, measured, outputs)
    for case in study.time:
        _among(f"time[{case.key}].designs", case.designs, designs)
        _among(f"time[{case.key}].outputs", case.outputs, outputs)
    if study.pade is not None:
        for design_key, case_key in study.pade.cases.items():
            place = f"pade.cases.{design_key}"
            if design_key not in designs:
                raise SettingError(place, case_key, f"no such design, {nearest(design_key, designs)}")
            _among(place, [case_key], cases)
        _among("pade.verdicts", study.pade.verdicts, designs)
    if study.audit is not None:
        _check_audit(study.audit, study, designs, outputs, cases)
    if study.sweep is not None:
        check_sweep(study.sweep, study, outputs)


def check_sweep(sweep: SweepSettings, study: StudySettings, outputs: Sequence[str]) -> None:
    """Check what a sweep says of designs, time cases and signals of the study.

    Raises
    ------
    SettingError
        The first one that leads nowhere, with the nearest that exists.
    """
    designs = [PASSIVE, *(d.key for d in study.designs), *(t.key for t in study.tuning)]
    for design in sweep.designs:
        if design not in designs:
            raise SettingError("sweep.designs", design, f"no such design, {nearest(design, designs)}")
    _among("sweep.designs", sweep.designs, designs)
    if sweep.time is not None:
        _among("sweep.time", [sweep.time], [case.key for case in study.time])
    _check_weights("sweep.weights", sweep.weights or {}, indicator_signals(outputs))
    try:
        indicator_limits(sweep.limits or {}, outputs)
    except SettingError as problem:
        problem.key = f"sweep.limits.{problem.key}"
        raise


def _check_map(entry: MapSettings, measured: Mapping[str, Sequence[str]], outputs: list[str]) -> None:
    """Check one stability map; `measured` says what the channels of each design measure."""
    place = f"stability_maps[{entry.key}]"
    _among(f"{place}.designs", entry.designs, list(measured))
    for design in entry.designs:
        count = len(measured[design])
        if not entry.fits(count):
            needed = max(entry.channel(name) for name in entry.free) + 1
            allowed = f"a design with {needed} channels is needed, it has {count}"
            raise SettingError(f"{place}.designs", design, allowed)
    chosen = list(entry.designs) or [key for key, names in measured.items() if entry.fits(len(names))]
    if not chosen:
        raise SettingError(f"{place}.designs", [], "no design of this study has these channels")
    for end, unit in entry.gain_units.items():
        for design in chosen:
            name = measured[design][entry.channel(end[:5])]
            right = GAIN_UNITS[signal_unit(name)]
            if unit != right:
                allowed = f"the gain from {name} of {design} needs the key {end}_{right}"
                raise SettingError(f"{place}.{end}_{unit}", getattr(entry, end), allowed)
    if entry.explorer is not None and entry.explorer.output:
        _among(f"{place}.explorer.output", [entry.explorer.output], outputs)


def _check_audit(
    audit: AuditSettings, study: StudySettings, designs: list[str], outputs: list[str], cases: list[str]
) -> None:
    for n, table in enumerate(audit.tables, 1):
        place = f"audit.tables[{n}]"
        _among(f"{place}.time", [table.time], cases)
        case = next(c for c in study.time if c.key == table.time)
        _among(f"{place}.active", [table.active], case.designs)
        for m, row in enumerate(table.rows, 1):
            _among(f"{place}.rows[{m}].indicator", [row.indicator], case.outputs)
    for n, roots in enumerate(audit.roots, 1):
        place = f"audit.roots[{n}]"
        _among(f"{place}.design", [roots.design], designs)
        if roots.substitutions and study.vehicle.kind != "half_car":
            raise SettingError(f"{place}.substitutions", study.vehicle.kind, "only a half_car has them")
    for n, interval in enumerate(audit.intervals, 1):
        _among(f"audit.intervals[{n}].design", [interval.design], designs)
    for n, peak in enumerate(audit.peaks, 1):
        _among(f"audit.peaks[{n}].design", [peak.design], [PASSIVE, *designs])
        _among(f"audit.peaks[{n}].output", [peak.output], outputs)
    for n, optimum in enumerate(audit.optima, 1):
        _among(f"audit.optima[{n}].published", [optimum.published], [d.key for d in study.designs])
        _among(f"audit.optima[{n}].tuned", [optimum.tuned], [t.key for t in study.tuning])


def _check_channels(place: str, channels: Iterable[Any], outputs: list[str], actuators: list[str]) -> None:
    for n, channel in enumerate(channels, 1):
        for name, allowed in (("measured", outputs), ("actuator", actuators)):
            _among(f"{place}[{n}].{name}", [getattr(channel, name)], allowed)


def _check_loop(place: str, plant: control.StateSpace, channels: Sequence[FeedbackChannel]) -> None:
    """Refuse loops that are neutral or have no solution."""
    try:
        close_loop(plant, channels)
    except NeutralLoopError:
        allowed = (
            "the loop is neutral, as with delayed acceleration: no delay is too small to destabilise it; "
            "give the channel an actuator_bandwidth_rad_per_s"
        )
        raise SettingError(place, MISSING, allowed) from None
    except InputError as problem:
        raise SettingError(place, MISSING, str(problem)) from None


def _check_weights(place: str, weights: Mapping[str, float], outputs: list[str]) -> None:
    for name, weight in weights.items():
        if name not in outputs:
            raise SettingError(f"{place}.{name}", weight, nearest(name, outputs))


def _unique(place: str, keys: list[str]) -> list[str]:
    for n, k in enumerate(keys):
        if k in keys[:n]:
            raise SettingError(f"{place}[{k}].key", k, "every key may be used only once")
    return keys


def _among(place: str, given: Iterable[str], allowed: Sequence[str]) -> None:
    """Refuse what is not there, and what is named twice."""
    seen: set[str] = set()
    for value in given:
        if value not in allowed:
            hint = nearest(value, allowed) if allowed else "there is none in this study"
            raise SettingError(place, value, hint)
        if value in seen:
            raise SettingError(place, value, "it stands there twice")
        seen.add(value)
