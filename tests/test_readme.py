"""The README's tour runs as it stands, and its two lines are there."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import pytest
from typer.testing import CliRunner

import susp_ctrl as sc
from susp_ctrl.cli import app

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.end_to_end
def test_the_tour_runs_from_top_to_bottom(capsys: pytest.CaptureFixture[str]) -> None:
    mpl.use("Agg")
    blocks = re.findall(r"^```python\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 6
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert "stable" in capsys.readouterr().out


def shell_lines() -> list[str]:
    blocks = re.findall(r"^```sh\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    return [line.partition("#")[0].strip() for block in blocks for line in block.splitlines()]


COMMANDS = [line.split()[1:] for line in shell_lines() if line.startswith("susp-ctrl ")]
LONG = ("run", "tune", "sweep", "compare-pade", "report")


def invoke(arguments: list[str]) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output


def test_every_command_line_is_understood() -> None:
    assert {arguments[0] for arguments in COMMANDS} >= {"list", "new", "simulate", "stability", *LONG}
    for arguments in COMMANDS:
        help_text = CliRunner().invoke(app, [arguments[0], "--help"], env={"COLUMNS": "200"})
        assert help_text.exit_code == 0, arguments
        for option in (a for a in arguments if a.startswith("--")):
            assert option in help_text.output, arguments


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the studies, as a person would stand in it."""
    shutil.copytree(ROOT / "studies", tmp_path / "studies")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.end_to_end
def test_quick_command_lines_run(clone: Path) -> None:
    for arguments in COMMANDS:
        if arguments[0] not in LONG:
            invoke(arguments)


@pytest.mark.end_to_end
@pytest.mark.slow
def test_long_command_lines_run(clone: Path) -> None:
    for arguments in COMMANDS:
        if arguments[0] == "sweep":
            invoke([*arguments, "--set", "sweep.samples=20"])
        elif arguments[0] in LONG:
            invoke(arguments)


@pytest.mark.end_to_end
@pytest.mark.slow
def test_reference_is_built_by_the_line_given(tmp_path: Path) -> None:
    pytest.importorskip("pdoc", reason="pdoc is not installed (extra docs)")
    (line,) = (line for line in shell_lines() if "-m pdoc" in line)
    arguments = line.partition("-m pdoc")[2].replace("out/api", str(tmp_path)).split()
    subprocess.run([sys.executable, "-m", "pdoc", *arguments], check=True, capture_output=True, cwd=tmp_path)
    page = (tmp_path / "susp_ctrl.html").read_text(encoding="utf-8")
    assert [name for name in sc.__all__ if f'id="{name}"' not in page] == []
    for module in (a for a in arguments if a.startswith("susp_ctrl.")):
        page = tmp_path / f"{module.replace('.', '/')}.html"
        assert "$$" in page.read_text(encoding="utf-8") or module.endswith("rightmost"), module


def test_files_that_the_readme_shows_exist() -> None:
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
