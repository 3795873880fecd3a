"""Roots, argument principle, sweep and map agree on random systems, and the simulation moves as the roots say.

Each of the four tells the number of unstable roots in its own way. They must not contradict each other anywhere, and
one may leave a number open only where a root really is on the imaginary axis, as far as rounding lets one tell.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from delay_oracles import random_loop, shifted
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc

# A root nearer than this to the axis, relative to the matrices, excuses a method that cannot tell.
NEAR = 1e-8
# Off a curve of the map by this share of the rectangle a number has to be right: curves of channels of one signal
# are closed form, those of delays shared by several signals are traced on a grid.
OFF_CURVES, OFF_TRACED_CURVES = 1e-3, 2e-2


def system_of(A, delays):
    return sc.DelayLTI.from_state_delays(A=A, delays=delays)


def size_of(A):
    return sum(np.linalg.norm(a, 2) for a in A)


def case_of(seed):
    """A random system; every third one with its rightmost root moved to a known, mostly tiny distance."""
    A, delays = random_loop(seed)
    if seed % 3:
        return A, delays, None
    random = np.random.default_rng([seed, 1])
    distance = random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-11.0, -1.0) * size_of(A)
    with warnings.catch_warnings():
        warnings.simplefilter(
            "error", RuntimeWarning
        )  # a rightmost root that is not confirmed is no known distance
        rightmost = sc.spectral_abscissa(system_of(A, delays))
    return shifted(A, delays, rightmost - distance), delays, distance


def check_agreement(seed, largest_map):
    """One system through all methods; the map where its delays act on few enough signals to be quick."""
    A, delays, distance = case_of(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.UndecidedStabilityWarning)
        count = check_verdict(A, delays, distance, seed)
        check_sweep(A, delays, count, seed)
        if delays.size == 2 and sum(np.linalg.matrix_rank(a) for a in A[1:]) <= largest_map:
            check_map(A, delays, count, seed)


def check_verdict(A, delays, distance, seed):
    """Roots, argument principle and sweep inside one verdict, and each asked alone; returns the number agreed."""
    loop, near = system_of(A, delays), NEAR * size_of(A)
    verdict, count = sc.stability(loop), sc.count_unstable_roots(loop)
    on_axis = np.abs(verdict.roots.real) <= near
    answers = {n for n in (*verdict.agreement.values(), count, verdict.unstable_roots) if n is not None}
    if verdict.stable is None or count is None:
        assert np.any(on_axis), verdict
    else:
        assert len(answers) == 1, (verdict, count)
    if seed % 4 == 0 and not np.any(on_axis):
        assert sc.characteristic_roots(loop, right_of=0.0).size == count
    if distance is not None and verdict.stable is not None:
        assert verdict.stable is bool(distance < 0.0), verdict
        assert abs(verdict.abscissa - distance) <= 1e-3 * abs(distance) + near
    return count


def check_sweep(A, delays, count, seed):
    """Along the ray to the delays, or one delay alone: the numbers at the delays and at three other places."""
    loop = system_of(A, delays)
    direction = np.array(delays)
    if seed % 2 == 0:
        direction[np.arange(delays.size) != seed // 2 % delays.size] = 0.0
    start = delays - direction
    sweep = sc.sweep_delays(loop, direction=direction, start=start, up_to=1.2)
    assert sweep.decided, sweep
    if sweep.axis_roots:
        return
    crossed = sweep.crossings["tau"].to_numpy()
    for tau in (1.0, *np.random.default_rng([seed, 2]).uniform(0.0, 1.2, 3)):
        if np.any(np.abs(crossed - tau) < 1e-9):
            continue
        here = count if tau == 1.0 else sc.count_unstable_roots(loop.with_delays(start + tau * direction))
        assert here is None or sweep.unstable_roots(tau) == here, (tau, sweep)
    undelayed = np.linalg.eigvals(sum(A)).real
    known = count is not None and sweep.proven and np.all(np.abs(crossed - 1.0) > 1e-9)
    if not np.any(start) and known and np.all(np.abs(undelayed) > 1e-6 * size_of(A)):
        # the tendencies alone, which know of no count
        passed = int(sweep.crossings["tendency"][crossed < 1.0].sum())
        assert np.sum(undelayed > 0.0) + 2 * passed == count, sweep


def check_map(A, delays, count, seed):
    """Over both delays up to 1.5 of their size: the numbers at the delays and five other points off the curves."""
    loop = system_of(A, delays)
    found = sc.stability_map(loop, tau1=(0.0, 1.5 * delays[0]), tau2=(0.0, 1.5 * delays[1]))
    traced = any(np.linalg.matrix_rank(a) > 1 for a in A[1:])
    if not found.decided:
        assert traced or count is None, found
    size = 1.5 * delays
    near = (OFF_TRACED_CURVES if traced else OFF_CURVES) * np.array(
        [[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]]
    )
    for point in (delays, *np.random.default_rng([seed, 3]).uniform(0.0, 1.0, (5, 2)) * size):
        around = found.unstable_roots(*np.clip(point + near * size, 0.0, size).T)
        if np.ptp(around) or around[0] < 0:
            continue  # beside a curve, or in a region that the map leaves open
        here = count if point is delays else sc.count_unstable_roots(loop.with_delays(point))
        assert here is None or around[0] == here, (point, found)


@pytest.mark.property
@settings(max_examples=30)
@given(st.integers(0, 2**31 - 1))
def test_all_methods_agree(seed):
    check_agreement(seed, largest_map=3)


@pytest.mark.property
@pytest.mark.slow
@settings(max_examples=2000)
@given(st.integers(2**31, 2**32 - 1))
def test_all_methods_agree_on_many_systems(seed):
    check_agreement(seed, largest_map=4)


def check_motion(seed):
    """From a random constant history, once every other root has died away: the rightmost pair alone, at its rate."""
    A, delays, _ = case_of(seed)
    loop = system_of(A, delays)
    roots = sc.characteristic_roots(loop, 3)
    rightmost = roots[0]
    others = roots[2 if rightmost.imag else 1 :]
    gap = rightmost.real - others[0].real
    if gap <= 1e-6 * abs(rightmost):
        return False  # a multiple root
    wait = np.log(1e7) / gap
    if wait > 40.0 * max(delays) or rightmost.real * wait < -12.0:
        return False  # the next root dies away too late, or everything has died away by then
    t = wait + np.linspace(0.0, 2.0 * np.pi / max(abs(rightmost.imag), 1.0 / max(delays)), 60)
    history = np.random.default_rng([seed, 4]).normal(size=len(A[0]))
    x = sc.simulate(loop, t, history=history, rtol=1e-11).states
    motion = np.exp(rightmost * (t - t[0]))
    basis = np.column_stack([motion.real, motion.imag][: 1 + (rightmost.imag != 0.0)])
    rest = x.T - basis @ np.linalg.lstsq(basis, x.T, rcond=None)[0]
    assert np.abs(rest).max() < 1e-4 * np.abs(x).max()
    return True


@pytest.mark.property
@pytest.mark.parametrize("first", [0, pytest.param(100, marks=pytest.mark.slow)])
def test_simulation_moves_at_the_rate_of_the_rightmost_root(first):
    """Ten systems with a dominant root (a hundred in the slow suite), stable and unstable."""
    seen = [check_motion(seed) for seed in range(first, first + (20 if first == 0 else 170))]
    assert sum(seen) >= (10 if first == 0 else 100)


def test_a_crossing_next_to_zero_is_one():
    """A pair that nearly meets at s = 0 leaves few digits of the frequency: its copies are one crossing."""
    A, delays, _ = case_of(3_395_014_272)
    direction = np.array([delays[0], 0.0, 0.0])
    sweep = sc.sweep_delays(system_of(A, delays), direction=direction, start=delays - direction, up_to=1.2)
    assert sweep.decided
    assert sweep.crossings["omega"].to_numpy() == pytest.approx([9.588e-5], rel=1e-3)


def test_a_double_root_that_a_pair_of_starts_stands_for():
    """At 3.8e-10, beside a norm of 7: the discretisation gives a pair that meets on the axis."""
    check_agreement(3_986_143_362, largest_map=0)
