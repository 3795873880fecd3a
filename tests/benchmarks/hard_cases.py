"""Processor times of the hard cases of roots, counts, crossings and verdicts, with what they say.

    python tests/benchmarks/hard_cases.py [--row NAME] [--systems 60] [--states 100 200 400]

Rows: `smith` (predictors with exact and inexact models), `random` (full-rank delayed matrices), `large` (many
states, two delayed signals), `h2` (norms of random systems), `map` (two full-rank delayed matrices), `half_car`,
`tune` (four channels, three limits, corners of the delays, inside and outside the small-gain box).
Set OMP_NUM_THREADS=1. It uses public names only: PYTHONPATH chooses the version that is measured.
"""

from __future__ import annotations

import argparse
import os
import time
import warnings

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import control
import numpy as np

import susp_ctrl as sc


def timed(run):
    """Processor time (s) and result."""
    start = time.process_time()
    result = run()
    return time.process_time() - start, result


def smith_predictor(delay, mismatch=0.0, model_delay=None):
    """P = 1/(s + 1) behind a delay, C = 1.8 + 4/s, with a model whose gain is off by `mismatch`."""
    plant, law = control.tf([1], [1, 1]), control.tf([1.8, 4.0], [1, 0])
    model = control.tf([1.0 + mismatch], [1, 1])
    inner = sc.feedback(law, model - sc.delay(model_delay or delay) * model)
    return sc.feedback(sc.delay(delay) * plant * inner, 1)


def random_system(seed, most_states=8, damping=(0.0, 1.0, 3.0), gain=(-1.0, 0.4), **signals):
    """Full-rank delayed matrices, up to five incommensurate delays, rates from 0.01 to 100 rad/s."""
    random = np.random.default_rng([seed, 7])
    n, m = random.integers(2, most_states + 1), random.integers(1, 6)
    rate = 10.0 ** random.uniform(-2.0, 2.0)
    A = [rate * (random.normal(size=(n, n)) - random.choice(damping) * np.eye(n))]
    A += [rate * 10.0 ** random.uniform(*gain) * random.normal(size=(n, n)) for _ in range(m)]
    signals = {name: np.ones((n, 1)) for name in signals}
    return sc.DelayLTI.from_state_delays(A=A, delays=10.0 ** random.uniform(-1.5, 0.8, m) / rate, **signals)


def large_plant(states, seed=1):
    """A random plant of many states and two delayed signals."""
    random = np.random.default_rng(seed)
    A = [random.normal(size=(states, states)) / np.sqrt(states) - 1.5 * np.eye(states)]
    A += [3.0 / states * np.outer(*random.normal(size=(2, states))) for _ in range(2)]
    return sc.DelayLTI.from_state_delays(A=A, delays=[0.3, 0.7])


def flexible_structure(states):
    """Lightly damped modes from 1 to 50 rad/s with two weak delayed feedbacks."""
    modes = states // 2
    omega, zero = np.linspace(1.0, 50.0, modes), np.zeros(modes)
    A0 = np.block([[np.zeros((modes, modes)), np.eye(modes)], [-np.diag(omega**2), -0.04 * np.diag(omega)]])
    into = np.append(zero, np.ones(modes))
    out, alternating = np.append(np.ones(modes), zero), np.append((-1.0) ** np.arange(modes), zero)
    A = [A0, -0.02 * np.outer(into, out), -0.01 * np.outer(into, alternating)]
    return sc.DelayLTI.from_state_delays(A=A, delays=[0.05, 0.2])


def verdict_row(name, loop):
    seconds, verdict = timed(lambda: sc.stability(loop))
    counts = ", ".join(f"{method} {count}" for method, count in verdict.agreement.items())
    print(f"{name:34s} {seconds:8.3f} s  stable {verdict.stable!s:5}  {counts}", flush=True)
    return seconds


def smith(options):
    for delay in (1.0, 4.0, 8.0, 40.0):
        loop = smith_predictor(delay)
        verdict_row(f"Smith, exact, {delay:g} s", loop)
        seconds, roots = timed(lambda loop=loop: sc.characteristic_roots(loop, 4))
        print(f"{'  roots':34s} {seconds:8.3f} s  {np.round(roots, 6)}", flush=True)
    verdict_row("Smith, gain off by 20 %, 4 s", smith_predictor(4.0, 0.2))
    verdict_row("Smith, gain off by 1e-10, 4 s", smith_predictor(4.0, 1e-10))
    verdict_row("Smith, 8 s modelled as 8.2 s", smith_predictor(8.0, model_delay=8.2))


