"""Whole figures: panels, and files of the same bytes for the same figure in a layout without clipped labels."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from susp_ctrl import plotting


def _figure() -> Figure:
    figure, axes = plotting.new_figure(height=2.0)
    plotting.draw_intervals({"a label that is rather long": [(0.0, 1.0, 0), (1.0, 2.0, 2)]}, axes[0, 0])
    return figure


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_the_same_figure_gives_the_same_bytes(ending: str, tmp_path: Path) -> None:
    first, second = tmp_path / f"1.{ending}", tmp_path / f"2.{ending}"
    plotting.save_figure(_figure(), first)
    plotting.save_figure(_figure(), second)
    assert first.read_bytes() == second.read_bytes()
    assert first.stat().st_size > 1000


def test_png_has_a_white_margin_all_round_and_the_size_asked_for(tmp_path: Path) -> None:
    plotting.save_figure(_figure(), tmp_path / "a.png", dpi=100.0)
    with Image.open(tmp_path / "a.png") as picture:
        pixels = np.asarray(picture.convert("L"))
    assert pixels.shape == (200, 670)
    edge = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    assert edge.min() > 250, "something is cut off at the edge"
    assert pixels.min() < 60


def test_nothing_is_clipped_in_the_pdf_either(tmp_path: Path) -> None:
    """The layout made for one medium must fit the other: the page as a picture has a white edge."""
    typst = pytest.importorskip("typst")
    figure = _figure()
    plotting.save_figure(figure, tmp_path / "a.png")
    figure.set_layout_engine("none")
    plotting.save_figure(figure, tmp_path / "a.pdf")
    page = b'#set page(width: auto, height: auto, margin: 0pt)\n#image("a.pdf")'
    picture = typst.compile(page, root=str(tmp_path), format="png", ppi=100.0)
    with Image.open(io.BytesIO(picture)) as opened:
        pixels = np.asarray(opened.convert("L"))
    edge = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    assert edge.min() > 250
    assert pixels.min() < 60


def test_saving_leaves_the_figure_as_it_was(tmp_path: Path) -> None:
    figure = _figure()
    canvas, dpi = figure.canvas, figure.dpi
    plotting.save_figure(figure, tmp_path / "a.pdf")
    plotting.save_figure(figure, tmp_path / "a.png")
    assert figure.canvas is canvas
    assert figure.dpi == dpi


def test_panels_fill_rows_and_only_the_outer_ones_name_their_axes() -> None:
    items = ["a", "b", "c", "d", "e"]

    def draw(item: str, ax: Axes) -> None:
        plotting.draw_history([0.0, 1.0], {"curve": [0.0, 1.0]}, ax, ylabel="y", legend=False, title=item)

    figure = plotting.panels(
        items, draw, columns=3, height=(0.5, 2.0), legend=2, one_ylabel=True, sharex=True
    )
    assert figure.get_size_inches()[1] == 4.5
    assert [ax.get_title() for ax in figure.axes if ax.get_visible()] == items
    assert [bool(ax.get_ylabel()) for ax in figure.axes[:5]] == [True, False, False, True, False]
    assert [bool(ax.get_xlabel()) for ax in figure.axes[:5]] == [False, False, True, True, True]
    assert len(figure.legends) == 1
    low = plotting.panels(items[:2], draw, columns=3, height=(0.5, 2.0), highest=2.0)
    assert len(low.axes) == 2
    assert low.get_size_inches()[1] == 2.0
    assert not low.legends


def test_a_fresh_figure_is_empty_and_current() -> None:
    before = plt.figure()
    try:
        made = plotting.fresh_figure()
        assert made is plt.gcf()
        assert made is not before
        assert not made.axes
    finally:
        plt.close("all")


def test_an_unknown_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"must end in \.png"):
        plotting.save_figure(_figure(), tmp_path / "a.gif")
