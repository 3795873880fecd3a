"""Particle swarm search with hard feasibility: ring and global topologies, one vectorised step.

The comparison of two points is Deb's: a feasible point beats an infeasible one, of two feasible points the
one with the smaller value wins, of two infeasible points the one with the smaller violation. Feasibility is
a state of a point; no value is ever spoilt by a penalty.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError

Objective = Callable[[FloatArray], Any]

TOPOLOGIES = ("ring", "global")
MOST_PARTICLES, MOST_ITERATIONS = 1_000_000, 10_000_000


@dataclass(frozen=True)
class SwarmPreset:
    """Named coefficients of the velocity rule, see `pso` for their meaning."""

    topology: str
    inertia: tuple[float, float]
    cognitive: float
    social: float
    velocity_clamp: float
    stagnation: int | None


PRESETS = {
    # Eq. (7) of the paper: eps1 = eps2 = 2 and one best point for the whole swarm. The paper leaves the
    # inertia weight open; the choice here is the linear schedule 0.9 -> 0.4 of Shi and Eberhart (1999).
    "paper": SwarmPreset("global", (0.9, 0.4), 2.0, 2.0, 0.5, None),
}

STOPPED = {
    0: "all iterations done",
    1: "stopped early: no improvement within `patience` iterations",
    2: "stopped early: the target value is reached",
    3: "stopped by the callback",
}


def pso(
    objective: Objective,
    lower: ArrayLike,
    upper: ArrayLike,
    particles: int = 60,
    iterations: int = 200,
    topology: str = "ring",
    seed: int | np.random.Generator = 0,
    *,
    preset: str | None = None,
    inertia: tuple[float, float] = (0.9, 0.4),
    cognitive: float = 2.0,
    social: float = 2.0,
    velocity_clamp: float = 0.5,
    stagnation: int | None = 40,
    patience: int | None = None,
    tolerance: float = 1e-9,
    target: float | None = None,
    initial: ArrayLike | None = None,
    callback: Callable[[OptimizeResult], Any] | None = None,
) -> OptimizeResult:
    r"""Minimise a batch function over a box by a particle swarm.

    .. math:: v \leftarrow \alpha v + \epsilon_1 r_1 (p - x) + \epsilon_2 r_2 (b - x), \; x \leftarrow x + v

    with p the best point a particle has seen, b the best point its neighbours have seen, and r1, r2 uniform
    on (0, 1) for each particle and coordinate.

    Parameters
    ----------
    objective : callable
        Maps positions (n, d) to values (n,), or to a pair (values (n,), violations (n,)). A violation of
        zero or less is feasible; a value or violation that is not finite marks an infeasible point.
    lower, upper : array_like, shape (d,)
        The box. A coordinate with equal limits is held fixed.
    particles, iterations : int
        Size of the swarm and number of steps after the first sample, which is a Latin hypercube.
    topology : {"ring", "global"}
        Who a particle's neighbours are: the two beside it on a ring, or everybody. A ring keeps several
        basins alive, which the many local minima of delayed feedback need.
    seed : int or numpy.random.Generator
        Source of all random numbers.
    preset : {"paper"}, optional
        Named coefficients that replace topology, inertia, cognitive, social, velocity_clamp and stagnation.
        "paper": global topology with eps1 = eps2 = 2; the paper leaves alpha open, here 0.9 falling to 0.4.
    inertia : (float, float)
        alpha at the first and at the last step, linear between.
    cognitive, social : float
        eps1 and eps2.
    velocity_clamp : float
        Largest speed per step as a fraction of the box, in (0, 1].
    stagnation : int or None
        Restart a particle that has not improved its own best for so many steps (never the one which holds
        the best point of all). None: no restarts.
    patience, tolerance : int or None, float
        Stop when `patience` steps in a row bring less than a relative gain of `tolerance`. None: never.
    target : float, optional
        Stop at a feasible value not above this one.
    initial : array_like, shape (k, d), optional
        Points of the first sample that are given rather than drawn, k <= particles.
    callback : callable, optional
        Called as callback(intermediate) after each step with the fields x, fun, violation, nit, nfev,
        feasible_share; a true return value stops the search.

    Returns
    -------
    scipy.optimize.OptimizeResult
        x, fun (nan when nothing feasible was found), violation, success (a feasible point was found),
        status, message, nit, nfev, history (DataFrame: iteration, evaluations, best, mean, feasible_share;
        best and mean over feasible points, nan without any) and the own best points of the swarm, best
        first: candidates (n, d), candidate_values (n,), candidate_violations (n,).

    Raises
    ------
    InputError
        For limits that are not finite or cross, a swarm of fewer than 2, or an unknown topology or preset.

    Notes
    -----
    The default coefficients explore: on the band and road objectives of the half car they reach the best known
    basin more often than 1.5 or 1.75, and `tune` leaves the last digits to a local polish. On smooth functions
    with one basin 1.5 converges faster.

    References
    ----------
    .. [1] J. Kennedy, R. Eberhart, "Particle swarm optimization", Proc. ICNN, 1995.
    .. [2] K. Deb, "An efficient constraint handling method for genetic algorithms", CMAME 186, 2000.
    .. [3] J. Kennedy, R. Mendes, "Population structure and particle swarm performance", CEC, 2002.
    """
    low, high = _box(lower, upper)
    validation.function("objective", objective)
    count = validation.integer("particles", particles, at_least=2, at_most=MOST_PARTICLES)
    steps = validation.integer("iterations", iterations, at_least=0, at_most=MOST_ITERATIONS)
    rng = validation.random_generator(seed)
    rule = _rule(preset, topology, inertia, cognitive, social, velocity_clamp, stagnation)
    wait = None if patience is None else validation.integer("patience", patience, at_least=1)
    gain = validation.number("tolerance", tolerance, at_least=0)
    goal = -np.inf if target is None else validation.number("target", target)

    positions = latin_hypercube(rng.random((count, low.size)), rng, low, high)
    if initial is not None:
        given = _initial_points(initial, low, high, count)
        positions[: len(given)] = given
    fastest = rule.velocity_clamp * (high - low)
    velocities = (2.0 * rng.random(positions.shape) - 1.0) * fastest
    alphas = np.linspace(*rule.inertia, max(steps, 1))
    neighbours = ring_neighbours(count) if rule.topology == "ring" else None

    values, violations = _judged(objective(positions), count)
    own, own_values, own_violations = positions.copy(), values.copy(), violations.copy()
    idle = np.zeros(count, dtype=int)
    record = np.empty((steps + 1, 3))
    record[0] = _summary(values, violations, own_values, own_violations)
    reference, waited, status, done = record[0, 0], 0, 0, 0

    for step in range(steps):
        rank = np.empty(count, dtype=int)
        order = deb_order(own_values, own_violations)
        rank[order] = np.arange(count)
        if neighbours is None:
            social_best = own[order[0]]
        else:
            social_best = own[neighbours[np.arange(count), rank[neighbours].argmin(axis=1)]]
        positions, velocities = swarm_step(
            positions, velocities, own, social_best, rng.random((2, *positions.shape)),
            alphas[step], rule.cognitive, rule.social, fastest, low, high,
        )  # fmt: skip
        if rule.stagnation is not None:
            tired = (idle >= rule.stagnation) & (rank > 0)
            if tired.any():
                fresh = rng.random((2, int(tired.sum()), low.size))
                positions[tired] = low + fresh[0] * (high - low)
                velocities[tired] = (2.0 * fresh[1] - 1.0) * fastest
                own_values[tired] = own_violations[tired] = np.inf
                idle[tired] = 0
        values, violations = _judged(objective(positions), count)
        better = (violations < own_violations) | ((violations == own_violations) & (values < own_values))
        own[better] = positions[better]
        own_values[better] = values[better]
        own_violations[better] = violations[better]
        idle += 1
        idle[better] = 0
        done = step + 1
        record[done] = _summary(values, violations, own_values, own_violations)

        best = record[done, 0]
        if np.isnan(reference) or best < reference - gain * abs(reference):
            reference, waited = best, 0
        else:
            waited += 1
        if callback is not None and callback(
            _intermediate(own, own_values, own_violations, done, count, record[done, 2])
        ):
            status = 3
        elif best <= goal:
            status = 2
        elif wait is not None and waited >= wait:
            status = 1
        if status:
            break

    order = deb_order(own_values, own_violations)
    found = bool(own_violations[order[0]] == 0)
    message = STOPPED[status] if found else f"no feasible point found ({STOPPED[status]})"
    history = pd.DataFrame(record[: done + 1], columns=["best", "mean", "feasible_share"])
    history.insert(0, "iteration", np.arange(done + 1))
    history.insert(1, "evaluations", count * np.arange(1, done + 2))
    result = OptimizeResult()
    result.update(
        x=own[order[0]].copy(),
        fun=float(own_values[order[0]]) if found else np.nan,
        violation=float(own_violations[order[0]]),
        success=found,
        status=status,
        message=message,
        nit=done,
        nfev=count * (done + 1),
        history=history,
        candidates=own[order],
        candidate_values=np.where(own_violations[order] == 0, own_values[order], np.nan),
        candidate_violations=own_violations[order],
    )
    return result


def swarm_step(
    positions: FloatArray,
    velocities: FloatArray,
    own_best: FloatArray,
    social_best: FloatArray,
    random: FloatArray,
    inertia: float,
    cognitive: float,
    social: float,
    fastest: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Move every particle once, v = a v + e1 r1 (p - x) + e2 r2 (b - x), and reflect it at the box.

    A pure function: the random numbers `random`, shape (2, n, d) on [0, 1), are an argument.

    Parameters
    ----------
    positions, velocities, own_best : ndarray, shape (n, d)
    social_best : ndarray, shape (n, d) or (d,)
    random : ndarray, shape (2, n, d)
    inertia, cognitive, social : float
    fastest : ndarray, shape (d,)
        Velocity clamp, at most the width of the box, so that one reflection brings a particle back inside.
    lower, upper : ndarray, shape (d,)

    Returns
    -------
    positions, velocities : ndarray, shape (n, d)
        A particle that met a wall is mirrored there and flies back.
    """
    velocity = inertia * velocities
    velocity += cognitive * random[0] * (own_best - positions)
    velocity += social * random[1] * (social_best - positions)
    np.minimum(velocity, fastest, out=velocity)
    np.maximum(velocity, -fastest, out=velocity)
    moved = positions + velocity
    inside = np.where(moved < lower, 2.0 * lower - moved, moved)
    inside = np.where(inside > upper, 2.0 * upper - inside, inside)
    np.negative(velocity, out=velocity, where=inside != moved)
    # Rounding alone can leave a mirrored point outside by one unit in the last place.
    np.minimum(inside, upper, out=inside)
    np.maximum(inside, lower, out=inside)
    return inside, velocity


