"""Every pair of options of `simulate` against collocation, which shares no step with the marches.

The oracle is told all kinks, and continues no run: it takes the whole of it.
"""

from __future__ import annotations

import warnings

import collocation
import numpy as np
import pytest
import simulation_axes as axes

import susp_ctrl as sc

QUICK = 20
SLOW = {"half car", "many states", "function with a pulse", "geometric", "spectral", 1e-11}


def history_of(kind, n):
    """What simulate is given, and the same with its kinks announced."""
    constant = 0.1 * np.cos(np.arange(n))
    if kind in ("constant", "continued"):
        return constant, constant
    if kind in ("none", "steady"):
        return (None if kind == "none" else kind,) * 2
    pulses = kind == "function with a pulse"

    def function(t):
        hit = 30.0 * ((t > -0.1011) & (t < -0.0987)) * pulses
        return 0.1 * np.cos(np.outer(1.0 + np.arange(n), t)) + hit

    return function, axes.announced(function, -0.1011, -0.0987) if pulses else function


def values_of(given, times):
    rng = np.random.default_rng(11)
    return rng.standard_normal(times.size) if isinstance(given, str) else given


def delayed_start(given, samples, times, hold):
    """An input that is zero before `axes.LATER`."""
    if given is None:
        return None
    kinks = [axes.LATER, *getattr(given, "breakpoints", ())]
    if isinstance(given, str):
        kinks += list(times)
        if hold == "linear":
            given = lambda t: np.interp(t, times, samples)  # noqa: E731
        else:
            given = lambda t: samples[np.clip(np.searchsorted(times, t, side="right") - 1, 0, None)]  # noqa: E731
    value = given if callable(given) else (lambda t: np.full(t.shape, given))
    return axes.announced(lambda t: np.where(t >= axes.LATER, value(t), 0.0), *kinks)


def misses(case):
    """What is wrong with one case; empty where nothing is."""
    plant, kind, when, history, way, rtol = case
    sys, times = axes.PLANTS[plant](), axes.TIMES[when]
    given, told = axes.INPUTS[kind]
    label, n = sys.input_labels[0], sys.nstates
    hold = given if isinstance(given, str) else "linear"
    before, told_before = history_of(history, n)
    options = {"hold": hold, "rtol": rtol}
    if history == "continued":
        first = sc.simulate(sys, [0.0, axes.LATER], history=before, rtol=rtol)
        times = times + axes.LATER
        before = first
    samples = values_of(given, times)
    inputs = None if given is None else {label: samples if isinstance(given, str) else given}
    known = None if told is None else {label: samples if isinstance(given, str) else told}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.PadeOrderWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        if way == "many together":
            ours = sc.simulate_many([sys], times, [inputs], history=before, **options)[0]
        elif way == "exact":
            ours = sc.simulate(sys, times, inputs, history=before, **options)
        else:
            order = 4 if way == "pade" else 6
            ours = sc.simulate(sys, times, inputs, method=way, order=order, **options)
            sys = axes.ordinary(sys, way, order)
    if history == "continued":
        known = None if told is None else {label: delayed_start(told, samples, times, hold)}
    reference = collocation.simulate(sys, times, known, hold=hold, history=told_before)
    found, exact = (np.atleast_2d(np.asarray(r.outputs)) for r in (ours, reference))
    # an input that jumps at an output time has two values there
    jumps = np.isin(times, np.asarray(getattr(told, "breakpoints", ()), dtype=float))
    jumps |= hold == "zero"
    peak = np.max(np.abs(exact), axis=1)
    state = np.max(np.abs(np.asarray(ours.states) - reference.states), axis=1, initial=0.0)
    sizes = np.max(np.abs(reference.states), axis=1, initial=0.0)
    state = state / np.maximum(sizes, 1e-12 + 1e-4 * np.max(sizes, initial=0.0))
    error = np.max(np.abs(found - exact)[:, ~jumps], axis=1, initial=0.0)
    # kinks that nobody announces leave an error that the estimate holds only to a factor
    factor = 30.0 if "nobody announces" in kind else 10.0
    allowed = np.maximum((factor * rtol + 1e-10) * peak, 2.0 * ours.error_estimate) + 1e-13
    wrong = []
    if np.any(error > allowed):
        wrong.append(f"outputs off by {np.max(error / np.where(peak > 0, peak, 1)):.1e}")
    if np.any(ours.error_estimate > (100.0 * rtol + 1e-5) * peak + 1e-13):
        wrong.append(f"error estimate {np.max(ours.error_estimate):.1e}")
    if np.max(state, initial=0.0) > 1e3 * rtol + 1e-8:
        wrong.append(f"states off by {np.max(state):.1e}")
    u = np.atleast_2d(ours.inputs)[0]
    if callable(given) and not np.allclose(u, given(times), rtol=1e-12, atol=1e-14):
        wrong.append("inputs are not those given")
    if isinstance(given, str) and not np.array_equal(u, samples):
        wrong.append("inputs are not the samples")
    return wrong


def failures(cases):
    found = []
    for case in cases:
        try:
            wrong = misses(case)
        except (
            sc.TooMuchWorkError
        ) as refusal:  # more than a hundred samples with delays of them, at the tightest rtol
            wrong = [] if case[-1] <= 1e-11 else [repr(refusal)]
        except Exception as problem:  # a crash is a failure like others, told with its case
            wrong = [repr(problem)]
        found += [f"{case}: {'; '.join(wrong)}"] if wrong else []
    return "\n".join(found)


@pytest.mark.property
def test_richest_pairs_agree_with_collocation():
    assert not failures([case for case in axes.pairs() if not SLOW & set(case)][:QUICK])


@pytest.mark.slow
@pytest.mark.property
@pytest.mark.parametrize("plant", axes.AXES["plant"])
def test_all_pairs_agree_with_collocation(plant):
    assert not failures([case for case in axes.pairs() if case[0] == plant])


def test_every_pair_is_there():
    cases = axes.pairs()
    for k in range(len(axes.AXES)):
        assert {case[k] for case in cases} == set(list(axes.AXES.values())[k])


@pytest.mark.analytical
@pytest.mark.parametrize("method", ["exact", "pade"])
@pytest.mark.parametrize("times", [[2.0], [0.0, 1.0, 2.0]])
def test_a_jump_at_the_last_instant_is_seen_there(method, times):
    """y = x + 10 u, u a step at t = 2: the last output is the one after the jump, whatever ends there."""
    lag = sc.DelayLTI.from_state_delays([[[-1.0]], [[0.5]]], [0.3], [[1.0]], [[1.0]], [[10.0]])
    step = {"sys": lag, "timepts": times, "method": method}
    assert sc.simulate(**step, inputs=lambda t: 1.0 * (t >= 2.0)).y[0, -1] == pytest.approx(10.0)
    assert sc.simulate(**step, inputs=lambda t: 1.0 * (t >= 2.0), breakpoints=[2.0]).y[
        0, -1
    ] == pytest.approx(10.0)


def test_a_held_sample_at_the_end_and_a_delayed_jump_that_arrives_there():
    held = np.array([0.0, 0.0, 500.0])
    force = sc.simulate(sc.QuarterCar().plant(), [0.0, 0.1, 0.2], {"force": held}, hold="zero")
    assert force.y[list(force.output_labels).index("actuator_force"), -1] == 500.0
    late = sc.simulate(sc.delay(1.0), [0.0, 1.0, 2.0], np.array([0.0, 1.0, 1.0]), hold="zero")
    assert late.y[0].tolist() == [0.0, 0.0, 1.0]
