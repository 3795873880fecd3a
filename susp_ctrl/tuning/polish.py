"""Local polish of a design the swarm has found: bounded, in scaled variables, one batch per gradient.

Three kinds of minimum need three methods. Where the response can vanish, Gauss-Newton on its real and imaginary
parts converges to rounding. A smooth minimum takes SLSQP, which also keeps limits. The peak over a band has its
minimum on a kink where several peaks are equal: there t is minimised subject to J(w_k) <= t at all frequencies
(the epigraph form), by SLSQP too. Where only values are known (spectral abscissa), Nelder-Mead.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from susp_ctrl.arrays import FloatArray
from susp_ctrl.tuning.objectives import SampledObjective
from susp_ctrl.tuning.problem import Case, TuningProblem
from susp_ctrl.tuning.sampling import channel_exponentials

Batch = Callable[[FloatArray], FloatArray]

# The type stubs of scipy know no overload for constraints given as dictionaries with a "jac".
_minimize: Any = minimize

STEP = 1e-6  # of the box, for central differences
EPIGRAPH_ROUNDS = 3


def polish(problem: TuningProblem, start: FloatArray) -> FloatArray:
    """Return a design at least as good as `start` among those near it.

    Parameters
    ----------
    problem : TuningProblem
    start : ndarray, shape (2 m,)
        A feasible design.

    Returns
    -------
    ndarray, shape (2 m,)
        The polished design, or `start` where nothing feasible and better was met.
    """
    free = problem.upper > problem.lower
    low, width = problem.lower, problem.upper - problem.lower

    def design(u: FloatArray) -> FloatArray:
        """Return designs (n, 2 m) of scaled free variables (n, d)."""
        points = np.tile(start, (len(u), 1))
        points[:, free] = np.clip(low[free] + u * width[free], low[free], problem.upper[free])
        return points

    origin = (start - low)[free] / width[free]
    best = start
    if not origin.size:
        return best
    for method in _methods(problem):
        for candidate in method(problem, design, (best - low)[free] / width[free]):
            values, violations = problem.evaluate(np.stack([best, candidate]))
            if violations[1] == 0 and values[1] < values[0]:
                best = candidate
    return best


def _methods(problem: TuningProblem) -> list[Callable[..., list[FloatArray]]]:
    sampled = problem.cases[0].objective
    if not isinstance(sampled, SampledObjective):
        return [_simplex]
    single = len(problem.cases) == 1 and len(problem.cases[0].delay_factors) == 1
    kinked = not problem.objective.smooth or not single
    methods = [_epigraph] if kinked else [_descend]
    # As many real equations as unknowns at most: then a point where the response vanishes can exist.
    equations = 2 * sampled.omega.size * sampled.plant.p11.shape[1]
    if single and equations <= np.count_nonzero(problem.upper > problem.lower):
        methods.insert(0, _vanish)
    return methods


def _vanish(problem: TuningProblem, design: Batch, start: FloatArray) -> list[FloatArray]:
    """Gauss-Newton on the weighted response itself."""
    case = problem.cases[0]
    sampled = _sampled(case)

    def residuals(u: FloatArray) -> FloatArray:
        gains, delays = case.spread(design(u))
        h = sampled.weighted_response(channel_exponentials(gains, delays, sampled.omega))
        flat = h.reshape(len(u), -1)
        return np.concatenate([flat.real, flat.imag], axis=1)

    def residual(u: FloatArray) -> FloatArray:
        return residuals(u[None])[0]

    def slope(u: FloatArray) -> FloatArray:
        return _jacobian(residuals, u)

    found = least_squares(
        residual,
        np.clip(start, 1e-9, 1.0 - 1e-9),
        jac=slope,
        bounds=(0.0, 1.0),
        ftol=None,
        xtol=1e-15,
        gtol=None,
        max_nfev=60,
    )
    return [design(found.x[None])[0]]


def _descend(problem: TuningProblem, design: Batch, start: FloatArray) -> list[FloatArray]:
    """Find a smooth minimum in the box, and within the limits if there are any."""

    def value(u: FloatArray) -> FloatArray:
        return problem.values(design(u))[:, None]

    scale = float(value(start[None])[0, 0]) or 1.0
    limits = _limit_constraints(problem, design)
    found = _minimize(
        lambda u: float(value(u[None])[0, 0]) / scale,
        start,
        jac=lambda u: _jacobian(value, u)[0] / scale,
        bounds=[(0.0, 1.0)] * start.size,
        # Not L-BFGS-B: for four variables it spends more time waking BLAS threads than the swarm takes.
        method="SLSQP",
        constraints=limits,
        options={"maxiter": 200, "ftol": 1e-15},
    )
    return [design(found.x[None])[0]]


def _epigraph(problem: TuningProblem, design: Batch, start: FloatArray) -> list[FloatArray]:
    """Minimise t subject to every spectrum line (or vehicle) below t."""

    def lines(u: FloatArray) -> FloatArray:
        points = design(u)
        return np.concatenate([_lines(problem, case, points) for case in problem.cases], axis=1)

    found: list[FloatArray] = []
    u = start
    for _ in range(EPIGRAPH_ROUNDS):
        now = lines(u[None])[0]
        scale = float(now.max()) or 1.0
        # Lines far below the peak cannot become active in one round; the next round looks again.
        active = np.flatnonzero(now > 0.6 * scale)

        constraint = _room_below(lines, active, scale)
        target = np.zeros(start.size + 1)
        target[-1] = 1.0
        result = _minimize(
            lambda z: float(z[-1]),
            np.append(u, 1.0),
            jac=lambda z, target=target: target,
            bounds=[(0.0, 1.0)] * start.size + [(0.0, 10.0)],
            method="SLSQP",
            constraints=[constraint, *_limit_constraints(problem, design)],
            options={"maxiter": 100, "ftol": 1e-12},
        )
        u = np.clip(result.x[:-1], 0.0, 1.0)
        found.append(design(u[None])[0])
        if now.max() - lines(u[None])[0].max() < 1e-9 * scale:
            break
    return found


def _room_below(lines: Batch, active: NDArray[np.intp], scale: float) -> dict[str, Any]:
    """Return the SLSQP inequality t - J(w_k)/scale >= 0 for z = (u, t) at the active lines."""

    def room(z: FloatArray) -> FloatArray:
        return z[-1] - lines(z[None, :-1])[0, active] / scale

    def slope(z: FloatArray) -> FloatArray:
        slopes = -_jacobian(lambda v: lines(v)[:, active], z[:-1]) / scale
        return np.hstack([slopes, np.ones((active.size, 1))])

    return {"type": "ineq", "fun": room, "jac": slope}


def _simplex(problem: TuningProblem, design: Batch, start: FloatArray) -> list[FloatArray]:
    """Nelder-Mead for objectives of which nothing but values is known; infeasible points are refused."""

    def value(u: FloatArray) -> float:
        values, violations = problem.evaluate(design(u[None]))
        return float(values[0]) if violations[0] == 0 else np.inf

    found = minimize(
        value,
        start,
        bounds=[(0.0, 1.0)] * start.size,
        method="Nelder-Mead",
        options={"maxfev": 250, "xatol": 1e-7, "fatol": 1e-10, "adaptive": True},
    )
    return [design(found.x[None])[0]]


def _sampled(case: Case) -> SampledObjective:
    """Return the case's objective as one that has a response (`_methods` has made sure)."""
    return cast(SampledObjective, case.objective)


