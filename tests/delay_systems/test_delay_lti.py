"""The class: evaluation, folding, well-posedness, what it refuses."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems.delay_lti import DelayLTI


def state_delay_response(A, delays, B, C, s):
    """Dense oracle: C (sI - sum A_k e^{-s tau_k})^-1 B."""
    matrix = s * np.eye(len(A[0])) - sum(
        np.asarray(M, dtype=float) * np.exp(-s * d) for M, d in zip(A, [0.0, *delays], strict=True)
    )
    return np.asarray(C) @ np.linalg.solve(matrix, np.asarray(B))


@pytest.mark.property
@given(
    seed=st.integers(0, 10_000),
    n=st.integers(1, 5),
    delays=st.lists(st.sampled_from([0.0, 0.1, 0.1, 0.7, 3.0]), min_size=0, max_size=3),
    rank=st.integers(0, 5),
)
def test_response_of_any_state_delay_system_equals_a_dense_solve(seed, n, delays, rank) -> None:
    rng = np.random.default_rng(seed)
    factor = [rng.normal(size=(n, min(rank, n))) @ rng.normal(size=(min(rank, n), n)) for _ in delays]
    A, B, C = [rng.normal(size=(n, n)), *factor], rng.normal(size=(n, 2)), rng.normal(size=(3, n))
    system = sc.DelayLTI.from_state_delays(A, delays, B, C)
    assert list(system.delays) == delays
    assert system.widths == tuple(min(rank, n) for _ in delays)
    s = np.array([0.4 + 1.3j, 2.9j, 1.7 + 0j])
    values = system(s)
    for k, point in enumerate(s):
        expected = state_delay_response(A, delays, B, C, point)
        np.testing.assert_allclose(values[..., k], expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


@pytest.mark.analytical
def test_input_delays_keep_their_place_after_the_state_delays() -> None:
    """x' = -x(t-1) + u + 3 u(t-0.25): H = (1 + 3 e^{-0.25 s})/(s + e^{-s})."""
    system = sc.DelayLTI.from_state_delays(
        [[[0.0]], [[-1.0]]], [1.0], B=[[1.0]], input_terms=[([[3.0]], 0.25)]
    )
    assert list(system.delays) == [1.0, 0.25]
    s = 1j * np.linspace(0.0, 30.0, 40)
    np.testing.assert_allclose(system(s), (1 + 3 * np.exp(-0.25 * s)) / (s + np.exp(-s)), rtol=1e-13)


@pytest.mark.analytical
def test_response_is_exact_at_and_near_poles_of_the_open_plant() -> None:
    """P has an integrator; the closed loop 1/(s + e^{-s}) is 1 at s = 0, where P itself is infinite."""
    system = sc.DelayLTI.from_state_delays([[[0.0]], [[-1.0]]], [1.0], B=[[1.0]])
    for s in (0.0, 1e-14j, 1e-9j, 1e-4j):
        assert system(s) == pytest.approx(1 / (s + np.exp(-s)), rel=1e-14)
    assert system.dcgain() == pytest.approx(1.0, rel=1e-15)


