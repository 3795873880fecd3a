"""Everything that a simulation can be asked, one axis for each argument: a new option joins the list of its axis.

`pairs` chooses cases in which every value of one axis meets every value of every other, as far as `FORBIDDEN` allows.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import control as ct
import numpy as np
from half_car_loops import half_car_loop

import susp_ctrl as sc
from susp_ctrl.delay_systems.approximation.spectral import spectral_approximation

STEP, END = 0.05, 2.0  # of the uniform output times (s)
LATER = 0.8  # where a continued run begins (s)


def oscillator(delay, gain=-1.5):
    plant = ct.ss([[0.0, 1.0], [-4.0, -0.4]], [[0.0, 0.0], [1.0, 1.0]], np.eye(2), np.zeros((2, 2)),
                  inputs=["u", "f"], outputs=["y", "v"])  # fmt: skip
    return sc.close_loop(plant, [sc.FeedbackChannel("y", "f", gain=gain, delay=delay)])


def chain(masses=5):
    """Masses in a row, each tied to the next, the last one fed back late to the first."""
    stiff = 30.0 * (2.0 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1))
    A = np.block([[np.zeros((masses, masses)), np.eye(masses)], [-stiff, -0.05 * stiff]])
    A1 = np.zeros_like(A)
    A1[masses, masses - 1] = -8.0
    B = np.eye(2 * masses)[:, [masses]]
    return sc.DelayLTI.from_state_delays([A, A1], [0.31], B=B, C=np.eye(2 * masses)[:masses])


PLANTS = {
    "no delay": lambda: sc.DelayLTI(ct.ss([[0.0, 1.0], [-4.0, -0.4]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])),
    "zero delay": lambda: oscillator(0.0),
    "zero gain": lambda: oscillator(0.3, gain=0.0),
    "delay shorter than the step": lambda: oscillator(0.013),
    "delay of one step": lambda: oscillator(STEP),
    "long delay": lambda: oscillator(0.43),
    "delay of a nanosecond": lambda: oscillator(1e-9),
    "several delays": lambda: sc.DelayLTI.from_state_delays(
        [[[-0.3]], [[-1.1]], [[0.4]]], [0.31, 0.1 * np.sqrt(2.0)], B=[[1.0]], input_terms=[([[2.0]], 0.37)]
    ),
    "many states": chain,
    "stiff": lambda: sc.DelayLTI.from_state_delays(
        [[[-2e3, 0.0], [1.0, -1.0]], [[0.0, -900.0], [0.0, 0.0]]], [0.21], B=[[2e3], [0.0]]
    ),
    "unstable": lambda: sc.DelayLTI.from_state_delays([[[0.9]], [[0.8]]], [0.17], B=[[1.0]]),
    "defective": lambda: sc.DelayLTI.from_state_delays(
        [np.diag(np.ones(2), 1) - np.eye(3), -0.5 * np.eye(3)[:, [2]] @ np.eye(3)[[0]]],
        [0.27],
        B=np.eye(3)[:, [2]],
    ),
    "integrator": lambda: sc.feedback(2.0 * sc.delay(0.23) * ct.tf([1.0], [1.0, 0.0]), 1),
    "feedthrough": lambda: sc.feedback(
        ct.tf([1.0, 2.0], [1.0, 1.0]), sc.delay(0.19) * ct.tf([1.0], [0.5, 1.0])
    ),
    "delayed input": lambda: sc.delay(0.3) * sc.delay(0.25) * ct.tf([1.0, 3.0], [1.0, 1.0]),
    "half car": lambda: half_car_loop(delays=(0.21, 0.1234)),
}


def ordinary(sys, way, order):
    """The approximation that `simulate` takes."""
    return sys.pade(order) if way == "pade" else spectral_approximation(sys, order)


def announced(function, *times):
    def signal(t):
        return function(t)

    signal.breakpoints = times
    return signal


def pulse(t):
    return np.where((t >= 1.2345) & (t < 1.2395), 20.0, 0.0)


def bent(t):
    return np.abs(np.sin(3.0 * t)) - (t > 1.1)


def smooth(t):
    return np.exp(-((t - 1.3) ** 2)) * np.cos(4.0 * t)


SPEED = 20.0
RECORD = np.random.default_rng(4)
DISTANCE = np.arange(301) * 0.2
ELEVATION = np.cumsum(RECORD.standard_normal(301)) * 1e-3
RANDOM = {"iso_class": "C", "speed": SPEED, "seed": 3}
ROADS = {
    "harmonic road": sc.HarmonicRoad(0.05, 7.0),
    "steady harmonic road": sc.HarmonicRoad(0.05, 7.0, steady=True),
    "random road": sc.RandomRoad(bins=40, n_max=0.5, **RANDOM),
    "bump": sc.BumpRoad(height=0.1, length=2.0, speed=SPEED),
    "two tracks": sc.TwoTrackRoad(road=sc.RandomRoad(bins=12, n_max=0.3, **RANDOM), track_width=1.5),
    "filtered noise": sc.FilteredNoiseRoad(speed=SPEED, length=61.0, step=0.4),
    **{
        f"measured, {way}": sc.MeasuredRoad(
            distance=DISTANCE, elevation=ELEVATION, speed=SPEED, interpolation=way
        )
        for way in ("cubic", "linear")
    },
}
# name: (what simulate is given, the same with all its kinks announced); "hold" stands for an array
INPUTS = {
    "nothing": (None, None),
    "number": (0.7, 0.7),
    "samples joined by lines": ("linear", "linear"),
    "samples held": ("zero", "zero"),
    "smooth callable": (smooth, smooth),
    "callable with kinks": (announced(bent, np.pi / 3, 1.1, 2 * np.pi / 3),) * 2,
    "callable with kinks that nobody announces": (bent, announced(bent, np.pi / 3, 1.1, 2 * np.pi / 3)),
    "pulse that nobody announces": (pulse, announced(pulse, 1.2345, 1.2395)),
    **{name: (road.signal(0.138), road.signal(0.138)) for name, road in ROADS.items()},
}
TIMES = {
    "uniform": np.arange(41) * STEP,
    "many uniform": np.arange(126) * 0.016,
    "uneven": np.append(0.0, np.cumsum(np.random.default_rng(1).uniform(0.02, 0.06, 48))),
    "many uneven": np.append(0.0, np.cumsum(np.random.default_rng(2).uniform(0.01, 0.02, 130))),
    "geometric": np.append(0.0, np.geomspace(1e-6, END, 111)),
    "one": np.array([1.7]),
    "not from zero": np.linspace(0.9, 1.9, 21),
}
HISTORIES = ("none", "constant", "function", "function with a pulse", "steady", "continued")
WAYS = ("exact", "many together", "pade", "spectral")
ACCURACIES = (1e-8, 1e-4, 1e-11)

AXES = {
    "plant": tuple(PLANTS),
    "input": tuple(INPUTS),
    "times": tuple(TIMES),
    "history": HISTORIES,
    "way": WAYS,
    "rtol": ACCURACIES,
}
ALL_SINES = {"nothing", "number", "steady harmonic road", "random road", "two tracks"}
FORBIDDEN = [
    # samples begin where the run begins
    ("input", {"samples joined by lines", "samples held"}, "times", {"one", "not from zero"}),
    # a steady motion needs sums of sines and a stable loop without a pole at zero under a constant
    ("input", set(INPUTS) - ALL_SINES, "history", {"steady"}),
    ("plant", {"unstable"}, "history", {"steady"}),
    # approximations have no history; responses are continued one by one
    ("way", {"pade", "spectral"}, "history", set(HISTORIES) - {"none"}),
    ("way", {"many together"}, "history", {"continued"}),
    # poles at 1e10 rad/s are too fast for the intervals of the oracle
    ("way", {"pade", "spectral"}, "plant", {"delay of a nanosecond"}),
    # without an input from rest nothing moves, and nothing is compared
    ("input", {"nothing"}, "history", {"none", "steady"}),
]


@lru_cache
def pairs():
    """Cases, as tuples in the order of `AXES`, that hold every allowed pair of values; the richest first."""
    names, sizes = list(AXES), [len(values) for values in AXES.values()]
    cases = np.indices(sizes, dtype=np.int16).reshape(len(sizes), -1).T
    for one, some, other, more in FORBIDDEN:
        a, b = names.index(one), names.index(other)
        is_one = np.isin(AXES[one], list(some))[cases[:, a]]
        is_other = np.isin(AXES[other], list(more))[cases[:, b]]
        cases = cases[~(is_one & is_other)]
    both = list(combinations(range(len(sizes)), 2))
    offsets = np.concatenate([[0], np.cumsum([sizes[a] * sizes[b] for a, b in both])])
    number = np.stack(
        [offsets[k] + cases[:, a] * sizes[b] + cases[:, b] for k, (a, b) in enumerate(both)], axis=1
    )
    missing = np.zeros(offsets[-1], dtype=bool)
    missing[number.ravel()] = True
    chosen = []
    some = np.random.default_rng(0).permutation(len(cases))
    # few of all cases hold most pairs
    for part in (some[:4000], some):
        left, held = cases[part], number[part]
        while True:
            new = missing[held].sum(axis=1)
            if not np.any(new):
                break
            best = int(np.argmax(new))
            chosen.append(tuple(AXES[name][i] for name, i in zip(names, left[best], strict=True)))
            missing[held[best]] = False
            left, held = left[new > 0], held[new > 0]
    return chosen
