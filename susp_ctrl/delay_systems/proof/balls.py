"""Ball arithmetic (Arb in FLINT) on the user's floats, which are exact numbers; python-flint is an extra."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from susp_ctrl.errors import InputError

flint: Any = import_module("flint") if find_spec("flint") else None

Ball = Any
"""A real (`flint.arb`) or complex (`flint.acb`) ball: python-flint ships no types."""


def require_flint() -> None:
    """Refuse where python-flint is not installed.

    Raises
    ------
    InputError
        With the line that installs it.
    """
    if flint is None:
        raise InputError("proofs need python-flint: pip install 'susp_ctrl[proof]'")


def is_zero(ball: Ball) -> bool:
    """Tell whether a ball is exactly zero: what may be something else is not."""
    return bool(ball == 0)


def rational(value: float) -> Any:
    """Return a float as the rational number it is."""
    return flint.fmpq(*float(value).as_integer_ratio())


def rank(blocks: Sequence[np.ndarray]) -> int:
    """Return an upper bound, mostly equal, on how many rows or columns a combination of the matrices depends on."""
    ranks = []
    for stacked in (np.hstack(blocks), np.vstack(blocks)):
        rows, columns = np.any(stacked != 0.0, axis=1), np.any(stacked != 0.0, axis=0)
        kept = stacked[rows][:, columns]
        if kept.size == 0:
            return 0
        ranks.append(flint.fmpq_mat([[rational(v) for v in row] for row in kept.tolist()]).rank())
    return min(ranks)


def inverse_vandermonde(nodes: Sequence[int]) -> np.ndarray:
    """Return the matrix that takes values at integers to coefficients, as balls."""
    powers = flint.fmpq_mat([[node**k for k in range(len(nodes))] for node in nodes])
    return np.array([[flint.arb(v) for v in row] for row in powers.inv().tolist()], dtype=object)


def magnitudes(matrix: Ball) -> Ball:
    """Return upper bounds of the magnitudes of a matrix of balls."""
    return flint.arb_mat([[entry.abs_upper() for entry in row] for row in matrix.tolist()])