@pytest.mark.property
def test_delays_and_gains_are_kept_as_given_and_changed_in_copies() -> None:
    A = [np.diag([-1.0, -2.0]), np.eye(2) * 0.1, np.zeros((2, 2)), np.eye(2) * 0.2]
    system = sc.DelayLTI.from_state_delays(A, [0.5, 0.3, 0.0], B=np.eye(2))
    other = system.with_delays([0.0, 0.1, 0.5]).with_gains([1.0, 2.0, 0.0])
    assert (list(system.delays), list(system.gains)) == ([0.5, 0.3, 0.0], [1.0, 1.0, 1.0])
    assert (list(other.delays), list(other.gains)) == ([0.0, 0.1, 0.5], [1.0, 2.0, 0.0])
    np.testing.assert_allclose(other(2j), np.linalg.inv(2j * np.eye(2) - A[0] - A[1]), rtol=1e-14)
    assert other.folded.delays.size == 0, "zero delays closed, empty and zero-gain channels dropped"
    with pytest.raises(ValueError, match="read-only"):
        system.delays[0] = 9.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"delays": [-0.1, 0.2]}, r"delays\[0\] = -0.1 is not allowed: at least 0"),
        ({"delays": [0.1]}, r"delays has shape \(1,\): a one-dimensional sequence of 2 numbers"),
        ({"delays": [0.1, np.nan]}, r"delays\[1\] = nan is not allowed: finite"),
        ({"gains": [1.0, np.inf]}, r"gains\[1\] = inf is not allowed: finite"),
        ({"gains": "much"}, r"gains = 'much' is not allowed: a sequence of numbers"),
    ],
)
def test_bad_delays_and_gains_are_refused_by_name(change, message) -> None:
    system = sc.DelayLTI.from_state_delays([[[-1.0]], [[0.1]], [[0.2]]], [0.1, 0.2])
    with pytest.raises(sc.InputError, match=message):
        system.with_delays(**change) if "delays" in change else system.with_gains(**change)


def test_what_is_no_continuous_linear_system_is_refused() -> None:
    with pytest.raises(sc.InputError, match=r"dt = 0\.1"):
        DelayLTI.of(ct.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]], dt=0.1))
    with pytest.raises(sc.InputError, match="dt = True"):
        DelayLTI.of(ct.tf([1.0], [1.0, 2.0], dt=True))
    with pytest.raises(sc.InputError, match="FrequencyResponseData"):
        DelayLTI.of(ct.frd([1.0, 2.0], [1.0, 2.0]))


def test_matrices_of_delayed_systems_must_fit() -> None:
    with pytest.raises(sc.InputError, match=r"A\[1\] has shape \(1, 1\): a matrix of shape \(2, 2\)"):
        sc.DelayLTI.from_state_delays([np.eye(2), [[1.0]]], [0.1])
    with pytest.raises(sc.InputError, match="delays has 2 entries: one for each of the 1 matrices"):
        sc.DelayLTI.from_state_delays([np.eye(2), np.eye(2)], [0.0, 0.1])
    with pytest.raises(sc.InputError, match="A is one matrix"):
        sc.DelayLTI.from_state_delays(np.eye(2), [])


def test_an_algebraic_loop_with_unit_gain_is_refused() -> None:
    gain = ct.ss([], [], [], [[1.0]], inputs=["u"], outputs=["y"])
    with pytest.raises(sc.InputError, match="algebraic loop"):
        sc.close_loop(gain, [sc.FeedbackChannel("y", "u", gain=1.0, delay=0.0)])


def test_a_neutral_loop_is_refused_by_name_with_the_remedy() -> None:
    mass = ct.ss([[0.0]], [[1.0]], [[0.0]], [[1 / 690.0]], inputs=["force"], outputs=["acceleration"])
    channel = sc.FeedbackChannel("acceleration", "force", gain=-800.0, delay=0.1)
    with pytest.raises(sc.NeutralLoopError, match="actuator_bandwidth"):
        sc.close_loop(mass, [channel])
    undelayed = sc.close_loop(mass, [channel.replace(delay=0.0)])
    assert undelayed(2j) == pytest.approx(1 / (690.0 + 800.0), rel=1e-14)
    with pytest.raises(sc.NeutralLoopError):
        undelayed.with_delays([0.1])
    lagged = sc.close_loop(mass, [channel.replace(actuator_bandwidth=60.0)])
    s = 7j
    assert lagged(s) == pytest.approx(1 / (690.0 + 800.0 * np.exp(-0.1 * s) / (1 + s / 60.0)), rel=1e-13)


def test_a_system_prints_its_signals_delays_and_gains() -> None:
    system = sc.DelayLTI.from_state_delays(
        [[[-1.0]], [[0.1]]], [0.25], inputs=[], outputs=["level"], name="tank"
    )
    assert str(system).splitlines() == [
        "<DelayLTI> tank: 1 states", "  inputs:  ", "  outputs: level", "  delays:  0.25 s", "  gains:   1",
    ]  # fmt: skip
