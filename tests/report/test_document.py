"""The files of a report: PDF, CSV tables, figures, manifest."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from susp_ctrl.report import document
from susp_ctrl.report.document import NO_TYPST, payload, write_pdf
from susp_ctrl.report.study_result import StudyResult
from susp_ctrl.study.results.study_run import StudyRun

typst = pytest.importorskip("typst")


@pytest.fixture(scope="module")
def small(make: Callable[..., StudyRun]) -> StudyResult:
    run = make(points=41, step=0.5)
    return StudyResult(replace(run, tuning=(), stability=None, time=run.time[:1], pade=run.pade[:1]))


@pytest.fixture(scope="module")
def saved(small: StudyResult, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = tmp_path_factory.mktemp("saved") / "Bericht mit Größe"
    return folder, small.save(folder)


def test_every_table_and_figure_becomes_a_file(small: StudyResult, saved: tuple[Path, list[Path]]) -> None:
    folder, written = saved
    names = {path.relative_to(folder).as_posix() for path in written}
    expected = {"report.pdf", "manifest.json"}
    expected |= {f"tables/{key}.csv" for key in small.tables}
    expected |= {f"figures/{key}.{ending}" for key in small.figures for ending in ("png", "pdf")}
    assert names == expected
    assert {path for path in folder.rglob("*") if path.is_file()} == set(written)


def test_manifest_agrees_with_the_files(saved: tuple[Path, list[Path]]) -> None:
    folder, written = saved
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    listed = {folder / entry["path"]: entry for entry in manifest["files"]}
    assert set(listed) == set(written) - {folder / "manifest.json"}
    for path, entry in listed.items():
        content = path.read_bytes()
        assert entry["bytes"] == len(content)
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
    assert manifest["study_sha256"] == "ab" * 32
    assert manifest["seeds"] == {"first_tuned": 1}
    assert manifest["versions"]["susp_ctrl"] == "0.1.0"
    assert {"matplotlib", "typst"} <= set(manifest["versions"])
    assert manifest["undecided"] is False


def test_two_runs_write_the_same_bytes(
    make: Callable[..., StudyRun], saved: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    """Everything is computed anew; the wall time of the run is another one."""
    run = make(points=41, step=0.5)
    again = replace(
        run,
        tuning=(),
        stability=None,
        time=run.time[:1],
        pade=run.pade[:1],
        provenance=replace(run.provenance, duration=99.0),
    )
    folder, written = saved
    StudyResult(again).save(tmp_path / "again")
    for path in written:
        assert (tmp_path / "again" / path.relative_to(folder)).read_bytes() == path.read_bytes(), path.name


def test_tables_are_written_in_full_precision(small: StudyResult, saved: tuple[Path, list[Path]]) -> None:
    folder, _ = saved
    for key in ("audit", "frequency_peaks", "rms_harmonic", "pade_first_published"):
        read, table = pd.read_csv(folder / "tables" / f"{key}.csv", dtype=str), small.tables[key]
        assert list(read.columns) == list(table.columns)
        for column in table.select_dtypes("number"):
            # float() reads every digit, which the parser of older pandas does not
            np.testing.assert_array_equal([float(text) for text in read[column].fillna("nan")], table[column])


def test_histories_are_written_with_the_digits_asked_for(
    small: StudyResult, saved: tuple[Path, list[Path]]
) -> None:
    folder, _ = saved
    table = small.tables["history_harmonic_exact"]
    read = pd.read_csv(folder / "tables" / "history_harmonic_exact.csv")
    pd.testing.assert_frame_equal(read, table, check_exact=False, rtol=6e-5, atol=0.0)
    assert not read.equals(table), "five digits are not all"


def _pages(small: StudyResult, folder: Path, data: dict[str, Any]) -> int:
    (folder / "report.json").write_text(json.dumps(data), encoding="utf-8")
    template = (document.asset("equations.typ") + document.asset("template.typ")).encode()
    pages = typst.compile(
        template,
        root=str(folder),
        ignore_system_fonts=True,
        sys_inputs={"data": "/report.json"},
        format="png",
        ppi=10,
    )
    return len(pages) if isinstance(pages, list) else 1


def _query(folder: Path, data: dict[str, Any], selector: str) -> list[dict[str, Any]]:
    (folder / "report.json").write_text(json.dumps(data), encoding="utf-8")
    template = (document.asset("equations.typ") + document.asset("template.typ")).encode()
    answer = typst.query(
        template, selector, root=str(folder), ignore_system_fonts=True, sys_inputs={"data": "/report.json"}
    )
    result: list[dict[str, Any]] = json.loads(answer)
    return result


def _plain(content: Any) -> str:
    if isinstance(content, dict):
        if content.get("func") == "space":
            return " "
        return str(content.get("text", "")) + _plain(content.get("children", content.get("body", "")))
    return "".join(map(_plain, content)) if isinstance(content, list) else ""


@pytest.fixture
def figures(saved: tuple[Path, list[Path]], tmp_path: Path) -> Path:
    (tmp_path / "figures").symlink_to(saved[0] / "figures")
    return tmp_path


def test_pdf_has_pages_headings_and_captions(
    small: StudyResult, saved: tuple[Path, list[Path]], figures: Path
) -> None:
    content = (saved[0] / "report.pdf").read_bytes()
    assert content.startswith(b"%PDF-")
    assert content.rstrip().endswith(b"%%EOF")
    data = payload(small.data, small.sections)
    assert 8 <= _pages(small, figures, data) <= 16
    headings = [_plain(entry["body"]) for entry in _query(figures, data, "heading.where(level: 1)")]
    assert headings[1:] == [section.title for section in small.sections], "after the table of contents"
    captions = [_plain(entry["body"]) for entry in _query(figures, data, "figure.caption")]
    shown = [t.caption for s in small.sections for t in s.tables if t.in_document]
    drawn = [f.caption for s in small.sections for f in s.figures]
    assert sorted(captions) == sorted([*shown, *drawn])


def test_values_are_never_read_as_markup(small: StudyResult, figures: Path) -> None:
    """A title, a label or an evidence with the signs of the markup language arrives as plain text."""
    nasty = '#panic("no") $x^2$ *bold* _it_ <label> @ref \\ ] } `raw` // comment'
    data = payload(small.data, small.sections)
    data["title"] = nasty
    data["sections"][0]["title"] = nasty
    table = next(
        block for section in data["sections"] for block in section["blocks"] if block["kind"] == "table"
    )
    table["caption"] = nasty
    table["rows"][0]["cells"][0] = nasty
    headings = [_plain(entry["body"]) for entry in _query(figures, data, "heading.where(level: 1)")]
    assert nasty in headings
    assert nasty in [_plain(entry["body"]) for entry in _query(figures, data, "figure.caption")]


def test_tables_break_over_pages_with_their_header(small: StudyResult, figures: Path) -> None:
    data = payload(small.data, small.sections)
    table = next(b for s in data["sections"] for b in s["blocks"] if b["kind"] == "table" and b["breakable"])
    before = _pages(small, figures, data)
    table["rows"] = table["rows"] * 5
    assert _pages(small, figures, data) >= before + 2


def test_an_undecided_verdict_is_said_on_the_first_page(make: Callable[..., StudyRun]) -> None:
    run = make(verdict="undecided", points=41, step=0.5)
    result = StudyResult(run)
    data = payload(run, result.sections)
    assert [block["title"] for block in data["opening"]] == ["In short", "Undecided stability"]
    assert data["opening"][1]["warning"] is True
    assert "published, harmonic" in data["opening"][1]["lines"][0]
    assert result._about()["undecided"] is True


def test_without_typst_the_rest_is_written_and_one_line_says_so(
    small: StudyResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "typst", None)
    assert write_pdf(tmp_path, {}) is None
    bare = StudyResult(replace(small.data, frequency=None, time=(), pade=(), audit=None))
    with pytest.warns(UserWarning, match="typst is not installed") as caught:
        written = bare.save(tmp_path / "report")
    assert [str(warning.message) for warning in caught] == [NO_TYPST]
    assert "report.pdf" not in {path.name for path in written}
    assert "vehicle.csv" in {path.name for path in written}


def test_a_failing_figure_leaves_the_earlier_report(
    small: StudyResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "report"
    bare = StudyResult(replace(small.data, frequency=None, time=(), pade=(), audit=None))
    bare.save(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    def fails(*_: Any, **__: Any) -> None:
        raise RuntimeError("no figure today")

    monkeypatch.setattr("susp_ctrl.plotting.save_figure", fails)
    with pytest.raises(RuntimeError, match="no figure today"):
        small.save(folder)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_progress_moves_from_zero_to_one(small: StudyResult, tmp_path: Path) -> None:
    seen: list[tuple[str, float]] = []
    bare = StudyResult(replace(small.data, frequency=None, audit=None, pade=()))
    bare.save(tmp_path / "report", progress=lambda stage, fraction: seen.append((stage, fraction)))
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    assert fractions[-1] == 1.0
    assert seen[-2][0] == "setting the document"
