"""Typed, frozen settings that check themselves, and the strict reader that makes them from a TOML table.

A settings class is a frozen dataclass whose fields are made with `setting`. The unit of a number is part of its key in
the file (field ``delay`` of unit ``s`` is ``delay_s`` there) and never of the attribute. Range and type are checked
when the object is made, whether from a file or in Python; the reader adds where in the file the value stands.
"""

from __future__ import annotations

import difflib
import math
import re
import reprlib
import types
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import cache
from typing import Any, Self, Union, get_args, get_origin, get_type_hints

from susp_ctrl.errors import InputError, one_line

_SHOWN = 60  # characters of a value in a message
_SHOWN_KEY = 80
_SHOWN_WORDS = 120  # of a list of what is allowed
_BRIEF = reprlib.Repr()
_BRIEF.maxlist = _BRIEF.maxtuple = _BRIEF.maxdict = 8
_BRIEF.maxstring = _BRIEF.maxlong = _BRIEF.maxother = _SHOWN

_UNSEEN = frozenset(
    {"Cc", "Cf", "Cs", "Zl", "Zp"}
)  # control, formatting (direction of writing), line separators

SIZES: Mapping[str, tuple[float, float]] = {
    "s": (1e-6, 1e8),
    "m": (1e-6, 1e4),
    "m_per_s": (1e-2, 1e3),
    "per_s": (1e-6, 1e6),
    "rad_per_s": (1e-4, 1e6),
    "kg": (1e-3, 1e7),
    "kg_m2": (1e-3, 1e9),
    "": (1e-6, 1e6),
}
"""Least and largest size, but for zero, of a number in each unit: far beyond any vehicle, and within what the
computations have digits for."""

OTHER_SIZES = (1e-6, 1e9)
"""The same in all other units: gains, stiffness, damping."""


