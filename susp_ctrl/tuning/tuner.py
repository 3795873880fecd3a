"""`tune`: swarm, local polish, and the full stability verdict on what is returned."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import StabilityVerdict, stability
from susp_ctrl.errors import InputError, UndecidedStabilityWarning
from susp_ctrl.tuning.polish import polish
from susp_ctrl.tuning.problem import TuningProblem
from susp_ctrl.tuning.swarm import pso

# Two designs nearer than this in every scaled coordinate are taken to lie in one basin. On band_peak of the half
# car 0.2 finds the best basin among the first eight in seeds where the swarm itself settled elsewhere.
BASIN_SIZE = 0.2
SAME_DESIGN = 1e-3
# Designs judged in the end by an evaluation of their own.
MOST_JUDGED = 16
# By how much, of the passive value, the search is taken to be mistaken at least.
SEARCH_ERROR = 1e-5
# Mistakes of the search that are told, of the passive value.
DOUBTED = 1e-3
# By how much, relative, a limit may be passed: the search keeps limits by its own frequencies.
LIMIT_TOLERANCE = 1e-4
# Values closer than this, relative to the passive value, are equal: the better damped design wins.
TIE = 1e-9
# Rough shares of the time, for the progress only; the rest is the judging of designs.
_SWARM, _POLISH = 0.5, 0.4


def tune(
    problem: TuningProblem,
    particles: int = 60,
    iterations: int = 200,
    seed: int | np.random.Generator = 0,
    *,
    polish_starts: int = 8,
    progress: Callable[[str, float], Any] | None = None,
    **swarm: Any,
) -> OptimizeResult:
    r"""Find the gains and delays of a tuning problem: min J(x) over the box, subject to stability.

    A particle swarm with feasibility-first comparison, then a bounded local polish from the best basins the
    swarm has visited. The best of what they found are judged again one by one: integrals and peaks at frequencies of
    their own, limits too. Then the full stability verdict (roots, argument principle and sweep must agree) on the
    best design; if the verdict is not "stable", the next best one is taken. Of designs with equal J (within
    1e-9 of the passive value) the best damped one is returned.

    Parameters
    ----------
    problem : TuningProblem
        What is tuned.
    particles, iterations, seed
        As in `pso`.
    polish_starts : int
        Number of basins to polish; 0 returns the swarm's own best.
    progress : callable, optional
        Called as ``progress(stage, fraction)`` with the stage in words and roughly the share of the whole search
        done, 0 to 1: after every step of the swarm, every basin polished and every design judged.
    **swarm
        Further settings of `pso`: topology, preset, inertia, cognitive, social, velocity_clamp, stagnation,
        patience, tolerance, target, initial, callback.

    Returns
    -------
    scipy.optimize.OptimizeResult
        x = [gains..., delays...], fun, success, status, message, nit, nfev; channels (list of
        FeedbackChannel), stability (verdict; of several plants the one with the rightmost root),
        stabilities (one per plant), history (DataFrame of the swarm), passive_value (J without control),
        swarm_fun (J before the polish), refused (number of better designs the verdict did not confirm).
        Without a feasible design success is False, fun nan, channels empty and stability None; x is then the
        point that came nearest.

    Raises
    ------
    InputError
        For settings out of range.

    Warns
    -----
    RuntimeWarning
        If the search was mistaken in designs as good as the one returned, by more than 1e-3 of the passive value.

    Examples
    --------
    >>> import susp_ctrl as sc
    >>> car, road = sc.HalfCar(), sc.RandomRoad(iso_class="C", speed=20.0)
    >>> lags = {"road_front": 0.0, "road_rear": car.axle_lag(20.0)}
    >>> problem = sc.TuningProblem(
    ...     car.plant(),
    ...     pairs=[("unsprung_displacement_front", "force_front"), ("unsprung_displacement_rear", "force_rear")],
    ...     objective=sc.RoadRms(road, {"body_acceleration": 0.7, "pitch_acceleration": 0.3}, lags),
    ...     gain_bounds=[(-34000, 34000), (-44000, 44000)],
    ... )
    >>> best = sc.tune(problem)
    >>> bool(best.success), bool(best.fun < 0.9 * best.passive_value)
    (True, True)
    """
    if not isinstance(problem, TuningProblem):
        raise InputError(f"problem is a {type(problem).__name__}: a TuningProblem is needed")
    starts = validation.integer("polish_starts", polish_starts, at_least=0)
    if progress is not None:
        validation.function("progress", progress)
    told = progress or (lambda stage, fraction: None)
    callback = swarm.pop("callback", None)

    def after_step(state: OptimizeResult) -> Any:
        told("swarm", _SWARM * state.nit / iterations)
        return callback is not None and callback(state)

    record = _Record(problem)
    found = pso(
        record, problem.lower, problem.upper, particles, iterations, seed=seed, callback=after_step, **swarm
    )
    feasible = found["candidate_violations"] == 0
    candidates, values = found["candidates"][feasible], found["candidate_values"][feasible]
    polished = []
    basins = record.basins(starts)
    for number, x in enumerate(basins, 1):
        polished.append(polish(problem, x))
        told("polish", _SWARM + _POLISH * number / len(basins))
    if polished:
        candidates = np.concatenate([polished, candidates])
        values = np.concatenate([problem.values(np.array(polished)), values])

    def judged(share: float) -> None:
        told("stability verdict", _SWARM + _POLISH + (1.0 - _SWARM - _POLISH) * share)

    chosen, fun, refused = None, np.nan, 0
    verdicts: list[StabilityVerdict] = []
    left = np.argsort(values, kind="stable")
    while chosen is None and left.size:
        best, left = _judged(problem, candidates, values, left, judged)
        place, verdicts, more = _select(problem, candidates[best.designs], best.values, judged)
        refused += more
        if place is not None:
            chosen, fun = int(best.designs[place]), float(best.values[place])
            _warn_of_mistakes(problem, best, values[best.designs], place)
    judged(1.0)
    message = str(found["message"])
    if chosen is None and found["success"]:
        message = f"no feasible point found: the stability verdict confirmed none of {refused} candidates"
    elif refused:
        message += f"; the stability verdict did not confirm {refused} better designs"
    result = OptimizeResult()
    result.update(
        x=found["x"] if chosen is None else candidates[chosen],
        fun=fun,
        success=chosen is not None,
        status=found["status"],
        message=message,
        nit=found["nit"],
        nfev=found["nfev"],
        channels=[] if chosen is None else problem.channels(candidates[chosen]),
        stability=None if chosen is None else max(verdicts, key=lambda verdict: verdict.abscissa),
        stabilities=verdicts,
        history=found["history"],
        passive_value=problem.passive_value,
        swarm_fun=problem.accurate(found["x"])[0] if found["success"] else found["fun"],
        refused=refused,
    )
    return result


class _Record:
    """The problem as the swarm sees it, keeping every design it has asked for.

    A ring settles in one basin in the end; where it has been before is worth a polish too.
    """

    def __init__(self, problem: TuningProblem) -> None:
        self._problem = problem
        self._asked: list[tuple[FloatArray, FloatArray, FloatArray]] = []

    def __call__(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        values, violations = self._problem.evaluate(points)
        self._asked.append((points, values, violations))
        return values, violations

    def basins(self, count: int) -> list[FloatArray]:
        """Return the best feasible design of each of the `count` best basins, best first."""
        points, values, violations = (np.concatenate(part) for part in zip(*self._asked, strict=True))
        good = np.flatnonzero((violations <= 0) & np.isfinite(values))
        points = points[good[np.argsort(values[good], kind="stable")]]
        found: list[FloatArray] = []
        while len(points) and len(found) < count:
            found.append(points[0])
            points = points[~_within(self._problem, points, points[0], BASIN_SIZE)]
        return found


class _Judged(NamedTuple):
    designs: NDArray[np.intp]
    values: FloatArray


def _judged(
    problem: TuningProblem,
    candidates: FloatArray,
    searched: FloatArray,
    left: NDArray[np.intp],
    judged: Callable[[float], None],
) -> tuple[_Judged, NDArray[np.intp]]:
    """Judge the first of the candidates left by an evaluation of their own, as long as a design may still win.

    By how much the search is mistaken shows on those judged before. Returns those within their limits, and what
    is left.
    """
    mistaken = SEARCH_ERROR * _scale(problem, 0.0)
    designs: list[int] = []
    values: list[float] = []
    seen: list[int] = []
    looked_at = 0
    for k in left:
        if len(seen) == MOST_JUDGED or searched[k] - 2.0 * mistaken > min(values, default=np.inf):
            break
        looked_at += 1
        if any(_within(problem, candidates[k], candidates[other], SAME_DESIGN) for other in seen):
            continue
        seen.append(int(k))
        value, overshoot = problem.accurate(candidates[k])
        judged(0.5 * len(seen) / MOST_JUDGED)
        if overshoot <= LIMIT_TOLERANCE and np.isfinite(value):
            designs.append(int(k))
            values.append(value)
            mistaken = max(mistaken, abs(value - searched[k]))
    return _Judged(np.array(designs, dtype=np.intp), np.array(values)), left[looked_at:]


def _warn_of_mistakes(problem: TuningProblem, best: _Judged, searched: FloatArray, place: int) -> None:
    """Warn where the search took a design at least as good as the chosen one for another value than it has."""
    misjudged = np.abs(best.values - searched)[searched <= searched[place]].max()
    if misjudged > DOUBTED * _scale(problem, best.values[place]):
        warnings.warn(
            f"the search was mistaken by up to {misjudged:.2g} in designs as good as the one returned, whose "
            f"J = {best.values[place]:.6g} is accurate: there may be better ones",
            RuntimeWarning,
            stacklevel=3,
        )


def _scale(problem: TuningProblem, otherwise: float) -> float:
    """Return the size of J without control."""
    return abs(problem.passive_value) if np.isfinite(problem.passive_value) else abs(otherwise)


def _within(problem: TuningProblem, points: FloatArray, centre: FloatArray, size: float) -> NDArray[np.bool_]:
    """Tell which points (..., 2 m) are near a centre in every coordinate, as fractions of the box."""
    width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
    return np.asarray(np.max(np.abs(points - centre) / width, axis=-1) <= size)


def _select(
    problem: TuningProblem, candidates: FloatArray, values: FloatArray, judged: Callable[[float], None]
) -> tuple[int | None, list[StabilityVerdict], int]:
    """Return the best candidate whose loops are all proven stable, its verdicts, and how many better failed."""
    refused = 0
    confirmed: list[tuple[float, int, list[StabilityVerdict]]] = []
    worst = np.inf
    for number, k in enumerate(np.argsort(values, kind="stable")):
        judged(0.5 + 0.5 * number / len(values))
        if values[k] > worst:
            break
        if any(_within(problem, candidates[k], candidates[c], SAME_DESIGN) for _, c, _ in confirmed):
            continue
        verdicts = _verdicts(problem, candidates[k])
        abscissa = max(verdict.abscissa for verdict in verdicts)
        if not all(verdict.stable is True for verdict in verdicts) or abscissa >= -problem.decay_rate:
            refused += not confirmed
            continue
        if not confirmed:
            passive = abs(problem.passive_value)
            worst = values[k] + TIE * (passive if np.isfinite(passive) else abs(values[k]))
        confirmed.append((abscissa, int(k), verdicts))
    if not confirmed:
        return None, [], refused
    # Of equally good basins the best damped one.
    _, chosen, verdicts = min(confirmed, key=lambda entry: entry[0])
    return chosen, verdicts, refused


def _verdicts(problem: TuningProblem, x: FloatArray) -> list[StabilityVerdict]:
    with warnings.catch_warnings():
        # An undecided design is not returned; the next best one is looked at instead.
        warnings.simplefilter("ignore", UndecidedStabilityWarning)
        return [stability(loop) for loop in problem.loops(x)]
