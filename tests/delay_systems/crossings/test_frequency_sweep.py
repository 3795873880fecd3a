"""Delay sweeps: closed forms, literature cases, degenerate crossings, and agreement with independent counts."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from delay_cases import matrices, row, rows, system
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems.crossings.crossing_search import CrossingSearch
from susp_ctrl.delay_systems.crossings.delay_line import DelayLine
from susp_ctrl.errors import InputError, NeutralLoopError

DESIGNS = {
    # Table of published designs of the source paper: g1, g2 (N/m), tau1, tau2 (s)
    "harmonic": (29653.0, -4416.0, 0.3255, 0.5438),
    "random": (19345.0, 26150.0, 0.5530, 0.5186),
    "damped": (19287.0, 23930.0, 0.434, 0.452),
    "many-peaked": (25333.0, 23371.0, 0.906, 0.546),
}


def states(*A, delays=None):
    """x' = A0 x + sum A_k x(t - delays_k)."""
    return sc.DelayLTI.from_state_delays(
        A=[np.atleast_2d(a) for a in A], delays=delays or [1.0] * (len(A) - 1)
    )


def car_loop(g1, g2, tau1, tau2):
    """The half car with delayed wheel-displacement feedback."""
    channels = [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", gain=g1, delay=tau1),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", gain=g2, delay=tau2),
    ]
    return sc.close_loop(sc.HalfCar().plant(), channels)


def roots_of(sweep):
    return sweep.intervals["unstable_roots"].tolist()


@pytest.mark.analytical
@pytest.mark.parametrize("gain", [1.0, 0.3, 40.0])
def test_integrator_crosses_at_odd_quarter_turns(gain):
    """x' = -k x(t - tau): s = jk at tau = (pi/2 + 2 pi r)/k, always to the right."""
    end = 20.0 / gain
    sweep = sc.sweep_delays(states([[0.0]], [[-gain]]), up_to=end)
    expected = (np.pi / 2 + 2 * np.pi * np.arange(3)) / gain
    np.testing.assert_allclose(sweep.crossings["tau"], expected, rtol=1e-12)
    np.testing.assert_allclose(sweep.crossings["omega"], gain, rtol=1e-12)
    assert sweep.crossings["tendency"].tolist() == [1, 1, 1]
    assert sweep.crossings["unstable_before"].tolist() == [0, 2, 4]
    assert sweep.crossings["unstable_after"].tolist() == [2, 4, 6]
    assert roots_of(sweep) == [0, 2, 4, 6]
    assert sweep.stable_intervals == [(0.0, pytest.approx(expected[0], rel=1e-12))]
    assert sweep.delay_margin == pytest.approx(expected[0], rel=1e-12)
    assert sweep.decided
    assert sweep.proven


@pytest.mark.analytical
def test_first_order_with_delayed_feedback_and_fixed_delay():
    """x' = -x - 3 x(t - tau): omega = sqrt 8, tau = arccos(-1/3)/sqrt 8; a fixed delay of the same term shifts it."""
    free = sc.sweep_delays(states([[-1.0]], [[-3.0]]), up_to=3.0)
    expected = np.arccos(-1.0 / 3.0) / np.sqrt(8.0)
    assert free.crossings["tau"][0] == pytest.approx(expected, rel=1e-12)
    assert free.crossings["omega"][0] == pytest.approx(np.sqrt(8.0), rel=1e-12)
    late = sc.sweep_delays(states([[-1.0]], [[-3.0]]), start=0.4, up_to=2.0)
    assert late.crossings["tau"][0] == pytest.approx(expected - 0.4, rel=1e-11)
    steep = sc.sweep_delays(states([[-1.0]], [[-3.0]]), direction=0.25, up_to=8.0)
    assert steep.crossings["tau"][0] == pytest.approx(4.0 * expected, rel=1e-12)


