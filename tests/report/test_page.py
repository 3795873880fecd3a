"""The report as one HTML page: everything inside, nothing from outside, values as plain text."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest

from susp_ctrl.report.blocks import Column, Table
from susp_ctrl.report.page import table_html, write_page
from susp_ctrl.report.study_result import StudyResult
from susp_ctrl.study.results.study_run import StudyRun

_VOID = {"meta", "br", "link", "img", "input", "hr"}


class _Reader(HTMLParser):
    """Collects identifiers and texts, and checks that every tag is closed in order."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.ids: list[str] = []
        self.counts: dict[str, int] = {}
        self.requests: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1
        for name, value in attrs:
            if name == "id" and tag in ("figure", "section"):
                self.ids.append(str(value))
            if name in ("src", "href", "xlink:href", "data", "action", "srcset") and not str(
                value
            ).startswith("#"):
                self.requests.append(str(value))
        if tag not in _VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in _VOID:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def result(make: Callable[..., StudyRun]) -> StudyResult:
    run = make(points=41, step=0.5)
    return StudyResult(replace(run, tuning=(), stability=None, time=run.time[:1], pade=run.pade[:1]))


@pytest.fixture(scope="module")
def page(result: StudyResult, tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("page")
    path = write_page(folder, result.data, result.sections)
    assert list(folder.iterdir()) == [path], "nothing else is left"
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def reader(page: str) -> _Reader:
    read = _Reader()
    read.feed(page)
    read.close()
    assert read.open == []
    return read


def test_every_table_figure_and_section_is_there(reader: _Reader, result: StudyResult) -> None:
    tables = [t.key for s in result.sections for t in s.tables if t.in_document]
    figures = [f.key for s in result.sections for f in s.figures]
    for key in tables:
        assert reader.ids.count(f"table-{key}") == 1
    for key in figures:
        assert reader.ids.count(f"figure-{key}") == 1
    assert [name for name in reader.ids if re.fullmatch(r"s\d+", name)] == [
        f"s{number}" for number in range(1, len(result.sections) + 1)
    ]
    assert reader.counts["table"] == len(tables)
    assert reader.counts["svg"] >= len(figures)
    assert all(line in reader.text for line in result.summary)


def test_the_page_asks_for_nothing_from_outside(page: str, reader: _Reader) -> None:
    assert reader.requests == []
    assert "default-src 'none'" in page
    assert not re.search(r"@import|url\((?!#)|fetch\(|XMLHttpRequest|<link|<img|<iframe", page)


def test_equations_are_drawn(page: str) -> None:
    pytest.importorskip("typst")
    assert len(re.findall(r'<div class="equations"><svg', page)) == 4


def test_values_are_escaped(result: StudyResult, tmp_path: Path) -> None:
    nasty = "<script>alert('x')</script> & {{title}} \\1"
    run = replace(result.data, headlines=(nasty,), frequency=None, time=(), pade=(), audit=None)
    text = write_page(tmp_path, run, StudyResult(run).sections).read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(&#x27;x&#x27;)&lt;/script&gt; &amp; {{title}} \\1" in text


def test_table_cells_are_escaped_and_marked() -> None:
    frame = pd.DataFrame({"a": ["<b>", "c"], "x": [1.0, -2.0], "best": [True, False]})
    table = Table("t", "T.", frame, (Column("a", "a&b"), Column("x", "x", "fixed", 1)), emphasis="best")
    text = table_html(table)
    assert '<th class="left">a&amp;b</th>' in text
    assert '<tr class="strong"><td class="left">&lt;b&gt;</td><td class="right">1.0</td></tr>' in text
    assert '<td class="right">−2.0</td>' in text


def test_saving_with_html_adds_the_page_and_lists_it(result: StudyResult, tmp_path: Path) -> None:
    bare = StudyResult(replace(result.data, frequency=None, time=(), pade=(), audit=None))
    written = bare.save(tmp_path / "report", html=True)
    assert tmp_path / "report" / "report.html" in written
    assert "report.html" in (tmp_path / "report" / "manifest.json").read_text()
