"""A search for a design: its convergence, how narrow the optimum it found is, and the trade-off of two objectives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import BLACK, GREY, Look, axes_for, each_curve, finished, log_values, styled


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
    for best, look in each_curve(histories, styles):
        positive = positive and bool(np.all(best[np.isfinite(best)] > 0.0))
        ax.step(np.arange(best.size), best, where="post", **look)
    if reference is not None:
        ax.axhline(reference, color=GREY, linewidth=1.0, linestyle=(0, (1, 1.2)), label=reference_label)
        positive = positive and reference > 0.0
    if log_cost and positive:
        log_values(ax)
    return finished(ax, "iteration", ylabel, title, legend=legend, tight=True)


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
    for cost, look in each_curve(costs, styles):
        ax.plot(percent, cost, **look)
    for mark in np.ravel(np.asarray(marks, dtype=float)):
        ax.axvline(100.0 * mark, color=BLACK, linewidth=0.6, linestyle=(0, (1, 2)))
    ax.set_ylim(bottom=0.0)
    return finished(ax, "frequency error (%)", ylabel, title, legend=legend, tight=True)


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
    return finished(ax, xlabel, ylabel, title, legend=True)
