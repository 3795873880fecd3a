"""From a study file to a checked `Study`."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import control

from susp_ctrl.delay_systems import FeedbackChannel, close_loop
from susp_ctrl.errors import InputError
from susp_ctrl.ride.signals import indicator_signals
from susp_ctrl.study.audit_schema import AuditSettings
from susp_ctrl.study.schema import StudySettings
from susp_ctrl.study.settings import Place, SettingError, nearest
from susp_ctrl.study.vehicle_schema import PASSIVE, feedback_channels
from susp_ctrl.vehicle import FullCar, HalfCar, QuarterCar

_STEP = re.compile(r"([A-Za-z0-9_]+)(?:\[([^\]]+)\])?(?:\.|$)")


@dataclass(frozen=True)
class Study:
    """A checked study: the settings, and where they come from.

    Attributes
    ----------
    settings : StudySettings
        What the study says.
    file : str
        Name of the study file, for messages and the report.
    sha256 : str
        Of the bytes of the file; empty for a study that was changed or built in Python.
    table : mapping
        The study as plain TOML data, from which `with_changes` starts.
    """

    settings: StudySettings
    file: str
    sha256: str
    table: Mapping[str, Any]

    @classmethod
    def from_table(cls, table: Mapping[str, Any], file: str = "study", sha256: str = "") -> Study:
        """Check a study given as TOML data.

        Raises
        ------
        InputError
            One line ``file: key = value: what is allowed``.
        """
        place = Place(file)
        settings = _with_indicators(StudySettings.from_table(place, table))
        try:
            _check_references(settings)
        except SettingError as problem:
            raise place.error(problem) from None
        return cls(settings, file, sha256, table)

    def with_changes(self, changes: Mapping[str, Any]) -> Study:
        """Return the study with some keys changed, checked again.

        Parameters
        ----------
        changes : mapping of str to value
            Keys as in messages: ``"vehicle.body_mass_kg"``, ``"time[random].road.seed"``,
            ``"designs[random_published].channels[1].delay_s"`` (entries of lists by their key, or by their position
            counted from 1).

        Raises
        ------
        InputError
            A path that leads nowhere, or a value that is not allowed.
        """
        table = deepcopy(dict(self.table))
        for path, value in changes.items():
            _set(table, path, value)
        return Study.from_table(table, self.file)

    @property
    def name(self) -> str:
        """Short name, used for folders."""
        return self.settings.name

    @property
    def title(self) -> str:
        """Title of the report."""
        return self.settings.title

    @cached_property
    def vehicle(self) -> HalfCar | QuarterCar | FullCar:
        """The vehicle."""
        return self.settings.vehicle.build()

    @cached_property
    def plant(self) -> control.StateSpace:
        """The vehicle as a plant with named signals."""
        return self.vehicle.plant()

    @property
    def lags(self) -> dict[str, float]:
        """Delay (s) of every road input behind the front axle, in the plant's order."""
        return {road: self._lag(road) for road in road_inputs(self.plant)}

    def _lag(self, road: str) -> float:
        if "rear" in road.split("_") and not isinstance(self.vehicle, QuarterCar):
            return self.vehicle.axle_lag(self.settings.vehicle.speed)
        return 0.0

    def __getstate__(self) -> dict[str, Any]:
        """Leave the plant out, which python-control cannot pickle; it is built again when asked for."""
        return {name: value for name, value in self.__dict__.items() if name != "plant"}

    def _repr_html_(self) -> str:
        """Say in a notebook what the study is."""
        return f"<b>{self.settings.title}</b><br>{self.file}"


def load_study(path: str | Path) -> Study:
    """Read and check a study file.

    Parameters
    ----------
    path : str or Path
        A TOML file; units stand in the keys.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        A file that is missing or is no TOML, an unknown key (the nearest known one is named), a value that is not
        allowed, a signal or design that does not exist: one line ``file: key = value: what is allowed``.
    """
    file = Path(path)
    try:
        content = file.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such study file") from None
    except OSError as problem:
        raise InputError(f"{path}: the study file cannot be read: {problem.strerror}") from None
    try:
        table = tomllib.loads(content.decode("utf-8"))
    except UnicodeDecodeError:
        raise InputError(f"{path}: the study file is not UTF-8 text") from None
    except tomllib.TOMLDecodeError as problem:
        raise InputError(f"{path}: the study file is not valid TOML: {problem}") from None
    return Study.from_table(table, str(path), hashlib.sha256(content).hexdigest())


def road_inputs(plant: control.StateSpace) -> list[str]:
    """Return the road inputs of a plant, in its order."""
    return [name for name in plant.input_labels if name.split("_")[0] == "road"]


def _with_indicators(study: StudySettings) -> StudySettings:
    """Fill in the outputs that the file leaves to the vehicle: its ride indicators."""
    indicators = tuple(indicator_signals(study.vehicle.build().plant().output_labels))
    heave_and_pitch = tuple(n for n in indicators if n in ("body_acceleration", "pitch_acceleration"))
    frequency = study.frequency
    if frequency is not None:
        frequency = replace(
            frequency,
            outputs=frequency.outputs or indicators,
            curve_outputs=frequency.curve_outputs or heave_and_pitch,
        )
    time = tuple(replace(case, outputs=case.outputs or indicators) for case in study.time)
    return replace(study, frequency=frequency, time=time)


# --- what one part of a study says of another ---------------------------------------------------------------------


def _check_references(study: StudySettings) -> None:
    """Check signals against the plant, and keys of designs and time cases against those that exist."""
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
    if study.audit is not None:
        _check_audit(study.audit, study, designs, outputs, cases)


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


def _set(table: dict[str, Any], path: str, value: Any) -> None:
    """Set a key of nested tables by its path."""
    here: Any = table
    steps = _STEP.findall(path)
    if sum(match.end() - match.start() for match in _STEP.finditer(path)) != len(path):
        raise InputError(f"{path} = {value!r}: a path such as time[random].road.seed is needed")
    for n, (name, entry) in enumerate(steps):
        if not isinstance(here, dict):
            raise InputError(f"{path} = {value!r}: there is no such key")
        if n == len(steps) - 1 and not entry:
            here[name] = value
            return
        if name not in here:
            if entry:
                raise InputError(f"{path} = {value!r}: there is no {name}")
            here[name] = {}
        here = here[name]
        if entry:
            found = [e for i, e in enumerate(here, 1) if e.get("key") == entry or entry == str(i)]
            if not found:
                raise InputError(f"{path} = {value!r}: {name} has no entry {entry!r}")
            here = found[0]
    raise InputError(f"{path} = {value!r}: a path that ends in a key is needed")
