r"""Gain, phase and delay margins of an open loop with delays, over all its crossovers.

A loop with delays crosses unit gain and the negative real axis many times; the margins are the least over all
crossovers, those at zero and infinite frequency included. The delay margin is in general not that of the smallest
phase margin. All crossovers are found by a search that proves that there are no others (`crossovers`). A dead time
turns the phase only: the gain crossovers are those of the loop without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.crossings import Work
from susp_ctrl.delay_systems.frequency.crossovers import (
    CELLS,
    Clear,
    Condition,
    clear_above,
    clear_below,
    distinct,
    vanishes,
    zeros_between,
)
from susp_ctrl.delay_systems.frequency.dead_time import LoopWithDeadTime, without_dead_time
from susp_ctrl.delay_systems.frequency.response_bounds import HighFrequencySeries
from susp_ctrl.delay_systems.frequency.return_difference import Expansion, ReturnDifference
from susp_ctrl.delay_systems.model import DelaySystem, FoldedLoop, arithmetic
from susp_ctrl.errors import InputError

_EPSILON = float(np.finfo(float).eps)
# What is as near to one as that is one.
_UNITY = 64.0 * _EPSILON
# Turns of a dead time whose crossovers are all listed; beyond, those that may be nearer to -1 than the others.
_LISTED = 100.0


@dataclass(frozen=True, eq=False)
class StabilityMargins:
    """Margins of an open loop L, for negative feedback ``1/(1 + L)``; they suppose that the closed loop is stable.

    Attributes
    ----------
    gain_margin : float
        Factor on the gain, nearest to one, at which the loop meets -1; below one where less gain destabilises;
        inf without phase crossover.
    gain_range : (float, float)
        Factors on the gain, below and above one, between which the loop does not meet -1; 0 and inf without such.
    phase_margin : float
        Least angle (rad) between L and -1 at unit gain, negative where L has turned beyond; inf without gain
        crossover.
    delay_margin : float
        Least delay (s) whose addition brings L to -1; inf without gain crossover; 0 where L keeps a gain of one or
        more up to infinite frequency, so that any delay destabilises.
    gain_crossovers : pandas.DataFrame
        Columns omega (rad/s), phase_margin (rad), phase_margin_deg, delay_margin (s): all frequencies of unit gain.
    phase_crossovers : pandas.DataFrame
        Columns omega (rad/s), gain_margin: frequencies where L is real and negative. With a dead time there are
        infinitely many: listed are those up to which the gain decides and, after a hundred turns, only such as may
        be nearer to -1 than the others. An infinite frequency stands for the limit.
    band : (float, float)
        Frequencies examined (rad/s).
    complete : bool
        Whether it is proven that no other crossover can lower a margin: every interval of frequency is shown, from
        the loop's Taylor polynomial and a bound of its remainder, to hold no crossover but those listed. The proof
        is that of the data to rounding, not one in interval arithmetic.
    """

    gain_margin: float
    gain_range: tuple[float, float]
    phase_margin: float
    delay_margin: float
    gain_crossovers: pd.DataFrame
    phase_crossovers: pd.DataFrame
    band: tuple[float, float]
    complete: bool

    @property
    def phase_margin_deg(self) -> float:
        """The phase margin in degrees."""
        return float(np.degrees(self.phase_margin))

    def __str__(self) -> str:
        return (
            f"gain margin {self.gain_margin:.6g} ({20 * np.log10(self.gain_margin):.4g} dB), "
            f"phase margin {self.phase_margin_deg:.6g} deg, delay margin {self.delay_margin:.6g} s\n"
            f"  {len(self.phase_crossovers)} phase and {len(self.gain_crossovers)} gain crossovers "
            f"from {self.band[0]:.4g} to {self.band[1]:.4g} rad/s"
            + ("" if self.complete else "; not proven that these are all")
        )


class _Crossovers(NamedTuple):
    """Frequencies, whether none is missing that matters, and whether every frequency is one."""

    omega: FloatArray
    complete: bool
    everywhere: bool = False


def stability_margins(
    sys: Any, omega_range: tuple[float, float] | None = None, channel: str | int | None = None
) -> StabilityMargins:
    """Return the margins of an open loop, least over all crossovers.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The open loop L.
    omega_range : (float, float), optional
        Band to examine (rad/s), by default all frequencies. With a band `complete` is False.
    channel : str or int, optional
        Of a square loop with several channels that which is broken (name or number of its input), the others being
        closed by negative feedback.

    Returns
    -------
    StabilityMargins
        ``.gain_margin``, ``.gain_range``, ``.phase_margin``, ``.phase_margin_deg``, ``.delay_margin``,
        ``.gain_crossovers``, ``.phase_crossovers``, ``.complete``.

    Raises
    ------
    InputError
        Several inputs or outputs without `channel`, an unknown channel, or an empty band.

    Notes
    -----
    A pole of L on the imaginary axis is no crossover. A touch of the unit circle or of the real axis counts as one. A
    loop that is real on the whole axis, as ``1/s^2``, or of unit gain on all of it, as an all-pass, has every
    frequency as a crossover: listed are the ends and the stationary points, where margins are least.
    """
    loop = without_dead_time(_broken_loop(DelaySystem.of(sys, "sys"), channel).folded)
    band = (0.0, np.inf)
    if omega_range is not None:
        low, high = validation.vector("omega_range", omega_range, size=2)
        if not 0.0 < low < high < np.inf:
            raise InputError(
                f"omega_range = {omega_range!r} is not allowed: two increasing frequencies are needed"
            )
        band = (float(low), float(high))
    gain = _between_ends(loop.rest, Condition.UNIT_GAIN, band)
    phase = _phase_crossovers(loop, gain.omega, band)
    if gain.everywhere:
        gain = _with_stationary(loop, Condition.STATIONARY_PHASE, gain, phase, band)
    if phase.everywhere:
        phase = _with_stationary(loop, Condition.STATIONARY_GAIN, phase, gain, band)
    complete = gain.complete and phase.complete and omega_range is None
    return _margins(loop, gain.omega, phase.omega, band, complete)


def _broken_loop(loop: DelaySystem, channel: str | int | None) -> DelaySystem:
    if channel is None:
        if not loop.issiso():
            raise InputError(
                f"sys has {loop.ninputs} inputs and {loop.noutputs} outputs: margins need one of each; "
                "name the channel to break, or select by sys[output, input]"
            )
        return loop
    if loop.ninputs != loop.noutputs:
        raise InputError(
            f"sys has {loop.ninputs} inputs and {loop.noutputs} outputs: a loop needs as many of both"
        )
    k = validation.signal_index("channel", channel, loop.input_labels)
    others = np.eye(loop.ninputs)
    others[k, k] = 0.0
    return arithmetic.closed_around(loop, DelaySystem.of(others), -1.0)[k, k]


def _margins(
    loop: LoopWithDeadTime,
    gain_at: FloatArray,
    phase_at: FloatArray,
    band: tuple[float, float],
    complete: bool,
) -> StabilityMargins:
    turned = _angles_to_minus_one(loop, gain_at)
    with np.errstate(divide="ignore", invalid="ignore"):
        delays = np.where(turned == 0.0, 0.0, np.mod(turned, 2.0 * np.pi) / gain_at)
    phase_at = phase_at[_negative(loop, phase_at)]
    factors = 1.0 / np.abs(loop.response(phase_at))
    factors[np.abs(factors - 1.0) <= _UNITY] = 1.0
    nearest = np.argsort(np.abs(np.log(factors)))
    keeps_gain = band[1] == np.inf and loop.direct is not None and abs(loop.direct[0]) >= 1.0 - 4.0 * _EPSILON
    gain_table = {"omega": gain_at, "phase_margin": turned, "phase_margin_deg": np.degrees(turned)}
    return StabilityMargins(
        gain_margin=float(factors[nearest[0]]) if factors.size else np.inf,
        gain_range=(
            float(factors[factors <= 1.0].max(initial=0.0)),
            float(factors[factors >= 1.0].min(initial=np.inf)),
        ),
        phase_margin=float(turned[np.argmin(np.abs(turned))]) if gain_at.size else np.inf,
        delay_margin=0.0 if keeps_gain else float(delays.min(initial=np.inf)),
        gain_crossovers=pd.DataFrame(gain_table | {"delay_margin": delays}),
        phase_crossovers=pd.DataFrame({"omega": phase_at, "gain_margin": factors}),
        band=band,
        complete=complete,
    )


def _angles_to_minus_one(loop: LoopWithDeadTime, omega: FloatArray) -> FloatArray:
    """Return the angle from -1 to L in (-pi, pi]; zero where rounding cannot tell it from zero."""
    angles = np.angle(-loop.response(omega))
    finite = np.isfinite(omega)
    expansion = _expanded(loop, omega[finite])
    slope = np.abs(expansion.coefficients[:, 1])
    uncertain = np.zeros(omega.size)
    # near -1 the value of S- is 1/2, and L moves by four times as much
    uncertain[finite] = 4.0 * (expansion.rounding[:, 0] + 16.0 * _EPSILON * omega[finite] * slope)
    angles[np.abs(angles) <= uncertain] = 0.0
    if loop.direct is not None and loop.direct[1] > 0.0:
        angles[~finite] = 0.0  # a delay turns without end
    return np.where(angles <= uncertain - np.pi, np.pi, angles)


def _negative(loop: LoopWithDeadTime, omega: FloatArray) -> np.ndarray:
    """Tell where L, real there, is negative and has no pole; S vanishes at a pole."""
    result = loop.response(omega).real < 0.0
    finite = np.isfinite(omega)
    expansion = _expanded(loop, omega[finite])
    S, slope = expansion.coefficients[:, 0], expansion.coefficients[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        # rounding of Im S moves its zero, and S with it
        skew = np.fmin(np.abs(slope / slope.imag), 1e4)
    moved = skew * expansion.rounding[:, 0] + 1024.0 * _EPSILON * omega[finite] * np.abs(slope)
    result[finite] &= np.abs(S) > moved
    if loop.direct is not None and loop.direct[0] != 0.0 and loop.direct[1] > 0.0:
        result[~finite] = True  # the limit of infinitely many crossovers, whatever its sign
    return result


def _expanded(loop: LoopWithDeadTime, omega: FloatArray) -> Expansion:
    return ReturnDifference(loop.whole).expansion(
        omega, np.where(loop.response(omega).real >= 0.0, 1.0, -1.0)
    )


def _between_ends(loop: FoldedLoop, condition: Condition, band: tuple[float, float]) -> _Crossovers:
    """Search from zero to infinity, these included: with delays up to where unit gain is excluded."""
    difference = ReturnDifference(loop)
    below = clear_below(difference, condition)
    if loop.delays.size == 0:
        above = clear_above(difference, condition)
    else:
        above = Clear(HighFrequencySeries.of(loop).end_of_gain(1.0), 0.0, False, False)
    ends = np.array([0.0, np.inf])[[below.at_end and band[0] == 0.0, above.at_end and band[1] == np.inf]]
    probes = np.array([0.0137, 0.213, 0.871, 3.91]) * (loop.plant.fastest or 1.0)
    if (below.identical or above.identical) and vanishes(difference, condition, probes):
        return _Crossovers(ends, loop.delays.size == 0, True)
    known = below.omega > 0.0 and above.omega < np.inf
    high = min(above.omega, band[1])
    if high == np.inf:
        high = 100.0 * (loop.plant.fastest + float(np.sum(1.0 / loop.delays))) or 1.0
    found = zeros_between(difference, condition, max(below.omega or 1e-12 * high, band[0]), high)
    return _Crossovers(np.sort(np.append(ends, found.omega)), known and found.complete)


def _phase_crossovers(loop: LoopWithDeadTime, gain_at: FloatArray, band: tuple[float, float]) -> _Crossovers:
    whole = loop.whole
    if whole.delays.size == 0:
        return _between_ends(whole, Condition.REAL_VALUE, band)
    difference = ReturnDifference(whole)
    below = clear_below(difference, Condition.REAL_VALUE)
    known = np.array([0.0] if band[0] == 0.0 else [])
    if band[1] == np.inf and loop.direct is not None and loop.direct[0] != 0.0:
        known = np.append(known, np.inf)
    turn = 2.0 * np.pi / float(whole.delays.sum())
    start = max(below.omega or 1e-12 * turn, band[0])
    last = min(HighFrequencySeries.of(whole).end_of_negative_values(), band[1])
    end = min(max(2.0 * start, 2.0 * turn), last)
    many, work, complete = start + _LISTED * turn, Work(CELLS), below.omega > 0.0
    search = partial(zeros_between, difference, Condition.REAL_VALUE)
    beside: list[tuple[float, float]] = []
    while True:
        pieces = [(start, end)]
        if end > many and loop.rest.delays.size == 0:
            if not beside:
                beside = [
                    (max(omega - turn, start), omega + turn) for omega in gain_at if start < omega < last
                ]
                known = np.concatenate([known, *(search(*piece, work).omega for piece in beside)])
            pieces = _influential(loop, known, start, end)
        for piece in pieces:
            found = search(*piece, work)
            known, complete = np.append(known, found.omega), complete and found.complete
        needed = min(_end_of_influence(loop, known), last)
        if end >= needed or work.spent:
            return _Crossovers(distinct(known), complete and end >= needed)
        start, end = end, min(2.0 * end, needed)


def _influential(
    loop: LoopWithDeadTime, known: FloatArray, start: float, end: float
) -> list[tuple[float, float]]:
    """Return the parts of a band in which a phase crossover could be nearer to -1 than all known."""
    below, above = _nearest_gains(loop, known)
    edges = [np.array([start, end])]
    for level in (below, above):
        if 0.0 < level < np.inf:
            found = zeros_between(_scaled(loop.rest, level), Condition.UNIT_GAIN, start, end)
            if not found.complete:
                return [(start, end)]
            edges.append(found.omega)
    ends = np.unique(np.concatenate(edges))
    between = np.abs(loop.response(np.sqrt(ends[:-1] * ends[1:])))
    inside = (between >= below) & (between <= above)
    return [(float(a), float(b)) for a, b in zip(ends[:-1][inside], ends[1:][inside], strict=True)]


def _nearest_gains(loop: LoopWithDeadTime, omega: FloatArray) -> tuple[float, float]:
    """Return the gains at crossovers that are nearest to one from below and above; 0 and inf without any."""
    sizes = np.abs(loop.response(omega[_negative(loop, omega)]))
    sizes[np.abs(sizes - 1.0) <= _UNITY] = 1.0
    return float(sizes[sizes <= 1.0].max(initial=0.0)), float(sizes[sizes >= 1.0].min(initial=np.inf))


def _end_of_influence(loop: LoopWithDeadTime, omega: FloatArray) -> float:
    """Return from which frequency on no crossover is nearer to -1 than those known; infinite if that is not known."""
    below, above = _nearest_gains(loop, omega)
    if below == above:
        return 0.0  # one, than which nothing is nearer
    if loop.rest.delays.size:
        return HighFrequencySeries.of(loop.rest).end_of_gain(below)
    # the gain ends at that of what passes directly, on the same side of one
    level, side = (below, 1.0) if abs(loop.rest.plant.D11[0, 0]) <= 1.0 else (above, -1.0)
    if not 0.0 < level < np.inf:
        return np.inf
    beyond = clear_above(_scaled(loop.rest, level), Condition.UNIT_GAIN)
    if beyond.identical:
        return 0.0
    return beyond.omega if beyond.sign == side else np.inf


def _scaled(loop: FoldedLoop, level: float) -> ReturnDifference:
    """Return the loop divided by a gain: it has unit gain where the loop has that."""
    plant, delays = loop
    whole = plant.matrix
    whole[plant.n_states] /= level
    return ReturnDifference(FoldedLoop(plant.rebuilt(whole), delays))


def _with_stationary(
    loop: LoopWithDeadTime,
    condition: Condition,
    found: _Crossovers,
    others: _Crossovers,
    band: tuple[float, float],
) -> _Crossovers:
    """Return, where every frequency is a crossover, those at which a margin is least: ends, extrema and -1."""
    if loop.whole.delays.size == 0:
        found = _between_ends(loop.rest, condition, band)
    ends = np.array([0.0, np.inf])[[band[0] == 0.0, band[1] == np.inf]]
    omega = np.unique(np.concatenate([found.omega, others.omega, ends]))
    return _Crossovers(omega, found.complete and others.complete)
