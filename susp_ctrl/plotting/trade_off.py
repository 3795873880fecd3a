"""A trade-off: one objective over another."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import BLACK, GREY, axes_for, styled


@styled
def draw_trade_off(
    first: ArrayLike,
    second: ArrayLike,
    ax: Axes | None = None,
    *,
    passive: tuple[float, float] | None = None,
    xlabel: str = "first objective",
    ylabel: str = "second objective",
    title: str | None = None,
) -> Axes:
    """Draw a Pareto front.

    Parameters
    ----------
    first, second
        Both objectives of each design, shape (designs,).
    ax
        Axes to draw into; new ones by default.
    passive
        Both objectives without control, marked beside the front.
    xlabel, ylabel, title
        Texts.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    x, y = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    order = np.argsort(x)
    ax.plot(x[order], y[order], color=BLACK, marker="o", markersize=4.0, label="designs")
    if passive is not None and np.all(np.isfinite(passive)):
        ax.plot(*passive, linestyle="none", marker="s", color=GREY, label="passive")
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    if title:
        ax.set_title(title)
    ax.legend(loc="best")
    return ax
