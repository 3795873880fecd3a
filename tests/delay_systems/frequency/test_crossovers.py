"""Crossovers near zero and infinite frequency, against signs in many digits and closed forms."""

from __future__ import annotations

import control as ct
import mpmath as mp
import numpy as np
import pytest

import susp_ctrl as sc

Coefficients = np.ndarray


def horner(coefficients, point):
    total = mp.mpf(0)
    for coefficient in coefficients:
        total = total * point + coefficient
    return total


def value(numerator: Coefficients, denominator: Coefficients, tau: float, omega: mp.mpf) -> mp.mpc:
    point = mp.mpc(0, omega)
    parts = (horner([mp.mpf(float(c)) for c in p], point) for p in (numerator, denominator))
    return mp.fdiv(*parts) * mp.exp(-point * mp.mpf(tau))


def in_units(polynomial: Coefficients, scale: float) -> Coefficients:
    return np.asarray(polynomial) * scale ** np.arange(len(polynomial) - 1, -1, -1.0)


def random_loop(seed: int) -> tuple[Coefficients, Coefficients, float]:
    """Up to three integrators, gains of both signs, real and complex zeros, undamped poles, feedthrough, all units."""
    rng = np.random.default_rng(seed)
    unit, tau = rng.choice([1e-6, 1e-3, 1.0, 1e3, 1e6]), rng.choice([0.0, 0.01, 0.3, 2.0])
    numerator, denominator = np.ones(1), np.append(1.0, np.zeros(seed % 4))
    for z in 10.0 ** rng.uniform(-1, 1, rng.integers(1, 3)):
        numerator = np.polymul(
            numerator, [1, z] if rng.random() < 0.4 else [1, 2 * rng.uniform(0.05, 1.2) * z, z * z]
        )
    if rng.random() < 0.25:
        denominator = np.polymul(denominator, [1, 0, 10.0 ** rng.uniform(-1, 1)])
    missing = len(numerator) - len(denominator) + (rng.random() < 0.7) * rng.integers(1, 3)
    for p in 10.0 ** rng.uniform(-1, 1, max(missing, 0)):
        denominator = np.polymul(denominator, [1, p])
    numerator = numerator * rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-1.5, 1.5)
    numerator, denominator = in_units(numerator, unit), in_units(denominator, unit)
    return numerator / denominator[0], denominator / denominator[0], tau * unit


def check_signs(numerator: Coefficients, denominator: Coefficients, tau: float) -> None:
    """Every crossover listed is one: Im L or |L| - 1 changes sign there."""
    margins = (sc.DelayLTI.of(ct.tf(numerator, denominator)) * sc.delay(tau)).margins()
    assert margins.complete
    with mp.workdps(60):
        for table, crosses in (
            (margins.phase_crossovers, lambda L: L.imag),
            (margins.gain_crossovers, lambda L: abs(L) - 1),
        ):
            omega = table["omega"].to_numpy()
            for w in omega[(omega > 0.0) & np.isfinite(omega)]:
                sides = (mp.mpf(w) * (1 + mp.mpf(step)) for step in (-1e-7, 1e-7))
                below, above = (crosses(value(numerator, denominator, tau, side)) for side in sides)
                assert below * above < 0, w


@pytest.mark.property
@pytest.mark.parametrize("seed", [2, 6, 7, 15, 41, 44])
def test_random_loops_have_no_other_crossovers(seed):
    check_signs(*random_loop(seed))


@pytest.mark.property
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 400))
def test_many_random_loops_have_no_other_crossovers(seed):
    check_signs(*random_loop(seed))


@pytest.mark.analytical
@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize(
    "loop",
    [
        ([0.972602205624244, 1.5584691297780302, 0.49267746499064496], [1, 0.35866717031942374, 0, 0]),
        ([0.3, 0.7, 1.9], [1, 0.8, 0, 0]),
        ([-2.0, -0.4, -3.1], [1, 5.2, 0, 0]),
    ],
)
def test_a_double_integrator_leaves_the_real_axis_at_once(loop, scale):
    """Near zero frequency the angle from the axis is w times (c1/c0 - d1/d0 - tau), not zero."""
    numerator, denominator = (in_units(p, scale) for p in loop)
    margins = (sc.delay(0.01 * scale) * sc.DelayLTI.of(ct.tf(numerator, denominator))).margins()
    assert margins.phase_crossovers["omega"].min() * scale > 1e-2
    assert margins.gain_range[0] == 0.0
    check_signs(numerator, denominator, 0.01 * scale)


@pytest.mark.analytical
@pytest.mark.parametrize("small", [1e-5, 1e-7])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_crossover_at_low_frequency_is_not_lost(small, sign):
    """(1 + (1 + d) s)/s^2 e^{-s} is real where atan((1 + d) w) = w: at w^2 = 3 d nearly, or nowhere near zero."""
    numerator, denominator = np.array([1.0 + sign * small, 1.0]), np.array([1.0, 0.0, 0.0])
    phase = (sc.DelayLTI.of(ct.tf(numerator, denominator)) * sc.delay(1.0)).margins().phase_crossovers
    near = phase["omega"][phase["omega"].between(1e-12, 0.1)].to_numpy()
    expected = [np.sqrt(3.0 * small)] if sign > 0 else []
    assert near == pytest.approx(expected, rel=1e-4)


@pytest.mark.analytical
@pytest.mark.parametrize("scale", [2.0**-20, 1.0, 2.0**20])
def test_a_touch_of_the_real_axis_counts(scale):
    """Im L is w (w^2 - 1)^2 over a real denominator: a touch at one, with two integrators at zero frequency."""
    numerator = in_units([1.0, 0.0, 2.0, 30.0, 1.0, 60.0], scale)
    denominator = in_units(np.polymul([1.0, 0.0, -4.0, 0.0, 0.0], [1.0, 0.0, -9.0]), scale)
    margins = sc.stability_margins(ct.tf(numerator, denominator))
    phase = margins.phase_crossovers["omega"].to_numpy() * scale
    assert phase[np.isfinite(phase)] == pytest.approx([1.0], rel=1e-6)


@pytest.mark.property
def test_a_loop_in_microseconds_is_decided():
    """In a companion form, whose states are far from even units."""
    numerator = in_units(-2.0 * np.polymul([1.0, 4.8, 6.4], [1.0, 0.26, 0.31]), 1e-6)
    denominator = in_units(np.poly([-3.6, -3.1, -0.41, -0.4, 0.0]), 1e-6)
    loop = sc.DelayLTI.of(ct.ss(ct.tf(numerator / denominator[0], denominator / denominator[0])))
    assert (loop * sc.delay(2e-6)).margins().complete
