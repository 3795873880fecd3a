"""Counts in the modes of A, for many states and few signals, beside counts by the matrix and closed forms."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.special import lambertw

import susp_ctrl as sc
from susp_ctrl.delay_systems.model import CharacteristicMatrix, characteristic
from susp_ctrl.delay_systems.roots import ContourError, count_right_of


def random_loop(seed):
    random = np.random.default_rng(seed)
    n, m = random.integers(2, 13), random.integers(1, 4)
    A = [random.normal(size=(n, n)) - random.uniform(0.0, 3.0) * np.eye(n)]
    A += [random.uniform(0.1, 1.0) * np.outer(*random.normal(size=(2, n))) for _ in range(m)]
    return sc.DelayLTI.from_state_delays(A=A, delays=10.0 ** random.uniform(-1.5, 0.6, m))


def matrix_of(loop):
    return CharacteristicMatrix.of(loop.folded)


@pytest.mark.property
@pytest.mark.parametrize("seed", range(25))
def test_modes_and_matrix_count_the_same(monkeypatch, seed):
    """Random loops of any order, the modes forced on them."""
    loop = random_loop(seed)
    assert matrix_of(loop).modes is None
    lines = (0.0, -0.3, 0.4)
    by_matrix = [count_right_of(matrix_of(loop), line) for line in lines]
    monkeypatch.setattr(characteristic, "_MANY_STATES", 1)
    monkeypatch.setattr(characteristic, "_FEW_SIGNALS", 0)
    assert matrix_of(loop).modes is not None
    assert [count_right_of(matrix_of(loop), line) for line in lines] == by_matrix


@pytest.mark.analytical
@pytest.mark.parametrize("order", [40, 120])
def test_one_delayed_mode_among_many(order):
    """x' = a x + b x(t - tau) in random coordinates with many other modes: branches of the Lambert function."""
    a, b, tau = 0.4, -3.0, 1.7
    random = np.random.default_rng(order)
    change = np.linalg.qr(random.normal(size=(order, order)))[0]
    others = random.uniform(-5.0, -3.0, order - 1)
    A0 = change @ np.diag(np.append(a, others)) @ change.T
    A1 = b * np.outer(change[:, 0], change[:, 0])
    K = matrix_of(sc.DelayLTI.from_state_delays(A=[A0, A1], delays=[tau]))
    assert K.modes is not None
    branches = a + lambertw(b * tau * np.exp(-a * tau), np.arange(-40, 40)) / tau
    for line in (0.0, -0.4, -1.0, 0.3):
        assert count_right_of(K, line) == np.sum(branches.real > line)


@pytest.mark.analytical
def test_equal_lags_in_a_row_have_no_modes():
    """1/(s + 1)^30 with delayed feedback: A is one Jordan block, the matrix itself counts (no root: gain below one)."""
    n = 30
    A0 = -np.eye(n) + np.eye(n, k=-1)
    A1 = np.zeros((n, n))
    A1[0, -1] = -0.9
    verdict = sc.stability(sc.DelayLTI.from_state_delays(A=[A0, A1], delays=[0.5]))
    assert verdict.stable is True
    A1[0, -1] = -1.5
    loop = sc.DelayLTI.from_state_delays(A=[A0, A1], delays=[0.5])
    # (s + 1)^30 = -1.5 e^{-s/2}, a branch for every root of unity: z = s + 1, z/60 e^{z/60} = c
    factors = (1.5 * np.exp(0.5)) ** (1.0 / n) * np.exp(1j * np.pi * (2.0 * np.arange(n) + 1.0) / n)
    roots = -1.0 + 2.0 * n * np.concatenate([lambertw(factors / (2.0 * n), k) for k in (-1, 0, 1)])
    assert sc.count_unstable_roots(loop) == np.sum(roots.real > 0.0)


@pytest.mark.analytical
def test_a_pole_on_the_line_is_left_to_the_matrix():
    """An integrator inside a large plant: the modes have a pole on the axis, the loop has not."""
    n = 40
    A0 = np.diag(np.append(0.0, -np.linspace(1.0, 4.0, n - 1)))
    A1 = -np.outer(np.eye(n)[0], np.eye(n)[0])
    for delay, expected in ((1.5, 0), (1.7, 2)):
        K = matrix_of(sc.DelayLTI.from_state_delays(A=[A0, A1], delays=[delay]))
        assert K.modes is not None
        assert count_right_of(K) == expected
    uncontrolled = np.diag(np.append(0.0, -np.linspace(1.0, 4.0, n - 1)))
    K = matrix_of(
        sc.DelayLTI.from_state_delays(A=[uncontrolled, -np.outer(*np.eye(n)[[1, 1]])], delays=[0.1])
    )
    with pytest.raises(ContourError):
        count_right_of(K)


@pytest.mark.parametrize("states", [23, 24, 60])
def test_many_states_without_any_delay_in_a_loop(states):
    """The eigenvalues are the roots: of a plant alone, and of one whose delay leads nowhere."""
    A = np.random.default_rng(states).normal(size=(states, states)) - 4.0 * np.eye(states)
    plant = control.ss(A, np.eye(states)[:, :1], np.eye(states)[:1], 0.0)
    expected = int(np.sum(np.linalg.eigvals(A).real > 0))
    for system in (plant, sc.delay(0.5) * plant):
        assert sc.count_unstable_roots(system) == expected
        assert sc.stability(system).unstable_roots == expected
