"""Realisations keep what was written: every coefficient, every entry, in any unit; refused where they cannot."""

from __future__ import annotations

import warnings
from fractions import Fraction

import control as ct
import numpy as np
import pytest

import susp_ctrl as sc
from susp_ctrl.delay_systems.model.realizations import _rank_factors

LAG = ct.tf([1000.0, 1.0], [1.0])
SLOW = np.asarray((LAG**6).num[0][0])


@pytest.mark.analytical
@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_small_leading_coefficients_keep_their_zeros(unit):
    """(500 s + 1)/(1000 s + 1)^6 in any unit of time: compared with the closed form of the factors."""
    powers = unit ** np.arange(6, -1, -1.0)
    G = sc.DelayLTI.of(ct.tf([500.0 * unit, 1.0], SLOW * powers))
    s = 1j * np.array([1e-5, 1e-3, 2e-3, 1e-2, 1.0]) / unit
    expected = (500.0 * unit * s + 1.0) / (1000.0 * unit * s + 1.0) ** 6
    np.testing.assert_allclose(G(s), expected, rtol=1e-12)


@pytest.mark.analytical
@pytest.mark.parametrize("delay", [0.0, 1.0, 100.0])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_slow_loops_are_unstable_in_every_unit(delay, unit):
    """1 + 2 (1 - 500 s) e^{-s tau}/(1000 s + 1)^6 has a pair on the right: its root solves the equation itself."""
    L = ct.tf([-1000.0 * unit, 2.0], SLOW * unit ** np.arange(6, -1, -1.0))
    loop = sc.feedback(sc.delay(delay * unit) * L, 1)
    verdict = sc.stability(loop)
    assert verdict.stable is False
    assert verdict.unstable_roots == 2
    s = verdict.roots[0] * unit
    value = (1000 * s + 1) ** 6 + 2 * (1 - 500 * s) * np.exp(-s * delay)
    assert abs(value) < 1e-9
    if delay == 100.0:
        assert verdict.abscissa * unit == pytest.approx(4.14864e-6, rel=1e-5)


def complex_ratio(num, den, omega):
    """num(jw)/den(jw) without rounding before the end."""

    def value(coefficients):
        real = imaginary = Fraction(0)
        for c in coefficients:  # Horner: (re + j im) j w + c
            real, imaginary = -imaginary * Fraction(omega) + Fraction(c), real * Fraction(omega)
        return real, imaginary

    (a, b), (c, d) = value(num.tolist()), value(den.tolist())
    size = c * c + d * d
    return complex(float((a * c + b * d) / size), float((b * c - a * d) / size))


@pytest.mark.property
def test_responses_of_random_coefficients_are_those_of_the_polynomials():
    """Poles over up to 12 decades, at any unit, against rational arithmetic."""
    rng = np.random.default_rng(5)
    for _ in range(40):
        n, base, spread = rng.integers(1, 9), 10.0 ** rng.integers(-8, 9), rng.choice([0.3, 3.0, 6.0])
        poles = -base * 10.0 ** rng.uniform(-spread, spread, n)
        zeros = -base * 10.0 ** rng.uniform(-spread, spread, rng.integers(0, n))
        num, den = np.atleast_1d(np.poly(zeros)) * 10.0 ** rng.uniform(-20, 20), np.poly(poles)
        omega = np.append(np.abs(poles), [0.01 * np.abs(poles).min(), 100 * np.abs(poles).max()])
        found = sc.DelayLTI.of(ct.tf(num, den))(1j * omega)
        exact = [complex_ratio(num, den, w) for w in omega.tolist()]
        np.testing.assert_allclose(found, exact, rtol=1e-10)


def test_a_response_far_below_its_feedthrough_is_refused():
    high_pass = ct.tf(np.poly([-1e-6] * 3), np.poly([-1e6] * 3))
    with pytest.raises(sc.InputError, match="no state space in double precision"):
        sc.DelayLTI.of(high_pass)


@pytest.mark.analytical
@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e10])
def test_entries_that_units_make_small_are_kept(scale):
    """(s + 1)^2 + 1000 e^{-2s} = 0 in states of any units: the rightmost root solves it."""
    loop = sc.DelayLTI.from_state_delays([-np.eye(2), [[0.0, scale], [-1000.0 / scale, 0.0]]], [1.0])
    verdict = sc.stability(loop)
    s = verdict.roots[0]
    assert verdict.stable is False
    assert abs((s + 1) ** 2 + 1000 * np.exp(-2 * s)) < 1e-9 * abs(s + 1) ** 2
    assert verdict.abscissa == pytest.approx(2.2187, abs=1e-4)


@pytest.mark.property
def test_factors_keep_every_entry_to_rounding():
    rng = np.random.default_rng(2)
    for _ in range(200):
        n, rank = rng.integers(1, 7), rng.integers(1, 4)
        matrix = (
            rng.normal(size=(n, rank))
            @ rng.normal(size=(rank, n))
            * (rng.random((n, n)) < rng.choice([0.5, 1]))
        )
        matrix *= 10.0 ** rng.uniform(-9, 9, (n, 1)) * 10.0 ** rng.uniform(-9, 9, n)
        U, V = _rank_factors(matrix)
        np.testing.assert_allclose(U @ V, matrix, rtol=4e-15)
        assert U.shape[1] <= n


def test_one_direction_in_all_states_is_one_signal():
    b, k = np.array([1.0, -2.0, 1e-9, 3e5]), np.array([0.3, 1e7, -2.0, 1e-4])
    U, V = _rank_factors(np.outer(b, k))
    assert U.shape == (4, 1)
    np.testing.assert_allclose(U @ V, np.outer(b, k), rtol=1e-15)


@pytest.mark.property
@pytest.mark.parametrize("seed", range(12))
def test_units_of_states_and_time_change_nothing(seed):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 6), rng.integers(1, 4)
    A = [rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.7) for _ in range(m + 1)]
    A[0] -= rng.uniform(0, 3) * np.eye(n)
    tau = 10.0 ** rng.uniform(-1.5, 0.5, m)
    states, second = 10.0 ** rng.uniform(-8, 8, n), 10.0 ** rng.uniform(-6, 6)
    expected = sc.stability(sc.DelayLTI.from_state_delays(A, tau))
    scaled = [a * states[:, None] / states / second for a in A]
    with warnings.catch_warnings(action="error"):
        found = sc.stability(sc.DelayLTI.from_state_delays(scaled, tau * second))
    assert found.stable is expected.stable
    assert found.unstable_roots == expected.unstable_roots
    assert found.abscissa * second == pytest.approx(expected.abscissa, rel=1e-8)


def test_names_that_occur_twice_are_told_or_numbered():
    with pytest.raises(sc.InputError, match=r"inputs\[1\] = 'u' is not allowed: every name may occur once"):
        sc.delay([1.0, 2.0], inputs=["u", "u"])
    twice = sc.delay([1.0, 2.0])[[0, 0], :]
    assert twice.noutputs == 2
    channel = sc.FeedbackChannel(0, 0, 0.2, 0.1, actuator_bandwidth=5.0)
    nested = sc.close_loop(sc.close_loop(ct.ss(-1, 1, 1, 0), channel), channel)
    assert len(set(nested.state_labels)) == nested.nstates == 3