@pytest.mark.analytical
def test_oscillator_regains_stability_again_and_again():
    """x'' + x + 0.2 x'(t - tau): |w^2 - 1| = 0.2 w, alternating switches; all from the quadratic by hand."""
    sweep = sc.sweep_delays(states([[0.0, 1.0], [-1.0, 0.0]], [[0.0, 0.0], [0.0, -0.2]]), up_to=12.0)
    high, low = 0.1 + np.sqrt(1.01), -0.1 + np.sqrt(1.01)
    # (1 - w^2) + 0.2 j w e^{-jw tau} = 0: e^{-jw tau} = j (1 - w^2)/(0.2 w), -j above w = 1 and j below
    expected = sorted(
        [((np.pi / 2 + 2 * np.pi * r) / high, high, 1) for r in range(2)]
        + [((3 * np.pi / 2 + 2 * np.pi * r) / low, low, -1) for r in range(1)]
    )
    found = sweep.crossings[["tau", "omega", "tendency"]].to_numpy()
    np.testing.assert_allclose(found, np.array(expected), rtol=1e-10)
    assert roots_of(sweep) == [0, 2, 0, 2]
    assert len(sweep.stable_intervals) == 2


@pytest.mark.analytical
def test_two_equal_integrators_cross_twice_at_once():
    sweep = sc.sweep_delays(states(np.zeros((2, 2)), -np.eye(2)), up_to=8.0)
    np.testing.assert_allclose(sweep.crossings["tau"], np.array([1, 1, 5, 5]) * np.pi / 2, rtol=1e-9)
    assert roots_of(sweep) == [0, 4, 8]


@pytest.mark.analytical
def test_root_on_the_axis_at_the_start():
    """x'' + x + 0.3 x(t - tau) is undamped without delay: not stable at the start, stable later."""
    sweep = sc.sweep_delays(states([[0.0, 1.0], [-1.0, 0.0]], [[0.0, 0.0], [-0.3, 0.0]]), up_to=8.0)
    assert sweep.crossings["tau"][0] == pytest.approx(0.0, abs=1e-9)
    assert sweep.crossings["omega"][0] == pytest.approx(np.sqrt(1.3), rel=1e-9)
    assert sweep.delay_margin == 0.0
    assert sweep.crossings["tau"][1] == pytest.approx(np.pi / np.sqrt(0.7), rel=1e-9)
    assert roots_of(sweep) == [2, 0, 2]


@pytest.mark.analytical
def test_root_at_zero_for_every_delay():
    """s - 1 + e^{-s tau} has s = 0 always; a real root passes through it at tau = 1."""
    sweep = sc.sweep_delays(states([[1.0]], [[-1.0]]), up_to=5.0)
    assert sweep.axis_roots == (0.0,)
    assert sweep.stable_intervals == []
    assert sweep.delay_margin == 0.0
    assert sweep.crossings[["tau", "omega", "tendency"]].to_numpy().tolist() == [[pytest.approx(1.0), 0.0, 1]]
    assert roots_of(sweep) == [0, 1]
    harmless = sc.sweep_delays(states([[-1.0]], [[1.0]]), up_to=5.0)
    assert harmless.axis_roots == (0.0,)
    assert harmless.stable_intervals == []


@pytest.mark.analytical
def test_undamped_mode_outside_the_loop_is_never_stable():
    A0 = np.zeros((3, 3))
    A0[:2, :2] = [[0.0, 2.5], [-2.5, 0.0]]
    A0[2, 2] = -1.0
    sweep = sc.sweep_delays(states(A0, np.diag([0.0, 0.0, -0.5])), up_to=3.0)
    assert sweep.axis_roots == (pytest.approx(2.5),)
    assert sweep.stable_intervals == []
    assert sweep.delay_margin == 0.0


@pytest.mark.analytical
def test_no_delay_in_a_loop():
    car = sc.sweep_delays(sc.HalfCar().plant(), up_to=1.0)
    assert car.crossings.empty
    assert car.delay_margin == np.inf
    idle = sc.sweep_delays(car_loop(0.0, 0.0, 0.1, 0.1))
    assert idle.delay_margin == np.inf


@pytest.mark.literature
@pytest.mark.parametrize(("case", "expected"), rows("critical_delays_up_to", "critical_delays_tau1_0"))
def test_critical_delays(case, expected):
    """Sources in tests/data/delay_cases.json."""
    two = expected["quantity"] == "critical_delays_tau1_0"
    sweep = sc.sweep_delays(system(case), (0, 1) if two else None, up_to=expected.get("up_to", 12.0))
    np.testing.assert_allclose(sweep.crossings["tau"], expected["value"], atol=expected["tolerance"], rtol=0)
    np.testing.assert_allclose(
        sweep.crossings["omega"], expected["omega"], atol=expected["tolerance"], rtol=0
    )


