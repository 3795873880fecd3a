"""Comparisons: an approximation with the truth over its order, and designs as changes in percent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import (
    BLACK,
    BLUE,
    GREEN,
    PURPLE,
    VERMILLION,
    Look,
    axes_for,
    finished,
    log_values,
    rows_named,
    styled,
    styles_for,
)

_BARS = ((VERMILLION, "////"), (BLUE, ""), (GREEN, "...."), (PURPLE, "xxxx"))


@styled
def draw_order_error(
    orders: ArrayLike,
    errors: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    ylabel: str = "relative error",
    xlabel: str = "order of the Padé approximation",
    needed: float | None = None,
    needed_label: str = "order needed for the band",
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw errors against the order of an approximation, on a logarithmic axis.

    Parameters
    ----------
    orders
        Orders, shape (n,).
    errors
        Label -> error, shape (n,), not negative; nan leaves a gap.
    ax
        Axes to draw into; new ones by default.
    ylabel, xlabel
        Names and units.
    needed, needed_label
        The order that the band asks for, marked by a vertical line, and its legend entry.
    styles, legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    steps = np.asarray(orders, dtype=float)
    for label, style in styles_for(errors, styles).items():
        values = np.asarray(errors[label], dtype=float)
        look = {**style, "marker": style["marker"] or "o"}
        ax.plot(steps, np.where(values > 0.0, values, np.nan), label=label, **look)
    if needed is not None:
        ax.axvline(needed, color=BLACK, linewidth=0.8, linestyle=(0, (1, 2)), label=needed_label)
    log_values(ax)
    return finished(ax, xlabel, ylabel, title, legend=legend)


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
        steps[wrong], values[wrong], linestyle="", color=VERMILLION, marker="s", markersize=5,
        label="wrong verdict",
    )  # fmt: skip
    ax.axhline(exact, color=BLACK, linewidth=1.0, linestyle=(0, (4, 1.8)), label="exact")
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    return finished(ax, xlabel, ylabel, title, legend=legend)


@styled
def draw_changes(
    indicators: Sequence[str],
    changes: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    xlabel: str = "change against passive (%)",
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw changes in percent as bars from the zero line: to the left less, to the right more.

    Parameters
    ----------
    indicators
        Names of the quantities, one group of bars each.
    changes
        Label of a design -> change (%), shape (number of indicators,).
    ax
        Axes to draw into; new ones by default.
    xlabel
        Name of the change.
    legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax, height=0.9 + 0.22 * len(indicators) * max(len(changes), 1))
    groups = np.arange(len(indicators), dtype=float)
    thick = 0.8 / max(len(changes), 1)
    for number, (label, values) in enumerate(changes.items()):
        colour, hatch = _BARS[number % len(_BARS)]
        place = groups - 0.4 + thick * (number + 0.5)
        percent = np.asarray(values, dtype=float)
        bars = ax.barh(
            place, percent, height=0.9 * thick, facecolor=colour, edgecolor=BLACK, linewidth=0.5, hatch=hatch,
            label=label,
        )  # fmt: skip
        ax.bar_label(bars, labels=[f"{value:+.0f}" for value in percent], padding=2, fontsize=6.5)
    ax.axvline(0.0, color=BLACK, linewidth=0.8)
    rows_named(ax, indicators, room=0.55)
    ax.margins(x=0.12)
    return finished(ax, xlabel, None, title, legend=legend)
