"""Malformed study files: each gives one line that names the file, the key, the value and what is allowed."""

# ruff: noqa: E501  one case, one line
from __future__ import annotations

import pytest

import susp_ctrl as sc

BASE = """
name = "small"
title = "A small study"

[vehicle]
kind = "half_car"
speed_m_per_s = 20.0
body_mass_kg = 690.0

[[designs]]
key = "first"
label = "first design"
channels = [
    { measured = "unsprung_displacement_front", actuator = "force_front", gain_N_per_m = 19345.0, delay_s = 0.5 },
    { measured = "unsprung_displacement_rear", actuator = "force_rear", gain_N_per_m = 26150.0, delay_s = 0.4 },
]

[frequency]
omega_from_rad_per_s = 1.0
omega_to_rad_per_s = 100.0
points = 50
outputs = ["body_acceleration"]

[[tuning]]
key = "found"
label = "found here"
objective = "harmonic"
omega_rad_per_s = 7.0
weights = { body_acceleration = 0.7, pitch_acceleration = 0.3 }
particles = 10
iterations = 5
pairs = [
    { measured = "unsprung_displacement_front", actuator = "force_front", gain_from_N_per_m = -100.0, gain_to_N_per_m = 100.0, delay_to_s = 0.9 },
]

[stability]
lines = ["equal", "ray", "tau2"]
up_to_s = 1.0

[[time]]
key = "wave"
label = "harmonic road"
duration_s = 2.0
step_s = 0.005
report_step_s = 0.01
designs = ["first"]
road = { kind = "harmonic", amplitude_m = 0.05, omega_rad_per_s = 7.0 }

[pade]
orders = [3, 5]
omega_from_rad_per_s = 1.0
omega_to_rad_per_s = 50.0
cases = { first = "wave" }

[audit]
tolerance = 0.005

[[audit.tables]]
item = "Table"
time = "wave"
active = "first"
rows = [ { indicator = "body_acceleration", passive = "3.0", active = "2.0", change_percent = "-33.3" } ]

[[audit.peaks]]
item = "peak"
output = "body_acceleration"
frequency_Hz = "5.9"
"""