@pytest.mark.literature
@pytest.mark.parametrize(
    ("case", "expected"), rows("unstable_root_count_intervals", "unstable_root_count_intervals_tau1_0")
)
def test_unstable_roots_of_every_interval(case, expected):
    """Sources in tests/data/delay_cases.json; a touch separates intervals of the same number."""
    value = np.array(expected["value"], dtype=float)
    direction = (0, 1) if expected["quantity"].endswith("tau1_0") else None
    sweep = sc.sweep_delays(system(case), direction, up_to=float(value[-1, 1]))
    found = sweep.intervals.to_numpy(dtype=float)
    assert found.shape == value.shape
    np.testing.assert_allclose(found[:, :2], value[:, :2], atol=max(expected["tolerance"], 1e-9), rtol=0)
    assert found[:, 2].tolist() == value[:, 2].tolist()
    assert sweep.decided


@pytest.mark.literature
@pytest.mark.parametrize(("case", "expected"), rows("crossing_set_omega_theta"))
def test_crossing_set(case, expected):
    """Pairs (omega, omega tau mod 2 pi); sources in tests/data/delay_cases.json."""
    sweep = sc.sweep_delays(system(case), up_to=20.0)
    omega = sweep.crossings["omega"].to_numpy()
    theta = np.mod(omega * sweep.crossings["tau"].to_numpy(), 2 * np.pi)
    for w, angle in expected["value"]:
        near = np.abs(omega - w) < 1e-6
        assert np.any(near)
        np.testing.assert_allclose(omega[near], w, atol=expected["tolerance"], rtol=0)
        # the tolerance is one of the angle, which grows with the number of turns
        np.testing.assert_allclose(theta[near], angle, atol=20 * expected["tolerance"], rtol=0)
    assert len(np.unique(np.round(omega, 6))) == len(expected["value"])


@pytest.mark.literature
@pytest.mark.parametrize(("case", "expected"), rows("delay_margin"))
def test_delay_margin(case, expected):
    """Sources in tests/data/delay_cases.json. PIETOOLS prints 1.5707 for pi/2 and 6.17258 for 6.172581371."""
    sweep = sc.sweep_delays(system(case), up_to=7.0)
    assert sweep.delay_margin == pytest.approx(expected["value"], abs=expected["tolerance"])


@pytest.mark.literature
def test_published_switches_of_the_delayed_oscillator_are_inner_bounds():
    """Gu, Kharitonov, Chen 2003, p. 193, as printed by PIETOOLS: 0.100174 and 1.71785 are off by 6e-6 and 8e-6."""
    expected = row("delayed_oscillator_gkc_p193", "stable_interval")
    (found,) = sc.sweep_delays(system("delayed_oscillator_gkc_p193"), up_to=5.0).stable_intervals
    np.testing.assert_allclose(found, expected["value"], atol=expected["tolerance"], rtol=0)
    error = np.abs(np.array(found) - expected["published"])
    assert np.all((error > 5e-6) & (error < 9e-6))
    assert expected["published"][0] > found[0]
    assert expected["published"][1] < found[1]


@pytest.mark.literature
def test_tangential_touch_is_no_crossing():
    """Haag, Muenz, Allgoewer 2009, example 1: |mu| touches one at omega = 1, tau = pi (2k + 1)."""
    expected = row("haag1_tangential_touch", "touch_delays")
    sweep = sc.sweep_delays(system("haag1_tangential_touch"), up_to=17.0)
    np.testing.assert_allclose(sweep.crossings["tau"], expected["value"], atol=expected["tolerance"], rtol=0)
    assert sweep.crossings["tendency"].tolist() == [0, 0, 0]
    assert roots_of(sweep) == [0, 0, 0, 0]
    assert sweep.delay_margin == pytest.approx(np.pi, abs=1e-9)


