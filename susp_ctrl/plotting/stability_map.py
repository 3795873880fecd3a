"""Stability maps: regions of equal number of unstable roots, crossing curves, and where the design lies."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import BLACK, VERMILLION, axes_for, styled

# Light for stable, darker with the number of unstable roots; the last shade stands for all larger numbers.
_SHADES = ("#FFFFFF", "#DADADA", "#BDBDBD", "#A3A3A3", "#8C8C8C", "#777777", "#646464")


@styled
def draw_stability_map(
    x: ArrayLike,
    y: ArrayLike,
    unstable_roots: ArrayLike,
    curves: ArrayLike,
    ax: Axes | None = None,
    *,
    xlabel: str = "delay 1 (s)",
    ylabel: str = "delay 2 (s)",
    design: tuple[float, float] | None = None,
    title: str | None = None,
) -> Axes:
    """Draw regions shaded by their number of unstable roots, and the crossing curves between them.

    Parameters
    ----------
    x, y
        Values along the axes, shapes (n,) and (m,).
    unstable_roots
        Number of unstable roots, shape (m, n); negative means undecided.
    curves
        Segments of the crossing curves, shape (k, 2, 2): segment, end, coordinate.
    ax
        Axes to draw into; new ones by default.
    xlabel, ylabel
        Names and units of the axes.
    design
        A point to mark.
    title
        Title of the axes.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    numbers = np.asarray(unstable_roots)
    columns, rows = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    highest = max(int(numbers.max(initial=0)), 0)
    values = np.arange(min(highest, len(_SHADES) - 1) + 1)
    levels = np.append(values - 0.5, highest + 0.5)
    ax.contourf(columns, rows, np.maximum(numbers, 0), levels=levels, colors=list(_SHADES[: values.size]))
    lines = np.asarray(curves, dtype=float).reshape(-1, 2, 2)
    ax.add_collection(LineCollection(list(lines), colors=BLACK, linewidths=0.7))
    present = [int(v) for v in np.unique(numbers) if v >= 0]
    handles: list[Any] = []
    for value in present[: len(_SHADES)]:
        shade = _SHADES[min(value, len(_SHADES) - 1)]
        text = "stable" if value == 0 else f"{value} unstable roots" if value > 1 else "1 unstable root"
        handles.append(
            ax.fill_between([], [], [], facecolor=shade, edgecolor=BLACK, linewidth=0.5, label=text)
        )
    if design is not None and columns[0] <= design[0] <= columns[-1] and rows[0] <= design[1] <= rows[-1]:
        (mark,) = ax.plot(
            *design, marker="X", color=VERMILLION, markeredgecolor=BLACK, markersize=7, linestyle=""
        )
        mark.set_label("design")
        handles.append(mark)
    ax.set_xlim(columns[0], columns[-1])
    ax.set_ylim(rows[0], rows[-1])
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(visible=False)
    if title:
        ax.set_title(title)
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    return ax
