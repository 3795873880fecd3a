"""Local polish of a design the swarm has found: bounded, in scaled variables, with exact slopes.

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

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.tuning.neighbourhood import Neighbourhood
from susp_ctrl.tuning.objectives import SampledObjective
from susp_ctrl.tuning.problem import TuningProblem

# The type stubs of scipy know no overload for constraints given as dictionaries with a "jac".
_minimize: Any = minimize

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
    best = start
    near = Neighbourhood(problem, start)
    if not near.size:
        return best
    for method in _methods(problem):
        for candidate in method(near, near.scaled(best)):
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


def _vanish(near: Neighbourhood, start: FloatArray) -> list[FloatArray]:
    """Gauss-Newton on the weighted response itself."""

    def residual(u: FloatArray) -> FloatArray:
        return _real_and_imaginary(near.response(u)[0])

    def slope(u: FloatArray) -> FloatArray:
        return _real_and_imaginary(near.response(u)[1])

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
    return [near.design(found.x)]


def _real_and_imaginary(h: ComplexArray) -> FloatArray:
    return np.concatenate([h.real, h.imag])


def _descend(near: Neighbourhood, start: FloatArray) -> list[FloatArray]:
    """Find a smooth minimum in the box, and within the limits if there are any."""
    scale = float(near.outcomes(start)[0][0]) or 1.0
    found = _minimize(
        lambda u: float(near.outcomes(u)[0][0]) / scale,
        start,
        jac=lambda u: near.slopes(u)[0][0] / scale,
        bounds=[(0.0, 1.0)] * start.size,
        # Not L-BFGS-B: for four variables it spends more time waking BLAS threads than the swarm takes.
        method="SLSQP",
        constraints=_limit_constraints(near),
        options={"maxiter": 200, "ftol": 1e-15},
    )
    return [near.design(found.x)]


def _epigraph(near: Neighbourhood, start: FloatArray) -> list[FloatArray]:
    """Minimise t subject to every spectrum line (or vehicle) below t."""
    found: list[FloatArray] = []
    u = start
    for _ in range(EPIGRAPH_ROUNDS):
        now = near.outcomes(u)[0]
        scale = float(now.max()) or 1.0
        # Lines far below the peak cannot become active in one round; the next round looks again.
        active = np.flatnonzero(now > 0.6 * scale)
        target = np.zeros(start.size + 1)
        target[-1] = 1.0
        result = _minimize(
            lambda z: float(z[-1]),
            np.append(u, 1.0),
            jac=lambda z, target=target: target,
            bounds=[(0.0, 1.0)] * start.size + [(0.0, 10.0)],
            method="SLSQP",
            constraints=[_room_below(near, active, scale), *_limit_constraints(near)],
            options={"maxiter": 100, "ftol": 1e-12},
        )
        u = np.clip(result.x[:-1], 0.0, 1.0)
        found.append(near.design(u))
        if now.max() - near.outcomes(u)[0].max() < 1e-9 * scale:
            break
    return found


def _room_below(near: Neighbourhood, active: NDArray[np.intp], scale: float) -> dict[str, Any]:
    """Return the SLSQP inequality t - J(w_k)/scale >= 0 for z = (u, t) at the active lines."""

    def room(z: FloatArray) -> FloatArray:
        return cast(FloatArray, z[-1] - near.outcomes(z[:-1])[0][active] / scale)

    def slope(z: FloatArray) -> FloatArray:
        return np.hstack([-near.slopes(z[:-1])[0][active] / scale, np.ones((active.size, 1))])

    return {"type": "ineq", "fun": room, "jac": slope}


def _limit_constraints(near: Neighbourhood) -> list[dict[str, Any]]:
    """Return the limits as SLSQP inequalities, 1 - value/limit >= 0 (one row per plant, corner and limit)."""
    if not near.most.size:
        return []

    # The epigraph form carries t as an additional last variable.
    def room(z: FloatArray) -> FloatArray:
        # A hair inside the limit, so that the result is feasible by the strict comparison of the search.
        return 1.0 - near.outcomes(z[: near.size])[1] / near.most - 1e-9

    def slope(z: FloatArray) -> FloatArray:
        slopes = -near.slopes(z[: near.size])[1] / near.most[:, None]
        return np.pad(slopes, ((0, 0), (0, z.size - near.size)))

    return [{"type": "ineq", "fun": room, "jac": slope}]


def _simplex(near: Neighbourhood, start: FloatArray) -> list[FloatArray]:
    """Nelder-Mead for objectives of which nothing but values is known; infeasible points are refused."""

    def value(u: FloatArray) -> float:
        values, violations = near.problem.evaluate(near.design(u)[None])
        return float(values[0]) if violations[0] == 0 else np.inf

    found = minimize(
        value,
        start,
        bounds=[(0.0, 1.0)] * start.size,
        method="Nelder-Mead",
        options={"maxfev": 250, "xatol": 1e-7, "fatol": 1e-10, "adaptive": True},
    )
    return [near.design(found.x)]
