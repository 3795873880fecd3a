"""Stability maps: closed-form curves, literature cases, and agreement with independent counts."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from delay_cases import row, rows, system
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.errors import InputError


def car_loop(g1, g2, tau1=0.3, tau2=0.45):
    channels = [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", gain=g1, delay=tau1),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", gain=g2, delay=tau2),
    ]
    return sc.close_loop(sc.HalfCar().plant(), channels)


def moved(loop, names, values):
    """The loop with the named parameters set."""
    gains, delays = loop.gains.copy(), loop.delays.copy()
    for name, value in zip(names, values, strict=True):
        (delays if name.startswith("tau") else gains)[int(name[-1]) - 1] = value
    return loop.with_gains(gains).with_delays(delays)


def agree(loop, mapped, names, points, rng):
    """Numbers at random points clear of the curves equal counts."""
    x, y = rng.uniform(*mapped.x_range, points), rng.uniform(*mapped.y_range, points)
    found, away = mapped.unstable_roots(x, y), mapped.distance(x, y)
    size = 1.0 if mapped.mixed else mapped.x_range[1] - mapped.x_range[0]
    for k in np.flatnonzero(away > 1e-4 * size):
        counted = sc.count_unstable_roots(moved(loop, names, (x[k], y[k])))
        assert counted is None or counted == found[k], (
            f"at {x[k]}, {y[k]}: {counted} counted, {found[k]} mapped"
        )


@pytest.mark.analytical
def test_scalar_loop_without_cross_term():
    """x' = -x(t - tau1)/2 - x(t - tau2)/2 at tau2 = tau1 loses stability at pi/2; along tau2 = 0 never."""
    loop = sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-0.5]], [[-0.5]]], delays=[1.0, 1.0])
    mapped = sc.stability_map(loop, tau1=(0, 6), tau2=(0, 6))
    assert mapped.unstable_roots(1.5, 1.5) == 0
    assert mapped.unstable_roots(1.64, 1.64) == 2
    assert mapped.distance(np.pi / 2, np.pi / 2) < 1e-4
    # j w + (e^{-jw t1} + e^{-jw t2})/2 = 0: cos(w (t1 - t2)/2) = w and w (t1 + t2)/2 = pi/2 on the first curve
    w = np.linspace(0.5, 0.99, 40)
    half = np.arccos(w) / w
    t1, t2 = np.pi / (2 * w) + half, np.pi / (2 * w) - half
    assert np.all(mapped.distance(t1, t2) < 2e-4)
    assert np.all(mapped.distance(t2, t1) < 2e-4)
    assert mapped.decided


@pytest.mark.literature
def test_gu_niculescu_chen_curve_points():
    """Gu, Niculescu, Chen 2005, example 1: points (omega, tau1, tau2) of the curves."""
    expected = row("gu_niculescu_chen_ex1", "crossing_curve_points")
    mapped = sc.stability_map(system("gu_niculescu_chen_ex1"), tau1=(0, 20), tau2=(0, 20))
    points = np.array(expected["value"])
    assert np.all(points[:, 1:] < 20.0)
    assert np.all(mapped.distance(points[:, 1], points[:, 2]) < 1e-3)
    low, high = row("gu_niculescu_chen_ex1", "crossing_frequency_interval")["value"]
    assert mapped.curves["omega"].min() == pytest.approx(low, abs=1e-4)
    assert mapped.curves["omega"].max() == pytest.approx(high, abs=1e-4)


@pytest.mark.literature
@pytest.mark.parametrize(
    "case", ["gu_niculescu_chen_ex1", "haag6_two_delay_oscillator", "julia_two_delay_loop"]
)
def test_counts_of_the_literature(case):
    """Numbers of unstable roots at the delays of tests/data/delay_cases.json."""
    found = [p.values for p in rows("unstable_root_count") if p.values[0]["id"] == case]
    mapped = sc.stability_map(system(case), tau1=(0, 12), tau2=(0, 12))
    for given_case, expected in found:
        _, t1, t2 = expected.get("at_delays", given_case["delays"])
        assert mapped.unstable_roots(t1, t2) == expected["value"]
    assert found


@pytest.mark.literature
def test_diagonal_is_safe_and_the_rest_is_not():
    """Haag 2009, example 6: no curve meets tau1 = tau2; tau2 alone switches at 2.0971, 3.4964, 9.2370."""
    mapped = sc.stability_map(system("haag6_two_delay_oscillator"), tau1=(0, 12), tau2=(0, 12))
    equal = np.linspace(0.0, 12.0, 200)
    assert np.all(mapped.unstable_roots(equal, equal) == 0)
    expected = row("haag6_two_delay_oscillator", "critical_delays_tau1_0")
    assert np.all(mapped.distance(0.0, expected["value"]) < 5e-4)


@pytest.mark.literature
def test_published_designs_have_no_curves():
    """The paper's random design: stable on the whole square of delays."""
    mapped = sc.stability_map(car_loop(19345.0, 26150.0))
    assert mapped.curves.empty
    assert mapped.regions["unstable_roots"].tolist() == [0]
    assert np.all(np.isinf(mapped.distance(np.linspace(0, 1, 5), 0.5)))
    assert mapped.decided


@pytest.mark.property
@pytest.mark.parametrize(("g1", "g2"), [(300e3, -150e3), (110e3, 1.0), (110e3, 0.0)])
def test_strong_half_car_agrees_with_counts(g1, g2):
    """Hardly coupled channels: nearly straight curves with tiny frequency intervals."""
    loop = car_loop(g1, g2)
    mapped = sc.stability_map(loop)
    assert mapped.decided
    agree(loop, mapped, ("tau1", "tau2"), 40, np.random.default_rng(0))