# (what stands in the file, what stands there instead, key in the message, further words in the message)
CASES = {
    "unknown top-level key": ('title = "A small study"', 'titel = "A small study"', "titel", ["title", "did you mean"]),
    "missing name": ('name = "small"', "", "name", ["missing"]),
    "missing title": ('title = "A small study"', "", "title", ["missing"]),
    "title is a number": ('title = "A small study"', "title = 3", "title = 3", ["text"]),
    "empty name": ('name = "small"', 'name = ""', 'name = ""', ["not empty"]),
    "unknown vehicle": ('kind = "half_car"', 'kind = "halfcar"', "vehicle.kind", ["halfcar", "half_car"]),
    "negative mass": ("body_mass_kg = 690.0", "body_mass_kg = -690.0", "vehicle.body_mass_kg", ["-690", "greater than 0"]),
    "mass of zero": ("body_mass_kg = 690.0", "body_mass_kg = 0", "vehicle.body_mass_kg", ["greater than 0"]),
    "mass is a text": ("body_mass_kg = 690.0", 'body_mass_kg = "heavy"', "vehicle.body_mass_kg", ["heavy", "number"]),
    "mass is infinite": ("body_mass_kg = 690.0", "body_mass_kg = inf", "vehicle.body_mass_kg", ["inf", "finite"]),
    "mass is nan": ("body_mass_kg = 690.0", "body_mass_kg = nan", "vehicle.body_mass_kg", ["nan", "finite"]),
    "mass is true": ("body_mass_kg = 690.0", "body_mass_kg = true", "vehicle.body_mass_kg", ["true", "number"]),
    "unit missing in the key": ("body_mass_kg = 690.0", "body_mass = 690.0", "vehicle.body_mass", ["body_mass_kg"]),
    "wrong unit in the key": ("body_mass_kg = 690.0", "body_mass_t = 0.69", "vehicle.body_mass_t", ["body_mass_kg"]),
    "negative damping": ("body_mass_kg = 690.0", "damping_rear_N_s_per_m = -1", "vehicle.damping_rear_N_s_per_m", ["-1", "at least 0"]),
    "speed of zero": ("speed_m_per_s = 20.0", "speed_m_per_s = 0.0", "vehicle.speed_m_per_s", ["greater than 0"]),
    "parameter of another vehicle": ("body_mass_kg = 690.0", "roll_inertia_kg_m2 = 5.0", "vehicle.roll_inertia_kg_m2", ["unknown"]),
    "vehicle is no table": ('[vehicle]\nkind = "half_car"\nspeed_m_per_s = 20.0\nbody_mass_kg = 690.0', "vehicle = 3", "vehicle = 3", ["table"]),
    "negative delay": ("delay_s = 0.5 }", "delay_s = -0.5 }", "designs[first].channels[1].delay_s", ["-0.5", "at least 0"]),
    "delay is a list": ("delay_s = 0.5 }", "delay_s = [0.5] }", "designs[first].channels[1].delay_s", ["[0.5]", "number"]),
    "missing delay": (", delay_s = 0.5 }", " }", "designs[first].channels[1].delay_s", ["missing"]),
    "missing gain": ("gain_N_per_m = 19345.0, ", "", "designs[first].channels[1].gain_N_per_m", ["missing"]),
    "gain in the wrong unit": ("gain_N_per_m = 19345.0", "gain_N_s_per_m = 19345.0", "designs[first].channels[1].gain_N_s_per_m", ["gain_N_per_m"]),
    "unknown measured signal": ('"unsprung_displacement_front", actuator = "force_front", gain_N_per_m', '"unsprung_displacement_middle", actuator = "force_front", gain_N_per_m', "designs[first].channels[1].measured", ["unsprung_displacement_middle", "did you mean"]),
    "signal of no kind": ('"unsprung_displacement_front", actuator = "force_front", gain_N_per_m', '"elephant", actuator = "force_front", gain_N_per_m', "designs[first].channels[1].measured", ["elephant"]),
    "measured is a number": ('measured = "unsprung_displacement_front", actuator = "force_front", gain_N_per_m', 'measured = 1, actuator = "force_front", gain_N_per_m', "designs[first].channels[1].measured", ["1", "output"]),
    "neutral loop": ('measured = "unsprung_displacement_front", actuator = "force_front", gain_N_per_m', 'measured = "body_acceleration", actuator = "force_front", gain_N_s2_per_m', "designs[first].channels", ["neutral", "actuator_bandwidth"]),
    "neutral search": ('measured = "unsprung_displacement_front", actuator = "force_front", gain_from_N_per_m = -100.0, gain_to_N_per_m', 'measured = "body_acceleration", actuator = "force_front", gain_from_N_s2_per_m = -100.0, gain_to_N_s2_per_m', "tuning[found].pairs", ["neutral", "actuator_bandwidth"]),
    "record too long": ("duration_s = 2.0", "duration_s = 2e7", "time[wave].step_s", ["at most 2,000,000"]),
    "unknown actuator": ('actuator = "force_front", gain_N_per_m', 'actuator = "road_front", gain_N_per_m', "designs[first].channels[1].actuator", ["road_front", "force_front"]),
    "no channels": ("channels = [", "channel = [", "designs[first].channel", ["channels"]),
    "empty channels": ('label = "first design"\nchannels = [\n    { measured = "unsprung_displacement_front", actuator = "force_front", gain_N_per_m = 19345.0, delay_s = 0.5 },\n    { measured = "unsprung_displacement_rear", actuator = "force_rear", gain_N_per_m = 26150.0, delay_s = 0.4 },\n]', 'label = "first design"\nchannels = []', "designs[first].channels", ["at least one"]),
    "channels is a table": ("channels = [\n    {", "channels = {", "TOML", []),
    "design called passive": ('key = "first"', 'key = "passive"', "designs[passive].key", ["passive", "taken"]),
    "key with a space": ('key = "first"', 'key = "the first"', "key", ["the first", "small letters"]),
    "key with a capital": ('key = "found"', 'key = "Found"', "tuning[Found].key", ["Found"]),
    "one key twice": ('key = "found"', 'key = "first"', "tuning[first].key", ["taken"]),
    "empty band": ("omega_to_rad_per_s = 100.0", "omega_to_rad_per_s = 1.0", "frequency.omega_to_rad_per_s", ["empty", "1"]),
    "band upside down": ("omega_from_rad_per_s = 1.0\nomega_to_rad_per_s = 100.0", "omega_from_rad_per_s = 5.0\nomega_to_rad_per_s = 2.0", "frequency.omega_to_rad_per_s = 2.0", ["5"]),
    "band from zero": ("omega_from_rad_per_s = 1.0\nomega_to_rad_per_s = 100.0", "omega_from_rad_per_s = 0\nomega_to_rad_per_s = 100.0", "frequency.omega_from_rad_per_s", ["greater than 0"]),
    "points is a fraction": ("points = 50", "points = 50.5", "frequency.points = 50.5", ["integer"]),
    "too few points": ("points = 50", "points = 1", "frequency.points = 1", ["at least 10"]),
    "unknown output": ('outputs = ["body_acceleration"]', 'outputs = ["body_acceleraton"]', "frequency.outputs", ["body_acceleraton", "body_acceleration"]),
    "outputs is a text": ('outputs = ["body_acceleration"]', 'outputs = "body_acceleration"', "frequency.outputs", ["list"]),
    "unknown curve design": ("points = 50", 'curve_designs = ["frist"]', "frequency.curve_designs", ["frist", "first"]),
    "unknown objective": ('objective = "harmonic"', 'objective = "harmonics"', "tuning[found].objective", ["harmonics", "harmonic"]),
    "objective without its frequency": ("omega_rad_per_s = 7.0\nweights", "weights", "tuning[found].omega_rad_per_s", ["missing", "harmonic"]),
    "key of another objective": ('omega_rad_per_s = 7.0\nweights', 'omega_rad_per_s = 7.0\niso_class = "C"\nweights', "tuning[found].iso_class", ["not used"]),
    "negative frequency": ("omega_rad_per_s = 7.0\nweights", "omega_rad_per_s = -7.0\nweights", "tuning[found].omega_rad_per_s = -7.0", ["greater than 0"]),
    "unknown weight": ("weights = { body_acceleration = 0.7", "weights = { body_accel = 0.7", "tuning[found].weights.body_accel", ["body_acceleration"]),
    "negative weight": ("body_acceleration = 0.7", "body_acceleration = -0.7", "tuning[found].weights.body_acceleration", ["-0.7", "at least 0"]),
    "weights all zero": ("body_acceleration = 0.7, pitch_acceleration = 0.3", "body_acceleration = 0.0", "tuning[found].weights", ["greater than 0"]),
    "weights is a list": ("weights = { body_acceleration = 0.7, pitch_acceleration = 0.3 }", "weights = [0.7, 0.3]", "tuning[found].weights", ["table"]),
    "lower gain above upper": ("gain_from_N_per_m = -100.0", "gain_from_N_per_m = 200.0", "tuning[found].pairs[1].gain_to_N_per_m = 100.0", ["200"]),
    "lower delay above upper": ("delay_to_s = 0.9", "delay_from_s = 0.95, delay_to_s = 0.9", "tuning[found].pairs[1].delay_to_s = 0.9", ["0.95"]),
    "negative delay bound": ("delay_to_s = 0.9", "delay_from_s = -0.1, delay_to_s = 0.9", "tuning[found].pairs[1].delay_from_s", ["-0.1", "at least 0"]),
    "one particle": ("particles = 10", "particles = 1", "tuning[found].particles", ["at least 2"]),
    "negative iterations": ("iterations = 5", "iterations = -5", "tuning[found].iterations", ["-5", "at least 0"]),
    "unknown topology": ("iterations = 5", 'topology = "star"', "tuning[found].topology", ["star", "ring, global"]),
    "negative seed": ("iterations = 5", "seed = -1", "tuning[found].seed", ["-1", "at least 0"]),
    "unknown design to compare": ("iterations = 5", 'compare = ["second"]', "tuning[found].compare", ["second", "first"]),
    "unknown line": ('"ray", "tau2"', '"rey", "tau2"', "stability.lines[2]", ["rey", "ray"]),
    "line tau0": ('"ray", "tau2"', '"ray", "tau0"', "stability.lines[3]", ["tau0"]),
    "up_to of zero": ("up_to_s = 1.0", "up_to_s = 0", "stability.up_to_s", ["greater than 0"]),
    "unknown key in stability": ("up_to_s = 1.0", "upto_s = 1.0", "stability.upto_s", ["up_to_s", "did you mean"]),
    "unknown road": ('kind = "harmonic", amp', 'kind = "harmonik", amp', "time[wave].road.kind", ["harmonik", "harmonic"]),
    "road without amplitude": ("amplitude_m = 0.05, ", "", "time[wave].road.amplitude_m", ["missing", "harmonic"]),
    "road with a key too many": ("amplitude_m = 0.05, ", "amplitude_m = 0.05, seed = 1, ", "time[wave].road.seed", ["not used"]),
    "unknown road class": ('kind = "harmonic", amplitude_m = 0.05, omega_rad_per_s = 7.0', 'kind = "random", seed = 1, iso_class = "I"', "time[wave].road.iso_class", ["I", "A, B"]),
    "negative amplitude": ("amplitude_m = 0.05", "amplitude_m = -0.05", "time[wave].road.amplitude_m", ["-0.05"]),
    "duration of zero": ("duration_s = 2.0", "duration_s = 0", "time[wave].duration_s", ["greater than 0"]),
    "step beyond the record": ("step_s = 0.005\n", "step_s = 5.0\n", "time[wave].step_s", ["duration_s"]),
    "report step no multiple": ("report_step_s = 0.01", "report_step_s = 0.012", "time[wave].report_step_s", ["multiple"]),
    "skip beyond the record": ("step_s = 0.005\n", "skip_s = 3.0\n", "time[wave].skip_s", ["duration_s"]),
    "unknown design simulated": ('designs = ["first"]', 'designs = ["fist"]', "time[wave].designs", ["fist", "first"]),
    "road missing": ('road = { kind = "harmonic", amplitude_m = 0.05, omega_rad_per_s = 7.0 }', "", "time[wave].road", ["missing"]),
    "order of zero": ("orders = [3, 5]", "orders = [0, 5]", "pade.orders[1]", ["at least 1"]),
    "order too high": ("orders = [3, 5]", "orders = [3, 500]", "pade.orders[2]", ["at most 60"]),
    "orders that fall": ("orders = [3, 5]", "orders = [5, 3]", "pade.orders", ["increasing"]),
    "half a wheel-hop band": ("orders = [3, 5]", "orders = [3, 5]\nwheel_hop_to_rad_per_s = 80.0", "pade.wheel_hop_from_rad_per_s", ["missing", "two ends"]),
    "empty wheel-hop band": ("orders = [3, 5]", "orders = [3, 5]\nwheel_hop_from_rad_per_s = 80.0\nwheel_hop_to_rad_per_s = 70.0", "pade.wheel_hop_to_rad_per_s", ["70", "80"]),
    "tolerance of zero": ("orders = [3, 5]", "orders = [3, 5]\ntolerances = [0.0]", "pade.tolerances[1]", ["greater than 0"]),
    "unknown design for verdicts": ("orders = [3, 5]", 'orders = [3, 5]\nverdicts = ["fisrt"]', "pade.verdicts", ["fisrt", "first"]),
    "unknown design for pade": ("cases = { first", "cases = { fisrt", "pade.cases.fisrt", ["first"]),
    "unknown case for pade": ('cases = { first = "wave" }', 'cases = { first = "waves" }', "pade.cases.first", ["waves", "wave"]),
    "tolerance too large": ("tolerance = 0.005", "tolerance = 5.0", "audit.tolerance", ["at most 0.1"]),
    "printed number is no text": ('passive = "3.0"', "passive = 3.0", "audit.tables[1].rows[1].passive", ["3.0", "text"]),
    "printed number is no number": ('passive = "3.0"', 'passive = "three"', "audit.tables[1].rows[1].passive", ["three"]),
    "unknown indicator": ('indicator = "body_acceleration"', 'indicator = "body"', "audit.tables[1].rows[1].indicator", ["body", "body_acceleration"]),
    "table of an unknown case": ('time = "wave"', 'time = "wawe"', "audit.tables[1].time", ["wawe", "wave"]),
    "peak of an unknown output": ('output = "body_acceleration"\nfreq', 'output = "acceleration"\nfreq', "audit.peaks[1].output", ["acceleration"]),
    "not TOML": ("[stability]", "[stability", "TOML", ["line"]),
    "key twice in the file": ("points = 50", "points = 50\npoints = 60", "TOML", []),
}  # fmt: skip


