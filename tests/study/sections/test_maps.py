"""Stability maps of a study: settings, curves against counts, gain limits, and what a click on the page shows."""

from __future__ import annotations

import collocation
import numpy as np
import oracles
import pytest

import susp_ctrl as sc
from susp_ctrl.errors import InputError
from susp_ctrl.study import Study, compute_study
from susp_ctrl.study.sections.map_explorer import map_explorers

FRONT = {"measured": "unsprung_displacement_front", "actuator": "force_front"}
REAR = {"measured": "unsprung_displacement_rear", "actuator": "force_rear"}
DESIGNS = [
    {
        "key": "published",
        "label": "published",
        "channels": [
            FRONT | {"gain_N_per_m": 19345.0, "delay_s": 0.553},
            REAR | {"gain_N_per_m": 26150.0, "delay_s": 0.5186},
        ],
    },
    {
        "key": "front_alone",
        "label": "front alone",
        "channels": [FRONT | {"gain_N_per_m": 20000.0, "delay_s": 0.2}],
    },
]


def study(*maps):
    table = {"name": "maps", "title": "Maps", "designs": DESIGNS, "stability_maps": list(maps)}
    return Study.from_table(table, "maps.toml")


def cases(*maps):
    return compute_study(study(*maps)).stability_maps


def loop(gains, delays):
    plant = sc.HalfCar().plant()
    return sc.close_loop(
        plant,
        [
            sc.FeedbackChannel(pair["measured"], pair["actuator"], gain, delay)
            for pair, gain, delay in zip((FRONT, REAR), gains, delays, strict=False)
        ],
    )


BEYOND = {
    "key": "beyond",
    "designs": ["published"],
    "gain_factor": 5.5,
    "tau1_from_s": 0.0,
    "tau1_to_s": 0.3,
    "tau2_from_s": 0.0,
    "tau2_to_s": 0.3,
}
SMALL_EXPLORER = {"points": 4, "output": "body_acceleration", "duration_s": 1.0, "step_s": 0.01}


@pytest.fixture(scope="module")
def beyond_run():
    return compute_study(study(BEYOND | {"explorer": SMALL_EXPLORER}))


@pytest.fixture(scope="module")
def explorer(beyond_run):
    (found,) = map_explorers(beyond_run).values()
    return found


@pytest.mark.literature
def test_published_gains_have_no_curve_and_all_designs_with_the_channels_are_mapped():
    (case,) = cases({"key": "all"})
    assert (case.design, case.x.low, case.x.high) == ("published", 0.0, 1.0)  # the other one has one channel
    assert case.map.curves.empty
    assert case.distance == np.inf
    assert case.map.design == (0.553, 0.5186)
    assert case.point_roots == 0
    assert case.counts.to_numpy().tolist() == [[0.0, 1.0, 1.0]]
    assert case.map.decided
    # The rear gain alone is lost at 99402 N/m, 63.12 rad/s, and the front one does not help (PAPER, section 4).
    assert case.independence.margin == pytest.approx(99402 / 26150, rel=1e-4)
    assert case.independence.omega == pytest.approx(63.12, abs=0.01)


@pytest.mark.property
def test_numbers_of_the_map_equal_counts_at_points_off_the_curves(beyond_run):
    (case,) = beyond_run.stability_maps
    assert case.map.decided
    assert case.counts["area"].sum() == pytest.approx(1.0)
    assert case.counts["regions"].sum() == len(case.map.regions)
    assert set(case.counts["unstable_roots"]) >= {0, 2, 4}
    rng = np.random.default_rng(3)
    clear = []
    x_values, y_values = (np.linspace(*ends, 300) for ends in (case.map.x_range, case.map.y_range))
    unstable = case.map.unstable_roots(x_values, y_values[:, None])
    for row, column in rng.integers(2, unstable.shape[0] - 2, (60, 2)):
        around = unstable[row - 2 : row + 3, column - 2 : column + 3]
        if (around == around[2, 2]).all():
            clear.append((row, column))
    assert len(clear) > 15
    for row, column in clear:
        delays = x_values[column], y_values[row]
        counted = sc.count_unstable_roots(loop((5.5 * 19345, 5.5 * 26150), delays))
        assert counted == unstable[row, column]