@pytest.mark.property
@pytest.mark.parametrize(
    "ranges",
    [
        {"gain1": (-3e5, 3e5), "tau2": (0, 1)},
        {"tau1": (0, 1), "gain2": (-3e5, 3e5)},
        {"tau1": (0, 1), "gain1": (-3e5, 3e5)},
        {"gain1": (-3e5, 3e5), "gain2": (-3e5, 3e5)},
    ],
    ids=lambda r: "-".join(r),
)
def test_gain_and_delay_of_the_half_car(ranges):
    loop = car_loop(150e3, -80e3)
    mapped = sc.stability_map(loop, **ranges)
    assert mapped.decided
    agree(loop, mapped, list(ranges), 25, np.random.default_rng(1))


def random_loop(seed, widths):
    rng = np.random.default_rng(seed)
    n = rng.integers(2, 6)
    A = [rng.standard_normal((n, n)) - rng.uniform(0, 3) * np.eye(n)]
    for r in widths:
        A.append(
            rng.uniform(0.3, 1.5) * rng.standard_normal((n, r)) @ rng.standard_normal((r, n)) / np.sqrt(n)
        )
    return sc.DelayLTI.from_state_delays(A=A, delays=[0.5, 0.8]), rng


@pytest.mark.property
@settings(max_examples=15)
@given(st.integers(0, 2**31))
def test_random_loops_over_two_delays(seed):
    loop, rng = random_loop(seed, (1, 1))
    mapped = sc.stability_map(loop, tau1=(0, 3), tau2=(0, 3))
    assert mapped.decided
    agree(loop, mapped, ("tau1", "tau2"), 12, rng)


@pytest.mark.property
@settings(max_examples=15)
@given(
    st.integers(0, 2**31),
    st.sampled_from([("gain1", "tau2"), ("tau1", "gain2"), ("gain1", "gain2"), ("tau1", "gain1")]),
)
def test_random_loops_over_gains(seed, names):
    """Real roots that pass through zero as a gain grows change the number by one."""
    loop, rng = random_loop(seed, (1, 1))
    mapped = sc.stability_map(loop, **{name: (0, 3) if name.startswith("tau") else (-3, 3) for name in names})
    assert mapped.decided
    agree(loop, mapped, names, 12, rng)


@pytest.mark.property
def test_random_loops_with_delays_shared_by_two_signals():
    """Traced numerically: where a map says that it is decided, it is right; most are."""
    decided = 0
    for seed in range(12):
        loop, rng = random_loop(seed, (2, 2))
        mapped = sc.stability_map(loop, tau1=(0, 3), tau2=(0, 3))
        decided += mapped.decided
        x, y = rng.uniform(0, 3, 10), rng.uniform(0, 3, 10)
        for k in np.flatnonzero(mapped.distance(x, y) > 0.02) if mapped.decided else []:
            counted = sc.count_unstable_roots(loop.with_delays([x[k], y[k]]))
            assert counted is None or counted == mapped.unstable_roots(x[k], y[k])
    assert decided >= 8


@pytest.mark.property
def test_third_delay_stays_fixed():
    rng = np.random.default_rng(5)
    A = [rng.standard_normal((3, 3)) - 2 * np.eye(3)] + [
        np.outer(rng.standard_normal(3), rng.standard_normal(3)) for _ in range(3)
    ]
    loop = sc.DelayLTI.from_state_delays(A=A, delays=[0.4, 0.7, 1.1])
    mapped = sc.stability_map(loop, tau1=(0, 3), tau2=(0, 3), channels=(0, 2))
    for x, y in rng.uniform(0, 3, (20, 2)):
        if mapped.distance(x, y) > 1e-3:
            assert mapped.unstable_roots(x, y) == sc.count_unstable_roots(loop.with_delays([x, 0.7, y]))


@pytest.mark.property
def test_arrays_broadcast():
    mapped = sc.stability_map(system("gu_niculescu_chen_ex1"), tau1=(0, 4), tau2=(0, 4))
    x, y = np.linspace(0, 4, 7), np.linspace(0, 4, 5)[:, None]
    assert mapped.unstable_roots(x, y).shape == (5, 7)
    assert mapped.distance(x, y).shape == (5, 7)
    assert mapped.unstable_roots(x, y)[3, 2] == mapped.unstable_roots(x[2], y[3, 0])
    assert np.ndim(mapped.distance(1.0, 1.0)) == 0
    with pytest.raises(InputError, match="leaves the map"):
        mapped.unstable_roots(5.0, 1.0)


@pytest.mark.analytical
def test_plot_and_text():
    import matplotlib.pyplot as plt

    mapped = sc.stability_map(system("gu_niculescu_chen_ex1"), tau1=(0, 4), tau2=(0, 4))
    figure, ax = plt.subplots()
    assert mapped.plot(ax) is ax
    assert ax.get_xlim() == (0.0, 4.0)
    plt.close(figure)
    assert "stable on" in str(mapped)


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"tau1": (1, 0)}, "tau1"),
        ({"tau1": (-1, 1)}, "tau1"),
        ({"gain1": (0, 1)}, "two of"),
        ({"tau1": (0, 1), "tau2": (0, 1), "gain1": (0, 1)}, "two of"),
        ({"channels": (0, 0)}, "channels"),
        ({"channels": (0, 5)}, "channels"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(InputError, match=message):
        sc.stability_map(system("gu_niculescu_chen_ex1"), **arguments)
