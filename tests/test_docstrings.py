"""What the docstrings promise: examples that run, and complete sections for every public name."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import pkgutil
import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import susp_ctrl as sc

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "susp_ctrl"
WITH_EXAMPLES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in PACKAGE.rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)
# Where the theory stands that everything else builds on.
THEORY = (
    "model.lft",
    "crossings.frequency_sweep",
    "simulation.time_response",
    "integrators.method_of_steps",
    "roots.rightmost",
    "roots.argument_principle",
    "approximation.spectral",
    "approximation.pade",
    "maps.two_delay_map",
    "crossings.delay_independence",
)
PUBLIC = [name for name in sc.__all__ if name != "__version__"]
SECTION = re.compile(r"^(Parameters|Attributes|Returns|Raises|Yields)\n-+$", re.MULTILINE)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)  # examples name the study files of the repository
    outcome = doctest.testmod(importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert outcome.attempted > 0
    assert outcome.failed == 0


def test_no_example_is_skipped() -> None:
    skipped = [
        path.name for path in PACKAGE.rglob("*.py") if "doctest: +SKIP" in path.read_text(encoding="utf-8")
    ]
    assert skipped == []


@pytest.mark.parametrize("name", THEORY)
def test_theory_stands_in_its_module_with_references(name: str) -> None:
    text = importlib.import_module(f"susp_ctrl.delay_systems.{name}").__doc__ or ""
    assert "References\n----------" in text
    assert ".. [1]" in text
    assert ".. math::" in text or ":math:" in text or name == "roots.rightmost"


def modules() -> Iterator[ModuleType]:
    yield sc
    for found in pkgutil.walk_packages(sc.__path__, "susp_ctrl."):
        yield importlib.import_module(found.name)


def test_every_module_and_what_it_defines_openly_has_a_docstring() -> None:
    missing = []
    for module in modules():
        members = [
            (f"{module.__name__}.{name}", value)
            for name, value in vars(module).items()
            if not name.startswith("_")
            and getattr(value, "__module__", "") == module.__name__
            and callable(value)
        ]
        missing += [
            name for name, value in [(module.__name__, module), *members] if not inspect.getdoc(value)
        ]
    assert missing == []


def sections(text: str) -> dict[str, str]:
    """Sections of a docstring by name."""
    marks = [(match.group(1), match.start(), match.end()) for match in SECTION.finditer(text)]
    if not marks:
        return {}
    ends = [start for _, start, _ in marks[1:]] + [len(text)]
    return {name: text[after:end] for (name, _, after), end in zip(marks, ends, strict=True)}


def described(text: str) -> set[str]:
    """Names that the entries of a section describe: what stands at its margin."""
    heads = re.findall(r"^([*\w][^\n:]*)", text, re.MULTILINE)
    return {name.strip().lstrip("*") for head in heads for name in head.split(",")}


def raises(value: Callable[..., Any]) -> bool:
    """Whether the code itself refuses something: a raise, or a check of an argument."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(value)))
    except (OSError, TypeError):
        return False
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise):
            return True
        if isinstance(node, ast.Call) and ast.unparse(node.func).startswith("validation."):
            return True
    return False


def complaints(name: str, value: Any, text: str) -> Iterator[str]:
    """What the docstring of a function leaves out; a method of one argument may say it in its first lines."""
    found = sections(text)
    signature = inspect.signature(value)
    given = [p for p in signature.parameters if p not in ("self", "cls")]
    told = described(found.get("Parameters", "")) | described(found.get("Attributes", ""))
    brief = "." in name and len(given) <= 1 and "Parameters" not in found
    for parameter in given:
        if parameter not in told and not brief:
            yield f"{name}: parameter {parameter} is not described"
    if signature.return_annotation not in (None, "None", inspect.Signature.empty) and "Returns" not in found:
        first = text.splitlines()[0]
        if not brief or not re.match(r"(Return|The |Whether |One |Draw )", first):
            yield f"{name}: Returns is missing"
    if raises(value) and "Raises" not in found:
        yield f"{name}: Raises is missing"


def own_members(value: type) -> dict[str, Any]:
    """Members that the class and those of its bases that are ours define."""
    ours = [base for base in reversed(value.__mro__) if base.__module__.startswith("susp_ctrl")]
    return {name: member for base in ours for name, member in vars(base).items()}


@pytest.mark.parametrize("name", PUBLIC)
def test_public_docstrings_are_complete(name: str) -> None:
    value = getattr(sc, name)
    text = inspect.getdoc(value) or ""
    assert text, name
    first = text.splitlines()[0]
    assert first.endswith("."), f"the summary is one line: {first}"
    if inspect.isclass(value) and issubclass(value, BaseException):
        return
    wrong = []
    if inspect.isclass(value):
        found = sections(text)
        told = described(found.get("Parameters", "")) | described(found.get("Attributes", ""))
        wrong += [
            f"{name}: parameter {parameter} is not described"
            for parameter in inspect.signature(value).parameters
            if parameter not in told and not parameter.startswith("_")
        ]
        for member, function in own_members(value).items():
            function = getattr(function, "__func__", function)
            if member.startswith("_") or not inspect.isfunction(function):
                continue
            inner = inspect.getdoc(getattr(value, member)) or ""
            assert inner, f"{name}.{member}"
            if not function.__module__.startswith("susp_ctrl"):
                continue
            wrong += complaints(f"{name}.{member}", function, inner)
        wrong += [
            f"{name}.{member} is not described"
            for member, prop in own_members(value).items()
            if isinstance(prop, property) and not inspect.getdoc(prop) and not member.startswith("_")
        ]
        own = [m for m in ("__init__", "__post_init__") if m in own_members(value)]
        if any(raises(own_members(value)[m]) for m in own) and "Raises" not in found:
            wrong.append(f"{name}: Raises is missing")
    else:
        wrong += complaints(name, value, text)
    assert wrong == []
