"""One look for every figure: readable in colour, by colour-blind readers, and in black and white.

A curve is told from its neighbours three times: by colour (Okabe and Ito's palette, which keeps its contrasts
for the common kinds of colour blindness), by line style, and by sparse markers. The settings act only on
figures drawn by this package: they are applied inside `styled` and never written to the user's matplotlib
configuration.

References
----------
Okabe, M., Ito, K., "Color Universal Design", 2008, https://jfly.uni-koeln.de/color/.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogFormatter
from numpy.typing import ArrayLike, NDArray

from susp_ctrl.plotting.minor_ticks import PanelAxes

_P = ParamSpec("_P")
_R = TypeVar("_R")

BLACK, BLUE, VERMILLION, GREEN, PURPLE, ORANGE, GREY = (
    "#000000",
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#7F7F7F",
)

SETTINGS: Any = {  # newer matplotlib types its keys one by one, older ones as str
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # ships with matplotlib: the same picture on every machine
    "font.size": 8.0,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 8.5,
    "axes.titleweight": "normal",
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.grid.which": "major",
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "axes.unicode_minus": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#D5D5D5",
    "grid.linewidth": 0.45,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7.5,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "#B0B0B0",
    "legend.fancybox": False,
    "legend.handlelength": 3.2,  # long enough to show a dash pattern
    "lines.linewidth": 1.25,
    "lines.markersize": 4.0,
    "text.parse_math": False,  # labels come from users: "$" is a dollar sign
    "text.hinting": "no_hinting",  # text as wide on the screen as on paper, so that one layout fits both
    "hatch.linewidth": 0.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "path.simplify": True,
    "path.simplify_threshold": 0.5,
    "pdf.compression": 9,
    "pdf.fonttype": 3,
    "svg.fonttype": "path",
    "svg.hashsalt": "susp_ctrl",  # the same picture gives the same bytes
}
"""Settings of matplotlib that make the look; applied by `styled` only."""

FULL_WIDTH = 6.7
"""Width (inch) of a figure that spans the text of an A4 page."""

_UNNAMED = re.compile(
    r"_(nolegend_|child\d+|container\d+)"
).fullmatch  # what matplotlib calls artists without label

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_DASH_DOT = (0, (6, 1.6, 1.2, 1.6))
_LONG_DASH = (0, (8, 2))
_DASH_DOT_DOT = (0, (6, 1.5, 1.2, 1.5, 1.2, 1.5))

# Line style and marker differ between every two curves, so that none relies on its colour.
_CYCLE: tuple[dict[str, Any], ...] = (
    {"color": BLACK, "linestyle": (0, (4, 1.8)), "marker": "", "linewidth": 1.1},
    {"color": VERMILLION, "linestyle": _DASH_DOT, "marker": "s"},
    {"color": BLUE, "linestyle": "-", "marker": "o"},
    {"color": GREEN, "linestyle": _LONG_DASH, "marker": "^"},
    {"color": PURPLE, "linestyle": _DASH_DOT_DOT, "marker": "D"},
    {"color": BLACK, "linestyle": "-", "marker": "v"},
    {"color": ORANGE, "linestyle": (0, (2.5, 1.2)), "marker": "P"},
    {"color": GREY, "linestyle": (0, (1, 1.2)), "marker": "X", "linewidth": 1.6},
)

_ROLES = {"passive": 0, "published": 1, "tuned": 2}


Look = int | str | Mapping[str, Any]
"""How a curve looks: a number or role of `curve_style`, or line properties."""


def curve_style(which: int | str) -> dict[str, Any]:
    """Return the line properties of one curve.

    Parameters
    ----------
    which
        The number of the curve (the cycle has eight different looks), or a role that always looks the same:
        ``"passive"`` (black, dashed), ``"published"`` (vermillion, dash-dot), ``"tuned"`` (blue, solid).

    Returns
    -------
    dict
        Keyword arguments of `matplotlib.lines.Line2D`.

    Raises
    ------
    KeyError
        If the role is not known.
    """
    number = _ROLES[which] if isinstance(which, str) else int(which)
    return {"markerfacecolor": "white", "markeredgewidth": 0.8, **_CYCLE[number % len(_CYCLE)]}


def styles_for(labels: Iterable[str], styles: Mapping[str, Look] | None = None) -> dict[str, dict[str, Any]]:
    """Return the line properties of several curves, by label.

    Parameters
    ----------
    labels
        The curves, in drawing order.
    styles
        For some or all labels, the number or role of `curve_style`, or line properties. Labels without an entry
        take the next looks that nobody asked for.
    """
    chosen = dict(styles or {})
    numbers = [look for look in chosen.values() if not isinstance(look, Mapping)]
    taken = {_ROLES[look] if isinstance(look, str) else look % len(_CYCLE) for look in numbers}
    free = [number for number in range(len(_CYCLE)) if number not in taken] or list(range(len(_CYCLE)))
    result, next_free = {}, 0
    for label in labels:
        if label not in chosen:
            chosen[label] = free[next_free % len(free)]
            next_free += 1
        look = chosen[label]
        result[label] = dict(look) if isinstance(look, Mapping) else curve_style(look)
    return result


def sparse_markers(points: int, curve: int, count: int = 9) -> tuple[int, int]:
    """Return `markevery` (first, step): about `count` markers, shifted so that curves do not mark the same x."""
    step = max(points // count, 1)
    return (curve * step // 5) % step, step


def each_curve(
    curves: Mapping[str, ArrayLike], styles: Mapping[str, Look] | None = None, dtype: type = float
) -> Iterator[tuple[NDArray[Any], dict[str, Any]]]:
    """Give the values of every curve, and its line properties with label and sparse markers."""
    for number, (label, style) in enumerate(styles_for(curves, styles).items()):
        values: NDArray[Any] = np.asarray(curves[label], dtype=dtype)
        yield values, {"label": label, "markevery": sparse_markers(values.size, number), **style}


def styled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate a drawing function: the look holds inside it, and the user's settings are untouched."""

    @wraps(function)
    def inside(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with matplotlib.rc_context(SETTINGS):
            return function(*args, **kwargs)

    return inside


def axes_for(ax: Axes | None, *, height: float = 2.9, width: float = FULL_WIDTH) -> Axes:
    """Return `ax`, or new axes in a new pyplot figure where none was given (to be called inside `styled`)."""
    return pyplot_axes(height=height, width=width)[0] if ax is None else ax


def pyplot_axes(rows: int = 1, *, height: float, width: float = FULL_WIDTH) -> list[Axes]:
    """Return axes one above the other in a new pyplot figure."""
    import matplotlib.pyplot as plt  # only an interactive caller needs pyplot's figure manager

    _, made = plt.subplots(rows, 1, sharex=True, figsize=(width, height), layout="constrained", squeeze=False)
    return list(made.flat)


def finished(
    ax: Axes,
    xlabel: str | None = None,
    ylabel: str | None = None,
    title: str | None = None,
    *,
    legend: bool = False,
    tight: bool = False,
) -> Axes:
    """Return axes with their names, title and legend; what is None stays as it is.

    Parameters
    ----------
    ax
        With everything drawn.
    xlabel, ylabel, title
        Texts.
    legend
        Whether to draw a legend.
    tight
        Let the curves reach the left and the right border.
    """
    for text in (ax.xaxis.label, ax.yaxis.label, ax.title):
        text.set_parse_math(False)  # they are made with the axes, which may be the caller's
    if xlabel is not None:
        ax.set_xlabel(xlabel)
    if ylabel is not None:
        ax.set_ylabel(ylabel)
    if title:
        ax.set_title(title, y=1.0 if isinstance(ax, PanelAxes) else None)
    if tight:
        ax.margins(x=0.0)
    if legend:
        ax.legend(*legend_entries(ax), loc="best")
    return ax


def legend_entries(ax: Axes) -> tuple[list[Any], list[str]]:
    """Return what a legend of the axes shows, and its labels.

    Unlike matplotlib's own choice it holds labels that begin with "_", which users may give.
    """
    artists: list[Any] = [*ax.lines, *ax.patches, *ax.collections, *ax.containers]
    labels = [str(artist.get_label()) for artist in artists]
    named = [
        (artist, label)
        for artist, label in zip(artists, labels, strict=True)
        if label and not _UNNAMED(label)
    ]
    return [artist for artist, _ in named], [label for _, label in named]


def rows_named(ax: Axes, names: Iterable[str], room: float = 0.6) -> None:
    """Make the y axis one of named rows, the first on top, with `room` beyond the middle of the outermost ones."""
    rows = list(names)
    ax.set_yticks(range(len(rows)), rows)
    ax.set_ylim(len(rows) - 1 + room, -room)
    ax.grid(visible=False, axis="y")


class PlainLogFormatter(LogFormatter):
    """Labels of a logarithmic axis: 0.01, 0.1, 1, 10, 100, beyond that 10⁻³, 10⁴ as text (mathtext is slow).

    An axis of less than a decade is also labelled between the powers of ten.
    """

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label, empty where the parent class would leave it out."""
        if not super().__call__(x, pos) or x <= 0.0:
            return ""
        exponent = float(np.log10(x))
        if abs(exponent) < 2.5:
            return f"{x:.3g}"
        power = int(np.floor(exponent + 1e-9))
        factor = x / 10.0**power
        leading = "" if abs(factor - 1.0) < 1e-6 else f"{factor:.2g}×"
        return f"{leading}10{str(power).translate(_SUPERSCRIPTS)}"


def powers_of_ten(axis: Axis) -> None:
    """Label a logarithmic axis by `PlainLogFormatter`."""
    axis.set_major_formatter(PlainLogFormatter(labelOnlyBase=False))
    axis.set_minor_formatter(PlainLogFormatter(labelOnlyBase=False))


def log_values(ax: Axes) -> None:
    """Make the y axis logarithmic."""
    ax.set_yscale("log")
    powers_of_ten(ax.yaxis)
