"""Exact frequency response, roots, sweep and map of the half car beside what one would write without this package.

    python tests/benchmarks/delay_systems.py [--points 10000] [--grid 200] [--sample 200] [--repeat 5]

Every peer runs in the same process on the same loop, and its difference from the package's result is printed beside
its time. What would take too long is run on a random part and scaled up; the table says so. Set OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import control
import numpy as np
import oracles
from delay_oracles import full_state_roots
from half_car_loops import DELAYS, GAINS, half_car_loop

import susp_ctrl as sc

# Gains (N/m) at which the half car loses stability for some delays; under the published ones it never does.
STRONG = (300e3, -150e3)
ROADS = ["road_front", "road_rear"]
# Fastest roots that matter (rad/s), wheel hop at either gain: the order of a Chebyshev approximation follows.
FASTEST = {GAINS: 75.0, STRONG: 120.0}


def best_of(run, repeat):
    """Shortest processor time (s) of several runs, and the result; with one thread it is that of an idle machine."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        result = run()
        times.append(time.process_time() - start)
    return min(times), result


def state_matrices(gains):
    """A[0] and the delayed A[1], A[2], from the plant's own matrices."""
    plant = sc.HalfCar().plant()
    A = [np.asarray(plant.A)]
    for gain, wheel in zip(gains, ("front", "rear"), strict=True):
        into = np.asarray(plant.B)[:, plant.input_labels.index(f"force_{wheel}")]
        out = np.asarray(plant.C)[plant.output_labels.index(f"unsprung_displacement_{wheel}")]
        A.append(gain * np.outer(into, out))
    return A


def chebyshev_order(gains, delays):
    """Order at which the full state over the longest delay has the wheel-hop roots right to some 1e-4 rad/s."""
    return int(0.5 * FASTEST[gains] * max(delays)) + 14


class Table:
    """Rows of what was done, by whom, in what time, and how far from the exact result; printed as they come."""

    def __init__(self):
        self.ours = np.nan
        print(f"{'task':<56}{'by':<48}{'time':>12}{'ratio':>10}  difference")

    def row(self, task, by, seconds, difference="", ours=False):
        if ours:
            self.ours = seconds
        ratio = "" if ours else f"{seconds / self.ours:.1f} x"
        shown = f"{1e3 * seconds:.2f} ms" if seconds < 10.0 else f"{seconds:.1f} s"
        print(f"{task:<56}{by:<48}{shown:>12}{ratio:>10}  {difference}", flush=True)


def full_state_count(gains, delays):
    """Roots with positive real part, by the peer."""
    roots = full_state_roots(state_matrices(gains), delays, chebyshev_order(gains, delays))
    return int(np.sum(roots.real > 0.0))


