"""Stability maps that cannot be decided say so; those that can agree with counts however thin a region is."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

import susp_ctrl as sc
from susp_ctrl.delay_systems.maps import shared_delays
from susp_ctrl.errors import UndecidedStabilityWarning

CASES = json.loads(
    (Path(__file__).parents[2] / "data" / "maps_of_ranks_three_and_one.json").read_text(encoding="utf-8")
)


def states(*A):
    """x' = A0 x + sum A_k x(t - tau_k)."""
    matrices = [np.atleast_2d(np.asarray(a, dtype=float)) for a in A]
    return sc.DelayLTI.from_state_delays(A=matrices, delays=[1.0] * (len(A) - 1))


def known_numbers_are_counts(loop, mapped, number=30):
    """Return how many of some random points have a number; each must be that of the argument principle."""
    rng = np.random.default_rng(7)
    x, y = rng.uniform(*mapped.x_range, number), rng.uniform(*mapped.y_range, number)
    told = mapped.unstable_roots(x, y)
    assert np.all(told >= -1)
    for k in np.flatnonzero(told >= 0):
        count = sc.count_unstable_roots(loop.with_delays([x[k], y[k]]))
        assert count is None or count == told[k], (x[k], y[k])
    return int(np.sum(told >= 0))


@pytest.mark.property
def test_an_undamped_mode_is_not_decided_as_a_whole():
    """x'' + x = 0.3 x(t - tau1) - 0.3 x(t - tau2): s = j is a root wherever the delays are equal."""
    loop = states([[0, 1], [-1, 0]], [[0, 0], [0.3, 0]], [[0, 0], [-0.3, 0]])
    with pytest.warns(UndecidedStabilityWarning, match="stability map is undecided"):
        mapped = sc.stability_map(loop, tau1=(0, 3), tau2=(0, 3))
    assert not mapped.decided
    assert mapped.regions["unstable_roots"].min() == -1
    assert "NOT DECIDED" in str(mapped)
    known_numbers_are_counts(loop, mapped)


def root_that_nearly_ignores_the_second_delay():
    return states(
        [[-1.76, 0.01], [-0.57, -2.14]],
        [[-2.24, 1.45], [2.22, -1.44]],
        [[-0.44, -0.15], [0.07, 3.48]],
        [[-0.06, 0.63], [-0.09, 0.49]],
    )


@pytest.mark.property
@pytest.mark.parametrize("followed", [True, False])
def test_a_curve_that_the_grid_cannot_resolve(monkeypatch, followed):
    """Its gap is closed by following it; were it left open, no number beside it would be told."""
    if not followed:
        monkeypatch.setattr(shared_delays, "_STEPS", 0)
    loop = root_that_nearly_ignores_the_second_delay()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if not followed else "error", UndecidedStabilityWarning)
        mapped = sc.stability_map(loop, tau1=(0, 2), tau2=(0, 1.5))
    assert mapped.decided == followed
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0.01, 1.99, 15), np.linspace(0.02, 1.48, 12)))
    told = mapped.unstable_roots(x, y)
    counts = [sc.count_unstable_roots(loop.with_delays([*tau, 1.0])) for tau in zip(x, y, strict=True)]
    assert np.all((told == counts) | (told == -1))
    assert np.mean(told == -1) < (1e-9 if followed else 0.15)


@pytest.mark.analytical
@pytest.mark.parametrize("fast", [False, True])
def test_a_root_at_zero_for_all_delays_is_nowhere_stable(fast):
    A = [np.array([[-1.0]]), np.array([[0.4]]), np.array([[0.6]])]
    if fast:
        A = [np.diag([a[0, 0], -1e6 if k == 0 else 0.0]) for k, a in enumerate(A)]
    with pytest.warns(UndecidedStabilityWarning, match="nowhere stable"):
        mapped = sc.stability_map(states(*A), tau1=(0, 3), tau2=(0, 3))
    assert mapped.axis_roots == (0.0,)
    assert not mapped.decided
    assert set(mapped.regions["unstable_roots"]) == {-1}
    assert set(mapped.unstable_roots(np.linspace(0, 3, 9), 1.0)) == {-1}
    assert "stable on 0 %" in str(mapped)
    assert "nowhere stable" in str(mapped)