def message(path):
    with pytest.raises(sc.InputError) as caught:
        sc.load_study(path)
    return str(caught.value)


@pytest.mark.parametrize("case", CASES, ids=lambda name: name.replace(" ", "-"))
def test_one_line_names_file_key_and_what_is_allowed(case, tmp_path):
    old, new, key, words = CASES[case]
    assert BASE.count(old) >= 1
    path = tmp_path / "study.toml"
    path.write_text(BASE.replace(old, new, 1), encoding="utf-8")
    text = message(path)
    assert "\n" not in text
    assert text.startswith(f"{path}: ")
    assert key in text
    for word in words:
        assert word in text


def test_the_base_of_all_these_is_valid(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(BASE, encoding="utf-8")
    assert sc.load_study(path).title == "A small study"


def test_missing_file(tmp_path):
    path = tmp_path / "no such study.toml"
    assert message(path) == f"{path}: there is no such study file"


def test_a_folder_is_no_study_file(tmp_path):
    text = message(tmp_path)
    assert text.startswith(f"{tmp_path}: ")
    assert "\n" not in text


def test_a_file_that_is_no_text(tmp_path):
    path = tmp_path / "study.toml"
    path.write_bytes(b'title = "\xff\xfe"')
    assert message(path) == f"{path}: the study file is not UTF-8 text"


def test_an_empty_file_lacks_its_first_key(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text("", encoding="utf-8")
    assert message(path) == f"{path}: name: this key is missing"
