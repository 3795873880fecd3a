"""Verdicts of random systems of all kinds against the winding number of the user's own determinant.

The oracle follows the phase of ``det(sI - A[0] - sum A[k] e^{-s tau_k})`` along a half disc that holds all unstable
roots, halving steps until the phase turns by little; nothing of the package is used. Systems: rates from 1e-4 to
1e4 rad/s, one to eight states in units of their own, one to five delays: any, equal, commensurate, some zero, in
pairs, and with matrices that cancel.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from delay_oracles import characteristic_matrix

import susp_ctrl as sc

KINDS = ("any", "equal", "commensurate", "some zero", "pairs", "uneven units", "rank one", "cancelling")
MOST_POINTS = 1_000_000


def random_case(kind, seed):
    """A[0], A[1], ... and delays of one of the `KINDS`."""
    random = np.random.default_rng([seed, KINDS.index(kind)])
    n, m = random.integers(1, 9), random.integers(1, 6)
    rate = 10.0 ** random.uniform(-4.0, 4.0)
    delays = 10.0 ** random.uniform(-1.5, 0.9, m) / rate
    if kind == "equal":
        delays[:] = delays[0]
    if kind == "commensurate":
        delays = delays[0] * random.integers(1, 5, m)
    if kind == "some zero":
        delays[random.random(m) < 0.5] = 0.0
    if kind == "pairs":
        delays = np.repeat(delays, 2)[:m]
    A = [rate * (random.normal(size=(n, n)) - random.choice([0.0, 1.0, 3.0, 5.0]) * np.eye(n))]
    for _ in range(m):
        rank = 1 if kind == "rank one" else random.integers(1, n + 1)
        factor = rate * 10.0 ** random.uniform(-1.0, 0.4) / np.sqrt(n * rank)
        A.append(factor * random.normal(size=(n, rank)) @ random.normal(size=(rank, n)))
    if kind == "cancelling" and m > 1:
        A[2], delays[1] = -(1.0 + random.choice([0.0, 1e-12, 1e-6, 0.1])) * A[1], delays[0]
    units = 10.0 ** random.uniform(-3.0, 3.0, n) if kind == "uneven units" else np.ones(n)
    return A, delays, units


def winding_count(A, delays):
    """Unstable roots; None where a root is so near to the axis that the phase cannot be followed."""
    radius = 1.05 * sum(np.linalg.norm(a, 2) for a in A)
    axis = np.concatenate(
        [
            np.linspace(0.0, radius, int(4000 + 12 * radius * delays.max())),
            np.geomspace(1e-9 * radius, radius, 3000),
        ]
    )
    arc = radius * np.exp(1j * np.linspace(np.pi / 2.0, 0.0, 1500))
    s = np.concatenate([1j * np.unique(axis), arc[1:]])
    phase = phase_factor(A, delays, s)
    while s.size < MOST_POINTS:
        coarse = np.abs(np.angle(phase[1:] / phase[:-1])) > 0.35
        if not np.any(coarse):
            return round(-float(np.angle(phase[1:] / phase[:-1]).sum()) / np.pi)
        if np.min(np.abs(np.diff(s))[coarse]) < 1e-13 * radius:
            return None
        middle = 0.5 * (s[1:] + s[:-1])[coarse]
        place = np.flatnonzero(coarse) + 1
        s, phase = np.insert(s, place, middle), np.insert(phase, place, phase_factor(A, delays, middle))
    return None


def phase_factor(A, delays, s):
    parts = np.array_split(s, 1 + s.size // 20_000)
    return np.concatenate([np.linalg.slogdet(characteristic_matrix(A, delays, part))[0] for part in parts])


def check(kind, seed):
    """No wrong count; True where oracle and verdict both gave one."""
    A, delays, units = random_case(kind, seed)
    scaled = [units[:, None] * a / units for a in A]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.UndecidedStabilityWarning)
        verdict = sc.stability(sc.DelayLTI.from_state_delays(A=scaled, delays=delays))
    expected = winding_count(A, delays)
    known = expected is not None and verdict.unstable_roots is not None
    if known:
        assert verdict.unstable_roots == expected, (kind, seed)
        assert {n for n in verdict.agreement.values() if n is not None} == {expected}, (kind, seed)
    return known


@pytest.mark.property
@pytest.mark.parametrize("kind", KINDS)
def test_verdicts_equal_the_winding_number(kind):
    assert sum(check(kind, seed) for seed in range(4)) >= 3


@pytest.mark.slow
@pytest.mark.property
@pytest.mark.parametrize("kind", KINDS)
def test_many_verdicts_equal_the_winding_number(kind):
    assert sum(check(kind, seed) for seed in range(4, 64)) >= 57
