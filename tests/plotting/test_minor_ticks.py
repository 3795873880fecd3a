"""Minor ticks drawn at once: the same picture as matplotlib's own, with far fewer artists."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from susp_ctrl.plotting.minor_ticks import PanelFigure


def _drawn(kind: type[Figure], change: Callable[[Figure], None] | None = None, **subplots: object) -> Figure:
    figure = kind(figsize=(5.0, 5.0))
    x = np.geomspace(0.02, 300.0, 50)
    for ax, height in zip(figure.subplots(2, 2, **subplots).flat, (1e-4, 1.0, 0.3, 1e5), strict=True):
        ax.loglog(x, 0.7 + height * x)
        ax.grid(visible=True, which="both")
    if change is not None:
        change(figure)
    return figure


def _picture(figure: Figure) -> np.ndarray:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def _look(figure: Figure) -> None:
    for ax in figure.axes:
        ax.tick_params(which="minor", length=6, color="red", right=True, direction="in", width=0.5)
        ax.grid(visible=True, which="minor", axis="y", color="green")
        ax.grid(visible=False, which="minor", axis="x")


def _zoom(figure: Figure) -> None:
    figure.canvas.draw()
    figure.axes[0].set_xlim(2.0, 5.0)  # less than a decade: minor ticks with labels
    figure.axes[1].set_ylim(1.0, 10.0)
    figure.axes[2].set_xlim(1e3, 1e-3)  # downwards
    figure.axes[3].set_xlim(1e-12, 1e12)


def _off(figure: Figure) -> None:
    figure.axes[0].minorticks_off()
    figure.axes[1].xaxis.set_minor_locator(NullLocator())
    figure.axes[2].set_xscale("linear")
    figure.axes[3].xaxis.set_visible(False)


def _again(figure: Figure) -> None:
    for ax in figure.axes:
        ax.clear()
        ax.semilogx([1.0, 1e4], [0.0, 1.0])


@pytest.mark.parametrize("change", [None, _look, _zoom, _off, _again])
def test_the_picture_is_that_of_matplotlib(change):
    subplots = {"sharex": "col", "sharey": True} if change in (None, _zoom) else {}
    expected, found = (
        _picture(_drawn(kind, change, **subplots)).astype(int) for kind in (Figure, PanelFigure)
    )
    assert expected.std() > 1.0
    # one grey level of 255 where lines cross in another order; with colours, the pixels of such crossings
    assert np.mean(np.abs(expected - found) > 1) < (5e-3 if change is _look else 1e-9)


def test_a_wide_axis_makes_few_ticks():
    figure = _drawn(PanelFigure)
    _picture(figure)
    axes = [axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]
    assert sum(len(axis.minorTicks) for axis in axes) <= 2 * len(axes)
    assert all(axis.get_minor_locator().tick_values(1.0, 100.0).size > 10 for axis in axes)


def test_figures_survive_pickling():
    figure = _drawn(PanelFigure)
    copy = pickle.loads(pickle.dumps(figure))
    assert np.array_equal(_picture(figure), _picture(copy))
