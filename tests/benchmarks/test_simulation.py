"""Exact simulation beside the delay-equation packages of PyPI, at equal or better accuracy.

Needs the extra `bench` and a C compiler: ``pip install .[bench]``, then
``pytest --slow -s tests/benchmarks``. Compile time is not counted. Times are printed, never asserted.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import collocation
import numpy as np
import pytest
from half_car_loops import DELAYS, GAINS, LAG, half_car_loop, relative, road_inputs

import susp_ctrl as sc

T = np.arange(20001) * 1e-3
RIDE = slice(0, 8)

pytestmark = [pytest.mark.slow]


def seconds(run, repeat=5):
    """Best time of several runs, and the last result."""
    best = np.inf
    for _ in range(repeat):
        begin = time.perf_counter()
        result = run()
        best = min(best, time.perf_counter() - begin)
    return best, result


def plant_matrices():
    plant = sc.HalfCar().plant()
    A, B, C = (np.asarray(m) for m in (plant.A, plant.B, plant.C))
    measured = [plant.output_labels.index(f"unsprung_displacement_{w}") for w in ("front", "rear")]
    columns = [plant.input_labels.index(c) for c in ("road_front", "road_rear", "force_front", "force_rear")]
    return A, B[:, columns], C[measured]


@pytest.fixture(scope="module")
def reference():
    return collocation.simulate(half_car_loop(), T, road_inputs()).states


@pytest.fixture(scope="module")
def ours(reference):
    """Time and error of the states alone, which is all that the peers compute; the default run for comparison."""
    sys, inputs = half_car_loop(), road_inputs()
    spent, response = seconds(lambda: sc.simulate(sys, T, inputs), repeat=9)
    print(f"\nsusp_ctrl, {sys.noutputs} outputs, default tolerance: {1e3 * spent:.1f} ms, ", end="")
    print(f"error {relative(response.states, reference):.1e}")
    assert relative(response.states, reference) < 1e-8
    fed_back = [f"unsprung_displacement_{axle}" for axle in ("front", "rear")]
    states = sys[fed_back, ["road_front", "road_rear"]]
    spent, response = seconds(lambda: sc.simulate(states, T, inputs, rtol=1e-6), repeat=9)
    error = relative(response.states, reference)
    print(f"susp_ctrl, states, rtol 1e-6: {1e3 * spent:.1f} ms, error {error:.1e}")
    assert error < 1e-8
    return spent, error


def test_more_accurate_than_jitcdde(ours, reference, tmp_path, monkeypatch):
    """20 s of the paper's loop at 1 ms; the road is a ninth state, so that its rear kink is a delay like others."""
    jitcdde = pytest.importorskip("jitcdde")
    symengine = pytest.importorskip("symengine")
    monkeypatch.chdir(tmp_path)  # its compilation would read the pyproject.toml it finds
    A, B, C = plant_matrices()
    y, t = jitcdde.y, jitcdde.t
    delayed = [sum(C[k, i] * y(i, t - DELAYS[k]) for i in np.flatnonzero(C[k])) for k in range(2)]
    u = [y(8), y(8, t - LAG), GAINS[0] * delayed[0], GAINS[1] * delayed[1]]
    f = [sum(A[i, j] * y(j) for j in range(8)) + sum(B[i, j] * u[j] for j in range(4)) for i in range(8)]
    f.append(0.35 * symengine.cos(7 * t))

    def run(rtol):
        system.purge_past()
        system.constant_past(np.zeros(9))
        system.reset_integrator()
        system.set_integration_parameters(
            rtol=rtol, atol=rtol * 1e-3, first_step=1e-5, max_step=0.05, min_step=1e-14
        )
        begin = time.perf_counter()
        system.step_on_discontinuities()
        first = int(np.searchsorted(T, system.t))
        states = np.array([system.integrate(s)[:8] for s in T[first:]]).T
        return time.perf_counter() - begin, relative(states, reference[:, first:])

    system = jitcdde.jitcdde(f, verbose=False)
    system.compile_C()
    for rtol in (1e-7, 1e-8, 1e-9, 1e-10):
        theirs, error = run(rtol)
        print(f"\njitcdde, rtol {rtol:g}: {theirs:.2f} s, error {error:.1e}")
        if error <= 1e-8:
            break
    print(f"ratio {theirs / ours[0]:.1f}, at {error / ours[1]:.0f} times our error")
    assert error > ours[1]


def test_more_accurate_than_ddeint(ours, reference):
    """ddeint over the first 2 s at 1 ms; it has no error control across kinks."""
    ddeint = pytest.importorskip("ddeint").ddeint
    A, B, C = plant_matrices()
    short = T[:2001]

    def rate(Y, t):
        u = [
            0.05 * np.sin(7.0 * t),
            0.05 * np.sin(7.0 * max(t - LAG, 0.0)),
            *(GAINS[k] * float(C[k] @ Y(t - DELAYS[k])) for k in range(2)),
        ]
        return A @ Y(t) + B @ np.array(u)

    spent, states = seconds(lambda: ddeint(rate, lambda t: np.zeros(8), short), repeat=1)
    error = relative(np.asarray(states).T, reference[:, :2001])
    print(f"\nddeint, 2 s only: {spent:.2f} s, error {error:.1e}")
    assert error > ours[1]


def measured_apart(task):
    """Processor time (s), wall time (s), peak memory (GB) and error of a task of the script, in a fresh process."""
    script = str(Path(__file__).with_name("simulation.py"))
    done = subprocess.run([sys.executable, script, "--one", task], capture_output=True, text=True, check=True)
    return tuple(float(word) for word in done.stdout.split())


@pytest.mark.parametrize(
    "task", [f"1000 s at 1 ms, {road}" for road in ("harmonic road", "300 sines", "samples joined by lines")]
)
def test_million_samples_in_a_gigabyte(task):
    spent, _, memory, error = measured_apart(task)
    print(f"\n{task}: {spent:.2f} s, {memory:.2f} GB, error {error:.1e}")
    assert memory < 1.0
    assert error < 1e-8


@pytest.mark.parametrize(
    "task",
    [
        "20 s at 1 ms, samples joined by lines",
        "40 s, road measured every 5 cm, linear",
        "20 000 uneven samples",
        "20 s at 2 ms, Padé order 30",
    ],
)
def test_runs_with_many_kinks_and_stiff_approximations(task):
    spent, _, _, error = measured_apart(task)
    print(f"\n{task}: {1e3 * spent:.1f} ms, error {error:.1e}")
    assert error < 1e-8
