"""Reading, changing and carrying a study."""

from __future__ import annotations

import hashlib
import pickle
from pathlib import Path

import pytest

import susp_ctrl as sc

MAIN = Path(__file__).parents[3] / "studies" / "wu_ren_2020.toml"


@pytest.fixture(scope="module")
def study():
    return sc.load_study(MAIN)


def test_values_arrive_in_their_place(study):
    published = {design.key: design for design in study.settings.designs}
    front, rear = published["random_published"].channels
    assert (front.gain, front.delay, rear.gain, rear.delay) == (19345.0, 0.5530, 26150.0, 0.5186)
    assert study.lags == {"road_front": 0.0, "road_rear": pytest.approx((1.25 + 1.51) / 20.0, rel=1e-15)}
    assert study.name == "wu_ren_2020"
    assert study.vehicle == sc.HalfCar()


def test_table_1_is_written_out_in_the_file(study):
    """Every number of Table 1 stands in the study file, not only in the defaults of the vehicle."""
    assert study.settings.vehicle.parameters == {
        "body_mass": 690.0,
        "pitch_inertia": 1200.0,
        "unsprung_mass_front": 40.5,
        "unsprung_mass_rear": 45.4,
        "tire_stiffness_front": 192000.0,
        "tire_stiffness_rear": 192000.0,
        "spring_stiffness_front": 17000.0,
        "spring_stiffness_rear": 22000.0,
        "damping_front": 1500.0,
        "damping_rear": 1500.0,
        "axle_distance_front": 1.25,
        "axle_distance_rear": 1.51,
    }


def test_hash_is_that_of_the_bytes(study):
    assert study.sha256 == hashlib.sha256(MAIN.read_bytes()).hexdigest()


def test_sections_that_are_not_given_are_none(tmp_path):
    path = tmp_path / "Straße mit Lücke.toml"
    path.write_text('name = "bare"\ntitle = "Bare"\n', encoding="utf-8")
    study = sc.load_study(path)
    assert study.settings.frequency is None
    assert study.settings.time == ()
    assert study.vehicle == sc.HalfCar()


def test_outputs_left_to_the_vehicle_are_its_ride_indicators(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        """
name = "bare"
title = "Bare"
vehicle = { kind = "quarter_car" }
frequency = {}
[[time]]
key = "bump"
label = "bump"
road = { kind = "bump", height_m = 0.05, length_m = 2.0 }
""",
        encoding="utf-8",
    )
    settings = sc.load_study(path).settings
    assert settings.frequency.outputs == ("body_acceleration", "suspension_deflection", "tire_deflection")
    assert settings.frequency.curve_outputs == ("body_acceleration",)
    assert settings.time[0].outputs == settings.frequency.outputs


def test_changes_reach_any_key(study):
    changed = study.with_changes(
        {
            "vehicle.body_mass_kg": 720.0,
            "time[random].road.seed": 7,
            "designs[random_published].channels[2].delay_s": 0.25,
            "title": "Heavier",
        }
    )
    assert changed.vehicle.body_mass == 720.0
    assert next(case for case in changed.settings.time if case.key == "random").road.seed == 7
    assert next(d for d in changed.settings.designs if d.key == "random_published").channels[1].delay == 0.25
    assert changed.title == "Heavier"
    assert study.vehicle.body_mass == 690.0
    assert changed.sha256 == ""


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"vehicle.body_mass_kg": -1.0}, ["vehicle.body_mass_kg = -1.0", "greater than 0"]),
        ({"vehicle.body_mas_kg": 1.0}, ["vehicle.body_mas_kg", "body_mass_kg"]),
        ({"designs[nobody].label": "x"}, ["designs[nobody].label", "nobody"]),
        ({"designs[first": 1}, ["designs[first", "a path such as"]),
        ({"title.more": 1}, ["title.more"]),
        ({"": 1}, ["a path that ends in a key"]),
        ({"designs": []}, ["frequency.curve_designs", "fig2_damped"]),
    ],
)
def test_changes_are_checked_like_a_file(study, changes, words):
    with pytest.raises(sc.InputError) as caught:
        study.with_changes(changes)
    for word in words:
        assert word in str(caught.value)


def test_a_study_and_its_errors_survive_pickling(study):
    assert study.plant.noutputs > 0
    again = pickle.loads(pickle.dumps(study))
    assert again.settings == study.settings
    assert again.plant.output_labels == study.plant.output_labels
    with pytest.raises(sc.InputError) as caught:
        study.with_changes({"title": 3})
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.parametrize(
    ("kind", "measured", "actuator", "gain_key"),
    [
        ("quarter_car", "body_velocity", "force", "gain_N_s_per_m"),
        ("quarter_car", "suspension_deflection", "force", "gain_N_per_m"),
        ("half_car", "pitch_angle", "force_front", "gain_N_per_rad"),
        ("full_car", "pitch_velocity", "force_front_left", "gain_N_s_per_rad"),
        ("half_car", "body_acceleration", "force_front", "gain_N_s2_per_m"),
    ],
)
def test_other_vehicles_and_signals(tmp_path, kind, measured, actuator, gain_key):
    path = tmp_path / "study.toml"
    path.write_text(
        f"""
name = "other"
title = "Other"
vehicle = {{ kind = "{kind}", speed_m_per_s = 10.0 }}
[[designs]]
key = "one"
label = "one"
[[designs.channels]]
measured = "{measured}"
actuator = "{actuator}"
{gain_key} = -10.0
delay_s = 0.01
actuator_bandwidth_rad_per_s = 300.0
""",
        encoding="utf-8",
    )
    study = sc.load_study(path)
    assert study.settings.designs[0].channels[0].gain == -10.0
    assert study.settings.vehicle.kind == kind
