"""Names of signals where systems are joined or taken apart."""

from __future__ import annotations

import re
from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.errors import InputError

_GENERIC_LABEL = re.compile(r"[uyx]\[\d+\]")


def name_list(names: str | Sequence[str] | None) -> Sequence[str] | None:
    """Return one name as a list of one."""
    return [names] if isinstance(names, str) else names


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
