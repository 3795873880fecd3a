"""A search for a design: its convergence, and how narrow the optimum it found is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import (
    BLACK,
    GREY,
    Look,
    axes_for,
    powers_of_ten,
    sparse_markers,
    styled,
    styles_for,
)


@styled
def draw_convergence(
    histories: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    ylabel: str = "best J so far",
    log_cost: bool = True,
    reference: float | None = None,
    reference_label: str = "passive",
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw the best value found against the iteration.

    Parameters
    ----------
    histories
        Label -> best value after every iteration, shape (iterations,).
    ax
        Axes to draw into; new ones by default.
    ylabel
        Name and unit of the value.
    log_cost
        Logarithmic axis for the value (used only where all values are positive).
    reference, reference_label
        A level to draw across, e.g. that of the passive car.
    styles, legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    positive = True
    for number, (label, style) in enumerate(styles_for(histories, styles).items()):
        best = np.asarray(histories[label], dtype=float)
        positive = positive and bool(np.all(best[np.isfinite(best)] > 0.0))
        ax.step(
            np.arange(best.size), best, where="post", label=label,
            markevery=sparse_markers(best.size, number), **style,
        )  # fmt: skip
    if reference is not None:
        ax.axhline(reference, color=GREY, linewidth=1.0, linestyle=(0, (1, 1.2)), label=reference_label)
        positive = positive and reference > 0.0
    if log_cost and positive:
        ax.set_yscale("log")
        powers_of_ten(ax.yaxis)
    ax.set_xlabel("iteration")
    ax.set_ylabel(ylabel)
    ax.margins(x=0.0)
    if title:
        ax.set_title(title)
    if legend:
        ax.legend(loc="best")
    return ax


@styled
def draw_detuning(
    detuning: ArrayLike,
    costs: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    ylabel: str = "J",
    marks: ArrayLike = (-0.05, 0.05),
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw how the objective of a single-frequency design grows when the frequency is missed.

    Parameters
    ----------
    detuning
        Relative frequency error (omega - omega0)/omega0, shape (n,); the axis is in percent.
    costs
        Label -> J at that frequency, shape (n,).
    ax
        Axes to draw into; new ones by default.
    ylabel
        Name and unit of J.
    marks
        Relative errors to be marked by vertical lines.
    styles, legend, title
        As in `susp_ctrl.plotting.draw_magnitude`.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    percent = 100.0 * np.asarray(detuning, dtype=float)
    for number, (label, style) in enumerate(styles_for(costs, styles).items()):
        cost = np.asarray(costs[label], dtype=float)
        ax.plot(percent, cost, label=label, markevery=sparse_markers(percent.size, number), **style)
    for mark in np.ravel(np.asarray(marks, dtype=float)):
        ax.axvline(100.0 * mark, color=BLACK, linewidth=0.6, linestyle=(0, (1, 2)))
    ax.set_xlabel("frequency error (%)")
    ax.set_ylabel(ylabel)
    ax.margins(x=0.0)
    ax.set_ylim(bottom=0.0)
    if title:
        ax.set_title(title)
    if legend:
        ax.legend(loc="best")
    return ax
