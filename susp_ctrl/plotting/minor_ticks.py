"""Minor ticks of logarithmic axes, drawn at once.

matplotlib makes five artists for every minor tick, and asks each of them again and again where it stands. On a figure
of many logarithmic panels that is most of the time of drawing. Minor ticks without labels are all alike: here the first
of them draws its lines at all places in one go. Colours, lengths and grid are those that `tick_params` and `grid` give.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import Locator, LogLocator
from numpy.typing import NDArray


class LabelledOnly(Locator):
    """Minor ticks of a logarithmic axis where they have labels, on at most one decade; else none.

    Parameters
    ----------
    every
        Locator of all of them.
    """

    def __init__(self, every: Locator) -> None:
        self.every = every

    def set_axis(self, axis: Any) -> None:
        """Set the axis, of `every` too."""
        super().set_axis(axis)
        self.every.set_axis(axis)

    @property
    def unlabelled(self) -> bool:
        """Whether the view is so wide that matplotlib's formatters label only powers of the base."""
        low, high = sorted(self.axis.get_view_interval())  # type: ignore[union-attr]  # set by the axis that has it
        return bool(low > 0.0 and high > 10.0 * low)

    def __call__(self) -> Any:
        """Return the places of ticks that may have labels."""
        return [] if self.unlabelled else self.every()

    def tick_values(self, vmin: float, vmax: float) -> Any:
        """Return the places of all ticks between two values."""
        return self.every.tick_values(vmin, vmax)


class MinorTicks(Artist):
    """Draws the minor ticks and grid lines that `LabelledOnly` leaves out.

    Parameters
    ----------
    axis
        Of the axes that hold this artist.
    """

    def __init__(self, axis: Axis) -> None:
        super().__init__()
        self._axis = axis
        self.set_in_layout(False)  # shorter than the major ticks

    def get_zorder(self) -> float:
        """Return the order of the axis: above or below the curves."""
        return float(self._axis.get_zorder())

    def draw(self, renderer: RendererBase) -> None:
        """Draw all ticks by the lines of the first."""
        locator = self._axis.get_minor_locator()
        if not (self._axis.get_visible() and isinstance(locator, LabelledOnly) and locator.unlabelled):
            return
        places = self._places(locator)
        first = self._axis.get_minor_ticks(1)[0]
        for line in (first.gridline, first.tick1line, first.tick2line):
            if line.get_visible() and places.size:
                kept = line.get_data(orig=True)
                line.set_data(*self._repeated(line, places, first.gridline))
                line.draw(renderer)
                line.set_data(*kept)

    def _places(self, locator: LabelledOnly) -> NDArray[Any]:
        low, high = sorted(self._axis.get_view_interval())
        places = np.asarray(locator.every(), dtype=float)
        places = places[(places >= low) & (places <= high)]
        taken = np.isclose(places[:, None], np.asarray(self._axis.get_majorticklocs())[None, :], atol=0.0)
        return places[~taken.any(axis=1)]

    def _repeated(self, line: Line2D, places: NDArray[Any], gridline: Line2D) -> tuple[Any, Any]:
        """Return x and y of a tick's line at all places: a marker at each, or a grid line that is broken between."""
        horizontal = isinstance(self._axis, XAxis)
        if line is gridline:
            along, across = np.repeat(places, 3), np.tile([0.0, 1.0, np.nan], places.size)
        else:
            fixed = np.ravel(line.get_ydata() if horizontal else line.get_xdata())[0]
            along, across = places, np.full(places.size, fixed)
        return (along, across) if horizontal else (across, along)


class PanelAxes(Axes):
    """Axes whose minor ticks on a logarithmic scale are drawn at once."""

    def clear(self) -> None:
        """Clear the axes."""
        super().clear()
        self.set_title("", y=1.0)  # else looked for anew at every layout and drawing
        for axis in (self.xaxis, self.yaxis):
            self.add_artist(MinorTicks(axis))

    def set_xscale(self, value: Any, **kwargs: Any) -> None:
        """Set the scale as matplotlib does."""
        super().set_xscale(value, **kwargs)
        _leave_out_unlabelled(self.xaxis)

    def set_yscale(self, value: Any, **kwargs: Any) -> None:
        """Set the scale as matplotlib does."""
        super().set_yscale(value, **kwargs)
        _leave_out_unlabelled(self.yaxis)


class PanelFigure(Figure):
    """A figure of `PanelAxes`."""

    def add_subplot(self, *args: Any, **kwargs: Any) -> Axes:
        """Add axes as matplotlib does."""
        if not {"projection", "polar", "axes_class"} & set(kwargs):
            kwargs["axes_class"] = PanelAxes
        return super().add_subplot(*args, **kwargs)


def _leave_out_unlabelled(axis: Axis) -> None:
    locator = axis.get_minor_locator()
    if axis.get_scale() == "log" and isinstance(locator, LogLocator):
        axis.set_minor_locator(LabelledOnly(locator))
