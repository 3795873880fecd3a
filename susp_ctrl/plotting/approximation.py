"""What an approximation of the delays says about stability, order by order."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import BLACK, BLUE, VERMILLION, axes_for, styled


@styled
def draw_abscissa_over_order(
    orders: ArrayLike,
    abscissas: ArrayLike,
    exact: float,
    ax: Axes | None = None,
    *,
    xlabel: str = "order of the Padé approximation",
    ylabel: str = "abscissa (1/s)",
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw the rightmost real part that each order finds, beside the exact one and the border of stability.

    Parameters
    ----------
    orders
        Orders, shape (n,).
    abscissas
        Real part of the rightmost root of each approximation (1/s), shape (n,). Points on the other side of zero
        than `exact` are filled.
    exact
        Real part of the rightmost exact root (1/s).
    ax
        Axes to draw into; new ones by default.
    xlabel, ylabel
        Names and units.
    legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    steps, values = np.asarray(orders, dtype=float), np.asarray(abscissas, dtype=float)
    wrong = (values < 0.0) != (exact < 0.0)
    ax.plot(steps, values, color=BLUE, linewidth=0.9, marker="o", markerfacecolor="none", label="Padé")
    ax.plot(
        steps[wrong],
        values[wrong],
        linestyle="",
        color=VERMILLION,
        marker="s",
        markersize=5,
        label="wrong verdict",
    )
    ax.axhline(exact, color=BLACK, linewidth=1.0, linestyle=(0, (4, 1.8)), label="exact")
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    if title:
        ax.set_title(title)
    if legend:
        ax.legend(loc="best")
    return ax
