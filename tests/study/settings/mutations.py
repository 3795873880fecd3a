"""Mutated study files: what a slip of the finger, a broken disk, or a stranger may make of one."""

from __future__ import annotations

import json
import tomllib
from copy import deepcopy
from pathlib import Path
from random import Random
from typing import Any

STUDIES = sorted((Path(__file__).parents[3] / "studies").glob("*.toml"))

_VALUES: tuple[Any, ...] = (
    True, 0, -1, 1, 3.5, 1e-15, 1e9, 1e12, 1e300, -1e300, float("nan"), float("inf"), 10**400, 2**63, 5e-324,
    "", "x", "passive", "random_published", "$x$ \\badcmd", "\x1b[2J", "\u202eevil", "a\nb", "=1+1", "ü", "1e999", "٣",
    [], [[]], {}, {"a": 1}, [1, "a"], ["x"] * 500, {"key": "x"}, [{}], [0.0, 1.0],
)  # fmt: skip
_KEYS = (
    "",
    "x",
    "key",
    "a.b",
    "a\nb",
    "\x00",
    "\x1b[31m",
    "\u202e",
    "k" * 50_000,
    "ключ",
    "delay_s",
    "gain_N_per_m",
)
_BYTES = (
    b"\x00",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"[",
    b"]" * 600,
    b"[" * 600,
    b'"',
    b"'''",
    b"\n",
    b"= ",
    b"\x1b",
    b"9" * 5000,
)


_DEEP = "500 brackets"


def mutated_file(seed: int) -> bytes:
    """Return the bytes of a study file with one to three mutations; the same seed gives the same file."""
    random = Random(seed)
    source = random.choice(STUDIES).read_text(encoding="utf-8")
    table = tomllib.loads(source)
    if random.random() < 0.2:
        content = source.encode()
        for _ in range(random.randint(1, 3)):
            content = _mutated_bytes(random, content)
        return content
    for _ in range(random.randint(1, 3)):
        _mutate(random, table)
    return _written(table).replace(f'"{_DEEP}"', "[" * 500 + "]" * 500).encode()


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Return every container with each of its keys or positions."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    return [place for key in keys for place in ((value, key), *_places(value[key]))]


def _mutate(random: Random, table: dict[str, Any]) -> None:
    places = _places(table)
    if not places:
        return
    numbers = [
        (inside, at) for inside, at in places if type(inside[at]) in (int, float) and abs(inside[at]) < 1e300
    ]
    only_size = numbers and random.random() < 0.5
    container, key = random.choice(numbers if only_size else places)
    value = container[key]
    match 7 if only_size else random.randrange(9):
        case 0:
            del container[key]
        case 1 if isinstance(container, list):
            container.insert(key, deepcopy(value))
        case 2 if isinstance(container, dict):
            container[random.choice(_KEYS)] = container.pop(key)
        case 3:
            for _ in range(random.choice((1, 2, 30))):
                value = [value] if random.random() < 0.8 else {"a": value}
            container[key] = value if random.random() < 0.7 else _DEEP
        case 4:
            other, there = random.choice(places)
            if other.__class__ is list and there >= len(other):
                return
            container[key] = deepcopy(other[there])
        case 5 | 6 | 7 if (container, key) in numbers and value == value:
            factor = random.choice((-1.0, 0.0, 0.5, 2.0, 10.0 ** random.randint(-18, 18)))
            container[key] = round(value * factor) if isinstance(value, int) else value * factor
        case _:
            container[key] = deepcopy(random.choice(_VALUES))


def _mutated_bytes(random: Random, content: bytes) -> bytes:
    lines = content.split(b"\n")
    line, at = random.randrange(len(lines)), random.randrange(len(content) + 1)
    match random.randrange(6):
        case 0:
            return b"\n".join([*lines[:line], *lines[line + 1 :]])
        case 1:
            return b"\n".join([*lines[:line], lines[line], *lines[line:]])
        case 2:
            return content[:at] + random.choice(_BYTES) + content[at:]
        case 3:
            return content[:at] + bytes([random.randrange(256)]) + content[at + 1 :]
        case 4:
            return content[:at]
        case _:
            return random.choice(_BYTES) + content


def _written(value: Any, top: bool = True) -> str:
    """Return plain data as TOML."""
    if isinstance(value, dict):
        pairs = [f"{json.dumps(key)} = {_written(inside, False)}" for key, inside in value.items()]
        return "\n".join(pairs) + "\n" if top else "{ " + ", ".join(pairs) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_written(inside, False) for inside in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)