@pytest.mark.literature
def test_double_root_on_the_axis():
    """NLEVP time_delay2 (double root at 3 pi j for tau = 1): the pair meets and parts, another pair crosses."""
    sweep = sc.sweep_delays(system("nep_dep_double"), up_to=1.2)
    assert sweep.delay_margin == pytest.approx(row("nep_dep_double", "delay_margin")["value"], abs=1e-9)
    for tau, number in row("nep_dep_double", "unstable_root_count_at")["value"]:
        assert sweep.unstable_roots(tau) == number
    at_one = sweep.crossings[np.abs(sweep.crossings["tau"] - 1.0) < 1e-9]
    assert sorted(zip(at_one["omega"].round(6), at_one["tendency"], strict=True)) == [
        (round(3 * np.pi, 6), 0),
        (round(4.5 * np.pi, 6), 1),
    ]


@pytest.mark.literature
def test_two_delays_in_the_ratio_one_to_two():
    """Gu, Kharitonov, Chen 2003: delays (tau/2, tau), stable between; printed upper end 1.3722."""
    expected = row("double_delay_oscillator_gkc", "stable_interval_tau")
    sweep = sc.sweep_delays(system("double_delay_oscillator_gkc"), (0.5, 1.0), up_to=3.0)
    np.testing.assert_allclose(
        sweep.stable_intervals, [expected["value"]], atol=expected["tolerance"], rtol=0
    )
    omega = row("double_delay_oscillator_gkc", "crossing_omega")
    np.testing.assert_allclose(sweep.crossings["omega"], omega["value"], atol=omega["tolerance"], rtol=0)


@pytest.mark.literature
@pytest.mark.parametrize(
    ("quantity", "direction"),
    [
        ("critical_delay_equal", (1, 1)),
        ("critical_tau1_at_tau2_0", (1, 0)),
        ("critical_tau2_at_tau1_0", (0, 1)),
    ],
)
def test_gu_niculescu_chen_lines(quantity, direction):
    """Gu, Niculescu, Chen 2005, example 1: first crossings along three lines."""
    expected = row("gu_niculescu_chen_ex1", quantity)
    sweep = sc.sweep_delays(system("gu_niculescu_chen_ex1"), direction, up_to=4.0)
    assert sweep.delay_margin == pytest.approx(expected["value"], abs=expected["tolerance"])
    assert sweep.crossings["omega"][0] == pytest.approx(expected["omega"], abs=expected["tolerance"])


@pytest.mark.literature
def test_equal_delays_hide_what_independent_delays_do():
    """Haag 2009, example 6: stable for every tau1 = tau2, unstable at (0, 2.5)."""
    assert sc.sweep_delays(system("haag6_two_delay_oscillator"), up_to=50.0).delay_margin == np.inf
    assert sc.sweep_delays(system("haag6_two_delay_oscillator"), (0, 1), up_to=5.0).unstable_roots(2.5) == 2


@pytest.mark.literature
def test_delay_margin_of_a_pi_loop_with_dead_time():
    """MATLAB's dead-time example: total delay 9.2712 s at the gain crossover."""
    expected = row("matlab_pi_deadtime", "critical_total_delay")
    sweep = sc.sweep_delays(system("matlab_pi_deadtime"), up_to=10.0)
    assert sweep.delay_margin == pytest.approx(expected["value"], abs=expected["tolerance"])
    beyond = sc.sweep_delays(system("matlab_pi_deadtime"), start=2.6, up_to=8.0)
    assert beyond.delay_margin == pytest.approx(
        row("matlab_pi_deadtime", "delay_margin_beyond_2.6")["value"], abs=expected["tolerance"]
    )


@pytest.mark.literature
def test_delay_margin_beyond_the_independent_range():
    """delay_independent_beta with beta = 0.9: margin 2.886 s; with 0.35 stable for every delay."""
    A0, A1 = matrices("delay_independent_beta")
    expected = row("delay_independent_beta", "delay_margin_beta_0.9")
    sweep = sc.sweep_delays(system("delay_independent_beta", A=[A0, A1 * (0.9 / 0.35)]), up_to=4.0)
    assert sweep.delay_margin == pytest.approx(expected["value"], abs=expected["tolerance"])
    assert sc.sweep_delays(system("delay_independent_beta"), up_to=4.0).delay_margin == np.inf


