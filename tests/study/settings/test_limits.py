"""What no study is: sizes beyond any vehicle, work without end, files that are none, and how it is told."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

import susp_ctrl as sc
from susp_ctrl.study import Study
from susp_ctrl.study.settings.work import MOST_CELLS

STUDIES = Path(__file__).parents[3] / "studies"
QUARTER, MAIN, SWEEP = (
    STUDIES / name for name in ("quarter_car_bump.toml", "wu_ren_2020.toml", "robustness.toml")
)
CHANNEL = "designs[prompt].channels[1]"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        (f"{CHANNEL}.delay_s", 1e12),
        (f"{CHANNEL}.delay_s", 1e-15),
        (f"{CHANNEL}.gain_N_s_per_m", 1e12),
        (f"{CHANNEL}.gain_N_s_per_m", -1e-300),
        ("stability.up_to_s", 1e9),
        ("time[bump].lead_in_s", 1e9),
        ("time[bump].road.height_m", 1e300),
        ("time[bump].road.height_m", -11.0),
        ("time[bump].road.height_m", 0.0),
        ("vehicle.body_mass_kg", 1e300),
        ("vehicle.body_mass_kg", 1e-9),
        ("vehicle.speed_m_per_s", 1e5),
        ("vehicle.damping_N_s_per_m", 10**400),
        ("frequency.omega_to_rad_per_s", 1e12),
    ],
)
def test_a_size_beyond_any_vehicle_is_refused_with_its_key(key, value):
    study = sc.load_study(QUARTER)
    with pytest.raises(sc.InputError) as caught:
        study.with_changes({key: value})
    assert key in str(caught.value)
    assert "needed" in str(caught.value)


def test_a_wave_of_no_height_is_refused():
    """Nothing moves then, and a change in percent of nothing is none."""
    study = sc.load_study(MAIN)
    with pytest.raises(sc.InputError, match=r"time\[harmonic\].road.amplitude_m = 0.0"):
        study.with_changes({"time[harmonic].road.amplitude_m": 0.0})


@pytest.mark.parametrize(
    ("path", "changes", "section"),
    [
        (QUARTER, {f"{CHANNEL}.delay_s": 1e4}, "stability"),
        (QUARTER, {"vehicle.body_mass_kg": 1e-3}, "stability"),
        (QUARTER, {"stability.up_to_s": 1e7}, "stability"),
        (QUARTER, {"stability.ray_up_to": 1e6, "stability.lines": ["ray"]}, "stability"),
        (QUARTER, {"time[bump].lead_in_s": 5e7}, "time[bump]"),
        (MAIN, {"time[random].lead_in_s": 1e6}, "time[random]"),
        (MAIN, {"time[random].road.bins": 100_000, "time[random].duration_s": 4000.0}, "time[random]"),
        (MAIN, {"tuning[random_tuned].particles": 100_000}, "tuning[random_tuned]"),
        (MAIN, {"tuning[random_tuned].iterations": 100_000}, "tuning[random_tuned]"),
        (
            MAIN,
            {"stability_maps[beyond_the_box].tau1_to_s": 1e4, "stability_maps[beyond_the_box].tau2_to_s": 1e4},
            "stability_maps[beyond_the_box]",
        ),
        (
            MAIN,
            {"stability_maps[beyond_the_box].gain_factor": 1e6, "stability_maps[beyond_the_box].tau1_to_s": 50.0},
            "stability_maps",
        ),
        (SWEEP, {"sweep.samples": 1_000_000, "designs[random_published].channels[1].delay_s": 2.0}, "sweep"),
    ],
)  # fmt: skip
def test_work_without_end_is_refused_with_the_number(path, changes, section):
    with pytest.raises(sc.InputError, match=r"cells of work .* are predicted, at most 1e\+") as caught:
        sc.load_study(path).with_changes(changes)
    assert section in str(caught.value)


def test_a_grid_of_too_many_variants_is_refused():
    study = sc.load_study(SWEEP)
    table = dict(study.table) | {
        "sweep": {
            "kind": "grid",
            "factors": [
                {"keys": [f"vehicle.{key}"], "relative": [-0.1, 0.1], "levels": 10_000}
                for key in ("body_mass_kg", "spring_stiffness_front_N_per_m")
            ],
        }
    }
    began = time.process_time()
    with pytest.raises(sc.InputError, match=r"sweep.factors: the grid has 100,000,000 variants"):
        Study.from_table(table)
    assert time.process_time() - began < 2.0


def test_ordinary_studies_are_far_within_the_bound():
    assert MOST_CELLS == 1e9
    for path in STUDIES.glob("*.toml"):
        sc.load_study(path)


# --- files --------------------------------------------------------------------------------------------------------


def refused(path):
    began = time.process_time()
    with pytest.raises(sc.InputError) as caught:
        sc.load_study(path)
    assert time.process_time() - began < 2.0
    text = str(caught.value)
    assert text.isprintable()
    assert len(text) <= 300
    return text


def test_a_byte_order_mark_is_accepted(tmp_path):
    path = tmp_path / "study.toml"
    path.write_bytes(b"\xef\xbb\xbf" + QUARTER.read_bytes())
    assert sc.load_study(path).settings == sc.load_study(QUARTER).settings


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
def test_pipes_devices_and_huge_files_are_refused_at_once(tmp_path):
    pipe, huge = tmp_path / "pipe.toml", tmp_path / "huge.toml"
    os.mkfifo(pipe)
    with huge.open("wb") as file:
        file.truncate(2**36)
    for path in (pipe, Path("/dev/zero"), tmp_path):
        assert "regular file" in refused(path)
    assert "bytes" in refused(huge)
    assert "path" in refused("a\0b")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("a = " + "[" * 500 + "]" * 500, "nested"),
        ("a = " + "[" * 30 + "]" * 30, "nested"),
        (".".join("abcdefghijklmnopqrstuvwxyz") + " = 1", "parts"),
        (" . ".join("a" * 50_000) + " = 1", "parts"),
        ("a = 1" + "0" * 400, "64 bits"),
        ("a = 1" + "0" * 5000, "not valid TOML"),
        ("k" * 50_000 + " = 1", "unknown key"),
        ("name = 'x'\ntitle = 'a\tb'", "invisible"),
        ('name = "x"\ntitle = "a\\u202eb"', "invisible"),
        ('name = "x"\ntitle = "a\\nb"', "line breaks"),
        ('name = "x"\ntitle = "t"\nvehicle = { kind = ["half_car"] }', "vehicle.kind"),
        ('name = "x"\ntitle = "t"\nvehicle = { kind = { a = 1 } }', "vehicle.kind"),
        ('"\\u001b[31m" = 1', "\\x1b[31m"),
        ('name = "x"\ntitle = "t"\n"\\u0000" = 1', "\\x00"),
    ],
)
def test_texts_that_are_no_study_are_one_short_line(content, said, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(content, encoding="utf-8")
    assert said in refused(path)


def test_long_texts_may_have_line_breaks(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('name = "x"\ntitle = "t"\ndescription = """one\n\ttwo"""\n', encoding="utf-8")
    assert sc.load_study(path).settings.description == "one\n\ttwo"


@pytest.mark.parametrize(
    "text", ["inf", "nan", "1e400", "1e99999999999", "1_000", "1" * 5000, "٣", "0x10", ""]
)
def test_printed_numbers_are_numbers(text):
    study = sc.load_study(MAIN)
    with pytest.raises(sc.InputError, match="number as printed"):
        study.with_changes({"audit.peaks[1].frequency_Hz": text})


def test_a_crossing_at_no_frequency_is_refused():
    study = sc.load_study(MAIN)
    with pytest.raises(sc.InputError, match="crossings_rad_per_s"):
        study.with_changes({"audit.intervals[1].crossings_rad_per_s": ["0.0"]})


@pytest.mark.parametrize(
    ("study", "key", "value"),
    [
        (QUARTER, "time[bump].designs", ["prompt", "prompt"]),
        (QUARTER, "stability.lines", ["equal", "equal"]),
        (QUARTER, "frequency.outputs", ["body_acceleration", "body_acceleration"]),
        (SWEEP, "sweep.designs", ["passive", "passive"]),
    ],
)
def test_what_is_named_twice_is_refused(study, key, value):
    with pytest.raises(sc.InputError, match="it stands there twice"):
        sc.load_study(study).with_changes({key: value})
