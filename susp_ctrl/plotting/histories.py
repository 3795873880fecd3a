"""Time histories: several designs over one another, an approximation as an overlay, and road profiles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import BLACK, Look, axes_for, curve_style, finished, styled, styles_for


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
    return finished(ax, xlabel, ylabel, title, legend=legend, tight=True)


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
    seconds = np.asarray(time, dtype=float)
    for number, (label, profile) in enumerate(profiles.items()):
        look = curve_style("published") if number % 2 else {"color": BLACK, "linestyle": "-"}
        ax.plot(
            seconds, scale * np.asarray(profile, dtype=float), label=label,
            color=look["color"], linestyle=look["linestyle"], linewidth=1.0,
        )  # fmt: skip
    return finished(ax, "time (s)", ylabel, title, legend=legend, tight=True)
