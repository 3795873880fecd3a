"""The ring swarm beside pyswarms, pymoo and scipy: how often each finds the best known value, and how long it takes.

    python tests/benchmarks/tuning.py [--seeds 5] [--particles 60] [--iterations 200] [--objectives road_rms ...]

Every method minimises the same batched objective over the same box with the same number of evaluations (polish
steps come on top and are inside the time). The value to reach is found in the run itself: the lowest of all
results, those of a differential evolution with a budget several times larger included. ``--seeds 50`` takes about
a quarter of an hour. Packages that are not installed (extra `bench`) are left out and named. Set OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
import time
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tuning"))

import numpy as np
from scipy.optimize import differential_evolution
from tuning_case import problem

import susp_ctrl as sc

OBJECTIVES = ("road_rms", "band_mean", "band_peak")
# Relative distance to the best known value that counts as reaching it; band_peak is not smooth.
REACHED = {"road_rms": 1e-4, "band_mean": 1e-4, "band_peak": 1e-3}


def ours(p, seed, particles, iterations):
    return float(sc.tune(p, particles=particles, iterations=iterations, seed=seed).fun)


def ring_alone(p, seed, particles, iterations):
    return float(sc.pso(p.values, p.lower, p.upper, particles, iterations, seed=seed).fun)


def paper_preset(p, seed, particles, iterations):
    return float(sc.pso(p.values, p.lower, p.upper, particles, iterations, seed=seed, preset="paper").fun)


def pyswarms(optimizer, **settings):
    """One of its optimisers, in the unit cube because it has no scaling of the box."""

    def run(p, seed, particles, iterations):
        from pyswarms import single

        logging.getLogger("pyswarms").setLevel(logging.WARNING)
        np.random.seed(seed)  # noqa: NPY002 - it draws from the global generator
        width = p.upper - p.lower
        options = {"c1": 1.49618, "c2": 1.49618, "w": 0.7298}  # Clerc and Kennedy (2002)
        if optimizer == "LocalBestPSO":
            options |= {"k": 3, "p": 2}
        swarm = getattr(single, optimizer)(
            particles, p.dimension, options, bounds=(np.zeros(p.dimension), np.ones(p.dimension)), **settings
        )
        cost, _ = swarm.optimize(lambda x: p.values(p.lower + x * width), iters=iterations, verbose=False)
        return float(cost)

    return run


# Its default wraps particles round the box and so misses optima on a bound; this is the best of its settings here.
CLAMPED = {"bh_strategy": "nearest", "velocity_clamp": (-0.5, 0.5)}


def pymoo(name):
    def run(p, seed, particles, iterations):
        from pymoo.algorithms.soo.nonconvex.de import DE
        from pymoo.algorithms.soo.nonconvex.pso import PSO
        from pymoo.core.problem import Problem
        from pymoo.optimize import minimize

        class Tuning(Problem):
            def __init__(self):
                super().__init__(n_var=p.dimension, n_obj=1, xl=p.lower, xu=p.upper)

            def _evaluate(self, x, out, *args, **kwargs):
                out["F"] = p.values(x)[:, None]

        algorithm = {"PSO": PSO, "DE": DE}[name](pop_size=particles)
        found = minimize(Tuning(), algorithm, ("n_gen", iterations), seed=seed, verbose=False)
        return float(found.F[0])

    return run


def evolution(p, seed, particles, iterations, polish=True):
    """scipy's differential evolution; particles in all, its own polish at the end."""
    found = differential_evolution(
        lambda x: p.values(np.atleast_2d(x.T)) if x.ndim > 1 else float(p.values(x[None])[0]),
        list(zip(p.lower, p.upper, strict=True)), popsize=max(1, particles // p.dimension), maxiter=iterations,
        rng=seed, tol=0.0, vectorized=True, updating="deferred", polish=polish,
    )  # fmt: skip
    return float(found.fun)


def larger_evolution(p, seed, particles, iterations):
    return evolution(p, seed, 4 * particles, 2 * iterations, polish=True)


METHODS = {
    "susp_ctrl.tune (ring, polish, verdict)": ours,
    "susp_ctrl.pso, ring alone": ring_alone,
    "susp_ctrl.pso, the paper's constants": paper_preset,
    "pyswarms, global best, as it comes": pyswarms("GlobalBestPSO"),
    "pyswarms, global best, held in the box": pyswarms("GlobalBestPSO", **CLAMPED),
    "pyswarms, local best, held in the box": pyswarms("LocalBestPSO", **CLAMPED),
    "pymoo PSO": pymoo("PSO"),
    "pymoo DE": pymoo("DE"),
    "scipy differential evolution, polish": evolution,
}


def compare(name, seeds, particles, iterations):
    """Run every method from every seed and print one table."""
    p = problem(name)
    results, missing = {}, []
    for method, run in METHODS.items():
        values, times = [], []
        try:
            run(p, 10_000, 8, 2)  # imports and first calls are nobody's time
            for seed in range(seeds):
                start = time.process_time()
                values.append(run(p, seed, particles, iterations))
                times.append(time.process_time() - start)
        except ImportError as problem_of_import:
            missing.append(f"{method} ({problem_of_import.name})")
            continue
        results[method] = np.array(values), np.array(times)
    checks = [larger_evolution(p, seed, particles, iterations) for seed in range(2)]
    best = min(min(checks), *(values.min() for values, _ in results.values()))
    print(f"\n{name}: best known {best:.9g} (differential evolution, 8 times the budget: {min(checks):.9g}), "
          f"reached within {REACHED[name]:g}, {particles} x {iterations}, {seeds} seeds")  # fmt: skip
    print(
        f"  {'method':<42}{'reached':>10}{'median excess':>16}{'worst excess':>15}{'time per run':>15}{'ratio':>9}"
    )
    reference = next(iter(results.values()))[1].mean()
    for method, (values, times) in results.items():
        excess = values / best - 1.0
        reached = f"{np.count_nonzero(excess <= REACHED[name])}/{seeds}"
        spent = times.mean()
        print(f"  {method:<42}{reached:>10}{np.median(excess):>16.1e}{excess.max():>15.1e}"
              f"{1e3 * spent:>12.0f} ms{spent / reference:>7.1f} x", flush=True)  # fmt: skip
    if missing:
        print(f"  not installed: {', '.join(missing)}")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--particles", type=int, default=60)
    parser.add_argument("--iterations", type=int, default=200)
    parser.add_argument("--objectives", nargs="+", choices=OBJECTIVES, default=OBJECTIVES)
    given = parser.parse_args(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in given.objectives:
            compare(name, given.seeds, given.particles, given.iterations)


if __name__ == "__main__":
    main()
