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
from collections.abc import Sequence
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.crossings import DelayLine, roots_always_on_axis, sweep_delays
from susp_ctrl.delay_systems.maps.crossing_plane import Axis, CrossingPlane
from susp_ctrl.delay_systems.maps.curves import trace_curves
from susp_ctrl.delay_systems.maps.regions import Raster, map_regions
from susp_ctrl.delay_systems.maps.segments import Segments
from susp_ctrl.delay_systems.maps.shared_delays import trace_blocks
from susp_ctrl.delay_systems.maps.stability_chart import StabilityMap
from susp_ctrl.delay_systems.model import CharacteristicMatrix, DelaySystem
from susp_ctrl.delay_systems.roots import count_unstable_roots
from susp_ctrl.errors import InputError, UndecidedStabilityWarning

# Where counts do not confirm the curves, finer samples are tried.
_FINENESS = (1, 2)


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

    Warns
    -----
    UndecidedStabilityWarning
        Counts of unstable roots do not confirm the map as a whole; -1 stands where no number is known.

    Notes
    -----
    Channels of one signal each: closed form. Delays shared by several signals: the curves are traced numerically
    on a grid of frequency and angle and polished.
    """
    system = DelaySystem.of(sys, "sys")
    most = system.delays.size - 1
    numbers = [
        validation.integer(f"channels[{k}]", c, at_least=0, at_most=most)
        for k, c in enumerate(validation.sequence("channels", channels))
    ]
    x, y = _axes(system, tau1, gain1, tau2, gain2, numbers)
    problem = _Problem(system, numbers, x, y)
    low, high = np.array([x.low, y.low]), np.array([x.high, y.high])
    raster = Raster(low, high)
    x0, y0 = low + np.array([0.381966, 0.618034]) * (high - low)
    origin = (float(x0), float(y0))
    axis_roots = problem.axis_roots()
    for fineness in _FINENESS:
        segments = problem.segments(fineness)
        # With a root that stays on the axis no count can tell.
        count = (lambda x, y: None) if axis_roots else problem.count
        regions = map_regions(raster, *_changes(segments, origin, raster), count)
        if regions.decided or axis_roots:
            break
    result = StabilityMap(
        x_label=problem.label(x),
        y_label=problem.label(y),
        x_range=(x.low, x.high),
        y_range=(y.low, y.high),
        segments=segments,
        origin=origin,
        found=regions,
        axis_roots=axis_roots,
        mixed=x.kind != y.kind,
        design=problem.design(),
    )
    if not result.decided:
        warnings.warn(
            f"stability map is undecided: {result.message}", UndecidedStabilityWarning, stacklevel=2
        )
    return result


def _changes(
    segments: Segments, origin: tuple[float, float], raster: Raster
) -> tuple[np.ndarray, np.ndarray]:
    """Return the change of roots to every raster point along two ways, which agree unless a curve has a gap."""
    x0, y0 = origin
    start_x, start_y = np.full_like(raster.x, x0), np.full_like(raster.y, y0)
    up_first = segments.crossed_up(start_x, y0, raster.y) + segments.crossed_across(x0, raster.x, raster.y)
    across_first = segments.crossed_across(x0, raster.x, start_y) + segments.crossed_up(
        raster.x, y0, raster.y
    )
    return up_first, across_first


def _axes(
    system: DelaySystem, tau1: Any, gain1: Any, tau2: Any, gain2: Any, channels: Sequence[int]
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
        checked = validation.delays if kind == "delay" else validation.vector
        bounds = checked(name, value, size=2)
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

    def __init__(self, system: DelaySystem, numbers: list[int], x: Axis, y: Axis) -> None:
        self.system, self.numbers, self.x, self.y = system, numbers, x, y
        self._free_gains = [axis for axis in (x, y) if not axis.is_delay]

    def at(self, x: float, y: float) -> DelaySystem:
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

    def axis_roots(self) -> tuple[float, ...]:
        """Return the frequencies of roots that lie on the axis all over the plane."""
        found = []
        for share in (np.array([0.2711, 0.6973]), np.array([0.8137, 0.3319])):
            x, y = (a.low + s * (a.high - a.low) for a, s in zip((self.x, self.y), share, strict=True))
            system = self.at(x, y)
            direction = np.zeros(system.delays.size)
            for axis in (self.x, self.y):
                if axis.is_delay:
                    direction[self.numbers[axis.channel]] = 1.0
            start = np.where(direction != 0.0, 0.1 * system.delays, system.delays)
            line = DelayLine.of(system, direction * system.delays, start, 1.0)
            found.append(set(np.round(roots_always_on_axis(line), 9)))
        return tuple(sorted(float(omega) for omega in found[0] & found[1]))

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

    def segments(self, fineness: int = 1) -> Segments:
        """Trace all crossing curves, with closer first samples at a higher `fineness`."""
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
            return trace_curves(plane, strongest, fineness)
        if self._free_gains:
            raise InputError("a gain can be free only where every channel involved is one signal")
        block = np.where(owner == self.numbers[0], 0, np.where(owner == self.numbers[1], 1, -1))
        return trace_blocks(loop, block, delays, self.x, self.y, fineness)

    def _loop(self, gains: FloatArray) -> tuple[CharacteristicMatrix, np.ndarray, FloatArray]:
        """Return the loop's channels, which delay each belongs to, and those delays."""
        n = self.system.delays.size
        system = self.system.with_gains(gains).with_delays(np.ones(n))
        line = DelayLine.of(system, np.arange(1.0, n + 1.0), np.zeros(n), 1.0)
        owner = np.rint(line.direction).astype(int) - 1
        return line.matrices, owner, self.system.delays[owner]

    def _lines(self, axis: Axis) -> Segments:
        """Straight lines across the plane where only one of the two delays is in a loop."""
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
