"""What the headlines say where there is no number."""

from __future__ import annotations

from pathlib import Path

import susp_ctrl as sc
from susp_ctrl.study import compute_study
from susp_ctrl.study.sections.headlines import change_text

QUARTER = Path(__file__).parents[3] / "studies" / "quarter_car_bump.toml"


def test_a_change_that_is_no_number_is_undefined():
    assert change_text(-12.34) == "-12.3 %"
    for value in (float("nan"), float("inf")):
        assert change_text(value).startswith("undefined")


def test_a_run_that_leaves_the_range_of_numbers_is_called_undefined():
    """A gain that makes the loop grow by more than a factor of 1e300 within the record."""
    study = sc.load_study(QUARTER).with_changes(
        {"designs[slow].channels[1].gain_N_s_per_m": 3e5, "time[bump].duration_s": 40.0}
    )
    effect = compute_study(study, sections=("time",)).headlines[-1]
    assert "80 ms undefined" in effect
    assert "nan" not in effect
