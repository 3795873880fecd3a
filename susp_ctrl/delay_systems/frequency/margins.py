r"""Gain, phase and delay margins of an open loop with delays, over all its crossovers.

A loop with delays crosses unit gain and the negative real axis many times. Every crossover is bracketed by samples
between which the response moves little, and then solved on the exact function; the margins are the least over all
of them. The delay margin is in general not that of the smallest phase margin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq, minimize_scalar

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.frequency.frequency_range import default_band, sampled_band
from susp_ctrl.delay_systems.frequency.response_bounds import tail_bound
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.errors import InputError

_MOST_POINTS = 100_000


@dataclass(frozen=True, eq=False)
class StabilityMargins:
    """Margins of an open loop L, for negative feedback ``1/(1 + L)``; they suppose that the closed loop is stable.

    Attributes
    ----------
    gain_margin : float
        Factor on the gain, nearest to one, at which the loop meets -1; below one where less gain destabilises;
        inf without phase crossover.
    phase_margin : float
        Least angle (rad) between L and -1 at unit gain, negative where L has turned beyond; inf without gain
        crossover.
    delay_margin : float
        Least delay (s) whose addition brings L to -1; inf without gain crossover.
    gain_crossovers : pandas.DataFrame
        Columns omega (rad/s), phase_margin (rad), delay_margin (s): all frequencies of unit gain found.
    phase_crossovers : pandas.DataFrame
        Columns omega (rad/s), gain_margin: all frequencies found where L is real and negative.
    band : (float, float)
        Frequencies examined (rad/s).
    complete : bool
        Whether a bound proves that no crossover above the band matters to the gain and delay margins.
    """

    gain_margin: float
    phase_margin: float
    delay_margin: float
    gain_crossovers: pd.DataFrame
    phase_crossovers: pd.DataFrame
    band: tuple[float, float]
    complete: bool

    def __str__(self) -> str:
        return (
            f"gain margin {self.gain_margin:.6g} ({20 * np.log10(self.gain_margin):.4g} dB), "
            f"phase margin {np.degrees(self.phase_margin):.6g} deg, delay margin {self.delay_margin:.6g} s\n"
            f"  {len(self.phase_crossovers)} phase and {len(self.gain_crossovers)} gain crossovers "
            f"from {self.band[0]:.4g} to {self.band[1]:.4g} rad/s"
        )


def stability_margins(sys: Any, omega_range: tuple[float, float] | None = None) -> StabilityMargins:
    """Return the margins of an open loop with one input and one output, least over all crossovers.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The open loop L.
    omega_range : (float, float), optional
        Band to examine (rad/s). By default it ends where a bound proves that the gain stays below one and that
        no crossover beyond can lower the gain margin, as far as that needs no more than 1e5 samples.

    Returns
    -------
    StabilityMargins

    Raises
    ------
    InputError
        Several inputs or outputs, or an empty band.

    Notes
    -----
    Between neighbouring samples L moves by less than a tenth of its size. Touches of the unit circle between
    two samples are looked for at every local extremum of the gain.
    """
    loop = DelaySystem.of(sys, "sys")
    if not loop.issiso():
        raise InputError(
            f"sys has {loop.ninputs} inputs and {loop.noutputs} outputs: margins need one of each; "
            "select them by sys[output, input]"
        )
    if omega_range is None:
        low, high = default_band(loop)
        samples = sampled_band(loop, low, high, 0.1, _MOST_POINTS)
        samples = _extended(loop, samples)
    else:
        low, high = validation.vector("omega_range", omega_range, size=2)
        if not 0.0 < low < high < np.inf:
            raise InputError(
                f"omega_range = {omega_range!r} is not allowed: two increasing frequencies are needed"
            )
        samples = sampled_band(loop, low, high, 0.1, _MOST_POINTS)
    gain_at = _gain_crossovers(loop, samples)
    phase_at = _phase_crossovers(loop, samples)
    turned = np.angle(-_values(loop, gain_at))
    delays = np.mod(turned, 2.0 * np.pi) / gain_at
    factors = 1.0 / np.abs(_values(loop, phase_at))
    nearest = np.argsort(np.abs(np.log(factors)))
    return StabilityMargins(
        gain_margin=float(factors[nearest[0]]) if factors.size else np.inf,
        phase_margin=float(turned[np.argmin(np.abs(turned))]) if gain_at.size else np.inf,
        delay_margin=float(delays.min()) if gain_at.size else np.inf,
        gain_crossovers=pd.DataFrame({"omega": gain_at, "phase_margin": turned, "delay_margin": delays}),
        phase_crossovers=pd.DataFrame({"omega": phase_at, "gain_margin": factors}),
        band=(float(samples[0]), float(samples[-1])),
        complete=_nothing_beyond(loop, samples, phase_at),
    )


def _extended(loop: DelaySystem, samples: FloatArray) -> FloatArray:
    """Go on until the rest can neither cross unit gain nor lower the gain margin."""
    for _ in range(8):
        if _nothing_beyond(loop, samples, _phase_crossovers(loop, samples)):
            break
        further = sampled_band(loop, float(samples[-1]), 3.0 * float(samples[-1]), 0.1, _MOST_POINTS)
        if samples.size + further.size > _MOST_POINTS:
            break
        samples = np.union1d(samples, further)
    return samples


def _nothing_beyond(loop: DelaySystem, samples: FloatArray, crossings: FloatArray) -> bool:
    """Whether the gain stays, beyond the samples, below one and below that of a crossing already found."""
    level = float(np.max(np.abs(_values(loop, crossings)), initial=1e-3))
    return tail_bound(loop.folded).at(float(samples[-1])) <= min(1.0, level) * (1.0 + 1e-12)


def _gain_crossovers(loop: DelaySystem, samples: FloatArray) -> FloatArray:
    def height(omega: float) -> float:
        return float(np.log(np.abs(_values(loop, np.array([omega]))[0])))

    with np.errstate(divide="ignore"):
        heights = np.log(np.abs(_values(loop, samples)))
    # an extremum near unit gain may reach it between the samples
    middle = heights[1:-1]
    top = (middle >= heights[:-2]) & (middle >= heights[2:]) & (middle < 0.0) & (middle > -0.2)
    bottom = (middle <= heights[:-2]) & (middle <= heights[2:]) & (middle > 0.0) & (middle < 0.2)
    points = [samples]
    for k in np.flatnonzero(top | bottom) + 1:
        side = -1.0 if top[k - 1] else 1.0
        bounds = (float(samples[k - 1]), float(samples[k + 1]))
        extremum = minimize_scalar(
            lambda w, side=side: side * height(w),
            bounds=bounds,
            method="bounded",
            options={"xatol": 1e-9 * bounds[1]},
        )
        points.append(np.array([extremum.x]))
    grid = np.unique(np.concatenate(points))
    with np.errstate(divide="ignore"):
        heights = np.log(np.abs(_values(loop, grid)))
    return _roots_between(height, grid, heights)


def _phase_crossovers(loop: DelaySystem, samples: FloatArray) -> FloatArray:
    def imaginary(omega: float) -> float:
        value = _values(loop, np.array([omega]))[0]
        return float(value.imag / abs(value))

    values = _values(loop, samples)
    with np.errstate(invalid="ignore"):
        found = _roots_between(imaginary, samples, values.imag / np.abs(values))
    return found[_values(loop, found).real < 0.0]


def _roots_between(function: Any, grid: FloatArray, values: FloatArray) -> FloatArray:
    finite = np.isfinite(values)
    changes = np.flatnonzero((values[:-1] * values[1:] < 0.0) & finite[:-1] & finite[1:])
    roots = [brentq(function, grid[k], grid[k + 1], xtol=1e-14 * grid[k + 1], rtol=1e-14) for k in changes]
    return np.unique(np.concatenate([roots, grid[values == 0.0]]))


def _values(loop: DelaySystem, omega: FloatArray) -> np.ndarray:
    return np.asarray(loop(1j * omega, squeeze=False))[0, 0]
