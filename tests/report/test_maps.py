"""Stability maps in the report: what is said, what is drawn, and the data of the map to click on."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from map_case import map_case, map_explorer

from susp_ctrl.report.document import payload, write_pdf
from susp_ctrl.report.explorer import explorer_data, explorer_html, packed
from susp_ctrl.report.page import write_page
from susp_ctrl.report.sections.maps import maps_section
from susp_ctrl.report.study_result import StudyResult
from susp_ctrl.study.results.study_run import StudyRun

DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"


@pytest.fixture(scope="module")
def mapped(run: StudyRun) -> StudyRun:
    flat = map_case("first_published", key="flat", crossed=False)
    maps = (flat, map_case("second_published"), map_case("second_published", key="front", gain=True))
    return replace(
        run, stability_maps=maps, frequency=None, tuning=(), stability=None, time=(), pade=(), audit=None
    )


def test_no_section_without_maps(run: StudyRun) -> None:
    assert maps_section(run) is None


def test_maps_without_curves_are_told_and_not_drawn(mapped: StudyRun) -> None:
    section = maps_section(mapped)
    assert section is not None
    assert [f.key for f in section.figures] == [
        "stability_map_plane_second_published",
        "stability_map_front_second_published",
    ]
    tables = {table.key: table for table in section.tables}
    assert set(tables) == {"stability_maps", "stability_map_regions", "gain_limits_front_second_published"}
    rows = [row["cells"] for row in tables["stability_maps"].cells() if "cells" in row]
    assert rows == [
        ["published, harmonic", "1", "100", "0", "∞", "3.8012", "agree"],
        ["published, random, gains × 5.5", "2", "50.0", "0", "0.2100 s", "3.8012", "agree"],
        ["published, random", "2", "50.0", "0", "21.0 % of the ranges", "3.8012", "agree"],
    ]
    groups = [row["group"] for row in tables["stability_maps"].cells() if "group" in row]
    assert groups[-1] == "Over τ₁ from 0 to 0.4 s, g₁ from 0 to 250 kN/m"
    assert (
        "Of 3 delays 0.4 s allows the least gain, up to 125.000 kN/m (lost at 65.00 rad/s)"
        in section.figures[1].caption
    )


def test_counts_that_differ_are_said(mapped: StudyRun) -> None:
    case = mapped.stability_maps[0]
    found = replace(case.map, found=replace(case.map.found, decided=False))
    doubtful = replace(mapped, stability_maps=(replace(case, map=found),))
    section = maps_section(doubtful)
    assert section is not None
    assert section.tables[0].cells()[1]["cells"][-1] == "DIFFER"


def test_figures_show_the_ranges_in_displayed_units(mapped: StudyRun) -> None:
    section = maps_section(mapped)
    assert section is not None
    (axes,) = section.figures[1].draw().axes
    assert axes.get_ylim() == (0.0, 250.0)
    assert axes.get_ylabel() == "g₁, gain of front force (kN/m)"
    assert axes.get_xlabel() == "τ₁, delay of front force (s)"
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts == ["stable", "2 unstable roots", "highest stable gain", "design"]


def test_limits_on_both_sides_of_zero_are_drawn(mapped: StudyRun) -> None:
    case = mapped.stability_maps[2]
    assert case.gain_limits is not None
    both = replace(case, gain_limits=case.gain_limits.assign(gain_from=[-90e3, np.nan, -80e3]))
    section = maps_section(replace(mapped, stability_maps=(both,)))
    assert section is not None
    (axes,) = section.figures[0].draw().axes
    (limit,) = [line for line in axes.get_lines() if line.get_label() == "limits of the stable gain"]
    np.testing.assert_allclose(limit.get_xdata(), [0.0, 0.2, 0.4, np.nan, 0.0, 0.2, 0.4])
    np.testing.assert_allclose(limit.get_ydata(), [np.nan, 130.0, 125.0, np.nan, -90.0, np.nan, -80.0])


def test_the_document_is_set_with_maps(mapped: StudyRun, tmp_path: Path) -> None:
    pytest.importorskip("typst")
    result = StudyResult(mapped)
    result.save(tmp_path / "report")
    names = {path.name for path in (tmp_path / "report" / "figures").iterdir()}
    assert {f"stability_map_plane_second_published.{ending}" for ending in ("png", "pdf")} <= names
    assert write_pdf(tmp_path / "report", payload(mapped, result.sections)) is not None


@pytest.mark.parametrize("scale", [1.0, 3.7e-5, 2.9e9])
def test_packed_curves_keep_their_values_to_a_fraction_of_the_peak(scale: float) -> None:
    values = scale * np.sin(np.linspace(0.0, 9.0, 200)) * np.linspace(0.2, 1.0, 200)
    peak, text = packed(values)
    pairs = [DIGITS.index(a) * 64 + DIGITS.index(b) for a, b in zip(text[::2], text[1::2], strict=True)]
    unpacked = (np.array(pairs) / 2047 - 1.0) * peak
    assert abs(unpacked - values).max() <= 0.51 * peak / 2047


def test_curves_that_are_zero_or_no_numbers_can_be_packed() -> None:
    peak, text = packed(np.zeros(3))
    assert (peak, len(text)) == (0.0, 6)
    assert packed(np.array([1.0, np.nan])) == (0.0, "")
    assert packed(np.array([1.0, np.inf])) == (0.0, "")


def test_data_of_the_explorer_are_those_of_the_grid() -> None:
    explorer = map_explorer(map_case("second_published"))
    data = explorer_data(explorer)
    assert data["start"] == [1, 1]  # (0.1, 0.2) is nearest to the design at (0.11, 0.19)
    assert len(data["points"]) == 25
    real, imaginary, roots, _, text = data["points"][1 * 5 + 3]
    assert complex(real, imaginary) == pytest.approx(explorer.roots[1, 3], rel=1e-5)
    assert (roots, len(text)) == (0, 2 * explorer.timepts.size)
    assert data["points"][24][3:] == [0.0, ""]
    json.dumps(data, allow_nan=False)


def test_the_explorer_stands_below_its_figure_and_brings_the_script(mapped: StudyRun, tmp_path: Path) -> None:
    case = mapped.stability_maps[1]
    sections = StudyResult(mapped).sections
    text = write_page(tmp_path, mapped, sections, explorers=[map_explorer(case)]).read_text(encoding="utf-8")
    figure, explorer = (text.index(f'id="{kind}-{name}"') for kind, name in (
        ("figure", "stability_map_plane_second_published"), ("explorer", "plane_second_published")))  # fmt: skip
    assert figure < explorer < text.index('id="figure-stability_map_front_second_published"')
    assert "const DIGITS" in text
    assert not re.search(r"(?:src|href)=\"https?:", text)
    assert "const DIGITS" not in write_page(tmp_path, mapped, sections).read_text(encoding="utf-8")


def test_texts_cannot_break_out_of_the_explorer() -> None:
    explorer = replace(map_explorer(map_case("second_published")), road_text="</script><b>", unit="</script>")
    text = explorer_html(explorer)
    assert text.count("</script>") == 1
    assert "&lt;/script&gt;&lt;b&gt;" in text
