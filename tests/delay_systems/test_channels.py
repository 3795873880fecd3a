"""Closing and opening loops by signal name."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import susp_ctrl as sc

OMEGA = np.array([0.2, 1.1, 3.0, 25.0])


@pytest.fixture
def plant() -> ct.StateSpace:
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4)) - 3 * np.eye(4)
    B, C, D = rng.normal(size=(4, 2)), rng.normal(size=(3, 4)), np.zeros((3, 2))
    D[2, 1] = 0.5
    return ct.ss(A, B, C, D, inputs=["front", "rear"], outputs=["x", "y", "a"], name="plant")


def feedback_by_hand(plant, channels, s):
    """G (I - K G)^-1 with K built entry by entry."""
    G = plant(s)
    K = np.zeros((plant.ninputs, plant.noutputs), dtype=complex)
    for c in channels:
        lag = 1.0 if c.actuator_bandwidth is None else 1 / (1 + s / c.actuator_bandwidth)
        K[plant.input_labels.index(c.actuator), plant.output_labels.index(c.measured)] += (
            c.gain * np.exp(-s * c.delay) * lag
        )
    return G @ np.linalg.inv(np.eye(plant.ninputs) - K @ G), K, G


@pytest.mark.analytical
def test_closed_and_open_loop_equal_the_matrix_formulas(plant) -> None:
    channels = [
        sc.FeedbackChannel("x", "front", gain=0.7, delay=0.3),
        sc.FeedbackChannel("x", "front", gain=-0.2, delay=0.9),
        sc.FeedbackChannel("y", "rear", gain=1.1, delay=0.0),
        sc.FeedbackChannel("a", "rear", gain=0.4, delay=0.2, actuator_bandwidth=12.0),
    ]
    closed, opened = sc.close_loop(plant, channels, name="loop"), sc.open_loop(plant, channels)
    assert (closed.name, closed.input_labels, closed.output_labels) == (
        "loop",
        ["front", "rear"],
        ["x", "y", "a"],
    )
    assert opened.input_labels == opened.output_labels == ["front", "rear"]
    assert list(closed.delays) == [0.3, 0.9, 0.0, 0.2]
    for s in 1j * OMEGA:
        H, K, G = feedback_by_hand(plant, channels, s)
        np.testing.assert_allclose(closed(s), H, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(opened(s), -K @ G, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(G @ np.linalg.inv(np.eye(2) + opened(s)), H, rtol=1e-12, atol=1e-14)


@pytest.mark.analytical
def test_closing_twice_equals_closing_once(plant) -> None:
    first = sc.FeedbackChannel("x", "front", gain=0.7, delay=0.3)
    second = sc.FeedbackChannel("y", "rear", gain=-0.5, delay=0.8)
    once = sc.close_loop(plant, [first, second])
    twice = sc.close_loop(sc.close_loop(plant, [first]), [second])
    assert list(twice.delays) == [0.3, 0.8]
    np.testing.assert_allclose(twice(1j * OMEGA), once(1j * OMEGA), rtol=1e-12)


def test_transfer_functions_are_taken_and_signals_may_be_numbers() -> None:
    loop = sc.close_loop(ct.tf([1.0], [1.0, 1.0]), [sc.FeedbackChannel(0, 0, gain=-2.0, delay=0.4)])
    s = 1j * OMEGA
    np.testing.assert_allclose(loop(s), 1 / (s + 1 + 2 * np.exp(-0.4 * s)), rtol=1e-13)


def test_unknown_signals_name_the_nearest_one(plant) -> None:
    with pytest.raises(sc.InputError, match="actuator = 'frnt' is not allowed: did you mean 'front'"):
        sc.close_loop(plant, [sc.FeedbackChannel("x", "frnt", 1.0, 0.1)])
    with pytest.raises(sc.InputError, match="measured = 7 is not allowed"):
        sc.open_loop(plant, [sc.FeedbackChannel(7, "front", 1.0, 0.1)])
    with pytest.raises(sc.InputError, match=r"channels\[0\] is a tuple"):
        sc.close_loop(plant, [("x", "front", 1.0, 0.1)])
    with pytest.raises(sc.InputError, match="channels is empty"):
        sc.open_loop(plant, [])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"gain": float("nan")}, "gain = nan is not allowed: a finite number"),
        ({"delay": -0.1}, "delay = -0.1 is not allowed: a finite number, at least 0"),
        ({"delay": "soon"}, "delay = 'soon' is not allowed"),
        (
            {"actuator_bandwidth": 0.0},
            "actuator_bandwidth = 0 is not allowed: a finite number, greater than 0",
        ),
    ],
)
def test_bad_numbers_in_a_channel_are_refused(fields, message) -> None:
    with pytest.raises(sc.InputError, match=message):
        sc.FeedbackChannel(**({"measured": "x", "actuator": "front", "gain": 1.0, "delay": 0.1} | fields))
