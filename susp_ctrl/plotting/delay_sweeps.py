"""Stability against delay: |z| over frequency, and the intervals of the delay in which a loop is stable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.frequency import frequency_axis
from susp_ctrl.plotting.style import (
    BLACK,
    VERMILLION,
    Look,
    axes_for,
    each_curve,
    finished,
    log_values,
    rows_named,
    styled,
)


@styled
def draw_unit_modulus(
    omega: ArrayLike,
    moduli: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    crossings: ArrayLike = (),
    ylabel: str = "|z|",
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw |z| against frequency with the unit line; a root pair crosses the axis where |z| = 1.

    Parameters
    ----------
    omega
        Frequencies (rad/s), shape (n,); the axis is in Hz.
    moduli
        Label -> |z|, shape (n,); infinite values leave a gap.
    ax
        Axes to draw into; new ones by default.
    crossings
        Crossing frequencies (rad/s), marked on the unit line.
    ylabel
        Name of the modulus.
    styles, legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    hertz = np.asarray(omega, dtype=float) / (2.0 * np.pi)
    for values, look in each_curve(moduli, styles):
        ax.plot(hertz, np.where(np.isfinite(values) & (values > 0.0), values, np.nan), **look)
    ax.axhline(1.0, color=BLACK, linewidth=1.0, linestyle="-", zorder=1.5)
    found = np.ravel(np.asarray(crossings, dtype=float)) / (2.0 * np.pi)
    if found.size:
        ax.plot(found, np.ones_like(found), "o", color=BLACK, markersize=5, label="crossing", zorder=4)
    frequency_axis(ax)
    log_values(ax)
    return finished(ax, "frequency (Hz)", ylabel, title, legend=legend, tight=True)


@styled
def draw_intervals(
    rows: Mapping[str, Sequence[tuple[float, float, int]]],
    ax: Axes | None = None,
    *,
    marks: Mapping[str, float] | None = None,
    mark_label: str = "mark",
    claims: Mapping[str, float] | None = None,
    claim_label: str = "published limit",
    xlabel: str = "delay (s)",
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw the stable and unstable intervals of a delay as bars, one row per loop.

    Parameters
    ----------
    rows
        Row label -> intervals (from, to, number of unstable roots), in seconds; a negative number of roots
        means undecided.
    ax
        Axes to draw into; new ones by default.
    marks, mark_label
        Row label -> a delay (s) marked by a triangle below the bar, and its meaning.
    claims, claim_label
        Row label -> a published end of the stable interval (s), marked by a vertical bar, and its meaning.
    xlabel
        Name and unit of the delay.
    legend, title
        As in `susp_ctrl.plotting.draw_magnitude`; the legend stands above the axes.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax, height=0.8 + 0.38 * len(rows))
    looks: dict[str, dict[str, Any]] = {
        "stable": {"facecolor": "white", "hatch": ""},
        "unstable": {"facecolor": "#8A8A8A", "hatch": "////"},
        "undecided": {"facecolor": "#E2E2E2", "hatch": "...."},
    }
    named: set[str] = set()
    end = 0.0
    for row, intervals in enumerate(rows.values()):
        for start, stop, roots in intervals:
            kind = "undecided" if roots < 0 else "stable" if roots == 0 else "unstable"
            label = kind if kind not in named else None
            named.add(kind)
            ax.barh(
                row, stop - start, left=start, height=0.52, edgecolor=BLACK, linewidth=0.7, label=label, **looks[kind]
            )  # fmt: skip
            end = max(end, stop)
            if roots > 0:
                ax.annotate(
                    str(roots), ((start + stop) / 2.0, row), ha="center", va="center", fontsize=6.5,
                    bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "linewidth": 0.0},
                )  # fmt: skip
    names = list(rows)

    def mark(delays: Mapping[str, float] | None, offset: float, **look: Any) -> None:
        points = [(delay, names.index(row) + offset) for row, delay in (delays or {}).items() if row in rows]
        if points:
            ax.plot(*np.transpose(points), linestyle="", markeredgewidth=1.4, clip_on=False, **look)

    mark(marks, 0.36, marker="^", color=BLACK, markersize=4.5, label=mark_label)  # below the bar
    mark(claims, 0.0, marker="|", color=VERMILLION, markersize=15, label=claim_label)
    rows_named(ax, names)
    ax.set_xlim(0.0, end or 1.0)
    finished(ax, xlabel, None, title)
    if legend:
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, frameon=False)
    return ax
