"""The literature cases of tests/data/delay_cases.json, for every test of the delay systems.

Each case is ``x'(t) = sum_k A[k] x(t - delays[k])`` with ``A[0]`` undelayed; its `source` says where it was
published. Each expected row has a quantity, a value, an absolute tolerance and, where the published value was
found wrong, that value beside it (`published`, `published_agrees`).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

CASES: dict[str, dict[str, Any]] = {
    case["id"]: case
    for case in json.loads((Path(__file__).parent / "data" / "delay_cases.json").read_text("utf-8"))["cases"]
}


def matrices(case: str | dict[str, Any]) -> list[np.ndarray]:
    """A[0], A[1], ... of a case."""
    return [np.array(a, dtype=float) for a in _case(case)["A"]]


def system(case: str | dict[str, Any], delays: Any = None, A: Any = None) -> Any:
    """The case as a DelayLTI; `delays` (of A[1:], or with the leading zero of A[0]) and `A` replace its own."""
    import susp_ctrl as sc

    a = matrices(case) if A is None else A
    tau = np.atleast_1d(np.asarray(_case(case)["delays"] if delays is None else delays, dtype=float))
    if tau.size == len(a):
        assert tau[0] == 0.0
        tau = tau[1:]
    return sc.DelayLTI.from_state_delays(A=a, delays=tau)


def rows(*quantities: str) -> list[Any]:
    """All rows of the given quantities as parameters ``(case, row)`` with readable ids."""
    found = []
    for case in CASES.values():
        for k, row in enumerate(case["expected"]):
            if row["quantity"] in quantities:
                found.append(pytest.param(case, row, id=f"{case['id']}-{row['quantity']}-{k}"))
    assert found, f"no case has {quantities}"
    return found


def row(case: str, quantity: str, number: int = 0) -> dict[str, Any]:
    """One row of a case."""
    return [r for r in CASES[case]["expected"] if r["quantity"] == quantity][number]


def _case(case: str | dict[str, Any]) -> dict[str, Any]:
    return CASES[case] if isinstance(case, str) else case
