"""Time, memory and error of exact simulations of the half car's loop, each in a fresh process.

    python tests/benchmarks/simulation.py [task ...]

Processor time counts one thread (OMP_NUM_THREADS=1), the best of several runs for short tasks; memory is the peak of
the whole process, Python and libraries included. The error is the one the response estimates, relative to each
output's peak, the worst of all outputs.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from half_car_loops import LAG, half_car_loop, road_inputs

import susp_ctrl as sc

LAGS = {"road_front": 0.0, "road_rear": LAG}
SHORT, LONG = np.arange(20_001) * 1e-3, np.arange(1_000_001) * 1e-3
RANDOM = sc.RandomRoad(iso_class="C", speed=20.0, seed=1)


def walk(count, scale=1e-4):
    """A rough profile that costs nothing to make."""
    return np.cumsum(np.random.default_rng(0).standard_normal(count)) * scale


def sampled(times, hold="linear"):
    profile = walk(times.size)
    inputs = {"road_front": profile, "road_rear": np.roll(profile, 138)}
    return lambda: sc.simulate(half_car_loop(), times, inputs, hold=hold)


def uneven(count):
    steps = np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, count)
    return sampled(np.append(0.0, np.cumsum(steps)))


def measured(interpolation):
    distance = np.arange(0.0, 801.0, 0.05)
    road = sc.MeasuredRoad(
        distance=distance, elevation=walk(distance.size, 1e-3), speed=20.0, interpolation=interpolation
    )
    return lambda: sc.simulate(half_car_loop(), np.arange(0.0, 40.0, 1e-3), road.inputs(LAGS))


def approximated(method, order):
    inputs = {"road_front": lambda t: 0.05 * np.sin(7.0 * t)}
    times = np.arange(10_001) * 2e-3
    return lambda: sc.simulate(half_car_loop(), times, inputs, method=method, order=order)


TASKS = {
    "20 s at 1 ms, harmonic road": lambda: lambda: sc.simulate(half_car_loop(), SHORT, road_inputs()),
    "20 s at 1 ms, 300 sines": lambda: lambda: sc.simulate(half_car_loop(), SHORT, RANDOM.inputs(LAGS)),
    "20 s at 1 ms, samples joined by lines": lambda: sampled(SHORT),
    "20 s at 1 ms, samples held": lambda: sampled(SHORT, "zero"),
    "20 000 uneven samples": lambda: uneven(20_000),
    "40 s, road measured every 5 cm, cubic": lambda: measured("cubic"),
    "40 s, road measured every 5 cm, linear": lambda: measured("linear"),
    "1000 s at 1 ms, harmonic road": lambda: lambda: sc.simulate(half_car_loop(), LONG, road_inputs()),
    "1000 s at 1 ms, 300 sines": lambda: lambda: sc.simulate(half_car_loop(), LONG, RANDOM.inputs(LAGS)),
    "1000 s at 1 ms, samples joined by lines": lambda: sampled(LONG),
    "1000 s at 1 ms, samples held": lambda: sampled(LONG, "zero"),
    "20 s at 2 ms, Padé order 10": lambda: approximated("pade", 10),
    "20 s at 2 ms, Padé order 30": lambda: approximated("pade", 30),
    "20 s at 2 ms, Padé order 60": lambda: approximated("pade", 60),
    "20 s at 2 ms, spectral order 30": lambda: approximated("spectral", 30),
}


def measure(task):
    """Processor time (s), wall time (s), peak memory (GB) and estimated relative error of a task, in this process."""
    run = TASKS[task]()
    repeat = 1 if task.startswith("1000") else 5
    spent, passed = [], []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.PadeOrderWarning)
        for _ in range(repeat):
            wall, processor = time.perf_counter(), time.process_time()
            response = run()
            spent.append(time.process_time() - processor)
            passed.append(time.perf_counter() - wall)
    peak = np.max(np.abs(response.outputs), axis=1)
    error = float(np.max(response.error_estimate / np.where(peak > 0.0, peak, np.inf)))
    return min(spent), min(passed), peak_memory(), error


def peak_memory():
    """Largest resident memory of this process (GB)."""
    status = Path("/proc/self/status")
    if status.exists():  # ru_maxrss would be that of the calling process, if it was larger
        line = next(one for one in status.read_text().splitlines() if one.startswith("VmHWM"))
        return int(line.split()[1]) / 1e6
    # kilobytes on most systems, bytes on macOS
    unit = 1e9 if sys.platform == "darwin" else 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def measured_apart(task):
    """`measure` in a fresh process."""
    printed = subprocess.run(
        [sys.executable, __file__, "--one", task], capture_output=True, text=True, check=True
    )
    return tuple(float(word) for word in printed.stdout.split())


def main(arguments):
    if arguments[:1] == ["--one"]:
        print(*measure(arguments[1]))
        return
    print(f"{'task':<42}{'processor':>12}{'wall':>12}{'memory':>10}  estimated error")
    for task in arguments or TASKS:
        spent, passed, memory, error = measured_apart(task)
        print(
            f"{task:<42}{1e3 * spent:>9.1f} ms{1e3 * passed:>9.1f} ms{memory:>7.2f} GB  {error:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
