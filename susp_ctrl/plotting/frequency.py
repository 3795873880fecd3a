"""Frequency responses: magnitude, Bode plots, power spectra. Frequencies come in rad/s and are drawn in Hz."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import Look, axes_for, each_curve, finished, log_values, pyplot_axes, styled

_TWO_PI = 2.0 * np.pi
_NARROW = 2.2  # inch


@styled
def draw_magnitude(
    omega: ArrayLike,
    magnitudes: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    ylabel: str = "magnitude",
    decibel: bool = False,
    log_magnitude: bool = False,
    log_frequency: bool = True,
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> Axes:
    """Draw magnitudes against frequency.

    Parameters
    ----------
    omega
        Frequencies (rad/s), shape (n,); the axis is in Hz.
    magnitudes
        Label -> magnitude, shape (n,), not negative.
    ax
        Axes to draw into; new ones by default.
    ylabel
        Name and unit of the magnitude.
    decibel
        Draw 20 log10 of the magnitude; the unit in `ylabel` is then the reference of the decibel.
    log_magnitude, log_frequency
        Logarithmic axes.
    styles
        Label -> look, see `susp_ctrl.plotting.curve_style`.
    legend
        Whether to draw a legend.
    title
        Title of the axes.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    hertz = np.asarray(omega, dtype=float) / _TWO_PI
    for values, look in each_curve(magnitudes, styles):
        ax.plot(hertz, _decibel(values) if decibel else values, **look)
    if log_frequency:
        frequency_axis(ax)
    if log_magnitude and not decibel:
        log_values(ax)
    elif not decibel:
        ax.set_ylim(bottom=0.0)
    return finished(ax, "frequency (Hz)", ylabel, title, legend=legend, tight=True)


@styled
def draw_bode(
    omega: ArrayLike,
    responses: Mapping[str, ArrayLike],
    axes: tuple[Axes, Axes] | None = None,
    *,
    ylabel: str = "magnitude (dB)",
    styles: Mapping[str, Look] | None = None,
    legend: bool = True,
    title: str | None = None,
) -> tuple[Axes, Axes]:
    """Draw magnitude (dB) and unwrapped phase (degrees) of complex responses against frequency (Hz).

    Parameters
    ----------
    omega
        Frequencies (rad/s), shape (n,).
    responses
        Label -> complex response, shape (n,).
    axes
        Two axes, magnitude first; new ones, one above the other, by default.
    ylabel
        Name and unit of the magnitude.
    styles, legend, title
        As in `draw_magnitude`.

    Returns
    -------
    tuple of two Axes
    """
    if axes is None:
        upper, lower = pyplot_axes(2, height=4.4)
        axes = upper, lower
    upper, lower = axes
    hertz = np.asarray(omega, dtype=float) / _TWO_PI
    for response, look in each_curve(responses, styles, complex):
        upper.plot(hertz, _decibel(np.abs(response)), **look)
        lower.plot(hertz, np.degrees(np.unwrap(np.angle(response))), **look)
    for ax in axes:
        frequency_axis(ax)
    finished(upper, None, ylabel, title, legend=legend, tight=True)
    finished(lower, "frequency (Hz)", "phase (degrees)", tight=True)
    return axes


def frequency_axis(ax: Axes) -> None:
    """Make the x axis logarithmic with plain numbers: 0.5, 1, 2, 5, 10, or only the decades on a narrow axis."""
    ax.set_xscale("log")
    narrow = ax.bbox.width < _NARROW * ax.figure.dpi
    ax.xaxis.set_major_locator(LogLocator(base=10.0, subs=(1.0,) if narrow else (1.0, 2.0, 5.0), numticks=20))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _position: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())


def _decibel(magnitude: Any) -> Any:
    # An exact zero has no decibel value; nan leaves a gap where -inf would spoil the axis limits.
    with np.errstate(divide="ignore"):
        level = 20.0 * np.log10(magnitude)
    return np.where(np.isfinite(level), level, np.nan)
