"""The spectral approximation as a state-space system, and the matrix behind the roots."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.special
from delay_oracles import full_state_roots

import susp_ctrl as sc
from susp_ctrl.delay_systems.approximation.spectral import discretized_matrix, spectral_approximation
from susp_ctrl.delay_systems.model.characteristic import CharacteristicMatrix
from susp_ctrl.errors import InputError


def two_delay_loop():
    plant = control.ss(
        [[0.0, 1.0], [-4.0, -0.6]], [[0.0], [1.0]], [[1.0, 0.0], [-4.0, -0.6]], [[0.0], [1.0]],
        inputs=["force"], outputs=["displacement", "acceleration"],
    )  # fmt: skip
    return sc.close_loop(
        plant,
        [
            sc.FeedbackChannel("displacement", "force", 1.2, 0.7),
            sc.FeedbackChannel("displacement", "force", -0.5, 0.31),
        ],
    )


@pytest.mark.analytical
def test_frequency_response_converges_spectrally():
    loop, points = two_delay_loop(), 1j * np.linspace(0.0, 20.0, 101)
    exact = loop(points)
    errors = []
    for order in (8, 16, 24):
        approximation = spectral_approximation(loop, order)
        assert isinstance(approximation, control.StateSpace)
        assert approximation.nstates == 2 + 2 * order
        errors.append(np.max(np.abs(approximation(points) - exact)))
    assert errors[1] < 1e-2 * errors[0]
    assert errors[2] < 1e-9


@pytest.mark.analytical
def test_step_response_of_a_delayed_integrator():
    """x' = u - x(t - 1): steps of the method of steps, t and then t - (t - 1)^2/2."""
    loop = sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-1.0]]], delays=[1.0], B=[[1.0]])
    times = np.linspace(0.0, 2.0, 41)
    response = control.step_response(spectral_approximation(loop, 40), times)
    expected = np.where(times < 1.0, times, times - 0.5 * (times - 1.0) ** 2)
    np.testing.assert_allclose(response.y[0, 0], expected, atol=2e-4)


@pytest.mark.analytical
def test_names_orders_and_idle_delays():
    loop = two_delay_loop()
    approximation = spectral_approximation(loop, [3, 5])
    assert approximation.nstates == 2 + 3 + 5
    assert approximation.input_labels == loop.input_labels
    assert approximation.output_labels == loop.output_labels
    idle = loop.with_delays([0.0, 0.31])
    assert spectral_approximation(idle, 6).nstates == 2 + 6
    np.testing.assert_allclose(spectral_approximation(idle, 20)(2j), idle(2j), rtol=1e-9)
    pure = spectral_approximation(sc.delay(0.4), 20)
    np.testing.assert_allclose(pure(3j), np.exp(-1.2j), rtol=1e-12)


@pytest.mark.parametrize("order", [0, 401, 2.5, [3], [3, 0]])
def test_bad_orders_are_named(order):
    with pytest.raises(InputError, match="order"):
        spectral_approximation(two_delay_loop(), order)


@pytest.mark.analytical
def test_eigenvalues_are_lambert_branches():
    K = CharacteristicMatrix.of(sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-1.0]]], delays=[1.0]).folded)
    eigenvalues = np.linalg.eigvals(discretized_matrix(K, 60.0, 400))
    branches = scipy.special.lambertw(-1.0, [0, 1, 2])
    assert np.max(np.min(np.abs(eigenvalues[:, None] - branches), axis=0)) < 1e-10


@pytest.mark.property
@pytest.mark.parametrize("seed", range(6))
def test_lines_per_signal_and_tapped_lines_agree_with_the_full_state(seed):
    """Few signals of many states, and many signals of few states: both layouts against Breda's."""
    random = np.random.default_rng(seed)
    n, m, rank = (5, 2, 1) if seed % 2 else (3, 3, 3)
    A = [random.normal(size=(n, n)) - np.eye(n)]
    A += [random.normal(size=(n, rank)) @ random.normal(size=(rank, n)) for _ in range(m)]
    delays = random.uniform(0.2, 1.5, m)
    K = CharacteristicMatrix.of(sc.DelayLTI.from_state_delays(A=A, delays=delays).folded)
    M = discretized_matrix(K, 50.0, 1000)
    lines = {1: 2, 0: 3}[seed % 2]
    assert (M.shape[0] - n) % lines == 0 or seed % 2
    assert M.shape[0] < n * 45
    expected = full_state_roots(A, delays, 40)[:4]
    eigenvalues = np.linalg.eigvals(M)
    assert np.max(np.min(np.abs(eigenvalues[:, None] - expected), axis=0)) < 1e-7


def test_the_largest_size_is_kept():
    K = CharacteristicMatrix.of(
        sc.DelayLTI.from_state_delays(A=[-np.eye(2), np.ones((2, 2))], delays=[100.0]).folded
    )
    assert discretized_matrix(K, 1e4, 300).shape[0] <= 300
