"""Characteristic roots in the complex plane: sets of roots, and their paths over a parameter."""

from __future__ import annotations

from collections.abc import Mapping

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
    styled,
    styles_for,
)

_MARKERS = ("x", "o", "s", "^", "D", "v", "P", "X")


@styled
def draw_roots(
    roots: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw sets of roots in the complex plane, with the imaginary axis as the border of stability.

    Parameters
    ----------
    roots
        Label -> roots (rad/s), shape (n,), complex.
    ax
        Axes to draw into; new ones by default.
    styles, legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax, height=3.4)
    for number, (label, style) in enumerate(styles_for(roots, styles).items()):
        values = np.ravel(np.asarray(roots[label], dtype=complex))
        ax.plot(
            values.real, values.imag, linestyle="", marker=_MARKERS[number % len(_MARKERS)], markersize=5,
            markerfacecolor="none", markeredgewidth=1.1, color=style["color"], label=label,
        )  # fmt: skip
    return _plane(ax, title, legend=legend and bool(roots))


@styled
def draw_root_locus(
    values: ArrayLike,
    roots: ArrayLike,
    ax: Axes | None = None,
    *,
    parameter: str = "parameter",
    title: str | None = None,
) -> Axes:
    """Draw the paths of roots over a parameter: circles at its first value, crosses at its last.

    Parameters
    ----------
    values
        Values of the parameter, shape (n,).
    roots
        Roots (rad/s), shape (n, branches), complex; nan where a branch does not exist.
    ax
        Axes to draw into; new ones by default.
    parameter
        Name and unit of the parameter.
    title
        Title of the axes.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax, height=3.4)
    steps, paths = np.asarray(values, dtype=float), np.asarray(roots, dtype=complex)
    ax.plot(paths.real, paths.imag, color=BLUE, linewidth=0.9)
    right = np.where(paths.real > 0.0, paths, np.nan)
    ax.plot(right.real, right.imag, color=VERMILLION, linewidth=1.6)
    ends = {"o": (0, "none"), "x": (-1, BLACK)}
    for marker, (row, face) in ends.items():
        ax.plot(
            paths[row].real, paths[row].imag, linestyle="", marker=marker, color=BLACK, markerfacecolor=face,
            label=f"{parameter} = {steps[row]:g}",
        )  # fmt: skip
    return _plane(ax, title, legend=True)


def _plane(ax: Axes, title: str | None, *, legend: bool) -> Axes:
    ax.axvline(0.0, color=GREY, linewidth=1.0, zorder=1.0)
    return finished(ax, "real part (rad/s)", "imaginary part (rad/s)", title, legend=legend)
