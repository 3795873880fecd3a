"""Time histories: several designs over one another, an approximation as an overlay, and road profiles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import BLACK, Look, axes_for, curve_style, styled, styles_for


@styled
def draw_history(
    time: ArrayLike,
    curves: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    overlay: Mapping[str, ArrayLike] | None = None,
    overlay_label: str = "{} (Padé)",
    overlay_count: int = 40,
    ylabel: str = "",
    xlabel: str = "time (s)",
    scale: float = 1.0,
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw time histories as lines and, over them, an approximation of the same as sparse markers.

    Parameters
    ----------
    time
        Times (s), shape (n,).
    curves
        Label -> history, shape (n,).
    ax
        Axes to draw into; new ones by default.
    overlay
        Label of a curve -> its approximation, shape (n,), drawn as open markers in the colour of that curve:
        where a marker leaves its line, the approximation is wrong.
    overlay_label
        Legend entry of an overlay; ``{}`` stands for the label of the curve.
    overlay_count
        About how many markers to draw for each overlay.
    ylabel, xlabel
        Names and units.
    scale
        Factor for display (1000 draws metres as millimetres); `ylabel` names the displayed unit.
    styles, legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    seconds = np.asarray(time, dtype=float)
    looks = styles_for(curves, styles)
    for label, look in looks.items():
        line = {key: value for key, value in look.items() if not key.startswith("marker")}
        ax.plot(seconds, scale * np.asarray(curves[label], dtype=float), label=label, **line)
    step = max(seconds.size // max(overlay_count, 1), 1)
    for number, (label, values) in enumerate((overlay or {}).items()):
        look = looks.get(label, curve_style(number))
        pick = slice((number * step) // 2, None, step)
        ax.plot(
            seconds[pick], scale * np.asarray(values, dtype=float)[pick],
            linestyle="", marker=look["marker"] or "o", color=look["color"], markersize=2.8,
            markerfacecolor="white", markeredgewidth=0.6, label=overlay_label.format(label), zorder=3,
        )  # fmt: skip
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.margins(x=0.0)
    if title:
        ax.set_title(title)
    if legend:
        ax.legend(loc="best")
    return ax


@styled
def draw_road(
    time: ArrayLike,
    profiles: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    ylabel: str = "elevation (mm)",
    scale: float = 1000.0,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw road elevation under the wheels against time.

    Parameters
    ----------
    time
        Times (s), shape (n,).
    profiles
        Label (front, rear) -> elevation (m), shape (n,).
    ax
        Axes to draw into; new ones by default.
    ylabel, scale
        Displayed unit and the factor that makes it.
    legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax, height=2.2)
    looks: tuple[dict[str, Any], ...] = ({"color": BLACK, "linestyle": "-"}, curve_style("published"))
    for number, (label, profile) in enumerate(profiles.items()):
        look: dict[str, Any] = {key: looks[number % 2][key] for key in ("color", "linestyle")}
        ax.plot(
            np.asarray(time, dtype=float),
            scale * np.asarray(profile, dtype=float),
            label=label,
            linewidth=1.0,
            **look,
        )
    ax.set_xlabel("time (s)")
    ax.set_ylabel(ylabel)
    ax.margins(x=0.0)
    if title:
        ax.set_title(title)
    if legend:
        ax.legend(loc="best")
    return ax
