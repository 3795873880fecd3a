"""Many variants of one design: what drives an indicator, how it spreads, and its map over two factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import (
    BLACK,
    BLUE,
    GREY,
    VERMILLION,
    Look,
    axes_for,
    finished,
    rows_named,
    sparse_markers,
    styled,
    styles_for,
)

_MOST_NUMBERS = 100  # cells of a map in which its values are written


@styled
def draw_sensitivity(
    shares: Mapping[str, float],
    directions: Mapping[str, float] | None = None,
    ax: Axes | None = None,
    *,
    xlabel: str = "share of the variance",
    title: str | None = None,
) -> Axes:
    """Draw the shares of factors in the variance of an indicator as bars, the largest on top.

    Parameters
    ----------
    shares
        Factor -> share, 0 to 1, in the order of drawing; nan is left blank.
    directions
        Factor -> rank correlation; its sign is written beside the bar and hatches those that lower the indicator.
    ax
        Axes to draw into; new ones by default.
    xlabel, title
        Texts.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax, height=0.9 + 0.3 * len(shares))
    named: set[str] = set()
    for row, (factor, share) in enumerate(shares.items()):
        value = float(share) if np.isfinite(share) else 0.0
        sign = float((directions or {}).get(factor, np.nan))
        falling = sign < 0.0
        meaning = "lowers it" if falling else "raises it" if sign > 0.0 else "no direction"
        ax.barh(
            row, value, height=0.6, edgecolor=BLACK, linewidth=0.6,
            facecolor="white" if falling else BLUE if sign > 0.0 else GREY,
            hatch="////" if falling else "",
            label=meaning if meaning not in named else None,
        )  # fmt: skip
        named.add(meaning)
        text = "–" if not np.isfinite(share) else f"{100.0 * value:.0f} %"
        ax.annotate(text, (value, row), xytext=(4, 0), textcoords="offset points", va="center", fontsize=7.0)
    rows_named(ax, shares)
    ax.set_xlim(0.0, 1.12)
    if directions:
        ax.legend(loc="lower right")
    return finished(ax, xlabel, None, title)


@styled
def draw_distribution(
    values: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    nominal: Mapping[str, float] | None = None,
    limit: float | None = None,
    xlabel: str = "value",
    styles: Mapping[str, Look] | None = None,
    title: str | None = None,
) -> Axes:
    """Draw the share of variants that do not exceed a value, one curve per design.

    Parameters
    ----------
    values
        Label -> values of all variants; those that are not finite are left out of the curve but not of its height.
    ax
        Axes to draw into; new ones by default.
    nominal
        Label -> value of the study itself, marked on the curve.
    limit
        Drawn as a vertical line.
    xlabel, styles, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    for number, (label, style) in enumerate(styles_for(values, styles).items()):
        every = np.asarray(values[label], dtype=float)
        ordered = np.sort(every[np.isfinite(every)])
        share = np.arange(1, ordered.size + 1) / max(every.size, 1)
        ax.plot(
            ordered, share, drawstyle="steps-post", label=label,
            markevery=sparse_markers(ordered.size, number), **style,
        )  # fmt: skip
        own = (nominal or {}).get(label, np.nan)
        if np.isfinite(own):
            ax.plot(own, 0.0, marker="^", color=style["color"], clip_on=False, zorder=4)
    if limit is not None:
        ax.axvline(limit, color=VERMILLION, linewidth=1.0, linestyle="--", label="limit")
    ax.set_ylim(0.0, 1.02)
    return finished(ax, xlabel, "share of variants", title, legend=True)


@styled
def draw_heat_map(
    values: ArrayLike,
    columns: Sequence[str],
    rows: Sequence[str],
    ax: Axes | None = None,
    *,
    xlabel: str = "",
    ylabel: str = "",
    label: str = "",
    title: str | None = None,
) -> Axes:
    """Draw a table of numbers as a map, the first row at the bottom, with a colour bar.

    Parameters
    ----------
    values
        Shape (rows, columns); nan is left blank. Small maps have their numbers written into them.
    columns, rows
        Names of the columns and rows.
    ax
        Axes to draw into; new ones by default.
    xlabel, ylabel, label, title
        Texts; `label` is that of the colour bar.

    Returns
    -------
    Axes
    """
    table = np.asarray(values, dtype=float)
    ax = axes_for(ax, height=1.6 + 0.28 * len(rows))
    # cividis reads the same with colour-blind eyes and grows monotonically darker in black and white
    image = ax.imshow(np.ma.masked_invalid(table), origin="lower", aspect="auto", cmap="cividis")
    ax.set_xticks(range(len(columns)), list(columns), rotation=30, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(rows)), list(rows))
    ax.grid(visible=False)
    if table.size <= _MOST_NUMBERS:
        for (row, column), value in np.ndenumerate(table):
            if np.isfinite(value):
                dark = float(np.asarray(image.norm(value))) < 0.55
                ax.text(
                    column, row, f"{value:.3g}", ha="center", va="center", fontsize=6.5,
                    color="white" if dark else BLACK,
                )  # fmt: skip
    ax.figure.colorbar(image, ax=ax, label=label)
    return finished(ax, xlabel, ylabel, title)
