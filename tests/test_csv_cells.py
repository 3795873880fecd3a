"""CSV files whose texts a spreadsheet shows and does not execute."""

from __future__ import annotations

import csv

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from susp_ctrl.csv_cells import plain_text, safe_text, write_csv

FORMULAS = (
    '=HYPERLINK("http://x","y")', "+1+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "\n=1", "＝1+1", "-x",
)  # fmt: skip
HARMLESS = ("a label", "-3.5", "+0.25e-3", "-inf", "1+1", "'quoted'", "", "−csf/mtf", ".5")


@pytest.mark.parametrize("text", FORMULAS)
def test_formulas_get_an_apostrophe(text):
    assert safe_text(text) == f"'{text}"


@pytest.mark.parametrize("text", HARMLESS)
def test_other_texts_stay(text):
    assert safe_text(text) == text


@pytest.mark.property
@given(st.text(alphabet="'=+-@\t\r\n1.e a", max_size=6) | st.text())
def test_every_text_comes_back_and_no_cell_begins_a_formula(text):
    written = safe_text(text)
    assert plain_text(written) == text
    try:
        float(written)
    except ValueError:
        assert written[:1] not in {"=", "+", "-", "@", "\t", "\r", "\n"}


def test_headings_and_texts_are_made_safe_and_numbers_stay(tmp_path):
    table = pd.DataFrame(
        {"=label": ["@a", "b", None], "x": [-1.5, np.nan, 3.0], "n": pd.array([-1, None, 2], dtype="Int64")}
    )
    write_csv(table, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows == [["'=label", "x", "n"], ["'@a", "-1.5", "-1"], ["b", "", ""], ["", "3.0", "2"]]
    assert list(table.columns) == ["=label", "x", "n"]