def random(options):
    times = [verdict_row(f"random {seed}", random_system(seed)) for seed in range(options.systems)]
    middle, high = np.quantile(times, [0.5, 0.9])
    print(f"{'random, all':34s} median {middle:.3f} s, 90 % {high:.3f} s, worst {max(times):.3f} s")


def large(options):
    for states in options.states:
        verdict_row(f"random plant, {states} states", large_plant(states))
        verdict_row(f"flexible structure, {states} states", flexible_structure(states))


def h2(options):
    for seed in range(options.systems // 3):
        loop = random_system(seed, 6, damping=(3.0, 5.0), gain=(-1.0, -0.5), B=True)
        try:
            seconds, norm = timed(lambda loop=loop: sc.h2_norm(loop))
        except sc.UnstableSystemError:
            continue
        print(f"{f'H2 norm, random {seed}':34s} {seconds:8.3f} s  {norm!r}", flush=True)


def stability_map(options):
    for states in (2, 3, 4, 5):
        numbers = np.random.default_rng(states)
        A = [numbers.normal(size=(states, states)) - 2.0 * np.eye(states)]
        A += [0.8 * numbers.normal(size=(states, states)) for _ in range(2)]
        loop = sc.DelayLTI.from_state_delays(A=A, delays=[0.5, 0.7])
        seconds, mapped = timed(lambda loop=loop: sc.stability_map(loop, tau1=(0, 3), tau2=(0, 3)))
        print(
            f"{f'map, {states} full-rank states':34s} {seconds:8.3f} s {str(mapped).splitlines()[1]}",
            flush=True,
        )


def half_car(options):
    channels = [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", 19345.0, 0.5530),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", 26150.0, 0.5186),
    ]
    for _ in range(3):
        verdict_row("half car", sc.close_loop(sc.HalfCar().plant(), channels))


def tuning_problem(kind, share):
    """Half car, two channels per axle, strokes and a tire limited, delays within 10 %; `share` scales the gains."""
    car, road = sc.HalfCar(), sc.RandomRoad(iso_class="C", speed=20.0)
    lags = {"road_front": 0.0, "road_rear": car.axle_lag(20.0)}
    comfort = {"body_acceleration": 0.7, "pitch_acceleration": 0.3}
    limited = ("suspension_deflection_front", "suspension_deflection_rear", "tire_deflection_front")
    signals = ("unsprung_displacement", "suspension_velocity")
    pairs = [(f"{signal}_{end}", f"force_{end}") for signal in signals for end in ("front", "rear")]
    bounds = share * np.array([[-120e3, 120e3]] * 2 + [[-3e3, 3e3]] * 2)

    def rms(name):
        return sc.RoadRms(road, {name: 1.0}, lags)

    idle = [sc.TuningProblem(car.plant(), pairs, rms(name), bounds).passive_value for name in limited]
    objective = {
        "rms": lambda: sc.RoadRms(road, comfort, lags),
        "peak": lambda: sc.BandPeak((1, 100), comfort, lags),
    }
    limits = [sc.Limit(rms(name), 1.1 * value) for name, value in zip(limited, idle, strict=True)]
    return sc.TuningProblem(
        car.plant(), pairs, objective[kind](), bounds, (0.001, 0.5),
        limits=limits, delay_tolerance=0.1, worst_case_delays=True,
    )  # fmt: skip


def tune(options):
    for kind in ("rms", "peak"):
        for share in (0.3, 0.5, 1.0):
            problem = tuning_problem(kind, share)
            seconds, best = timed(lambda problem=problem: sc.tune(problem, particles=20, iterations=15))
            name = f"tune {kind}, box {share:g}, proven {problem.proven}"
            print(
                f"{name:34s} {seconds:8.3f} s  J {best.fun!r}, passive {problem.passive_value:.6g}",
                flush=True,
            )


ROWS = {
    "smith": smith,
    "random": random,
    "large": large,
    "h2": h2,
    "map": stability_map,
    "half_car": half_car,
    "tune": tune,
}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--row", choices=ROWS, action="append")
    parser.add_argument("--systems", type=int, default=60)
    parser.add_argument("--states", type=int, nargs="*", default=[100, 200, 400])
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in options.row or ROWS:
        ROWS[name](options)


if __name__ == "__main__":
    main()