def _lines(problem: TuningProblem, case: Case, points: FloatArray) -> FloatArray:
    """Return what must stay below t: every line of the spectrum, or the one value of a smooth objective."""
    rows = []
    for factor in case.delay_factors:
        gains, delays = case.spread(points, factor)
        if problem.objective.smooth:
            rows.append(case.objective.evaluate(gains, delays)[:, None])
        else:
            sampled = _sampled(case)
            rows.append(sampled.spectra(channel_exponentials(gains, delays, sampled.omega)))
    return np.concatenate(rows, axis=1)


def _limit_constraints(problem: TuningProblem, design: Batch) -> list[Any]:
    """Return the limits as SLSQP inequalities, 1 - value/limit >= 0 (one row per plant, corner and limit)."""
    if not problem.limits:
        return []

    def room(u: FloatArray) -> FloatArray:
        points = design(u)
        rows = [
            1.0 - bound.evaluate(*case.spread(points, factor)) / limit.at_most
            for case in problem.cases
            for factor in case.delay_factors
            for limit, bound in zip(problem.limits, case.limits, strict=True)
        ]
        return np.stack(rows, axis=1)

    # The epigraph form carries t as an additional last variable.
    def scaled(z: FloatArray) -> FloatArray:
        return z[:dimension]

    dimension = int(np.count_nonzero(problem.upper > problem.lower))

    def slope(z: FloatArray) -> FloatArray:
        full = np.zeros((room(scaled(z)[None]).shape[1], z.size))
        full[:, :dimension] = _jacobian(room, scaled(z))
        return full

    # A hair inside the limit, so that the result is feasible by the strict comparison of the search.
    return [{"type": "ineq", "fun": lambda z: room(scaled(z)[None])[0] - 1e-9, "jac": slope}]


def _jacobian(function: Batch, u: FloatArray) -> FloatArray:
    """Central differences, shape (outputs, d), all points in one batch; one-sided at the walls."""
    ahead = np.minimum(u + STEP, 1.0)
    behind = np.maximum(u - STEP, 0.0)
    d = u.size
    points = np.tile(u, (2 * d, 1))
    points[np.arange(d), np.arange(d)] = ahead
    points[d + np.arange(d), np.arange(d)] = behind
    values = function(points)
    return ((values[:d] - values[d:]) / (ahead - behind)[:, None]).T
