"""Every public callable names what is wrong with its arguments: no other exception than the documented ones."""

from __future__ import annotations

import inspect

import pytest
from call_registry import calls
from spoilt_calls import judged, spoilt

import susp_ctrl as sc


def test_every_public_callable_is_listed():
    public = {name for name in sc.__all__ if callable(getattr(sc, name))}
    errors = {
        name for name in public if inspect.isclass(kind := getattr(sc, name)) and issubclass(kind, Exception)
    }
    assert public - errors == {name for name in calls() if name[0].isalpha() and name.isidentifier()}


def test_the_calls_themselves_are_right():
    for name, (function, arguments) in calls().items():
        if name not in ("run_study", "sweep"):  # too long for this
            function(**arguments)


def faults(seed, count):
    return [
        (name, bad, wrong) for name, bad, call in spoilt(seed, count) if (wrong := judged(name, bad, call))
    ]


@pytest.mark.property
def test_spoilt_arguments_are_named():
    assert faults(seed=0, count=600) == []


@pytest.mark.slow
@pytest.mark.property
@pytest.mark.parametrize("seed", range(1, 9))
def test_many_spoilt_arguments_are_named(seed):
    """Together 20,000 calls."""
    assert faults(seed, count=2500) == []
