r"""Stability maps over two delays, two gains, or a gain and a delay.

The plane is cut by the crossing curves, on which a root lies on the imaginary axis, into regions of constant
number of unstable roots. For two scalar channels the curves are closed form in the frequency (`crossing_plane`);
the number changes by two across a curve (by one where a real root passes through zero), to the side that is known,
so one count at a reference point gives all of them. Counts at a point of each region check this.

With two delays the characteristic equation is

.. math:: p_0(s) + p_1(s) z_1 + p_2(s) z_2 + p_{12}(s) z_1 z_2 = 0, \qquad z_k = e^{-s \tau_k},

and on a crossing curve :math:`s = j\omega`, :math:`|z_1| = |z_2| = 1`: solved for z_2 it is a Möbius map of the unit
circle, which meets the unit circle in at most two points at every frequency.

References
----------
.. [1] K. Gu, S.-I. Niculescu, J. Chen, "On stability crossing curves for general systems with two delays",
   J. Math. Anal. Appl. 311, 2005.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pandas as pd
import scipy.ndimage

from susp_ctrl import validation
from susp_ctrl.delay_systems.argument_principle import count_unstable_roots
from susp_ctrl.delay_systems.crossing_plane import Axis, CrossingPlane
from susp_ctrl.delay_systems.delay_line import LoopMatrices, delay_line
from susp_ctrl.delay_systems.delay_lti import DelayLTI, as_delay_lti
from susp_ctrl.delay_systems.lft import FloatArray
from susp_ctrl.delay_systems.map_blocks import trace_blocks
from susp_ctrl.delay_systems.map_curves import trace_curves
from susp_ctrl.delay_systems.map_result import StabilityMap
from susp_ctrl.delay_systems.map_segments import Segments
from susp_ctrl.errors import InputError, UndecidedStabilityWarning

# Raster on which connected regions are told apart, how many of them are counted independently, and how many
# points along each axis besides.
_RASTER = 240
_CHECKED_REGIONS = 20
_SPREAD = 4


def stability_map(
    sys: Any,
    tau1: tuple[float, float] | None = None,
    tau2: tuple[float, float] | None = None,
    *,
    gain1: tuple[float, float] | None = None,
    gain2: tuple[float, float] | None = None,
    channels: tuple[int, int] = (0, 1),
) -> StabilityMap:
    """Map the number of unstable roots over two parameters of a loop.

    Parameters
    ----------
    sys : DelayLTI
        The system with its loops closed. What is not free keeps its value.
    tau1, tau2 : (float, float), optional
        Ranges (s) of the delays number ``channels[0]`` and ``channels[1]``; both (0, 1) if no range is given.
    gain1, gain2 : (float, float), optional
        Ranges of their gains. Exactly two of the four ranges are free; x is the first of them in the order
        tau1, gain1, tau2, gain2, y the other one.
    channels : (int, int), optional
        Which delays of `sys` are number one and two.

    Returns
    -------
    StabilityMap
        ``.curves``, ``.regions``, ``.unstable_roots(x, y)``, ``.distance(x, y)``, ``.plot(ax)``.

    Raises
    ------
    InputError
        Not two ranges, a range that is empty or negative for a delay, unknown channels, a gain free on a delay
        that several signals share.
    NeutralLoopError
        A loop that is neutral once its delays are positive.

    Notes
    -----
    Channels of one signal each: closed form. Delays shared by several signals: the curves are traced numerically
    on a grid of frequency and angle and polished.
    """
    system = as_delay_lti(sys, "sys")
    x, y = _axes(system, tau1, gain1, tau2, gain2, channels)
    numbers = [
        validation.integer("channels", c, at_least=0, at_most=system.delays.size - 1) for c in channels
    ]
    problem = _Problem(system, numbers, x, y)
    segments = problem.segments()
    low, high = np.array([x.low, y.low]), np.array([x.high, y.high])
    raster = _Raster(low, high)
    origin = (low[0] + 0.381966 * (high[0] - low[0]), low[1] + 0.618034 * (high[1] - low[1]))
    relative = segments.crossed_up(*origin, raster.y) + segments.crossed_across(origin[0], raster.x, raster.y)
    place, area = raster.regions(relative)
    # The widest region fixes the number: there the count is farthest from any curve.
    first = place[0]
    base = problem.count(float(raster.x[first]), float(raster.y[first]))
    offset = 0 if base is None else base - int(relative[first])
    regions, agreed = _checked(problem, raster, relative + offset, place, area)
    # Along another way the same numbers must come out: a curve with a gap shows.
    start = np.full_like(raster.x, origin[1])
    other = segments.crossed_across(origin[0], raster.x, start) + segments.crossed_up(
        raster.x, origin[1], raster.y
    )
    whole = bool(np.array_equal(other, relative))
    decided = base is not None and agreed and whole and int(relative.min()) + offset >= 0
    return StabilityMap(
        x_label=problem.label(x),
        y_label=problem.label(y),
        x_range=(x.low, x.high),
        y_range=(y.low, y.high),
        segments=segments,
        reference=(*origin, offset),
        known=base is not None,
        regions=regions,
        decided=decided,
        mixed=x.kind != y.kind,
        design=problem.design(),
    )


class _Raster:
    """Points of the rectangle on which connected regions are told apart."""

    def __init__(self, low: FloatArray, high: FloatArray) -> None:
        share = (np.arange(_RASTER) + 0.5) / _RASTER
        # Off the round numbers on which curves like to lie.
        self.x = np.tile(low[0] + (high[0] - low[0]) * share, _RASTER)
        self.y = np.repeat(low[1] + (high[1] - low[1]) * share, _RASTER)
        self.clear = np.zeros(_RASTER**2)

    def regions(self, number: np.ndarray) -> tuple[np.ndarray, FloatArray]:
        """Return a point well inside each region of equal number, the widest region first, and its area."""
        grid = number.reshape(_RASTER, _RASTER)
        labels = np.zeros(grid.shape, dtype=int)
        total = 0
        for value in np.unique(grid):
            own, found = scipy.ndimage.label(grid == value)
            labels[own > 0] = own[own > 0] + total
            total += found
        edge = np.zeros(grid.shape, dtype=bool)
        for axis in (0, 1):
            change = np.diff(labels, axis=axis) != 0
            before, after = ((slice(None, -1), slice(None)), (slice(1, None), slice(None)))
            if axis == 1:
                before, after = before[::-1], after[::-1]
            edge[before] |= change
            edge[after] |= change
        clear = scipy.ndimage.distance_transform_edt(np.pad(~edge, 1, constant_values=True))[1:-1, 1:-1]
        self.clear = clear.ravel()
        inner = np.array(scipy.ndimage.maximum_position(clear, labels, np.arange(1, total + 1)))
        place = inner[:, 0] * _RASTER + inner[:, 1]
        area = np.bincount(labels.ravel() - 1, minlength=total) / labels.size
        order = np.argsort(-self.clear[place], kind="stable")
        return place[order], area[order]


def _axes(
    system: DelayLTI, tau1: Any, gain1: Any, tau2: Any, gain2: Any, channels: tuple[int, int]
) -> tuple[Axis, Axis]:
    given = {"tau1": tau1, "gain1": gain1, "tau2": tau2, "gain2": gain2}
    if gain1 is None and gain2 is None:
        given["tau1"] = (0.0, 1.0) if tau1 is None else tau1
        given["tau2"] = (0.0, 1.0) if tau2 is None else tau2
    free = {name: value for name, value in given.items() if value is not None}
    if len(free) != 2:
        raise InputError(f"{', '.join(free) or 'no range'} given: two of tau1, gain1, tau2, gain2 are needed")
    if len(channels) != 2 or (system.delays.size > 1 and channels[0] == channels[1]):
        raise InputError(f"channels = {channels!r} is not allowed: two different numbers are needed")
    axes = []
    for name, value in free.items():
        kind = "delay" if name.startswith("tau") else "gain"
        bounds = validation.vector(name, value, size=2, at_least=0.0 if kind == "delay" else None)
        if bounds[0] >= bounds[1]:
            raise InputError(
                f"{name} = ({bounds[0]:g}, {bounds[1]:g}) is not allowed: an increasing pair is needed"
            )
        number = int(name[-1]) - 1
        needed = channels[number]
        if not 0 <= needed < system.delays.size:
            raise InputError(f"channels[{number}] = {needed}: the system has {system.delays.size} delays")
        if kind == "gain" and system.widths[needed] != 1:
            raise InputError(
                f"{name} is free, but delay {needed} is shared by {system.widths[needed]} signals"
            )
        axes.append(Axis(number, kind, float(bounds[0]), float(bounds[1])))
    return axes[0], axes[1]


class _Problem:
    """The loop with two parameters free: systems at any values, and the crossing curves."""

    def __init__(self, system: DelayLTI, numbers: list[int], x: Axis, y: Axis) -> None:
        self.system, self.numbers, self.x, self.y = system, numbers, x, y
        self._free_gains = [axis for axis in (x, y) if not axis.is_delay]

    def at(self, x: float, y: float) -> DelayLTI:
        """Return the system at one point of the plane."""
        gains, delays = self.system.gains.copy(), self.system.delays.copy()
        for axis, value in ((self.x, x), (self.y, y)):
            (delays if axis.is_delay else gains)[self.numbers[axis.channel]] = value
        return self.system.with_gains(gains).with_delays(delays)

    def count(self, x: float, y: float) -> int | None:
        """Count the unstable roots at one point by the argument principle."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UndecidedStabilityWarning)
            return count_unstable_roots(self.at(x, y))

    def design(self) -> tuple[float, float]:
        """Return the point of the plane at which the given system lies."""
        values = [
            (self.system.delays if axis.is_delay else self.system.gains)[self.numbers[axis.channel]]
            for axis in (self.x, self.y)
        ]
        return float(values[0]), float(values[1])

    def label(self, axis: Axis) -> str:
        """Return the name of an axis."""
        number = self.numbers[axis.channel]
        return f"delay {number + 1} (s)" if axis.is_delay else f"gain {number + 1}"

    def segments(self) -> Segments:
        """Trace all crossing curves."""
        n = self.system.delays.size
        largest = self.system.gains.copy()
        unit = self.system.gains.copy()
        for axis in self._free_gains:
            number = self.numbers[axis.channel]
            unit[number], largest[number] = 1.0, max(abs(axis.low), abs(axis.high))
        loop, owner, delays = self._loop(unit)
        strongest, _, _ = self._loop(largest)
        pair = [self.numbers[axis.channel] for axis in (self.x, self.y)]
        if self.x.is_delay and self.y.is_delay and not np.all(np.isin(pair, owner)):
            return Segments.joined([self._lines(axis) for axis in (self.x, self.y)])
        if all(np.sum(owner == number) <= 1 for number in self.numbers):
            place = np.full(owner.size, -1)
            for k, number in enumerate(self.numbers[: 1 if n == 1 else 2]):
                place[owner == number] = k
            known = [int(np.clip(number, 0, n - 1)) for number in self.numbers]
            plane = CrossingPlane(
                loop, place, (float(self.system.delays[known[0]]), float(self.system.delays[known[1]])),
                delays, self.x, self.y,
            )  # fmt: skip
            return trace_curves(plane, strongest)
        if self._free_gains:
            raise InputError("a gain can be free only where every channel involved is one signal")
        return trace_blocks(loop, np.where(owner == self.numbers[0], 0, np.where(owner == self.numbers[1], 1, -1)),
                            delays, self.x, self.y)  # fmt: skip

    def _loop(self, gains: FloatArray) -> tuple[LoopMatrices, np.ndarray, FloatArray]:
        """Return the loop's channels, which delay each belongs to, and those delays."""
        n = self.system.delays.size
        system = self.system.with_gains(gains).with_delays(np.ones(n))
        line = delay_line(system, np.arange(1.0, n + 1.0), np.zeros(n), 1.0)
        owner = np.rint(line.direction).astype(int) - 1
        return line.matrices, owner, self.system.delays[owner]

    def _lines(self, axis: Axis) -> Segments:
        """Straight lines across the plane where only one of the two delays is in a loop."""
        from susp_ctrl.delay_systems.frequency_sweep import sweep_delays

        number = self.numbers[axis.channel]
        start, direction = self.system.delays.copy(), np.zeros(self.system.delays.size)
        start[number], direction[number] = axis.low, 1.0
        found = sweep_delays(self.system, direction, start, axis.high - axis.low).crossings
        along_x = axis is self.x
        other = self.y if along_x else self.x
        parts = []
        for tau, omega, tendency in found[["tau", "omega", "tendency"]].itertuples(index=False):
            value = axis.low + tau
            ends = np.array([other.low, other.high])
            points = np.column_stack([np.full(2, value), ends] if along_x else [ends, np.full(2, value)])
            # More roots on the right of an upward line; of a line to the right they are below.
            if (tendency > 0) != along_x:
                points = points[::-1]
            if tendency:
                parts.append(Segments(points[:1], points[1:], np.array([2]), np.array([omega])))
        return Segments.joined(parts)


