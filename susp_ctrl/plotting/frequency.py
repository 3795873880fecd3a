"""Frequency responses: magnitude, Bode plots, power spectra. Frequencies come in rad/s and are drawn in Hz."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from susp_ctrl.plotting.style import Look, axes_for, powers_of_ten, sparse_markers, styled, styles_for

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
    for number, (label, style) in enumerate(styles_for(magnitudes, styles).items()):
        values = np.asarray(magnitudes[label], dtype=float)
        if decibel:
            values = _decibel(values)
        ax.plot(hertz, values, label=label, markevery=sparse_markers(hertz.size, number), **style)
    if log_frequency:
        frequency_axis(ax)
    if log_magnitude and not decibel:
        ax.set_yscale("log")
        powers_of_ten(ax.yaxis)
    elif not decibel:
        ax.set_ylim(bottom=0.0)
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel(ylabel)
    ax.margins(x=0.0)
    if title:
        ax.set_title(title)
    if legend:
        ax.legend(loc="best")
    return ax


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
        import matplotlib.pyplot as plt

        _, made = plt.subplots(2, 1, sharex=True, figsize=(6.7, 4.4), layout="constrained")
        axes = (made[0], made[1])
    upper, lower = axes
    hertz = np.asarray(omega, dtype=float) / _TWO_PI
    for number, (label, style) in enumerate(styles_for(responses, styles).items()):
        response = np.asarray(responses[label], dtype=complex)
        marks = sparse_markers(hertz.size, number)
        upper.plot(hertz, _decibel(np.abs(response)), label=label, markevery=marks, **style)
        phase = np.degrees(np.unwrap(np.angle(response)))
        lower.plot(hertz, phase, label=label, markevery=marks, **style)
    for ax in axes:
        frequency_axis(ax)
        ax.margins(x=0.0)
    upper.set_ylabel(ylabel)
    lower.set_ylabel("phase (degrees)")
    lower.set_xlabel("frequency (Hz)")
    if title:
        upper.set_title(title)
    if legend:
        upper.legend(loc="best")
    return axes


def frequency_axis(ax: Axes) -> None:
    """Make the x axis logarithmic with plain numbers: 0.5, 1, 2, 5, 10, or only the decades on a narrow axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    def plain(value: Any, _position: Any) -> str:
        return f"{value:g}"

    ax.set_xscale("log")
    narrow = ax.bbox.width < _NARROW * ax.figure.dpi
    ax.xaxis.set_major_locator(LogLocator(base=10.0, subs=(1.0,) if narrow else (1.0, 2.0, 5.0), numticks=20))
    ax.xaxis.set_major_formatter(FuncFormatter(plain))
    ax.xaxis.set_minor_formatter(NullFormatter())


def _decibel(magnitude: Any) -> Any:
    # An exact zero has no decibel value; nan leaves a gap where -inf would spoil the axis limits.
    with np.errstate(divide="ignore"):
        level = 20.0 * np.log10(magnitude)
    return np.where(np.isfinite(level), level, np.nan)
