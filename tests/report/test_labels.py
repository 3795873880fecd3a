"""Labels are texts: whatever marks they hold, figures, document, page and tables show them as they are."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from html.parser import HTMLParser

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from susp_ctrl import plotting
from susp_ctrl.report import document
from susp_ctrl.report.blocks import Column, Section, Table
from susp_ctrl.report.document import payload
from susp_ctrl.report.page import table_html
from susp_ctrl.report.study_result import StudyResult

LABELS = (
    r"costs $5 \badcmd $ more",
    "$x$",
    r"_a_ *b* #c @d [e] `f` \g ~ == <h> {i}",
    "_hidden",
    "=1+1 <b>&amp;</b> // /* \"'",
)
X = np.array([1.0, 2.0, 3.0])


def curves():
    return {label: n + X for n, label in enumerate(LABELS)}


def drawn_texts(figure):
    figure.canvas.draw()
    return [text for text in figure.findobj(Text) if text.get_text()]


@pytest.mark.parametrize("own_axes", [True, False])
def test_no_text_of_a_figure_is_mathematics(own_axes):
    ax = plt.figure().subplots() if own_axes else None
    ax = plotting.draw_magnitude(X, curves(), ax, ylabel=LABELS[0])
    ax = plotting.style.finished(ax, xlabel=LABELS[0], title=LABELS[1])
    texts = drawn_texts(ax.figure)
    assert set(LABELS) <= {text.get_text() for text in texts}, "a label is missing in the legend"
    for text in texts:
        if text.get_text() in LABELS:
            assert not text.get_parse_math(), text.get_text()
    plt.close(ax.figure)


def test_a_shared_legend_shows_every_label():
    figure = plotting.panels(
        [0, 1], lambda _, ax: plotting.draw_magnitude(X, curves(), ax), columns=2, height=(1.0, 2.0), legend=2
    )
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(LABELS)


def label_run(make):
    run = make(points=41, step=0.5)
    designs = tuple(replace(design, label=label) for design, label in zip(run.designs, LABELS, strict=True))
    time = tuple(replace(case, label=label) for case, label in zip(run.time, LABELS, strict=False))
    return replace(run, designs=designs, time=time, headlines=LABELS[:3], tuning=(), pade=())


def texts_of(element):
    """Return the texts in an element of a typst document, in order."""
    if isinstance(element, dict):
        own = [element["text"]] if element.get("func") == "text" else []
        own += [" "] if element.get("func") == "space" else []
        return own + [text for part in element.values() for text in texts_of(part)]
    return [text for part in element for text in texts_of(part)] if isinstance(element, list) else []


def label_table():
    frame = plotting_frame()
    return Table("labels", "Labels", frame, (Column("label", "label"), Column("x", "x", "number")))


def plotting_frame():
    return pd.DataFrame({"label": LABELS, "x": np.arange(len(LABELS)) - 1.0})


def test_the_document_sets_labels_as_they_are(make, tmp_path):
    typst = pytest.importorskip("typst")
    run = label_run(make)
    data = payload(run, [Section("Labels", (label_table(),))])
    (tmp_path / "report.json").write_text(json.dumps(data), encoding="utf-8")
    template = (document.asset("equations.typ") + document.asset("template.typ")).encode()
    answer = typst.query(
        template, "figure", root=str(tmp_path), ignore_system_fonts=True, sys_inputs={"data": "/report.json"}
    )
    shown = texts_of(json.loads(answer))
    assert [text for text in shown if text in LABELS] == list(LABELS)


class _Cells(HTMLParser):
    def __init__(self):
        super().__init__()
        self.cells, self.inside = [], False

    def handle_starttag(self, tag, attrs):
        self.inside = tag == "td"
        if self.inside:
            self.cells.append("")
        assert tag in {"table", "thead", "tbody", "tr", "th", "td"}, f"a label became the tag {tag}"

    def handle_data(self, data):
        if self.inside:
            self.cells[-1] += data


def test_the_page_shows_labels_as_they_are():
    parser = _Cells()
    parser.feed(table_html(label_table()))
    assert parser.cells[::2] == list(LABELS)


@pytest.mark.slow
def test_a_whole_report_with_such_labels_is_written(make, tmp_path):
    run = label_run(make)
    run = replace(run, stability=None, frequency=None, audit=None, time=run.time[:1])
    StudyResult(run).save(tmp_path / "report", html=True)
    assert "<b>&amp;</b>" not in (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    for path in (tmp_path / "report" / "tables").glob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.reader(file):
                assert not any(cell.startswith(("=", "@")) for cell in row), path.name
