"""The trade-off between two objectives: a Pareto front by limits on the second one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import OptimizeResult

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.tuning.objectives import Objective
from susp_ctrl.tuning.problem import Limit, TuningProblem
from susp_ctrl.tuning.tuner import tune


@dataclass(frozen=True, eq=False)
class ParetoFront:
    """Designs of which none is better than another in both objectives.

    Attributes
    ----------
    table : DataFrame
        One row per design, by rising first objective: first, second, abscissa, gain_1, ..., delay_1, ...
    passive : (float, float)
        Both objectives without control.
    results : list of OptimizeResult
        What `tune` returned for each row.
    """

    table: pd.DataFrame
    passive: tuple[float, float]
    results: list[OptimizeResult]

    def plot(
        self, ax: Any = None, *, xlabel: str = "first objective", ylabel: str = "second objective"
    ) -> Any:
        """Draw the second objective over the first, with the passive plant beside it; return the axes."""
        from susp_ctrl.plotting import draw_trade_off  # loads matplotlib

        return draw_trade_off(
            self.table["first"], self.table["second"], ax, passive=self.passive, xlabel=xlabel, ylabel=ylabel
        )


def pareto_front(
    problem: TuningProblem,
    against: Objective,
    points: int = 11,
    particles: int = 60,
    iterations: int = 200,
    seed: int = 0,
    **settings: Any,
) -> ParetoFront:
    r"""Trade the objective of a problem against another one.

    .. math:: \min_x J_1(x) \quad\text{subject to}\quad J_2(x) \le \epsilon

    for limits spaced evenly between the value of J2 at the best J1 and the best J2. Unlike a swept weight this
    also finds the parts of the front that are not convex. Each search starts from the designs found before.

    Parameters
    ----------
    problem : TuningProblem
        The problem; its own limits and stability conditions hold for every design.
    against : Harmonic, BandMean, BandPeak, RoadRms
        The second objective.
    points : int
        Number of designs asked for; dominated ones are dropped.
    particles, iterations, seed
        As in `tune`.
    **settings
        Further settings of `tune`.

    Returns
    -------
    ParetoFront

    Raises
    ------
    InputError
        If there is no feasible design at all, or a setting is out of range.

    References
    ----------
    .. [1] Y. Y. Haimes, L. S. Lasdon, D. A. Wismer, "On a bicriterion formulation of the problems of
       integrated system identification and system optimization", IEEE Trans. SMC 1, 1971.
    """
    if not isinstance(problem, TuningProblem):
        raise InputError(f"problem is a {type(problem).__name__}: a TuningProblem is needed")
    number = validation.integer("points", points, at_least=2, at_most=1000)
    other = problem.replace(objective=against)
    search = {"particles": particles, "iterations": iterations, "seed": seed} | settings
    first, last = tune(problem, **search), tune(other, **search)
    if not (first.success and last.success):
        raise InputError(f"problem has no feasible design: {first.message}")
    found = [first]
    levels = np.linspace(_value(other, first.x), float(last.fun), number)
    for level in levels[1:]:
        # The end of the range is met by one design only; a hair of room lets the polish move at all.
        limited = problem.replace(limits=(*problem.limits, Limit(against, level + 1e-6 * abs(level))))
        known = np.unique([found[-1].x, last.x], axis=0)
        result = tune(limited, **(search | {"initial": known[:particles]}))
        if result.success:
            found.append(result)
        elif level == levels[-1]:
            # the search does not see the limited value as accurately as the level is known
            found.append(last)
    pairs = np.array([[_value(problem, r.x), _value(other, r.x)] for r in found])
    kept = [
        k
        for k, pair in enumerate(pairs)
        if not np.any(np.all(pairs <= pair, axis=1) & np.any(pairs < pair, axis=1))
    ]
    kept.sort(key=lambda k: pairs[k, 0])
    m = len(problem.pairs)
    columns = [f"gain_{k + 1}" for k in range(m)] + [f"delay_{k + 1}" for k in range(m)]
    rows = [[*pairs[k], found[k].stability.abscissa, *found[k].x] for k in kept]
    table = pd.DataFrame(rows, columns=["first", "second", "abscissa", *columns])
    return ParetoFront(table, (problem.passive_value, other.passive_value), [found[k] for k in kept])


def _value(problem: TuningProblem, x: FloatArray) -> float:
    return problem.accurate(x)[0]