def deb_order(values: FloatArray, violations: FloatArray) -> NDArray[np.intp]:
    """Return the indices that sort points best first: by violation, then by value (both (n,))."""
    return np.lexsort((values, violations))


def ring_neighbours(count: int) -> NDArray[np.intp]:
    """Return, shape (count, 3), each particle with the two beside it on a ring."""
    return (np.arange(count)[:, None] + np.array([-1, 0, 1])) % count


def latin_hypercube(
    jitter: FloatArray, rng: np.random.Generator, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Return n points of the box, one in each of n equal slices of every coordinate."""
    strata = rng.permuted(np.tile(np.arange(len(jitter))[:, None], (1, jitter.shape[1])), axis=0)
    return lower + (strata + jitter) / len(jitter) * (upper - lower)


def _judged(answer: Any, count: int) -> tuple[FloatArray, FloatArray]:
    """Split an objective's answer into values and violations; an infeasible point has no value (inf)."""
    if isinstance(answer, tuple):
        values, violations = (_numbers(part) for part in answer)
    else:
        values = _numbers(answer)
        violations = np.zeros(values.shape)
    if values.shape != (count,) or violations.shape != (count,):
        raise InputError(
            f"objective returned shapes {values.shape} and {violations.shape}: ({count},) is needed"
        )
    np.maximum(violations, 0.0, out=violations)
    violations[~np.isfinite(violations) | (~np.isfinite(values) & (violations == 0))] = np.inf
    values[violations > 0] = np.inf
    return values, violations


def _numbers(answer: Any) -> FloatArray:
    return validation.array("what objective returns", answer, finite=False).copy()


def _summary(
    values: FloatArray, violations: FloatArray, own_values: FloatArray, own_violations: FloatArray
) -> tuple[float, float, float]:
    """Return best so far, mean and feasible share of the swarm; nan where nothing is feasible."""
    feasible = violations == 0
    number = np.count_nonzero(feasible)
    # Infeasible own bests carry inf, so the plain minimum is the best feasible one.
    best = own_values.min()
    mean = values[feasible].sum() / number if number else np.nan
    return (best if np.isfinite(best) else np.nan), mean, number / values.size


def _intermediate(
    own: FloatArray, values: FloatArray, violations: FloatArray, done: int, count: int, share: float
) -> OptimizeResult:
    first = deb_order(values, violations)[0]
    state = OptimizeResult()
    state.update(
        x=own[first].copy(),
        fun=float(values[first]) if violations[first] == 0 else np.nan,
        violation=float(violations[first]),
        nit=done,
        nfev=count * (done + 1),
        feasible_share=float(share),
    )
    return state


def _box(lower: ArrayLike, upper: ArrayLike) -> tuple[FloatArray, FloatArray]:
    low = validation.vector("lower", lower)
    high = validation.vector("upper", upper, size=low.size)
    if low.size == 0:
        raise InputError("lower is empty: at least one coordinate is needed")
    if np.any(low > high):
        bad = int(np.flatnonzero(low > high)[0])
        raise InputError(f"lower[{bad}] = {low[bad]:g} is above upper[{bad}] = {high[bad]:g}")
    return low, high


def _rule(
    preset: str | None,
    topology: str,
    inertia: tuple[float, float],
    cognitive: float,
    social: float,
    velocity_clamp: float,
    stagnation: int | None,
) -> SwarmPreset:
    """Check the coefficients, or take those of a preset."""
    validation.one_of("topology", topology, TOPOLOGIES)
    if preset is not None:
        return PRESETS[validation.one_of("preset", preset, PRESETS)]
    first, last = validation.vector("inertia", inertia, size=2, at_least=0)
    return SwarmPreset(
        topology,
        (float(first), float(last)),
        validation.number("cognitive", cognitive, at_least=0),
        validation.number("social", social, at_least=0),
        validation.number("velocity_clamp", velocity_clamp, above=0, at_most=1),
        None if stagnation is None else validation.integer("stagnation", stagnation, at_least=1),
    )


def _initial_points(initial: ArrayLike, lower: FloatArray, upper: FloatArray, count: int) -> FloatArray:
    given = validation.matrix("initial", initial, columns=lower.size)
    if len(given) > count:
        raise InputError(f"initial has {len(given)} points: at most particles = {count} are allowed")
    if np.any((given < lower) | (given > upper)):
        row, column = np.argwhere((given < lower) | (given > upper))[0]
        raise InputError(
            f"initial[{row}, {column}] = {given[row, column]:g} is outside "
            f"[{lower[column]:g}, {upper[column]:g}]"
        )
    return given