@pytest.mark.literature
@pytest.mark.parametrize("name", DESIGNS)
def test_published_designs_are_stable_for_every_delay(name):
    """The paper prints crossings at 0.6312 s and 0.5817 s; under its eq. (1) there are none for any delay."""
    g1, g2, tau1, tau2 = DESIGNS[name]
    loop = car_loop(g1, g2, tau1, tau2)
    for direction, start in (((1, 1), (0, 0)), ((tau1, tau2), (0, 0)), ((0, 1), (tau1, 0))):
        sweep = sc.sweep_delays(loop, direction, start, up_to=2.0)
        assert sweep.crossings.empty
        assert sweep.delay_margin == np.inf
        assert sweep.stable_intervals == [(0.0, 2.0)]
        assert sweep.decided
        assert sweep.proven


@pytest.mark.property
@pytest.mark.parametrize(("g1", "g2"), [(300e3, 200e3), (300e3, -150e3), (110e3, 0.0)])
@pytest.mark.parametrize("line", [((1, 1), (0, 0)), ((0.553, 0.5186), (0, 0)), ((0, 1), (0.553, 0.1))])
def test_strong_half_car_loops_agree_with_counts(g1, g2, line):
    direction, start = line
    loop = car_loop(g1, g2, 0.1, 0.1)
    sweep = sc.sweep_delays(loop, direction, start, up_to=1.0)
    assert sweep.decided
    assert sweep.proven
    for tau in np.random.default_rng(3).uniform(0.0, 1.0, 5):
        counted = sc.count_unstable_roots(loop.with_delays(np.array(start) + tau * np.array(direction)))
        assert sweep.unstable_roots(tau) == counted


@pytest.mark.property
def test_ways_of_finding_agree():
    """Exact pencil, search over one turn, and search over the delay give the same crossings."""
    for name, end in (
        ("ctcr_olgac_sipahi", 1.0),
        ("delayed_oscillator_gkc_p193", 9.5),
        ("nep_dep_double", 3.2),
    ):
        search = CrossingSearch(DelayLine.of(system(name), np.ones(1), np.zeros(1), end))
        found = [way() for way in search.ways()]
        assert len(found) == 3
        for other in found[1:]:
            assert other.complete
            order = np.lexsort((other.omega, other.tau.round(7)))
            first = np.lexsort((found[0].omega, found[0].tau.round(7)))
            np.testing.assert_allclose(other.tau[order], found[0].tau[first], atol=1e-9)
            np.testing.assert_allclose(other.omega[order], found[0].omega[first], atol=1e-8)
            assert other.degree[order].tolist() == found[0].degree[first].tolist()


def random_system(seed):
    """1 to 6 states, 1 to 3 delays, any rank."""
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 7), rng.integers(1, 4)
    A = [rng.standard_normal((n, n)) - rng.uniform(0, 3) * np.eye(n)]
    for _ in range(m):
        r = rng.integers(1, n + 1)
        scale = rng.uniform(0.1, 1.5) / np.sqrt(n)
        A.append(scale * rng.standard_normal((n, r)) @ rng.standard_normal((r, n)))
    return sc.DelayLTI.from_state_delays(A=A, delays=rng.uniform(0.05, 2.0, m)), rng


def check_random_line(seed):
    loop, rng = random_system(seed)
    m = loop.delays.size
    one = np.eye(m)[rng.integers(m)]
    direction, start, end = [
        (np.ones(m), np.zeros(m), 2.0),
        (loop.delays, np.zeros(m), 1.0),
        (one, loop.delays * (1 - one), 2.0),
        (rng.integers(1, 4, m).astype(float), np.zeros(m), 1.0),
    ][rng.integers(4)]
    sweep = sc.sweep_delays(loop, direction, start, up_to=end)
    assert sweep.decided, f"{loop}\n{sweep}"
    assert sweep.proven, f"{loop}\n{sweep}"
    for tau in rng.uniform(0.0, end, 4):
        counted = sc.count_unstable_roots(loop.with_delays(start + tau * direction))
        assert counted is None or counted == sweep.unstable_roots(tau)


