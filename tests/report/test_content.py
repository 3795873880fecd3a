"""The report as content: which tables and figures there are, and what their cells and lines hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from susp_ctrl.report.blocks import Column, Table
from susp_ctrl.report.looks import looks
from susp_ctrl.report.study_result import StudyResult
from susp_ctrl.study.results.study_run import Design, StudyRun


def _table(result: StudyResult, key: str) -> Table:
    return next(table for section in result.sections for table in section.tables if table.key == key)


def test_every_table_has_its_columns_and_every_key_is_used_once(result: StudyResult) -> None:
    tables = [table for section in result.sections for table in section.tables]
    figures = [figure for section in result.sections for figure in section.figures]
    assert len({table.key for table in tables}) == len(tables)
    assert len({figure.key for figure in figures}) == len(figures)
    for table in tables:
        rows = table.cells() if table.columns else []
        assert all(len(row["cells"]) == len(table.columns) for row in rows if "cells" in row)
        assert all(isinstance(cell, str) for row in rows if "cells" in row for cell in row["cells"])
        assert table.caption.endswith(".")
        assert table.in_document == bool(table.columns)
    assert all(figure.caption.endswith(".") for figure in figures)


def test_what_the_study_computed_is_in_the_tables_unchanged(result: StudyResult, run: StudyRun) -> None:
    assert run.stability is not None
    assert run.audit is not None
    assert run.frequency is not None
    pd.testing.assert_frame_equal(result.tables["stability"], run.stability.verdicts)
    pd.testing.assert_frame_equal(result.tables["audit"], run.audit.table)
    pd.testing.assert_frame_equal(result.tables["frequency_peaks"], run.frequency.peaks)
    pd.testing.assert_frame_equal(result.tables["convergence_first_tuned"], run.tuning[0].history)
    pd.testing.assert_frame_equal(result.tables["pade_first_published"], run.pade[0].table)


def test_rms_table_sets_methods_and_designs_side_by_side(result: StudyResult, run: StudyRun) -> None:
    frame = result.tables["rms_harmonic"]
    assert list(frame["method"][:4]) == ["exact", "pade", "stationary", "printed"]
    assert len(frame) == 6 * 4
    long = run.time[0].rms
    for record in long.to_dict(orient="records"):
        row = frame[(frame["indicator"] == record["indicator"]) & (frame["method"] == record["method"])].iloc[
            0
        ]
        assert row[record["design"]] == record["value"]
        if record["design"] != "passive":
            assert row[f"{record['design']}_change_percent"] == record["change_percent"]
    assert "passive_change_percent" not in frame
    printed = frame[frame["method"] == "printed"]
    assert (printed["passive"] == 0.5026).all()
    assert printed["first_tuned"].isna().all()


def test_rms_table_shows_marks_and_printed_digits(result: StudyResult) -> None:
    rows = _table(result, "rms_harmonic").cells()
    assert rows[0] == {"group": "body acceleration (m/s²)"}
    assert rows[1]["cells"] == ["exact", "3.0647", "2.2005", "−28.2\u2009▼", "1.3362", "−56.4\u2009▼"]
    assert rows[4]["cells"][:3] == ["printed", "0.5026", "0.5026"]


def test_histories_hold_every_design_output_and_the_road(result: StudyResult, run: StudyRun) -> None:
    exact, pade = result.tables["history_random_exact"], result.tables["history_random_pade"]
    assert list(exact.columns[:3]) == ["time_s", "road_front_m", "road_rear_m"]
    assert exact.shape == (401, 3 + 3 * 6)
    assert pade.shape == (401, 1 + 2 * 6)
    np.testing.assert_array_equal(
        pade["first_tuned.pitch_acceleration"], run.time[1].histories["first_tuned", "pade"][1]
    )


def test_published_numbers_are_listed_with_verdict_and_numbered_evidence(result: StudyResult) -> None:
    rows = _table(result, "audit").cells()
    groups = [row["group"] for row in rows if "group" in row]
    cells = [row["cells"] for row in rows if "cells" in row]
    assert groups == ["Table 2", "eq. (15)"]
    assert len(cells) == 40
    assert cells[0][1] == "3.0647"
    assert cells[0][5:] == ["✗ not reproduced", "[1]"]
    assert cells[-1][5:] == ["≈ explained by a misprint", "[2]"]


def test_unfinished_margins_and_designs_off_the_line_are_told_apart(run: StudyRun) -> None:
    assert run.stability is not None
    proven, open_, lost = (
        replace(line, sweep=replace(line.sweep, delay_margin=margin), tau_of_design=None)
        for line, margin in zip(run.stability.lines, (np.inf, np.nan, 0.7), strict=False)
    )
    part = replace(run, stability=replace(run.stability, lines=(proven, open_, lost)))
    rows = [row["cells"] for row in _table(StudyResult(part), "delay_intervals").cells() if "cells" in row]
    margins = [cells[5] for cells in rows if cells[0]]
    assert sorted(margins) == sorted(["∞ (proven)", "none met", "0.700000"])
    assert all(cells[4] == "–" for cells in rows if cells[0])


def test_sections_that_a_study_does_not_have_are_left_out(run: StudyRun) -> None:
    bare = replace(run, frequency=None, tuning=(), stability=None, time=(), pade=(), audit=None)
    result = StudyResult(bare)
    assert [section.title for section in result.sections] == [
        "Vehicle and designs",
        "Model and methods",
        "Provenance",
    ]
    assert set(result.tables) == {"vehicle", "static_loads", "designs", "provenance"}
    assert len(result.figures) == 0


def test_figures_are_drawn_when_asked_for_and_only_once(run: StudyRun) -> None:
    result = StudyResult(run)
    assert "histories_random" in result.figures
    assert not result.figures._drawn
    figure = result.figures["road_harmonic"]
    assert result.figures["road_harmonic"] is figure
    assert set(result.figures._drawn) == {"road_harmonic"}
    with pytest.raises(KeyError):
        result.figures["no_such_figure"]


def test_history_figure_draws_exact_lines_and_pade_markers(result: StudyResult, run: StudyRun) -> None:
    axes = result.figures["histories_harmonic"].axes
    assert len(axes) == 6
    lines = axes[2].get_lines()
    assert len(lines) == 3 + 2
    expected = 1000.0 * run.time[0].histories["first_published", "exact"][2]
    np.testing.assert_allclose(lines[1].get_ydata(), expected)
    assert axes[2].get_ylabel() == "mm"


def test_sweep_figure_has_a_panel_for_every_design(result: StudyResult, run: StudyRun) -> None:
    assert run.stability is not None
    axes = [ax for ax in result.figures["sweep_equal"].axes if ax.get_visible()]
    assert [ax.get_title() for ax in axes] == [design.label for design in run.designs[1:]]
    np.testing.assert_allclose(
        axes[0].get_lines()[0].get_ydata(), run.stability.lines[0].sweep.figure_data["z1"]
    )


def test_velocity_gain_draws_all_designs_for_both_roads(result: StudyResult, run: StudyRun) -> None:
    assert run.frequency is not None
    axes = result.figures["velocity_gain"].axes
    assert len(axes) == 4
    assert all(len(ax.get_lines()) == len(run.designs) for ax in axes)
    in_phase = run.frequency.velocity_gain_in_phase
    assert in_phase is not None
    np.testing.assert_array_equal(axes[3].get_lines()[0].get_ydata(), in_phase["passive"][1])


def test_a_design_looks_the_same_in_every_figure(result: StudyResult) -> None:
    def colour(figure: str, label: str) -> str:
        lines = [line for ax in result.figures[figure].axes for line in ax.get_lines()]
        return next(str(line.get_color()) for line in lines if line.get_label() == label)

    for label in ("published, harmonic", "tuned, harmonic"):
        assert colour("velocity_gain", label) == colour("histories_harmonic", label)
        assert colour("velocity_gain", label) == colour("detuning_first_tuned", label)


def test_cells_of_every_kind() -> None:
    frame = pd.DataFrame({"a": [1.5, np.nan], "b": ["tire_load_rear", "x"], "c": [True, False]})
    columns = (
        Column("a", "a", "fixed", 2, scale=1000.0),
        Column("b", "b", "signal", words={"x": "words"}),
        Column("c", "c", "check"),
    )
    rows = Table("t", "T.", frame, columns, emphasis="c").cells()
    assert rows[0] == {"cells": ["1500.00", "rear tire load", "✓"], "strong": True}
    assert rows[1] == {"cells": ["–", "words", ""], "strong": False}
    assert [column.align for column in columns] == ["right", "left", "left"]


def test_notebook_view_holds_summary_and_escaped_tables(result: StudyResult) -> None:
    page = result._repr_html_()
    assert "First line." in page
    assert "Published against computed" in page
    assert "<script" not in page
    assert "rms_harmonic" in repr(result)
    assert result.summary == ("First line.", "Second line.", "Third line.")


@pytest.mark.parametrize(
    "roles", [("passive", *["tuned"] * 5), ("passive", *["published"] * 4, *["tuned"] * 3)]
)
def test_up_to_eight_designs_of_any_role_look_different(roles: tuple[str, ...]) -> None:
    designs = [Design(f"d{n}", f"design {n}", role, ()) for n, role in enumerate(roles)]  # type: ignore[arg-type]
    assert len(set(looks(designs).values())) == len(designs)


def test_file_names_are_not_taken_for_signal_names(run: StudyRun) -> None:
    named = replace(run, provenance=replace(run.provenance, study_file="body_acceleration.toml"))
    rows = _table(StudyResult(named), "provenance").cells()
    assert rows[0]["cells"] == ["study file", "body_acceleration.toml"]


def test_a_single_road_input_has_no_lag_to_speak_of(run: StudyRun) -> None:
    assert run.frequency is not None
    peaks = run.frequency.peaks
    single = replace(run.frequency, velocity_gain_in_phase=None, peaks=peaks[peaks["road"] == "lagged"])
    section = next(
        s for s in StudyResult(replace(run, frequency=single)).sections if s.title == "Frequency response"
    )
    shown = [getattr(block, "text", "") + getattr(block, "caption", "") for block in section.blocks]
    assert not any("agged" in text for text in shown)
    assert all("lagged" not in text for table in section.tables for text, _ in table.spans)
