"""A study of all sections, small enough for the quick suite, run once."""

from __future__ import annotations

from pathlib import Path

import pytest

import susp_ctrl as sc
from susp_ctrl.study import compute_study

MAIN = Path(__file__).parents[2] / "studies" / "wu_ren_2020.toml"

SMALL = {
    "frequency.points": 60,
    "tuning[harmonic_tuned].iterations": 60,
    "tuning[harmonic_tuned].particles": 30,
    "tuning[random_tuned].iterations": 20,
    "tuning[random_tuned].particles": 12,
    "stability.lines": ["equal", "tau2"],
    "time[harmonic].duration_s": 3.0,
    "time[harmonic].pade_order": 5,
    "time[random].duration_s": 2.0,
    "time[random].lead_in_s": 1.0,
    "time[random].pade_order": 5,
    "pade.orders": [3, 8],
    "pade.points": 50,
    "pade.cases": {"random_published": "harmonic", "harmonic_tuned": "harmonic"},
}


@pytest.fixture(scope="session")
def main_study():
    return sc.load_study(MAIN)


@pytest.fixture(scope="session")
def small_study(main_study):
    return main_study.with_changes(SMALL)


@pytest.fixture(scope="session")
def small_progress():
    return []


@pytest.fixture(scope="session")
def small_run(small_study, small_progress):
    return compute_study(small_study, progress=lambda stage, share: small_progress.append((stage, share)))
