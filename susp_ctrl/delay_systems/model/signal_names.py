"""Names of signals where systems are joined or taken apart."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.errors import InputError

_GENERIC_LABEL = re.compile(r"[uyx]\[\d+\]")


def name_list(names: str | Sequence[str] | None) -> Sequence[str] | None:
    """Return one name as a list of one."""
    return [names] if isinstance(names, str) else names


def checked_names(names: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords ``inputs``, ``outputs``, ``states``, ``name``; any other is refused."""
    for key in names:
        validation.one_of("keyword", key, ("inputs", "outputs", "states", "name"))
    return dict(names)


def signal_labels(kind: str, names: Any, count: int) -> int | list[str]:
    """Return one name for each of `count` signals, or their number where none are given.

    Raises
    ------
    InputError
        Not as many names as signals, one that occurs twice, or something that is no name.
    """
    if names is None:
        return count
    given = validation.sequence(kind, name_list(names))
    for k, name in enumerate(given):
        if not isinstance(name, str):
            raise InputError(f"{kind}[{k}] = {name!r} is not allowed: a name is needed")
    if len(given) != count:
        raise InputError(f"{kind} has {len(given)} names: one for each of {count} {kind} is needed")
    for k, name in enumerate(given):
        if name in given[:k]:  # python-control would keep one of them
            raise InputError(f"{kind}[{k}] = {name!r} is not allowed: every name may occur once")
    return list(given)


def system_name(name: Any) -> str | None:
    """Return the name of a system."""
    if name is not None and not isinstance(name, str):
        raise InputError(f"name = {name!r} is not allowed: a string is needed")
    return name


def are_generic(labels: Sequence[str]) -> bool:
    """Whether all names are the numbered ones that python-control gives."""
    return all(_GENERIC_LABEL.fullmatch(label) for label in labels)


def names_together(first: Sequence[str], second: Sequence[str]) -> list[str]:
    """Names of both; generic ones are counted anew, doubles get a number."""
    if first and second and are_generic([*first, *second]):
        return [f"{first[0][0]}[{k}]" for k in range(len(first) + len(second))]
    result: list[str] = []
    for label in (*first, *second):
        unique, number = label, 2
        while unique in result:
            unique, number = f"{label}_{number}", number + 1
        result.append(unique)
    return result


def positions(kind: str, key: Any, labels: Sequence[str]) -> list[int]:
    """Return the positions of signals given by name, number, slice of numbers, or a list of these."""
    if isinstance(key, slice):
        if any(isinstance(end, str) for end in (key.start, key.stop, key.step)):
            raise InputError(f"{kind} {key} is not allowed: a slice takes numbers; names go in a list")
        return list(range(len(labels))[key])
    if isinstance(key, (list, tuple, np.ndarray)):
        return [_position(kind, entry, labels) for entry in key]
    return [_position(kind, key, labels)]


def _position(kind: str, entry: Any, labels: Sequence[str]) -> int:
    if isinstance(entry, Integral) and not isinstance(entry, bool) and -len(labels) <= int(entry) < 0:
        return int(entry) + len(labels)
    if isinstance(entry, Integral) and not isinstance(entry, bool) and not 0 <= int(entry) < len(labels):
        raise InputError(f"{kind} {entry} is not allowed: the system has {len(labels)} {kind}s")
    return validation.signal_index(kind, entry, labels)