@pytest.mark.analytical
def test_crossing_curves_satisfy_the_characteristic_equation_of_the_oracle(beyond_run):
    """On a curve det Z(j w) = 0 at some w of the crossing band."""
    (case,) = beyond_run.stability_maps
    low, high = case.crossing_band
    gains = (5.5 * oracles_gain(0), 5.5 * oracles_gain(1))
    omega = np.linspace(low - 1.0, high + 1.0, 20001)
    curves = case.map.curves[["x0", "y0", "x1", "y1"]].to_numpy()
    inside = curves[np.all((curves >= 0.0) & (curves <= 0.3), axis=1)]
    for start in inside[:: len(inside) // 12, :2]:
        value = np.abs(np.linalg.det(oracles.dynamic_stiffness(1j * omega, gains, tuple(start))))
        scale = np.abs(np.linalg.det(oracles.dynamic_stiffness(1j * omega)))
        assert (value / scale).min() < 2e-3


def oracles_gain(n):
    return (19345.0, 26150.0)[n]


@pytest.mark.analytical
def test_the_least_gain_limit_of_one_channel_is_the_peak_of_its_response():
    """Over all delays a single loop is lost at g = 1/max |G(j w)|, G from the front force to its wheel."""
    (case,) = cases(
        {
            "key": "front",
            "designs": ["front_alone"],
            "tau1_from_s": 0.0,
            "tau1_to_s": 1.0,
            "gain1_from_N_per_m": -200e3,
            "gain1_to_N_per_m": 200e3,
        }
    )
    omega = np.linspace(50.0, 80.0, 30001)
    z = oracles.dynamic_stiffness(1j * omega)
    force = np.array([-1.0, 0.0, 1.0, -1.25])  # on the wheel down, on the body up
    threshold = 1.0 / np.abs(np.linalg.solve(z, force[:, None])[:, 0, 0]).max()
    limits = case.gain_limits
    assert limits["gain_to"].min() == pytest.approx(threshold, rel=2e-4)
    assert -limits["gain_from"].max() == pytest.approx(threshold, rel=2e-4)
    assert (case.x.name, case.y.name, case.y.unit) == ("tau1", "gain1", "N/m")
    assert case.map.design == (0.2, 20000.0)


@pytest.mark.property
@pytest.mark.parametrize("gain_first", [False, True])
def test_gain_limits_are_where_the_count_changes(gain_first):
    """With gain1 and tau2 free the gain is x, with tau1 and gain1 it is y."""
    delay = "tau2" if gain_first else "tau1"
    (case,) = cases(
        {
            "key": "limits",
            "designs": ["published"],
            f"{delay}_from_s": 0.1,
            f"{delay}_to_s": 0.5,
            "gain1_from_N_per_m": -50e3,
            "gain1_to_N_per_m": 180e3,
        }
    )
    assert (case.x.name == "gain1") is gain_first
    limits = case.gain_limits
    assert limits["gain_from"].isna().all()  # not met down to -50 kN/m
    assert limits["delay_s"].iloc[[0, -1]].tolist() == [0.1, 0.5]
    for tau, gain, omega in limits[["delay_s", "gain_to", "omega_rad_per_s"]].iloc[::40].to_numpy():
        delays = (0.553, tau) if gain_first else (tau, 0.5186)
        assert sc.count_unstable_roots(loop((0.998 * gain, 26150.0), delays)) == 0
        assert sc.count_unstable_roots(loop((1.002 * gain, 26150.0), delays)) >= 2
        rightmost = sc.characteristic_roots(loop((gain, 26150.0), delays), count=1)[0]
        assert abs(rightmost.real) < 0.02
        assert abs(rightmost.imag) == pytest.approx(omega, rel=5e-3)


def test_a_design_outside_of_its_map_has_neither_number_nor_distance():
    (case,) = cases(BEYOND)
    assert case.point_roots == -1
    assert np.isnan(case.distance)


@pytest.mark.analytical
def test_roots_of_the_explorer_solve_the_characteristic_equation_and_agree_with_the_counts(explorer):
    assert explorer.roots.shape == (4, 4)
    assert ((explorer.roots.real > 0) == (explorer.unstable_roots > 0)).all()
    assert (explorer.roots.imag >= 0).all()
    gains = (5.5 * 19345.0, 5.5 * 26150.0)
    for row, tau2 in enumerate(explorer.y_values):
        for column, tau1 in enumerate(explorer.x_values):
            s = explorer.roots[row, column]
            z = oracles.dynamic_stiffness(s, gains, (tau1, tau2))
            assert np.linalg.svd(z, compute_uv=False)[-1] < 1e-6 * np.linalg.norm(z)


@pytest.mark.analytical
@pytest.mark.parametrize(("row", "column"), [(0, 1), (2, 3)])
def test_responses_of_the_explorer_equal_an_independent_simulation(explorer, row, column):
    delays = explorer.x_values[column], explorer.y_values[row]
    road = sc.BumpRoad(0.05, 1.0, 20.0)
    inputs = road.inputs({"road_front": 0.0, "road_rear": 2.76 / 20.0})
    exact = collocation.simulate(loop((5.5 * 19345, 5.5 * 26150), delays), explorer.timepts, inputs).outputs[
        0
    ]
    assert abs(explorer.responses[row, column] - exact).max() < 2e-4 * abs(exact).max()
    passive = sc.simulate(loop((0.0, 0.0), (0.1, 0.1)), explorer.timepts, inputs).outputs[0]
    assert abs(explorer.passive - passive).max() < 2e-4 * abs(passive).max()
    assert explorer.timepts[-1] == pytest.approx(1.0)
    assert (explorer.output, explorer.unit) == ("body_acceleration", "m/s2")


def test_no_explorer_where_none_is_asked_or_nothing_crosses():
    assert map_explorers(compute_study(study(BEYOND))) == {}
    assert map_explorers(compute_study(study({"key": "flat", "explorer": SMALL_EXPLORER}))) == {}


MALFORMED = {
    "unknown key": ({"tau3_to_s": 1.0}, "tau3_to_s", "did you mean"),
    "no unit": ({"tau1_to": 1.0}, "tau1_to", "tau1_to_s"),
    "half a range": ({"tau1_from_s": 0.0}, "tau1_to_s", "needs both"),
    "empty range": ({"tau1_from_s": 1.0, "tau1_to_s": 1.0}, "tau1_to_s", "more than tau1_from = 1"),
    "negative delay": ({"tau1_from_s": -0.1, "tau1_to_s": 1.0}, "tau1_from_s", "at least 0"),
    "one free": ({"tau1_from_s": 0.0, "tau1_to_s": 1.0}, "tau1_to_s", "two of tau1"),
    "unit of the gain": (
        {"tau1_from_s": 0.0, "tau1_to_s": 1.0, "gain1_from_N_s_per_m": 0.0, "gain1_to_N_s_per_m": 1.0},
        "gain1_from_N_s_per_m",
        "gain1_from_N_per_m",
    ),
    "unit that is none": ({"gain1_to_kN_per_m": 1.0}, "gain1_to_kN_per_m", "gain1_to_N_per_m"),
    "no such design": ({"designs": ["publishd"]}, "designs", 'did you mean "published"'),
    "passive": ({"designs": ["passive"]}, "designs", "allowed are"),
    "design too small": ({"designs": ["front_alone"]}, "designs", "a design with 2 channels"),
    "channels": ({"channels": [1, 1]}, "channels", "two different"),
    "channel zero": ({"channels": [0, 1]}, "channels[1]", "at least 1"),
    "factor": ({"gain_factor": 0.0}, "gain_factor", "greater than 0"),
    "key": ({"key": "Two words"}, "key", "small letters"),
    "explorer points": ({"explorer": {"points": 1}}, "explorer.points", "at least 2"),
    "explorer output": ({"explorer": {"output": "body_accel"}}, "explorer.output", "body_acceleration"),
    "explorer step": ({"explorer": {"step_s": 1e-5}}, "explorer.step_s", "0.002"),
    "explorer road": ({"explorer": {"road": {"kind": "bump"}}}, "explorer.road.height_m", "missing"),
    "explorer unknown": ({"explorer": {"point": 5}}, "explorer.point", 'did you mean "points"'),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed_maps_give_one_line(name):
    change, key, words = MALFORMED[name]
    with pytest.raises(InputError) as found:
        study({"key": "map"} | change)
    text = str(found.value)
    assert text.startswith("maps.toml: stability_maps[")
    assert f"].{key}" in text
    assert words in text
    assert "\n" not in text


def test_a_key_is_used_once():
    with pytest.raises(InputError, match=r"stability_maps\[one\]\.key = \"one\": every key"):
        study({"key": "one"}, {"key": "one"})
