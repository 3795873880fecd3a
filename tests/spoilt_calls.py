"""Calls with one or two arguments spoilt, in a fixed order: what may come out is a result or one clear line."""

from __future__ import annotations

import random
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
import pandas as pd
from call_registry import calls, small_loop

import susp_ctrl as sc

LONGEST_MESSAGE = 300
LONGEST_CALL = 120.0


class _Odd:
    """An object of no known kind."""


def _ragged() -> list[Any]:
    return [[1.0, 2.0], [3.0]]


def _raises(*_args: Any) -> Any:
    raise RuntimeError("from inside the caller's own function")


BAD: list[Callable[[], Any]] = [
    lambda: None, lambda: True, lambda: "text", lambda: "", lambda: b"bytes", lambda: 1 + 2j, lambda: np.nan,
    lambda: np.inf, lambda: -np.inf, lambda: -1.0, lambda: 0, lambda: 0.0, lambda: -3, lambda: 1.5,
    lambda: 10**400, lambda: -(10**400), lambda: 1e308, lambda: -1e308, lambda: 5e-324, lambda: 2**63,
    list, lambda: (), dict, lambda: set(), lambda: _ragged(), lambda: [[]], lambda: [None],
    lambda: ["a", "b"], lambda: [1.0, np.nan], lambda: [np.inf, 1.0], lambda: [3.0, 2.0, 1.0],
    lambda: [1.0, 1.0], lambda: [-1.0, 2.0], lambda: [1j, 2.0], lambda: [10**400, 1.0], lambda: np.zeros(0),
    lambda: np.zeros((0, 3)), lambda: np.ones((2, 2, 2)), lambda: np.ones((2, 3)), lambda: np.eye(2),
    lambda: np.arange(5), lambda: np.array(["x", "y"]), lambda: np.array([None, 1.0]), lambda: np.array(1.0),
    lambda: np.datetime64("2020-01-01"), lambda: np.float32(0.5), lambda: np.bool_(True), lambda: _Odd(),
    lambda: _Odd, lambda: _raises, lambda: np.sin, lambda: (lambda: 1.0), lambda: iter([1.0]), lambda: range(3),
    lambda: slice(None), lambda: ..., lambda: {"y": 1.0}, lambda: {1: 2}, lambda: {"a": np.nan},
    lambda: {"y": "z"}, lambda: [("y", "u", "v")], lambda: [(1,)], lambda: "no_such_signal", lambda: Path("x"),
    lambda: Path("/"), lambda: "\0", lambda: "x" * 300_000, lambda: list(range(2000)),
    lambda: pd.DataFrame({"a": [1.0]}),
    lambda: pd.Series([1.0, 2.0]), lambda: ct.tf([1.0], [1.0, 1.0]), lambda: ct.tf([1.0, 0.0, 0.0], [1.0, 1.0]),
    lambda: ct.tf([1.0], [1.0, 1.0], 0.1), lambda: ct.ss(-1.0, 1.0, 1.0, 0.0),
    lambda: ct.ss(np.eye(2), np.eye(2), np.eye(2), 0),
    lambda: ct.ss(1.0, 1.0, 1.0, 0.0, 0.1), lambda: ct.ss([], [], [], 1.0), lambda: ct.frd([1.0, 2.0], [1.0, 2.0]),
    lambda: ct.nlsys(lambda t, x, u, p: -x, None, inputs=1, outputs=1, states=1), small_loop,
    lambda: sc.delay(0.5), lambda: sc.delay([0.1, 0.2]), lambda: sc.QuarterCar(), lambda: sc.HalfCar().plant(),
    lambda: sc.HarmonicRoad(0.01, 5.0), lambda: sc.BumpRoad(0.05, 1.0, 10.0), lambda: sc.RandomRoad(speed=20.0, bins=5),
    lambda: sc.FeedbackChannel("y", "u", 1.0), lambda: [sc.FeedbackChannel("y", "u", 1.0)], lambda: sc.Range(0.0, 1.0),
    lambda: sc.Harmonic(1.0, {"y": 1.0}), lambda: np.random.default_rng(0), lambda: sc.stability(small_loop()),
]  # fmt: skip
"""What arguments are replaced by; made anew for every call."""


def spoilt(seed: int, count: int) -> Iterator[tuple[str, dict[str, Any], Callable[[], Any]]]:
    """Yield name, spoilt arguments and the call; every callable in turn, its arguments in a fixed random order."""
    rng = random.Random(seed)
    valid = {name: call for name, call in calls().items() if call[1] and name not in ("run_study", "sweep")}
    names = list(valid)
    for k in range(count):
        name = names[k % len(names)]
        function, arguments = valid[name]
        chosen = rng.sample(list(arguments), 2 if len(arguments) > 1 and rng.random() < 0.2 else 1)
        bad = {key: rng.choice(BAD)() for key in chosen}
        yield name, bad, lambda function=function, arguments=arguments, bad=bad: function(**(arguments | bad))


@contextmanager
def ends_within(seconds: float, name: str) -> Iterator[None]:
    """Make an endless call a TimeoutError; counted in processor time, which other work on the machine leaves alone."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"{name} did not end within {seconds:g} s of processor time")

    if not hasattr(signal, "setitimer"):  # Windows
        yield
        return
    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def judged(name: str, bad: dict[str, Any], call: Callable[[], Any]) -> str:
    """Make the call; return what is wrong with its outcome, an empty text if nothing is.

    Operators follow Python's own convention: a TypeError where neither operand knows the other (pandas asks the other
    operand for attributes of arrays). What a function of the caller raises comes out as it is.
    """
    with warnings.catch_warnings(action="ignore"), ends_within(LONGEST_CALL, name):
        try:
            call()
        except sc.InputError as refusal:
            text = str(refusal)
            if len(text.splitlines()) != 1 or len(text) > LONGEST_MESSAGE:
                return f"not one short line: {text[:200]!r}"
        except RuntimeError as problem:
            if "caller's own function" not in str(problem):
                return repr(problem)[:300]
        except FileNotFoundError:
            pass
        except (TypeError, ValueError) as problem:
            # raised by the caller's own function, or by the other operand of an operator
            if name[-1] not in "+*/" and not any(map(callable, bad.values())):
                return f"{type(problem).__name__}: {str(problem)[:200]}"
        except Exception as problem:  # that is what is looked for
            if not (name[-1] in "+*/" and isinstance(bad.get("other"), (pd.DataFrame, pd.Series))):
                return f"{type(problem).__name__}: {str(problem)[:200]}"
    return ""
