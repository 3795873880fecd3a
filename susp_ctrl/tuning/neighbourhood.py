"""A tuning problem as a local search sees it: scaled free variables, objective and limits, their slopes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.tuning.case import Case
from susp_ctrl.tuning.problem import TuningProblem

Pair = tuple[FloatArray, FloatArray]

STEP = 1e-6  # of the box, for central differences where no slope is known


class Neighbourhood:
    """Objective and limits of all vehicles and corners, over variables u in [0, 1] for what the box leaves free.

    Parameters
    ----------
    problem : TuningProblem
    start : ndarray, shape (2 m,)
        Where the search starts; gives the variables that are held fixed.

    Attributes
    ----------
    size : int
        Number of free variables.
    most : ndarray
        The limits, one entry per vehicle, corner and limit.
    """

    def __init__(self, problem: TuningProblem, start: FloatArray) -> None:
        self.problem, self._start = problem, start
        self._free = problem.upper > problem.lower
        self._low, self._high = problem.lower[self._free], problem.upper[self._free]
        self.size = self._low.size
        corners = sum(len(case.delay_factors) for case in problem.cases)
        self.most = np.tile([limit.at_most for limit in problem.limits], corners)
        # A method asks for objective and limits at one point after the other: solved once for both.
        self._outcomes, self._slopes = _last(self._new_outcomes), _last(self._new_slopes)

    def scaled(self, design: FloatArray) -> FloatArray:
        """Return the variables of a design."""
        return (design[self._free] - self._low) / (self._high - self._low)

    def design(self, u: FloatArray) -> FloatArray:
        """Return the design (..., 2 m) of variables (..., d)."""
        designs = np.broadcast_to(self._start, (*u.shape[:-1], self._start.size)).copy()
        designs[..., self._free] = np.clip(self._low + u * (self._high - self._low), self._low, self._high)
        return designs

    def outcomes(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what is minimised (one entry, or what must stay below t) and what is limited."""
        return self._outcomes(u)

    def slopes(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of `outcomes`, (entries, d) each."""
        return self._slopes(u)

    def response(self, u: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the weighted response of the first vehicle, flat, and its derivatives (entries, d)."""
        h, slopes = self.problem.cases[0].response(self.design(u))
        return h, slopes[:, self._free] * (self._high - self._low)

    @property
    def _lines(self) -> bool:
        return not self.problem.objective.smooth

    def _new_outcomes(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        points = self.design(u)[None]
        return self._split([case.outcomes(points, self._lines)[0] for case in self.problem.cases])

    def _new_slopes(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        points, width = self.design(u)[None], self._high - self._low
        parts = []
        for case in self.problem.cases:
            slopes = case.slopes(points, self._lines)[0][..., self._free] * width
            unknown = np.isnan(slopes)
            if np.any(unknown):
                slopes = np.where(unknown, self._differences(case, u), slopes)
            parts.append(slopes)
        return self._split(parts)

    def _differences(self, case: Case, u: FloatArray) -> FloatArray:
        """Central differences of the outcomes, all points in one batch; one-sided at the walls."""
        ahead, behind = np.minimum(u + STEP, 1.0), np.maximum(u - STEP, 0.0)
        chosen = np.eye(u.size, dtype=bool)
        points = np.concatenate([np.where(chosen, moved, u) for moved in (ahead, behind)])
        values = case.outcomes(self.design(points), self._lines)
        change = np.moveaxis(values[: u.size] - values[u.size :], 0, -1)
        return np.asarray(change / (ahead - behind))

    def _split(self, parts: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Part the outcomes (corners, outcomes, ...) of every vehicle into objective and limits, corners in rows."""
        number = len(self.problem.limits)
        both: tuple[list[FloatArray], list[FloatArray]] = ([], [])
        for part in parts:
            for rows, piece in zip(both, np.split(part, [part.shape[1] - number], axis=1), strict=True):
                rows.append(piece.reshape(-1, *part.shape[2:]))
        return np.concatenate(both[0]), np.concatenate(both[1])


def _last(function: Callable[[FloatArray], Pair]) -> Callable[[FloatArray], Pair]:
    """Return the function with its last answer kept."""
    kept: list[tuple[FloatArray, Pair]] = []

    def remembering(u: FloatArray) -> Pair:
        if not kept or not np.array_equal(kept[0][0], u):
            kept[:] = [(u.copy(), function(u))]
        return kept[0][1]

    return remembering
