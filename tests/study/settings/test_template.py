"""The template of a study file: valid, complete, and right also where a comment mark is taken away."""

from __future__ import annotations

import re
from dataclasses import fields
from importlib.resources import files
from typing import get_args, get_type_hints

import pytest

import susp_ctrl as sc
from susp_ctrl.study import compute_study
from susp_ctrl.study.settings.fields import Settings, file_key
from susp_ctrl.study.settings.study import StudySettings
from susp_ctrl.study.settings.study_file import new_study

TEXT = files("susp_ctrl.study").joinpath("template.toml").read_text(encoding="utf-8")
SECTIONS = ("vehicle", "designs", "frequency", "stability", "tuning", "time", "pade")


def keys_of(cls: type[Settings], only: tuple[str, ...] = ()) -> set[str]:
    """All keys that settings and the settings inside them can have; `only` some members of the outermost."""
    found, hints = set(), get_type_hints(cls)
    for member in fields(cls):
        inside = [hints[member.name], *get_args(hints[member.name])]
        nested = [kind for kind in inside if isinstance(kind, type) and issubclass(kind, Settings)]
        if (nested and only and member.name not in only) or "rule" not in member.metadata:
            continue
        if not nested and member.name not in ("parameters", "gain", "gain_from", "gain_to"):
            found.add(file_key(member.name, member.metadata["rule"]))
        for kind in nested:
            found |= keys_of(kind)
    return found


@pytest.fixture
def study(tmp_path):
    return sc.load_study(new_study(tmp_path / "template"))


@pytest.mark.end_to_end
@pytest.mark.filterwarnings("ignore::susp_ctrl.errors.PadeOrderWarning")
def test_the_template_runs(study):
    small = {
        "frequency.points": 30,
        "tuning[tuned].particles": 10,
        "tuning[tuned].iterations": 4,
        "time[random].duration_s": 1.0,
        "time[random].lead_in_s": 0.0,
        "time[random].pade_order": 3,
        "pade.orders": [3, 5],
        "pade.points": 30,
    }
    run = compute_study(study.with_changes(small))
    assert [design.key for design in run.designs] == ["passive", "first", "tuned"]
    assert not run.undecided


def test_every_key_of_the_schema_stands_in_the_template():
    known = keys_of(StudySettings, SECTIONS) - {"kind", "lines"}
    assert len(known) > 50
    missing = {key for key in known if not re.search(rf"(?<![\w]){key}(?![\w])", TEXT)}
    assert missing <= {"bins"}


@pytest.mark.parametrize("pattern", [r"^# (?=\w+ = |\[\[)", r"^# ( {4}|(?=box)|(?=\]))"])
def test_commented_keys_are_right_too(tmp_path, pattern):
    path = tmp_path / "template.toml"
    text = re.sub(pattern, "", TEXT, flags=re.MULTILINE)
    lines = text.splitlines()
    # Only one road, and the list of gains as a whole.
    roads = [n for n, line in enumerate(lines) if line.startswith("road = ")]
    for n in roads[1:]:
        lines[n] = f"# {lines[n]}"
    text = "\n".join(lines)
    if "box" in pattern:
        assert "\nbox = [" in text
    else:
        text = text.replace("\nbox = [", "\n# box = [")
        assert "\ntolerances = " in text
    path.write_text(text, encoding="utf-8")
    study = sc.load_study(path)
    assert study.settings.stability is not None
    assert bool(study.settings.stability.box) == ("box" in pattern)