@pytest.mark.analytical
def test_curves_through_round_numbers_do_not_disturb_a_gain_map():
    """x' = -x + g1 x(t-1) + g2 x(t-1.5): a root at zero on g1 + g2 = 1; stable where |g1| + |g2| < 1."""
    loop = sc.DelayLTI.from_state_delays(A=[[[-1.0]], [[1.0]], [[1.0]]], delays=[1.0, 1.5])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mapped = sc.stability_map(loop, gain1=(-3, 3), gain2=(-2, 4))
    assert mapped.decided
    g1, g2 = np.meshgrid(np.linspace(-0.95, 0.95, 20), np.linspace(-0.95, 0.95, 20))
    inside = np.abs(g1) + np.abs(g2) < 0.999
    assert np.all(mapped.unstable_roots(g1[inside], g2[inside]) == 0)
    beyond = g1 + g2 > 1.001
    assert np.all(mapped.unstable_roots(g1[beyond], g2[beyond]) % 2 == 1)


@pytest.mark.property
@pytest.mark.parametrize(("name", "at_least"), [("gap", 5), ("thin", 30)])
def test_wide_blocks_agree_with_counts(name, at_least):
    case = CASES[name]
    loop = states(*case["A"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UndecidedStabilityWarning)
        mapped = sc.stability_map(loop, tau1=case["tau1"], tau2=case["tau2"])
    assert known_numbers_are_counts(loop, mapped) >= at_least
    if not mapped.decided:
        assert -1 in set(mapped.regions["unstable_roots"])


@pytest.mark.property
def test_curves_of_wide_blocks_are_as_fine_as_those_of_scalar_channels():
    """Points of the segments and the middles between them are roots on the axis, so thin regions are counted right."""
    case = CASES["thin"]
    loop = states(*case["A"])
    mapped = sc.stability_map(loop, tau1=case["tau1"], tau2=case["tau2"])
    x, y = 3.664637004195994, 0.11493963199230706
    assert mapped.unstable_roots(x, y) == sc.count_unstable_roots(loop.with_delays([x, y])) == 5
    A0, A1, A2 = (np.array(a) for a in case["A"])
    curves = mapped.curves
    size = np.array([np.ptp(mapped.x_range), np.ptp(mapped.y_range)])
    away = []
    for k in np.random.default_rng(0).permutation(len(curves))[:40]:
        row = curves.iloc[k]
        tau, w = np.array([row.x0 + row.x1, row.y0 + row.y1]) / 2, row.omega
        for _ in range(8):
            # the nearest (omega, tau1, tau2) with a root on the axis, by steps of least length
            E = np.exp(-1j * w * tau)
            K = 1j * w * np.eye(3) - A0 - E[0] * A1 - E[1] * A2
            u, s, v = np.linalg.svd(K)
            left, right = u[:, -1].conj(), v[-1].conj()
            slopes = [
                1j * np.eye(3) + 1j * (tau[0] * E[0] * A1 + tau[1] * E[1] * A2),
                1j * w * E[0] * A1,
                1j * w * E[1] * A2,
            ]
            g = np.array([left @ m @ right for m in slopes]) * np.array([1e3, *size])
            step = np.linalg.lstsq(np.array([g.real, g.imag]), [-s[-1], 0.0], rcond=None)[0]
            w, tau = w + 1e3 * step[0], tau + size * step[1:]
        away.append(np.linalg.norm((tau - np.array([row.x0 + row.x1, row.y0 + row.y1]) / 2) / size))
    assert np.max(away) < 1e-4