def _checked(
    problem: _Problem, raster: _Raster, number: np.ndarray, place: np.ndarray, area: FloatArray
) -> tuple[pd.DataFrame, bool]:
    """Count the roots of the widest regions independently; a region one point wide lies on a curve."""
    counted = np.full(place.size, -1)
    chosen = np.flatnonzero(raster.clear[place] > 1.0)[:_CHECKED_REGIONS]
    agreed = True
    for k in chosen:
        count = problem.count(float(raster.x[place[k]]), float(raster.y[place[k]]))
        counted[k] = -1 if count is None else count
        agreed &= count is None or count == number[place[k]]
    # Points spread over the whole rectangle as well: they find a curve that is missing altogether.
    even = (_RASTER * (2 * np.arange(_SPREAD) + 1)) // (2 * _SPREAD)
    for k in (even[:, None] * _RASTER + even).ravel():
        if raster.clear[k] > 2.0:
            count = problem.count(float(raster.x[k]), float(raster.y[k]))
            agreed &= count is None or count == number[k]
    table = pd.DataFrame(
        {
            "unstable_roots": number[place],
            "area": area,
            "x": raster.x[place],
            "y": raster.y[place],
            "counted": counted,
        }
    )
    return table.sort_values("area", ascending=False, kind="stable").reset_index(drop=True), bool(agreed)
