"""From a study file to a checked `Study`, and a commented template for a new file."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import control

from susp_ctrl import validation
from susp_ctrl.errors import InputError
from susp_ctrl.ride.indicators import indicator_signals
from susp_ctrl.study.settings.fields import MISSING, Place, SettingError, is_plain_text, shortened
from susp_ctrl.study.settings.references import check_references
from susp_ctrl.study.settings.study import StudySettings
from susp_ctrl.study.settings.vehicle import parameter_keys
from susp_ctrl.study.settings.work import check_work
from susp_ctrl.vehicle import FullCar, HalfCar, QuarterCar

_LARGEST_FILE = 1_000_000
_DEEPEST = 20  # tables and lists inside each other
_LONG_PATH = re.compile(r"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){%d}" % _DEEPEST)  # noqa: UP031  braces
_LARGEST_INTEGER = 2**63 - 1  # of TOML
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
        _check_plain(place, table)
        settings = _with_indicators(StudySettings.from_table(place, table))
        try:
            check_references(settings)
            check_work(settings, settings.vehicle.build().plant())
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

    def value(self, path: str) -> Any:
        """Return what a key says, by its path as in `with_changes`; None where the study does not give it.

        Parameters of the vehicle that are not given have their default.
        """
        here: Any = self.table
        for name, entry in _STEP.findall(path):
            here = here.get(name) if isinstance(here, Mapping) else None
            if entry and here is not None:
                here = _entry(here, entry)
        section, _, key = path.partition(".")
        if here is None and section == "vehicle":
            names = parameter_keys(type(self.vehicle))
            if key in names:
                return getattr(self.vehicle, names[key])
            return self.settings.vehicle.speed if key == "speed_m_per_s" else None
        return here

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
        car, rear = self.vehicle, 0.0
        if not isinstance(car, QuarterCar):
            rear = car.axle_lag(self.settings.vehicle.speed)
        words = {name: name.split("_") for name in self.plant.input_labels}
        return {name: rear if "rear" in parts else 0.0 for name, parts in words.items() if parts[0] == "road"}

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
    try:
        content = validation.file_content(path, most=_LARGEST_FILE)
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such study file") from None
    except InputError as problem:
        raise InputError(f"{path}: the study file cannot be read: {problem}") from None
    try:
        text = content.decode("utf-8-sig")  # some editors begin a file with a byte-order mark
    except UnicodeDecodeError:
        raise InputError(f"{path}: the study file is not UTF-8 text") from None
    if _LONG_PATH.search(text):  # the parser takes time with the square of its length
        raise InputError(f"{path}: the study file has a key of more than {_DEEPEST} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{path}: the study file is nested too deeply") from None
    except ValueError as problem:  # no TOML, or an integer of thousands of digits
        raise InputError(f"{path}: the study file is not valid TOML: {problem}") from None
    return Study.from_table(table, str(path), hashlib.sha256(content).hexdigest())


def new_study(name: str | Path) -> Path:
    """Write a commented template of a study file.

    Parameters
    ----------
    name : str or Path
        Name of the study, with its folder where it is not the current one; ``.toml`` may be left out. Letters,
        digits, ``_`` and ``-``.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        A name with other characters, a folder that does not exist, or a file that is there already.
    """
    given = Path(name)
    path = given if given.suffix == ".toml" else given.with_name(f"{given.name}.toml")
    if not re.fullmatch(r"[\w-]+", path.stem):
        raise InputError(f"name = {str(name)!r} is not allowed: letters, digits, _ and - are")
    if not path.parent.is_dir():
        raise InputError(f"name = {str(name)!r} is not allowed: there is no folder {str(path.parent)!r}")
    text = files("susp_ctrl.study").joinpath("template.toml").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text.replace('name = "NAME"', f'name = "{path.stem}"', 1))
    except FileExistsError:
        raise InputError(f"name = {str(name)!r} is not allowed: {path} is there already") from None
    return path


def _check_plain(place: Place, table: Mapping[str, Any]) -> None:
    """Refuse what no study says, wherever it stands: deep nesting, keys that cannot be read, vast integers."""
    left: list[tuple[int, str, Any]] = [(0, "", table)]
    while left:
        depth, path, value = left.pop()
        if depth > _DEEPEST:
            raise place.error(SettingError(path.rstrip("."), MISSING, f"nested more than {_DEEPEST} deep"))
        if isinstance(value, Mapping):
            for key, inside in value.items():
                if not isinstance(key, str) or not is_plain_text(key):
                    allowed = "a key without control or invisible characters is needed"
                    raise place.error(SettingError(f"{path}{key!r}", MISSING, allowed))
                left.append((depth + 1, f"{path}{shortened(key)}.", inside))
        elif isinstance(value, (list, tuple)):
            left += [(depth + 1, path, inside) for inside in value]
        elif isinstance(value, int) and abs(value) > _LARGEST_INTEGER:
            raise place.error(
                SettingError(path.rstrip("."), MISSING, "an integer of at most 64 bits is needed")
            )


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


def _entry(entries: Any, wanted: str) -> Any:
    """Return the entry of a list of tables by its key or its position, counted from 1; None if there is none."""
    if not isinstance(entries, list):
        return None
    tables = [(n, entry) for n, entry in enumerate(entries, 1) if isinstance(entry, Mapping)]
    return next((entry for n, entry in tables if entry.get("key") == wanted or wanted == str(n)), None)


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
            here = _entry(here, entry)
            if here is None:
                raise InputError(f"{path} = {value!r}: {name} has no entry {entry!r}")
    raise InputError(f"{path} = {value!r}: a path that ends in a key is needed")
