"""Mutated study files: each is either a study that ends in reasonable time, or one line that says what is wrong."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from study.settings.mutations import STUDIES, mutated_file

import susp_ctrl as sc
from susp_ctrl.errors import LONGEST_MESSAGE
from susp_ctrl.study import compute_study
from susp_ctrl.study.audit import check_substitutions

QUICK, ALL = 150, 4000
SLOWEST_CHECK = 5.0  # processor seconds: far more than any takes


def checked(path: Path) -> sc.Study | None:
    """Do what the command check does; return the study, or None where one proper line refused it."""
    try:
        study = sc.load_study(path)
        check_substitutions(study)
    except sc.InputError as refusal:
        text = str(refusal)
        assert text.isprintable(), text
        assert 0 < len(text) <= LONGEST_MESSAGE
        return None
    return study


def check_mutants(seeds: range, folder: Path) -> int:
    accepted = 0
    path = folder / "study.toml"
    for seed in seeds:
        path.write_bytes(mutated_file(seed))
        began = time.process_time()
        try:
            accepted += checked(path) is not None
        except Exception as problem:
            raise AssertionError(f"mutant {seed}: {type(problem).__name__}: {problem}") from problem
        assert time.process_time() - began < SLOWEST_CHECK, f"mutant {seed} took too long"
    return accepted


def test_mutants_are_studies_or_one_line(tmp_path):
    accepted = check_mutants(range(QUICK), tmp_path)
    assert 0.05 * QUICK < accepted < 0.7 * QUICK  # both kinds are well represented


@pytest.mark.slow
def test_thousands_of_mutants_are_studies_or_one_line(tmp_path):
    check_mutants(range(QUICK, ALL), tmp_path)


def test_the_studies_themselves_are_accepted():
    for path in STUDIES:
        assert checked(path) is not None


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 400, 100))
def test_what_is_accepted_runs(first, tmp_path):
    """Every accepted mutant of the two smallest studies, computed to the end."""
    path = tmp_path / "study.toml"
    for seed in range(first, first + 100):
        content = mutated_file(seed)
        if b"quarter_car" not in content and b"full_car" not in content:
            continue
        path.write_bytes(content)
        study = checked(path)
        if study is not None:
            began = time.process_time()
            compute_study(study)
            assert time.process_time() - began < 300.0, f"mutant {seed} took too long"
