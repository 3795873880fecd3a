"""Transmission zeros where the response and its derivative vanish together."""

from __future__ import annotations

import numpy as np
import pytest

import susp_ctrl as sc


@pytest.mark.analytical
def test_a_double_zero_at_the_origin_is_not_lost():
    """Body acceleration of a quarter car over its road is ``s^2 (c s + k)`` over the characteristic function."""
    car = sc.QuarterCar()
    channel = sc.FeedbackChannel("body_velocity", "force", gain=-1e3, delay=0.05)
    zeros = sc.close_loop(car.plant(), channel)["body_acceleration", "road"].zeros()
    for expected in (0.0, -car.spring_stiffness / car.damping):
        assert np.abs(zeros - expected).min() < 1e-6
