"""Steady motion under sums of sines, and runs that begin on it."""

from __future__ import annotations

import numpy as np
import pytest
from half_car_loops import LAG, half_car_loop, relative

import susp_ctrl as sc

RNG = np.random.default_rng(5)
OMEGAS, AMPLITUDES, PHASES = RNG.uniform(1.0, 90.0, 40), RNG.uniform(0.0, 1e-3, 40), RNG.uniform(0.0, 6.0, 40)


class Sines:
    """Sum of sines that exists for all t."""

    def __init__(self, lag=0.0):
        self.sines = (OMEGAS, AMPLITUDES, PHASES - OMEGAS * lag)

    def __call__(self, t):
        omegas, amplitudes, phases = self.sines
        return np.sin(np.multiply.outer(t, omegas) + phases) @ amplitudes


ROAD = {"road_front": Sines(), "road_rear": Sines(LAG)}


@pytest.mark.analytical
def test_steady_response_is_the_sum_of_phasors():
    sys = half_car_loop()
    H = sys(1j * OMEGAS, squeeze=False)
    for t in (np.linspace(-1.0, 3.0, 1001), np.array([0.0, 0.3, 7.0])):
        phasor = AMPLITUDES * np.exp(1j * PHASES) * (H[:, 0] + H[:, 1] * np.exp(-1j * OMEGAS * LAG))
        expected = np.imag(phasor @ np.exp(1j * np.outer(OMEGAS, t)))
        response = sc.steady_response(sys, t, ROAD)
        assert relative(response.outputs, expected) < 1e-12
        np.testing.assert_allclose(response.inputs[1], Sines(LAG)(t), atol=1e-14)


@pytest.mark.property
def test_run_that_begins_on_the_steady_motion_stays_there():
    sys, t = half_car_loop(), np.linspace(0.0, 4.0, 801)
    steady = sc.steady_response(sys, t, ROAD)
    run = sc.simulate(sys, t, ROAD, history="steady")
    assert relative(run.outputs, steady.outputs) < 1e-9
    assert relative(run.states, steady.states) < 1e-9


@pytest.mark.property
def test_run_from_rest_settles_on_the_steady_motion():
    sys, t = half_car_loop(), np.linspace(20.0, 22.0, 301)
    run = sc.simulate(sys, np.append(0.0, t), ROAD)
    assert relative(run.outputs[:, 1:], sc.steady_response(sys, t, ROAD).outputs) < 1e-8


def test_constant_and_triple_inputs():
    sys = sc.DelayLTI.from_state_delays([[[-1.0]], [[-0.5]]], [0.4], B=[[1.0]])
    t = np.linspace(0.0, 1.0, 5)
    name = sys.input_labels[0]
    np.testing.assert_allclose(sc.steady_response(sys, t, {name: 3.0}).outputs, 2.0, rtol=1e-14)
    triple = sc.steady_response(sys, t, {name: ([2.0], [1.0], [0.5])}).outputs
    np.testing.assert_allclose(triple, np.imag(sys(2j) * np.exp(1j * (2.0 * t + 0.5))), rtol=1e-13)


def test_bad_input_is_named():
    sys, t = half_car_loop(), [0.0, 1.0]
    with pytest.raises(sc.InputError, match="road_front"):
        sc.steady_response(sys, t, {"road_front": np.sin})
    with pytest.raises(sc.InputError, match="steady"):
        sc.simulate(sys, t, {"road_front": np.sin}, history="steady")
    unstable = sc.DelayLTI.from_state_delays([[[0.0]], [[-1.0]]], [2.0], B=[[1.0]])
    with pytest.raises(sc.UnstableSystemError):
        sc.steady_response(unstable, t, {unstable.input_labels[0]: 1.0})
