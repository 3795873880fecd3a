"""Whole figures: made, with panels and one legend, and saved as small files, the same bytes for the same figure."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, YAxis
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_pdf import PdfFile, RendererPdf, Verbatim
from matplotlib.figure import Figure
from matplotlib.transforms import offset_copy
from numpy.typing import NDArray
from PIL import Image

from susp_ctrl.plotting.minor_ticks import PanelFigure
from susp_ctrl.plotting.style import FULL_WIDTH, legend_entries, styled

_Item = TypeVar("_Item")

_POINTS_PER_INCH = 72.0
_NARROWEST, _LOWEST = 1.9, 1.1  # inch: room for the names of a panel that python-control drew
_PATH = re.compile(rb' d="[^"]*"')
_LONG_NUMBER = re.compile(rb"(\.\d\d)\d+")


@styled
def new_figure(
    rows: int = 1, columns: int = 1, *, height: float = 2.9, **subplots: Any
) -> tuple[Figure, NDArray[Any]]:
    """Return a figure of the page's width with ``rows x columns`` axes, outside pyplot's figure manager.

    Parameters
    ----------
    rows, columns
        Number of axes.
    height
        Height of the whole figure (inch).
    **subplots
        Passed to `matplotlib.figure.Figure.subplots` (``sharex=True``, ...).

    Returns
    -------
    Figure, ndarray of Axes
        The array has the shape (rows, columns).
    """
    figure = PanelFigure(figsize=(FULL_WIDTH, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **subplots)
    return figure, axes


def panels(
    items: Sequence[_Item],
    draw: Callable[[_Item, Axes], Any],
    *,
    columns: int,
    height: tuple[float, float],
    highest: float = np.inf,
    legend: int = 0,
    one_ylabel: bool = False,
    **subplots: Any,
) -> Figure:
    """Return a figure with one panel for each item, row by row.

    Parameters
    ----------
    items
        What is drawn.
    draw
        Draws an item into its axes.
    columns
        Panels in a row, at most.
    height
        Of the figure but for its rows, and of a row (inch).
    highest
        The rows become lower where the figure would be higher than this (inch).
    legend
        Columns of a legend above all panels; 0 for none.
    one_ylabel
        Name the y axis only in the first column.
    **subplots
        As in `new_figure`; with ``sharex=True`` only the lowest panels name the x axis.
    """
    columns = min(columns, len(items))
    rows = -(-len(items) // columns)
    whole = min(height[0] + height[1] * rows, highest)
    figure, axes = new_figure(rows, columns, height=whole, **subplots)
    for ax in axes.flat[len(items) :]:
        ax.set_visible(False)
    for number, (item, ax) in enumerate(zip(items, axes.flat, strict=False)):
        draw(item, ax)
        if one_ylabel and number % columns:
            ax.set_ylabel("")
        if subplots.get("sharex") and number + columns < len(items):
            ax.set_xlabel("")
    if legend:
        shared_legend(figure, axes, columns=legend)
    return figure


def fresh_figure() -> Figure:
    """Open an empty pyplot figure and make it current, so that nothing is drawn over an earlier plot.

    For plots that others draw: python-control takes the current figure unless told otherwise.
    """
    import matplotlib.pyplot as plt  # only an interactive caller needs pyplot's figure manager

    return plt.figure(FigureClass=PanelFigure)


def lay_out(figure: Figure, axes: NDArray[Any], *, centred: bool) -> None:
    """Place the panels that python-control drew into a fresh figure, once and not at every drawing.

    Parameters
    ----------
    figure
        Of `fresh_figure`; it grows where its panels would be too small for their names.
    axes
        The panels, shape (rows, columns). Texts of the figure name pairs of rows (magnitude and phase).
    centred
        Centre the title over the panels, not over the figure.
    """
    rows, columns = axes.shape
    width, height = figure.get_size_inches()
    figure.set_size_inches(max(width, _NARROWEST * columns), max(height, _LOWEST * rows))
    for column in axes.T:
        _name_beside(figure, [ax.yaxis for ax in column])
    for row in axes:
        _name_beside(figure, [ax.xaxis for ax in row])
    figure.tight_layout()
    with matplotlib.rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
        figure.set_layout_engine(None)  # with an engine, even "none", every file is drawn twice
    names = [text for text in figure.texts if text.get_rotation()]
    for text, upper, lower in zip(names, axes[::2, 0], axes[1::2, 0], strict=False):
        # As python-control does, whose empty line beside the names of the axes holds it.
        left = 0.8 * upper.yaxis.label.get_window_extent().x0 / figure.bbox.width
        text.set_position((left, (upper.get_position().y1 + lower.get_position().y0) / 2.0))
    if centred:
        middle = (axes[0, 0].get_position().x0 + axes[0, -1].get_position().x1) / 2.0
        for text in figure.texts:
            if text not in names:
                text.set_x(middle)


def _name_beside(figure: Figure, line: Sequence[Axis]) -> None:
    """Put the names of axes in a row or column into one line, outside all tick labels.

    `Figure.align_labels` does so too, but then every name asks for all tick labels of all panels at every drawing.
    """
    vertical = isinstance(line[0], YAxis)
    taken = [0.0]
    for axis in line if any(axis.get_label_text() for axis in line) else ():
        frame = axis.axes.bbox
        shown = [text for text in axis.get_ticklabels() if text.get_visible() and text.get_text()]
        boxes = [text.get_window_extent() for text in shown]
        taken += [frame.x0 - box.x0 if vertical else frame.y0 - box.y0 for box in boxes]
    for axis in line:
        points = -max(taken) * _POINTS_PER_INCH / figure.dpi - axis.labelpad
        x, y, where = (points, 0.0, (0.0, 0.5)) if vertical else (0.0, points, (0.5, 0.0))
        axis.set_label_coords(*where, transform=offset_copy(axis.axes.transAxes, figure, x, y, "points"))


@styled
def shared_legend(figure: Figure, axes: Any, *, columns: int = 4) -> None:
    """Place one legend above all axes of a figure, each label once."""
    entries: dict[str, Any] = {}
    for ax in np.ravel(np.asarray(axes, dtype=object)):
        for handle, label in zip(*legend_entries(ax), strict=True):
            entries.setdefault(label, handle)
    if entries:
        figure.legend(
            list(entries.values()),
            list(entries),
            loc="outside upper center",
            ncols=min(columns, len(entries)),
        )


@styled
def save_figure(figure: Figure, path: str | Path, *, dpi: float = 100.0, colours: int = 24) -> None:
    """Write a figure with the look's settings; the same figure gives the same bytes (no time stamp).

    Parameters
    ----------
    figure
        The figure.
    path
        File name; the ending ``.png``, ``.pdf`` or ``.svg`` is the format.
    dpi
        Dots per inch of a PNG.
    colours
        Size of the palette of a PNG: line drawings need few colours, and a palette makes a third of the size.

    Raises
    ------
    ValueError
        Another ending.
    """
    ending = Path(path).suffix.lower()
    shown_on, shown_at = figure.canvas, figure.dpi
    # The canvases are drawn directly: `savefig` would draw a figure with a layout engine twice.
    try:
        if ending == ".png":
            figure.dpi = dpi
            agg = FigureCanvasAgg(figure)
            agg.draw()
            _save_palette(np.asarray(agg.buffer_rgba())[:, :, :3], path, dpi, colours)
        elif ending == ".pdf":
            _save_pdf(figure, path)
        elif ending == ".svg":
            figure.savefig(path, metadata={"Date": None, "Creator": None})
            text = Path(path).read_bytes()
            Path(path).write_bytes(_PATH.sub(lambda match: _LONG_NUMBER.sub(rb"\1", match.group()), text))
        else:
            raise ValueError(f"path = {str(path)!r} is not allowed: it must end in .png, .pdf or .svg")
    finally:
        figure.set_canvas(shown_on)
        figure.dpi = shown_at


def _save_palette(pixels: NDArray[np.uint8], path: str | Path, dpi: float, colours: int) -> None:
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    reduced = picture.quantize(colours, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    reduced.save(path, optimize=True, dpi=(dpi, dpi))


class _ShortPdfFile(PdfFile):
    """A PDF whose paths have two decimals, a hundredth of a point, instead of six: dense curves take half the space."""

    @staticmethod
    def pathOperations(*args: Any, **kwargs: Any) -> list[Verbatim]:
        """Return the operators of a path with short numbers."""
        operators = PdfFile.pathOperations(*args, **kwargs)
        return [Verbatim(_LONG_NUMBER.sub(rb"\1", operator.pdfRepr())) for operator in operators]


def _save_pdf(figure: Figure, path: str | Path) -> None:
    stamps = {"CreationDate": None, "Producer": None, "Creator": None}
    figure.dpi = _POINTS_PER_INCH
    width, height = figure.get_size_inches()
    # Written to memory first: where a disk is full, matplotlib's own clearing up fails over it and hides the cause.
    content = BytesIO()
    file = _ShortPdfFile(content, metadata=stamps)
    try:
        file.newPage(width, height)
        pages = RendererPdf(file, _POINTS_PER_INCH, height, width)
        renderer = MixedModeRenderer(figure, width, height, _POINTS_PER_INCH, pages)
        figure.draw(cast(RendererBase, renderer))  # stands in for one, without being a subclass
        renderer.finalize()
        file.finalize()
    finally:
        file.close()
    Path(path).write_bytes(content.getvalue())
