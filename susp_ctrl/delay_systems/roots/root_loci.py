"""Root locus: how the rightmost characteristic roots move when a delay or a gain changes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import CharacteristicMatrix, DelaySystem
from susp_ctrl.delay_systems.roots.argument_principle import ContourError, count_right_of
from susp_ctrl.delay_systems.roots.rightmost import MOST_ROOTS, rightmost_roots
from susp_ctrl.errors import InputError

# A root is the continuation of a branch if it lies this near (relative) to where the branch was heading.
_NEAR = 0.25


@dataclass(frozen=True, eq=False)
class RootLocus:
    """Answer of `root_locus`.

    Attributes
    ----------
    parameter : str
        What was varied.
    values : ndarray, shape (n,)
        Its values.
    roots : ndarray of complex, shape (n, branches)
        Paths of the roots (rad/s) with non-negative imaginary part, one column for each; nan where a path has
        left the rightmost roots or not yet joined them. The conjugate paths are not repeated.
    unstable_roots : ndarray of int, shape (n,)
        Number of roots with positive real part by the argument principle, conjugates included; -1 where a root
        lies on the axis.
    """

    parameter: str
    values: FloatArray
    roots: ComplexArray
    unstable_roots: np.ndarray

    @cached_property
    def abscissa(self) -> FloatArray:
        """Largest real part of the roots at every value (rad/s), shape (n,); minus infinity without roots."""
        return np.asarray(
            np.max(np.where(np.isnan(self.roots), -np.inf, self.roots.real), axis=1, initial=-np.inf)
        )

    def to_pandas(self) -> pd.DataFrame:
        """Return one row for each value and branch: parameter, branch, real and imaginary part (rad/s)."""
        there = ~np.isnan(self.roots)
        row, branch = np.nonzero(there)
        found = self.roots[there]
        return pd.DataFrame(
            {self.parameter: self.values[row], "branch": branch, "real": found.real, "imaginary": found.imag}
        )

    def plot(self, ax: Any = None) -> Any:
        """Draw the paths in the complex plane, conjugates included, and return the axes."""
        from susp_ctrl.plotting import draw_root_locus  # loads matplotlib

        both = np.hstack([self.roots, np.where(self.roots.imag > 0.0, self.roots.conj(), np.nan)])
        return draw_root_locus(self.values, both, ax, parameter=self.parameter)

    def __str__(self) -> str:
        changes = np.flatnonzero(np.diff(self.unstable_roots)) + 1
        lines = [
            f"root locus over {self.parameter}, {self.values.size} values from {self.values[0]:g} to "
            f"{self.values[-1]:g}: {self.roots.shape[1]} branches",
            f"  {self.parameter} = {self.values[0]:g}: {_unstable(self.unstable_roots[0])}",
        ]
        lines += [
            f"  {self.parameter} = {self.values[k]:g}: {_unstable(self.unstable_roots[k])}" for k in changes
        ]
        return "\n".join(lines)

    __repr__ = __str__


def root_locus(sys: Any, parameter: str, values: ArrayLike, count: int = 8) -> RootLocus:
    """Follow the rightmost characteristic roots while a delay or a gain changes.

    Parameters
    ----------
    sys : DelayLTI
        The system with its loops closed.
    parameter : str
        ``"delay[k]"`` or ``"gain[k]"``: the k-th of ``sys.delays`` or ``sys.gains`` takes the values;
        ``"delays"`` or ``"gains"``: all of them are multiplied by the values.
    values : array_like, shape (n,)
        Increasing values, in seconds, in units of the gain, or factors.
    count : int, optional
        Number of rightmost roots at every value; pairs are not split.

    Returns
    -------
    RootLocus

    Raises
    ------
    InputError
        An unknown parameter, values that do not increase, a negative delay.

    Notes
    -----
    Every value is solved by itself, with its own check of completeness; the branches are joined afterwards, each
    to the nearest root to where it was heading. Where steps are too large to tell, a branch ends and a new one
    begins.
    """
    system = DelaySystem.of(sys, "sys")
    steps = validation.increasing("values", values)
    wanted = validation.integer("count", count, at_least=1, at_most=MOST_ROOTS)
    change = _change(system, validation.one_of("parameter", parameter, _parameters(system)))
    found, unstable = [], []
    for value in steps:
        K = CharacteristicMatrix.of(change(float(value)).folded)
        roots = rightmost_roots(K, wanted).roots
        found.append(roots[roots.imag >= 0.0])
        unstable.append(_count(K))
    return RootLocus(parameter, steps, _branches(found), np.array(unstable))


def _parameters(system: DelaySystem) -> list[str]:
    n = system.delays.size
    return [
        *(f"{kind}[{k}]" for kind in ("delay", "gain") for k in range(n)),
        *(["delays", "gains"] if n else []),
    ]


def _change(system: DelaySystem, parameter: str) -> Any:
    """Return the function from a value of the parameter to the changed system."""
    of_delay = parameter.startswith("delay")
    present = system.delays if of_delay else system.gains
    replaced = system.with_delays if of_delay else system.with_gains
    index = re.search(r"\[(\d+)\]", parameter)

    def changed(value: float) -> DelaySystem:
        if of_delay and value < 0.0:
            raise InputError(f"values holds {value:g}: a delay is at least 0")
        if index is None:
            return replaced(present * value)
        new = present.copy()
        new[int(index.group(1))] = value
        return replaced(new)

    return changed


def _count(K: CharacteristicMatrix) -> int:
    try:
        return count_right_of(K)
    except ContourError:
        return -1


def _branches(found: list[ComplexArray]) -> ComplexArray:
    """Join the roots of successive values to branches, shape (values, branches)."""
    paths = np.full((len(found), 0), np.nan + 0j)
    for i, roots in enumerate(found):
        left = np.arange(roots.size)
        if i and paths.shape[1] and roots.size:
            heading = paths[i - 1]
            if i > 1:
                heading = np.where(np.isnan(paths[i - 2]), heading, 2.0 * heading - paths[i - 2])
            alive = np.flatnonzero(~np.isnan(heading))
            distance = np.abs(heading[alive, None] - roots)
            reach = np.maximum(_NEAR * np.maximum(np.abs(roots), _spacing(roots)), 1e-300)
            branch, root = linear_sum_assignment(np.minimum(distance / reach, 1e3))
            joined = distance[branch, root] <= reach[root]
            paths[i, alive[branch[joined]]] = roots[root[joined]]
            left = np.setdiff1d(left, root[joined])
        fresh = np.full((len(found), left.size), np.nan + 0j)
        fresh[i] = roots[left]
        paths = np.hstack([paths, fresh])
    return paths


def _spacing(roots: ComplexArray) -> float:
    return float(np.ptp(roots.imag) + np.ptp(roots.real)) / max(roots.size - 1, 1) if roots.size else 0.0


def _unstable(number: int) -> str:
    return "a root on the axis" if number < 0 else "stable" if number == 0 else f"{number} unstable roots"