class SettingError(InputError):
    """A setting is not allowed: its key, its value, and what is."""

    def __init__(self, key: str, value: Any, allowed: str) -> None:
        self.key, self.value, self.allowed = key, value, allowed
        said = "" if value is MISSING else f" = {shown(value)}"
        super().__init__(f"{key}{said}: {allowed}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the three parts, so that the error survives another process."""
        return type(self), (self.key, self.value, self.allowed)


@dataclass(frozen=True)
class TextForm:
    """The form of a text: whether one has it, and in words what is needed."""

    fits: Callable[[str], Any]
    needed: str


KEY = TextForm(
    re.compile(r"[a-z][a-z0-9_]*").fullmatch, "a short name of small letters, digits and _ is needed"
)
"""What can serve as the key of a design, a search or a case."""


@dataclass(frozen=True)
class Rule:
    """Unit and limits of one key."""

    unit: str = ""
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    choices: tuple[str, ...] = ()
    not_empty: bool = False
    form: TextForm | None = None
    lines: bool = False
    """Whether a text may have line breaks."""

    @property
    def limits(self) -> str:
        """The limits in words."""
        parts = [
            f"greater than {self.above:g}" if self.above is not None else "",
            f"at least {self.at_least:g}" if self.at_least is not None else "",
            f"at most {self.at_most:g}" if self.at_most is not None else "",
        ]
        return "".join(f", {part}" for part in parts if part)


def setting(default: Any = MISSING, *, unit: str = "", **limits: Any) -> Any:
    """Return a dataclass field with the unit and the limits of a key; without `default` it is required."""
    return field(default=default, metadata={"rule": Rule(unit=unit, **limits)}, kw_only=True)


@dataclass(frozen=True)
class Settings:
    """Base of all settings: every field is checked by its annotation and its `Rule`."""

    def __post_init__(self) -> None:
        for name, (rule, kind) in self._plan().items():
            object.__setattr__(self, name, _checked(file_key(name, rule), getattr(self, name), kind, rule))
        self.check()

    @classmethod
    def _plan(cls) -> dict[str, tuple[Rule, Any]]:
        return _rules_and_types(cls)  # type: ignore[arg-type]  # classes are hashable

    def check(self) -> None:
        """Check what several keys decide together; raise `SettingError`."""

    def check_needs(
        self,
        word: str,
        needs: Mapping[str, tuple[str, ...]],
        optional: Mapping[str, tuple[str, ...]] | None = None,
        owner: str = "",
    ) -> None:
        """Check that exactly those fields have a value that the value of the field `word` needs, or leaves free."""
        chosen, free = getattr(self, word), optional or {}
        concerned = {name for names in (*needs.values(), *free.values()) for name in names}
        for name, (rule, _) in self._plan().items():
            value, needed = getattr(self, name), name in needs[chosen]
            if needed and value is None:
                allowed = f'this key is missing: {owner}{word} = "{chosen}" needs it'
                raise SettingError(file_key(name, rule), MISSING, allowed)
            if name in concerned and not needed and name not in free.get(chosen, ()) and value is not None:
                allowed = f'not used with {word} = "{chosen}": remove this key'
                raise SettingError(file_key(name, rule), value, allowed)

    @classmethod
    def from_table(cls, place: Place, table: Any) -> Self:
        """Read the settings from a TOML table, strictly: unknown and missing keys are errors."""
        if not isinstance(table, Mapping):
            raise place.error(SettingError("", table, "a table is needed"))
        return cls.read(place, table)

    @classmethod
    def read(cls, place: Place, table: Mapping[str, Any]) -> Self:
        """Read a table; settings that depend on several of its keys at once do more than read the fields."""
        return cls.read_fields(place, table)

    @classmethod
    def read_fields(
        cls, place: Place, table: Mapping[str, Any], units: Mapping[str, str] | None = None
    ) -> Self:
        """Read a table field by field; `units` are those of fields whose unit depends on another key of the table."""
        plan, own_units = cls._plan(), units or {}
        names = {
            f"{name}_{own_units[name]}" if name in own_units else file_key(name, rule): name
            for name, (rule, _) in plan.items()
        }
        for given, value in table.items():
            if given not in names:
                raise place.error(SettingError(given, value, f"unknown key, {nearest(given, names)}"))
        defaults = {f.name: f.default for f in fields(cls)}
        values: dict[str, Any] = {}
        for in_file, name in names.items():
            if in_file in table:
                values[name] = _nested(plan[name][1], place.inside(in_file), table[in_file])
            elif defaults[name] is MISSING:
                raise place.error(SettingError(in_file, MISSING, "this key is missing"))
        try:
            return cls(**values)
        except SettingError as problem:
            problem.key = next((f for f, name in names.items() if name == problem.key), problem.key)
            raise place.error(problem) from None


def file_key(name: str, rule: Rule) -> str:
    """Return the key of a field in the file: its name and its unit."""
    return f"{name}_{rule.unit}" if rule.unit else name


@cache
def _rules_and_types(cls: type) -> dict[str, tuple[Rule, Any]]:
    hints = get_type_hints(cls)
    members: tuple[Field[Any], ...] = fields(cls)
    return {f.name: (f.metadata["rule"], hints[f.name]) for f in members if "rule" in f.metadata}


def shown(value: Any) -> str:
    """Return a value as it would stand in the file, shortened."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{shortened(value)}"'
    return shortened(_BRIEF.repr(value))


def shortened(text: str, most: int = _SHOWN) -> str:
    """Return the beginning of a text, escaped as on one line."""
    escaped = one_line(text[:most], 10 * most)
    return escaped if len(text) <= most and len(escaped) <= most else f"{escaped[: most - 3]}..."


def nearest(word: str, words: Iterable[str]) -> str:
    """Return the hint ``did you mean ...? allowed are ...``."""
    allowed = list(words)
    if not allowed:
        return "no key is allowed here"
    close = difflib.get_close_matches(word, allowed, n=1, cutoff=0.5)
    hint = f'did you mean "{shortened(close[0])}"? ' if close else ""
    return f"{hint}allowed are {shortened(', '.join(allowed), _SHOWN_WORDS // (2 if close else 1))}"


# --- values -----------------------------------------------------------------------------------------------------


def _checked(name: str, value: Any, kind: Any, rule: Rule) -> Any:
    optional, kind = _without_none(kind)
    if value is None and optional:
        return None
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is float:
        return _number(name, value, rule)
    if kind is int:
        return _integer(name, value, rule)
    if kind is bool:
        if not isinstance(value, bool):
            raise SettingError(name, value, "true or false is needed")
        return value
    if kind is str:
        return _text(name, value, rule)
    if origin is tuple:
        if isinstance(value, (str, bytes, Mapping)) or not hasattr(value, "__iter__"):
            raise SettingError(name, value, "a list is needed")
        if rule.not_empty and not value:
            raise SettingError(name, [], "at least one entry is needed")
        items = list(value)
        if len(arguments) == 2 and arguments[1] is not Ellipsis and len(items) != 2:
            raise SettingError(name, items, "two numbers, from and to, are needed")
        return tuple(_checked(f"{name}[{n}]", item, arguments[0], rule) for n, item in enumerate(items, 1))
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            raise SettingError(name, value, "a table is needed")
        if rule.not_empty and not value:
            raise SettingError(name, {}, "at least one entry is needed")
        return {k: _checked(f"{name}.{k}", v, arguments[1], rule) for k, v in value.items()}
    if not isinstance(value, kind):
        raise SettingError(name, value, f"{kind.__name__} is needed")
    return value


def _without_none(kind: Any) -> tuple[bool, Any]:
    if get_origin(kind) in (Union, types.UnionType):
        left = [k for k in get_args(kind) if k is not type(None)]
        return True, left[0]
    return False, kind


def _number(name: str, value: Any, rule: Rule) -> float:
    checked = check_size(name, value, rule.unit, rule.limits)
    if not _within(checked, rule):
        raise SettingError(name, value, f"a finite number{rule.limits} is needed")
    return checked


def check_size(name: str, value: Any, unit: str, limits: str = "") -> float:
    """Return a finite number of a size that there is in this unit; raise `SettingError` for any other value."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise SettingError(name, value, f"a finite number{limits} is needed")
    low, high = SIZES.get(unit, OTHER_SIZES)
    if value and not low <= abs(value) <= high:
        wanted = f"a number{limits}, of a size from {low:g} to {high:g} is needed"
        raise SettingError(name, value, wanted)
    return float(value)


def _integer(name: str, value: Any, rule: Rule) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not _within(value, rule):
        raise SettingError(name, value, f"an integer{rule.limits} is needed")
    return value


def _within(value: float, rule: Rule) -> bool:
    return (
        (rule.above is None or value > rule.above)
        and (rule.at_least is None or value >= rule.at_least)
        and (rule.at_most is None or value <= rule.at_most)
    )


def _text(name: str, value: Any, rule: Rule) -> str:
    if not isinstance(value, str):
        raise SettingError(name, value, "a text in quotes is needed")
    if not is_plain_text(value, lines=rule.lines):
        breaks = "" if rule.lines else "line breaks, "
        raise SettingError(name, value, f"a text without {breaks}control or invisible characters is needed")
    if rule.choices and value not in rule.choices:
        raise SettingError(name, value, nearest(value, rule.choices))
    if rule.not_empty and not value.strip():
        raise SettingError(name, value, "a text that is not empty is needed")
    if rule.form is not None and not rule.form.fits(value):
        raise SettingError(name, value, rule.form.needed)
    return value


def is_plain_text(text: str, *, lines: bool = False) -> bool:
    """Whether a text holds only what can be seen, besides spaces and, with `lines`, line breaks and tabs."""
    if lines:
        text = text.translate({ord(c): " " for c in "\n\r\t"})
    return text.isprintable() or not any(unicodedata.category(c) in _UNSEEN for c in text)


# --- tables -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Place:
    """Where in which file a table stands."""

    file: str
    path: str = ""

    def inside(self, name: str) -> Place:
        """Return the place of a table below this one."""
        return Place(self.file, f"{self.path}.{name}" if self.path else name)

    def error(self, problem: SettingError) -> SettingError:
        """Return the error with the file and the full key."""
        full = f"{self.path}.{problem.key}" if self.path and problem.key else self.path or problem.key
        return SettingError(f"{self.file}: {shortened(full, _SHOWN_KEY)}", problem.value, problem.allowed)


def _nested(kind: Any, place: Place, value: Any) -> Any:
    """Turn tables, and lists of tables, into settings where the annotation says so."""
    _, kind = _without_none(kind)
    if isinstance(kind, type) and issubclass(kind, Settings):
        return kind.from_table(place, value)
    arguments = get_args(kind)
    if get_origin(kind) is tuple and isinstance(arguments[0], type) and issubclass(arguments[0], Settings):
        if not isinstance(value, list):
            raise place.error(SettingError("", value, "a list of tables, [[...]], is needed"))
        return tuple(
            arguments[0].from_table(Place(place.file, f"{place.path}[{_title(entry, n)}]"), entry)
            for n, entry in enumerate(value, 1)
        )
    return value


def _title(entry: Any, position: int) -> str:
    """Return how messages call an entry of a list of tables: its key, or its position counted from 1."""
    named = entry.get("key") if isinstance(entry, Mapping) else None
    return named if isinstance(named, str) and named else str(position)
