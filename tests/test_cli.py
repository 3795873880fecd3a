"""The command line as a person uses it: real processes' exit codes, one line per mistake, no half-written report."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import susp_ctrl as sc
import susp_ctrl.study
from susp_ctrl.cli import app
from susp_ctrl.terminal import Terminated

STUDY = Path(__file__).parents[1] / "studies" / "wu_ren_2020.toml"

pytestmark = pytest.mark.end_to_end


def call(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture
def edited(tmp_path: Path):
    """Return a function that writes the paper's study with some text replaced."""

    def edit(old: str, new: str) -> Path:
        text = STUDY.read_text(encoding="utf-8")
        assert old in text, old
        path = tmp_path / "edited.toml"
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        return path

    return edit


def assert_one_line(result: Result, *parts: str) -> None:
    assert result.exit_code == 2, result.output
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("susp-ctrl: ")
    for part in parts:
        assert part in lines[0], lines[0]


def test_help_names_every_command_and_every_command_has_help_with_an_example() -> None:
    overview = call("--help")
    assert overview.exit_code == 0
    for command in (
        "run",
        "list",
        "new",
        "check",
        "stability",
        "sweep-delays",
        "simulate",
        "compare-pade",
        "tune",
    ):
        assert command in overview.output
        detail = call(command, "--help")
        assert detail.exit_code == 0
        assert "Example: susp-ctrl" in " ".join(detail.output.split())


def test_a_mistyped_command_or_option_names_the_nearest() -> None:
    for arguments in (["stabilty", STUDY], ["run", STUDY, "--ouut", "x"]):
        result = call(*arguments)
        assert result.exit_code == 2
        assert "Did you mean" in " ".join(result.stderr.replace("Possible options", "Did you mean").split())


def test_list_shows_titles_and_refuses_an_empty_folder(tmp_path: Path) -> None:
    listing = call("list", STUDY.parent)
    assert listing.exit_code == 0
    assert "Double time-delay active suspension" in listing.output
    assert_one_line(call("list", tmp_path), str(tmp_path), "no study file")
    assert_one_line(call("list", tmp_path / "nowhere"), "no such folder")


@pytest.mark.parametrize(
    "command", ["run", "check", "stability", "sweep-delays", "simulate", "compare-pade", "tune"]
)
def test_a_missing_file_is_one_line(command: str, tmp_path: Path) -> None:
    assert_one_line(call(command, tmp_path / "nothing.toml"), "nothing.toml")


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("body_mass_kg = 690.0", "body_mass_kg = -690.0", ("edited.toml", "body_mass_kg", "-690", "greater than 0")),
        ("body_mass_kg = 690.0", "body_mass_kg = 'heavy'", ("body_mass_kg", "heavy")),
        ("body_mass_kg = 690.0", "body_mas_kg = 690.0", ("body_mas_kg", "body_mass_kg")),
        ('actuator = "force_front"', 'actuator = "force_frnt"', ("force_frnt", "force_front")),
        ("delay_s = 0.3255", "delay_s = -0.3255", ("delay_s", "-0.3255", "at least 0")),
        ("omega_from_rad_per_s = 0.5", "omega_from_rad_per_s = 500.0", ("omega", "500")),
        ("gain_from_N_per_m = -34000.0", "gain_from_N_per_m = 35000.0", ("gain", "35000", "34000")),
        ("[vehicle]", "[vehicle", ("edited.toml",)),
    ],
)  # fmt: skip
def test_bad_studies_are_one_line_that_names_file_key_value_and_what_is_allowed(
    edited, old, new, parts
) -> None:
    assert_one_line(call("check", edited(old, new)), *parts)


def test_changes_on_the_command_line_are_checked_like_the_file() -> None:
    assert_one_line(call("stability", STUDY, "--set", "vehicle.body_mass_kg=-1"), "body_mass_kg", "-1")
    assert_one_line(call("stability", STUDY, "--set", "vehicle.body_mas_kg=1"), "body_mas_kg", "body_mass_kg")
    assert_one_line(call("stability", STUDY, "--set", "vehicle"), "KEY=VALUE")


def test_stability_answers_in_json_and_agrees_with_the_known_roots() -> None:
    """Rightmost roots of the published designs as computed from eq. (1) by an independent program."""
    result = call("stability", STUDY, "--json")
    assert result.exit_code == 0, result.output
    verdicts = {row["design"]: row for row in json.loads(result.stdout)["verdicts"]}
    assert all(row["verdict"] == "stable" for row in verdicts.values())
    assert round(verdicts["random_published"]["abscissa"], 5) == -1.17254
    assert round(verdicts["harmonic_published"]["abscissa"], 5) == -2.24877