@pytest.mark.property
@settings(max_examples=100)
@given(st.integers(0, 2**31))
def test_random_lines_agree_with_counts(seed):
    check_random_line(seed)


@pytest.mark.property
@pytest.mark.slow
@settings(max_examples=2000)
@given(st.integers(0, 2**31))
def test_many_random_lines_agree_with_counts(seed):
    check_random_line(seed)


@pytest.mark.property
def test_intervals_follow_from_the_crossings():
    sweep = sc.sweep_delays(system("ctcr_olgac_sipahi"), up_to=2.0)
    before, after = (sweep.crossings[f"unstable_{side}"].to_numpy() for side in ("before", "after"))
    np.testing.assert_array_equal(after - before, 2 * sweep.crossings["tendency"])
    edges = sweep.intervals[["tau_from", "tau_to"]].to_numpy()
    assert edges[0, 0] == 0.0
    assert edges[-1, 1] == 2.0
    np.testing.assert_array_equal(edges[1:, 0], edges[:-1, 1])


@pytest.mark.analytical
def test_figure_data_is_the_modulus_of_z():
    """x' = -x(t - tau): z = -jw, so |z| = w; two equal delays give the two roots of a quadratic."""
    data = sc.sweep_delays(states([[0.0]], [[-1.0]]), up_to=3.0).figure_data
    np.testing.assert_allclose(data["z1"], data["omega"], rtol=1e-10)
    A0, A1, A2 = matrices("gu_niculescu_chen_ex1")
    both = sc.sweep_delays(states(A0, A1, A2), up_to=3.0).figure_data
    w = both["omega"].to_numpy()
    # s^2 + (2 s + 1) z = 0
    moduli = np.sort(both.drop(columns="omega").to_numpy(), axis=1)
    np.testing.assert_allclose(moduli[:, 0], w**2 / np.abs(2j * w + 1), rtol=1e-9)
    mixed = sc.sweep_delays(states(A0, A1, A2), (0.3, 0.7), up_to=3.0).figure_data
    assert list(mixed.columns) == ["omega", "rho"]


@pytest.mark.analytical
def test_plot_returns_the_axes_and_text_is_readable():
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots()
    sweep = sc.sweep_delays(system("ctcr_olgac_sipahi"), up_to=1.0)
    assert sweep.plot(ax) is ax
    assert ax.get_ylabel() == "|z|"
    plt.close(figure)
    text = str(sweep)
    assert "delay margin 0.16234564" in text
    assert "stable" in text


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"direction": (0, 0)}, "direction"),
        ({"direction": (1, 1, 1)}, "direction"),
        ({"start": (-0.1, 0)}, "start"),
        ({"direction": (1, -1), "start": (0, 1)}, "negative"),
        ({"up_to": 0.0}, "up_to"),
        ({"up_to": np.nan}, "up_to"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(InputError, match=message):
        sc.sweep_delays(system("gu_niculescu_chen_ex1"), **arguments)


@pytest.mark.analytical
def test_neutral_along_the_line_is_refused():
    """Acceleration feedback without delay is well posed; with any delay it is neutral."""
    loop = sc.close_loop(
        sc.HalfCar().plant(), [sc.FeedbackChannel("body_acceleration", "force_front", gain=-200.0, delay=0.0)]
    )
    with pytest.raises(NeutralLoopError):
        sc.sweep_delays(loop)


@pytest.mark.analytical
def test_thousands_of_crossings_are_listed_and_more_are_refused():
    """x' = -x - 2 x(t - tau): one crossing frequency sqrt(3), a pair more every 2 pi/sqrt(3)."""
    loop = states([[-1.0]], [[-2.0]])
    found = sc.sweep_delays(loop, up_to=5000.0)
    expected = np.floor((5000.0 * np.sqrt(3.0) - 2.0 * np.pi / 3.0) / (2.0 * np.pi)) + 1
    assert len(found.crossings) == expected
    assert found.intervals["unstable_roots"].tolist() == (2 * np.arange(expected + 1)).tolist()
    with pytest.raises(sc.InputError, match=r"some 2\.76e\+08 crossings: at most 50,000 are listed"):
        sc.sweep_delays(loop, up_to=1e9)