def frequency_response(table, points, repeat):
    loop = half_car_loop()
    roads = loop[:, ROADS]
    omega = np.geomspace(0.1, 100.0, points)
    task = f"{points} frequencies, {roads.noutputs} outputs x 2 roads"
    spent, exact = best_of(lambda: roads(1j * omega), repeat)
    table.row(task, "susp_ctrl, exact", spent, ours=True)
    peak = np.abs(exact).max(axis=-1)
    ride = [loop.output_labels.index(name) for name in oracles.RIDE_OUTPUTS]

    def by_four():
        return np.array([oracles.ride_response(1j * w, GAINS, DELAYS) for w in omega])

    spent, value = best_of(by_four, 1)
    error = np.max(np.abs(np.moveaxis(value, 0, -1) - exact[ride]).max(axis=-1) / peak[ride])
    table.row("", "loop of 4 x 4 solves (8 outputs)", spent, f"{error:.1e}")

    plant, A = sc.HalfCar().plant(), state_matrices(GAINS)
    inputs = [plant.input_labels.index(name) for name in ROADS]
    B, C, D = np.asarray(plant.B)[:, inputs], np.asarray(plant.C), np.asarray(plant.D)[:, inputs]
    force = [plant.input_labels.index(f"force_{wheel}") for wheel in ("front", "rear")]
    wheel = [plant.output_labels.index(f"unsprung_displacement_{wheel}") for wheel in ("front", "rear")]
    direct = np.asarray(plant.D)[:, force]

    def by_eight():
        values = []
        for w in omega:
            E = np.array(GAINS) * np.exp(-1j * w * np.array(DELAYS))
            x = np.linalg.solve(
                1j * w * np.eye(8) - A[0] - sum(a * e / g for a, e, g in zip(A[1:], E, GAINS, strict=True)), B
            )
            values.append(C @ x + D + (direct * E) @ (C[wheel] @ x))
        return np.array(values)

    spent, value = best_of(by_eight, 1)
    error = np.max(np.abs(np.moveaxis(value, 0, -1) - exact).max(axis=-1) / peak)
    table.row("", "loop of 8 x 8 solves", spent, f"{error:.1e}")

    order = int(0.5 * omega[-1] * max(DELAYS)) + 8
    pade = loop.pade(order)[:, ROADS]
    few = omega if points <= 1000 else omega[:: points // 1000]
    part, value = best_of(lambda: control.frequency_response(pade, few).complex, 1)
    where = np.searchsorted(omega, few)
    error = np.max(np.abs(value - exact[..., where]).max(axis=-1) / peak)
    scaled = "" if few.size == points else f", from {few.size} points"
    table.row("", f"python-control, Padé {order}{scaled}", part * points / few.size, f"{error:.1e}")


def rightmost_roots(table, repeat):
    for gains, name in ((GAINS, "published gains"), (STRONG, "300 and -150 kN/m")):
        loop, A = half_car_loop(gains=gains), state_matrices(gains)
        spent, roots = best_of(lambda loop=loop: sc.characteristic_roots(loop, 8), 3 * repeat)
        table.row(f"8 rightmost roots, {name}", "susp_ctrl, confirmed by the count", spent, ours=True)
        enough = chebyshev_order(gains, DELAYS)
        for order in (enough - 12, enough, enough + 10):
            spent, found = best_of(lambda A=A, order=order: full_state_roots(A, DELAYS, order), repeat)
            error = np.max(np.min(np.abs(roots[:, None] - found), axis=1))
            table.row("", f"full state, Chebyshev order {order}, eigenvalues", spent, f"{error:.1e} rad/s")


def sweeps(table, repeat, sample):
    rng = np.random.default_rng(0)
    lines = (
        (GAINS, (1.0, 1.0), "published gains, equal delays"),
        (STRONG, (1.0, 1.0), "300 and -150 kN/m, equal delays"),
        (STRONG, DELAYS, "300 and -150 kN/m, delays in proportion"),
    )
    for gains, direction, name in lines:
        loop = half_car_loop(gains=gains)
        run = lambda loop=loop, direction=direction: sc.sweep_delays(loop, direction, up_to=1.0)  # noqa: E731
        spent, sweep = best_of(run, repeat)
        assert sweep.decided
        table.row(f"sweep to 1 s: {name}", f"susp_ctrl, {len(sweep.crossings)} crossings", spent, ours=True)
        taus = rng.uniform(0.005, 1.0, max(4, sample // 10))

        def counts(gains=gains, direction=direction, taus=taus):
            return np.array([full_state_count(gains, tau * np.array(direction)) for tau in taus])

        spent, number = best_of(counts, 1)
        differ = int(np.sum(number != sweep.unstable_roots(taus)))
        table.row(
            "",
            f"200 delays, full state (from {taus.size})",
            spent * 200 / taus.size,
            f"{differ} of {taus.size} differ",
        )


def stability_map(table, grid, sample, repeat):
    loop = half_car_loop(gains=STRONG)
    spent, mapped = best_of(lambda: sc.stability_map(loop, tau1=(0.0, 1.0), tau2=(0.0, 1.0)), repeat)
    assert mapped.decided
    number = f"{len(mapped.regions)} regions, {len(mapped.curves)} segments"
    table.row("map of [0, 1] x [0, 1] s", f"susp_ctrl, {number}", spent, ours=True)
    axis = (np.arange(grid) + 0.5) / grid
    points = axis[np.random.default_rng(1).integers(0, grid, (sample, 2))]

    def rightmost(point):
        return sc.spectral_abscissa(loop.with_delays(point)) > 0.0

    def unstable(number):
        return number > 0

    peers = (
        ("susp_ctrl, rightmost root", points, rightmost, unstable),
        (
            "susp_ctrl, argument principle",
            points,
            lambda p: sc.count_unstable_roots(loop.with_delays(p)),
            int,
        ),
        ("full state, all roots", points[: max(4, sample // 5)], lambda p: full_state_count(STRONG, p), int),
    )
    for name, tried, run, wanted in peers:
        spent, found = best_of(lambda run=run, tried=tried: [run(point) for point in tried], 1)
        away = [point for point in range(len(tried)) if mapped.distance(*tried[point]) > 1e-4]
        differ = sum(found[k] != wanted(int(mapped.unstable_roots(*tried[k]))) for k in away)
        table.row(
            f"  {grid} x {grid} grid, scaled from {len(tried)} points",
            name,
            spent * grid**2 / len(tried),
            f"{differ} of {len(away)} off the curves differ",
        )


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10_000, help="frequencies")
    parser.add_argument("--grid", type=int, default=200, help="grid of the peer of the map, per axis")
    parser.add_argument("--sample", type=int, default=200, help="points of that grid that are really run")
    parser.add_argument("--repeat", type=int, default=5, help="runs of which the fastest counts")
    given = parser.parse_args(arguments)
    table = Table()
    frequency_response(table, given.points, given.repeat)
    rightmost_roots(table, given.repeat)
    sweeps(table, given.repeat, given.sample)
    stability_map(table, given.grid, given.sample, given.repeat)


if __name__ == "__main__":
    main()
