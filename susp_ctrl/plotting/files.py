"""Figures as files: small, and the same bytes for the same figure."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_pdf import PdfFile, RendererPdf, Verbatim
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from susp_ctrl.plotting.style import styled

_POINTS_PER_INCH = 72.0
_PATH = re.compile(rb' d="[^"]*"')
_LONG_NUMBER = re.compile(rb"(\.\d\d)\d+")


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
    file = _ShortPdfFile(str(path), metadata=stamps)
    try:
        file.newPage(width, height)
        pages = RendererPdf(file, _POINTS_PER_INCH, height, width)
        renderer = MixedModeRenderer(figure, width, height, _POINTS_PER_INCH, pages)
        figure.draw(cast(RendererBase, renderer))  # stands in for one, without being a subclass
        renderer.finalize()
        file.finalize()
    finally:
        file.close()