def test_a_change_of_the_study_reaches_the_computation() -> None:
    result = call(
        "stability", STUDY, "--json",
        "--set", "designs[random_published].channels[1].gain_N_per_m=300000",
    )  # fmt: skip
    verdicts = {row["design"]: row for row in json.loads(result.stdout)["verdicts"]}
    assert verdicts["random_published"]["verdict"] == "unstable"
    assert verdicts["harmonic_published"]["verdict"] == "stable"


def test_a_command_whose_section_the_study_lacks_says_so(tmp_path: Path) -> None:
    text = STUDY.read_text(encoding="utf-8")
    path = tmp_path / "short.toml"
    path.write_text(text[: text.index("[frequency]")], encoding="utf-8")
    assert_one_line(call("tune", path), "short.toml", "[tuning]")


def test_simulate_gives_the_rms_of_exact_delays_and_pade_side_by_side() -> None:
    """The passive car on the harmonic road: PAPER's steady state at 7 rad/s is 3.6408 m/s2."""
    short = ("--set", "time[harmonic].duration_s=40", "--set", "time[harmonic].skip_s=30")
    short += ("--set", "time[random].duration_s=1", "--set", "time[random].lead_in_s=0")
    result = call("simulate", STUDY, "--json", *short)
    assert result.exit_code == 0, result.output
    tables = json.loads(result.stdout)
    assert list(tables) == ["harmonic", "random"]
    rows = {(row["indicator"], row["design"], row["method"]): row["value"] for row in tables["harmonic"]}
    assert rows["body_acceleration", "passive", "stationary"] == pytest.approx(3.6408, abs=5e-5)
    assert rows["body_acceleration", "passive", "exact"] == pytest.approx(3.6408, rel=0.02)
    exact = rows["body_acceleration", "harmonic_published", "exact"]
    assert rows["body_acceleration", "harmonic_published", "pade"] == pytest.approx(exact, rel=1e-3)
    text = call("simulate", STUDY, *short).stdout
    assert "harmonic road x_g = 0.05 m" in text
    assert "nan" not in text.lower()


def test_new_writes_a_valid_study_once(tmp_path: Path) -> None:
    result = call("new", tmp_path / "my_car")
    assert result.exit_code == 0, result.output
    path = tmp_path / "my_car.toml"
    assert result.stdout.strip() == str(path)
    study = sc.load_study(path)
    assert study.name == "my_car"
    before = path.read_bytes()
    for again in (tmp_path / "my_car", path):
        assert_one_line(call("new", again), "my_car.toml", "is there already")
    assert path.read_bytes() == before
    assert_one_line(call("new", tmp_path / "no" / "car"), "no folder")
    assert_one_line(call("new", tmp_path / "my car"), "my car", "letters")


def test_report_is_written_again_from_stored_results_without_computing(tmp_path: Path, monkeypatch) -> None:
    study, first, again = tmp_path / "small.toml", tmp_path / "first", tmp_path / "again"
    text = (STUDY.parent / "quarter_car_bump.toml").read_text(encoding="utf-8")
    short = text[: text.index("[frequency]")] + text[text.index("[stability]") : text.index("[pade]")]
    study.write_text(short.replace("duration_s = 4.0", "duration_s = 1.0"), encoding="utf-8")
    assert_one_line(call("report", tmp_path), "no stored results", "results.npz")
    assert call("run", study, "--out", first, "--keep-results").exit_code == 0

    def computed(*_: object, **__: object) -> None:
        raise AssertionError("the report computed the study again")

    monkeypatch.setattr(susp_ctrl.study, "compute_study", computed)
    result = call("report", first, "--out", again)
    assert result.exit_code == 0, result.output
    tables = sorted(path.name for path in (first / "tables").iterdir())
    assert tables == sorted(path.name for path in (again / "tables").iterdir())
    assert len(tables) > 5
    for name in tables:
        assert (first / "tables" / name).read_bytes() == (again / "tables" / name).read_bytes(), name
    figures = sorted((again / "figures").glob("*.png"))
    assert figures
    for path in figures:
        assert path.read_bytes() == (first / "figures" / path.name).read_bytes()


def test_a_run_that_fails_leaves_no_report_and_keeps_the_old_one(tmp_path: Path, monkeypatch) -> None:
    target = tmp_path / "report"
    target.mkdir()
    (target / "manifest.json").write_text('{"files": []}')

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(susp_ctrl.study, "compute_study", interrupted)
    result = call("run", STUDY, "--out", target)
    assert result.exit_code == 130
    assert "nothing was written" in result.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["report"]
    assert (target / "manifest.json").read_text() == '{"files": []}'


