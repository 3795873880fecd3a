"""Inputs and histories are what the caller gave, however short their features, and work has a bound."""

from __future__ import annotations

import warnings

import control
import control as ct
import numpy as np
import pytest
from half_car_loops import half_car_loop, relative

import susp_ctrl as sc
from susp_ctrl.delay_systems.integrators import refinement

DELAY = 0.3


def late_lag():
    """1/(s + 1) after a delay."""
    return sc.delay(DELAY) * ct.tf([1.0], [1.0, 1.0])


def response_to_pulse(t, start, width, height):
    rise = [1.0 - np.exp(-np.clip(t - DELAY - begin, 0.0, None)) for begin in (start, start + width)]
    return height * (rise[0] - rise[1])


def pulse(start, width, height):
    return lambda t: np.where((t >= start) & (t < start + width), height, 0.0)


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("start", "width", "seen"),
    [(3.3371, 5e-3, "25 times"), (7.77, 2e-4, "one time"), (1.5117, 11e-3, ""), (6.1, 2e-3, "resolution")],
)
def test_pulse_that_nobody_announces_is_found(start, width, seen):
    """By the user's times in it, by looks a thousandth of the run apart, or as far apart as is asked."""
    inside = {"25 times": start + width * np.linspace(0.02, 0.98, 25), "one time": [start + 0.3 * width]}
    t = np.unique(np.concatenate([np.linspace(0.0, 10.0, 41), inside.get(seen, [])]))
    options = {"resolution": 1.9e-3} if seen == "resolution" else {}
    given = pulse(start, width, 200.0)
    response = sc.simulate(late_lag(), t, given, **options)
    exact = response_to_pulse(t, start, width, 200.0)
    assert np.max(np.abs(response.outputs - exact)) < 3e-8 * np.max(exact)
    np.testing.assert_array_equal(response.inputs, given(t))


@pytest.mark.property
def test_smooth_bump_as_a_plain_callable_is_that_of_the_road():
    sys, t = half_car_loop(), np.arange(0.0, 3.0, 0.01)
    bump = sc.BumpRoad(height=0.1, length=0.6, speed=20.0)
    announced = sc.simulate(sys, t, bump.inputs({"road_front": 1.0137}))
    plain = sc.simulate(sys, t, {"road_front": lambda t: bump.profile(t, lag=1.0137)})
    assert relative(plain.outputs[:8], announced.outputs[:8]) < 1e-7
    np.testing.assert_array_equal(plain.inputs[0], bump.profile(t, lag=1.0137))


@pytest.mark.property
def test_pulse_between_announced_kinks_is_found():
    """More than a hundred kinks take another march, which holds the callable against its quadrature."""
    t = np.sort(np.append(np.linspace(0.0, 4.0, 81), 2.0123))
    kinks = np.arange(1, 160) * 0.025

    def rough(s):
        return np.interp(s, np.append(0.0, kinks), np.cos(7.0 * np.append(0.0, kinks)))

    def rough_with_pulse(s):
        return rough(s) + pulse(2.0123 - 1e-6, 2e-6, 1e4)(s)

    rough.breakpoints = rough_with_pulse.breakpoints = kinks
    both, alone = (sc.simulate(late_lag(), t, given).outputs for given in (rough_with_pulse, rough))
    # a rectangle that the delay has smoothed once: what is left is its area
    assert abs(np.max(both - alone) - 0.02) < 2e-3


@pytest.mark.analytical
@pytest.mark.parametrize("rtol", [1e-6, 1e-11])
def test_jump_in_a_history_is_found_and_its_error_told(rtol):
    """x' = x(t - 1): the past acts by its integral."""
    sys = sc.DelayLTI.from_state_delays([[[0.0]], [[1.0]]], [1.0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        response = sc.simulate(sys, [0.5, 0.9], history=pulse(-0.4303, 2.5e-3, 30.0), rtol=rtol)
    error = np.max(np.abs(response.outputs - [0.0, 0.075]))
    assert error < max(1e-9, 0.1 * rtol)
    # both are chance: where in its last cell the jump lies
    assert error <= 30.0 * response.error_estimate[0] + 1e-15


@pytest.mark.analytical
@pytest.mark.parametrize("centre", [0.3, 2.2, 5.0])
@pytest.mark.parametrize("size", [1.0, 1e-290, 1e200])
def test_tails_that_vanish_take_no_work(centre, size, monkeypatch):
    """A Gaussian of width 0.02 s: its area goes into the lag. Values down to the least number there is."""
    monkeypatch.setattr(refinement, "_MOST_WORK", (600, 0))
    t = np.linspace(0.0, 10.0, 501)
    given = lambda t: size * np.exp(-0.5 * ((t - centre) / 0.02) ** 2)  # noqa: E731
    y = sc.simulate(late_lag(), t, given).outputs / size
    late = t > centre + DELAY + 0.2
    area = 0.02 * np.sqrt(2.0 * np.pi) * np.exp(0.5 * 0.02**2)
    np.testing.assert_allclose(y[late], area * np.exp(-(t[late] - centre - DELAY)), rtol=1e-7)
    sc.simulate(half_car_loop(), t, {"road_front": given})


def test_rough_input_meets_a_bound_and_says_so(monkeypatch):
    monkeypatch.setattr(refinement, "_MOST_WORK", (3000, 30))
    t = np.linspace(0.0, 2.0, 201)
    rough = lambda t: np.sin(300.0 * t) * np.abs(np.sin(777.0 * t)) ** 0.3  # noqa: E731
    with pytest.raises(sc.TooMuchWorkError, match=r"cells.*breakpoints.*rtol"):
        sc.simulate(half_car_loop(), t, {"road_front": rough}, rtol=1e-6)


def test_delay_of_a_nanosecond_is_no_delay():
    t = np.linspace(0.0, 3.0, 61)
    bent = lambda t: np.abs(np.sin(5.0 * t)) * 0.02  # noqa: E731
    late, prompt = (
        sc.simulate(
            half_car_loop(delays=(d, d)), t, {"road_front": bent}, breakpoints=np.pi / 5 * np.arange(1, 5)
        )
        for d in (1e-9, 0.0)
    )
    assert relative(late.outputs[:8], prompt.outputs[:8]) < 1e-6


def test_arguments_that_contradict_are_refused():
    def wave(t):
        return np.sin(3.0 * t)

    wave.sines = ([3.1], [1.0], [0.0])
    with pytest.raises(sc.InputError, match="sines"):
        sc.simulate(late_lag(), [0.0, 1.0], wave)
    for resolution in (0.0, -1.0, 1e-9, np.nan):
        with pytest.raises(sc.InputError, match="resolution"):
            sc.simulate(late_lag(), [0.0, 1.0], np.sin, resolution=resolution)


@pytest.mark.property
@pytest.mark.parametrize("method", ["exact", "pade"])
def test_response_at_other_times(method):
    sys, t = half_car_loop(), np.arange(201) * 0.01
    samples = np.cumsum(np.random.default_rng(2).standard_normal(t.size)) * 1e-3
    inputs = {"road_front": samples, "road_rear": lambda t: 0.01 * np.sin(9.0 * t)}
    order = 6 if method == "pade" else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.PadeOrderWarning)
        response = sc.simulate(sys, t, inputs, method=method, order=order)
    again = response.at(t[::7])
    assert relative(again.outputs, response.outputs[:, ::7]) < 1e-9
    between = response.at([0.333, 1.2345]).inputs
    np.testing.assert_allclose(between[0], np.interp([0.333, 1.2345], t, samples), rtol=1e-12)
    with pytest.raises(sc.InputError, match="timepts"):
        response.at([1.0, 2.5])


@pytest.mark.analytical
@pytest.mark.parametrize("rtol", [1e-11, 1e-10, 1e-8])
def test_an_output_time_on_a_kink_that_nobody_announces(rtol):
    """x' = 0.9 x + |t - 1.1|: cells around the kink are some roundings long, and an output time lies there."""
    t = np.array([1.0, 1.1, 1.2])
    found = sc.simulate(control.ss(0.9, 1.0, 1.0, 0.0), t, lambda s: np.abs(s - 1.1), rtol=rtol)
    known = sc.simulate(
        control.ss(0.9, 1.0, 1.0, 0.0), t, lambda s: np.abs(s - 1.1), rtol=rtol, breakpoints=[1.1]
    )
    a = 0.9
    before = ((a * 1.1 - 1.0) * np.exp(a * 1.1) + 1.0) / a**2  # int_0^1.1 e^{a(1.1-s)} (1.1-s) ds
    for response in (found, known):
        assert np.ravel(response.outputs)[1] == pytest.approx(before, rel=1e-8)