@pytest.mark.parametrize(
    ("stopped", "status", "said"),
    [(KeyboardInterrupt(), 130, "interrupted"), (Terminated(15), 143, "terminated")],
)
def test_who_ends_it_is_told(stopped, status: int, said: str, tmp_path: Path, monkeypatch) -> None:
    def ended(*_: object, **__: object) -> None:
        raise stopped

    monkeypatch.setattr(susp_ctrl.study, "compute_study", ended)
    result = call("run", STUDY, "--out", tmp_path / "report")
    assert result.exit_code == status
    assert result.stderr == f"susp-ctrl: {said}; nothing was written\n"
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def quick_study(tmp_path: Path) -> Path:
    """A study of the quarter car that is computed in a moment."""
    text = (STUDY.parent / "quarter_car_bump.toml").read_text(encoding="utf-8")
    path = tmp_path / "quick.toml"
    path.write_text(text[: text.index("[frequency]")] + "[frequency]\npoints = 50\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("target", ["x" * 250, "quick.toml", "quick.toml/below", "/proc/report"])
def test_a_target_that_cannot_be_written_is_known_before_computing(target, quick_study, monkeypatch) -> None:
    def computed(*_: object, **__: object) -> None:
        raise AssertionError("computed")

    monkeypatch.setattr(susp_ctrl.study, "compute_study", computed)
    result = call("run", quick_study, "--out", quick_study.parent / target)
    assert result.exit_code in (1, 2)
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stderr.startswith("susp-ctrl: ")


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on files")
@pytest.mark.parametrize("most", [300, 3_000, 12_000])
def test_results_survive_a_save_that_fails(most: int, quick_study: Path, monkeypatch) -> None:
    """No file may grow beyond a limit, as on a full disk: the save fails somewhere in the middle."""
    import resource

    import susp_ctrl.study.results as results

    target, kept = quick_study.parent / "report", quick_study.parent / "elsewhere"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    write = results.write_run

    def unlimited(data, path):  # the other place has room
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        return write(data, path)

    kept.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(kept))
    monkeypatch.setattr(results, "write_run", unlimited)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        result = call("run", quick_study, "--out", target)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert result.exit_code == 1, result.output
    line = result.stderr.strip()
    assert "\n" not in line
    assert "File too large" in line
    assert "what was there before is unchanged" in line
    assert sorted(path.name for path in quick_study.parent.iterdir()) == ["elsewhere", "quick.toml"]
    (folder,) = kept.iterdir()
    assert f"susp-ctrl report {folder}" in line
    again = call("report", folder, "--out", target)
    assert again.exit_code == 0, again.output
    assert (target / "tables" / "frequency_peaks.csv").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="no POSIX signals")
@pytest.mark.slow
def test_a_run_that_is_terminated_leaves_nothing_half_written(tmp_path: Path) -> None:
    command = "from susp_ctrl.cli import main; main()"
    arguments = ["run", str(STUDY), "--out", str(tmp_path / "report")]
    process = subprocess.Popen([sys.executable, "-c", command, *arguments], stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 300.0
    while not any(".partial-" in path.name for path in tmp_path.iterdir()):
        assert time.monotonic() < end
        assert process.poll() is None
        time.sleep(0.02)
    process.terminate()
    _, said = process.communicate(timeout=60)
    assert process.returncode == 143
    assert said == "susp-ctrl: terminated; nothing was written\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("old", ["name", "speed_m_per_s"])
def test_nothing_invisible_reaches_the_terminal(old: str, quick_study: Path) -> None:
    text = quick_study.read_text(encoding="utf-8")
    for evil in ("\\u001b[2J", "\\u0000", "\\u202e", "\\u009b31m", "a\\nb", "k" * 50_000):
        quick_study.write_text(text.replace(old, f'"{old}{evil}"', 1), encoding="utf-8")
        result = call("check", quick_study)
        assert_one_line(result)
        assert result.stderr.strip().isprintable()
        assert len(result.stderr) < 320


def test_a_path_is_shown_escaped(tmp_path: Path) -> None:
    for name in ("no\x1b[2J.toml", "no\nfile.toml", "no\u202e.toml"):
        result = call("check", tmp_path / name)
        assert_one_line(result, "no such study file")
        assert result.stderr.strip().isprintable()


def test_the_installed_command_exists() -> None:
    command = shutil.which("susp-ctrl", path=Path(sys.executable).parent)
    assert command is not None
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"susp-ctrl {sc.__version__}\n"
