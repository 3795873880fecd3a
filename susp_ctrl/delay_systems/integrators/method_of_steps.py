r"""Exact time simulation: a spectral method of steps on cells between kinks.

Between kinks every signal is smooth. The time axis is cut at the kinks (`kinks`) and
into cells; on a cell the delayed signals are polynomials known from earlier cells (or, for delays shorter than
the cell, from the cell itself) and the plant answers exactly to polynomial forcing
(`cells`). Cells of one length share their operators and are taken in panels, so that
Python is busy once per cell or less, never once per sample.

The cells' length follows the decay of the Legendre coefficients. Beside the solution runs a companion that uses
every input and every delayed signal without its two highest coefficients; the difference estimates the error.

On a cell of length h, with Legendre coefficients c of all forcing,

.. math:: x(t + h) = e^{A h} x(t) + \sum_n G_n c_n, \qquad
          G_n = \int_0^h e^{A (h - \theta)} B \, P_n(2\theta/h - 1) \, d\theta,

with the same matrices for all cells of that length. See `time_response` for the method as such.

References
----------
.. [1] A. Bellen, M. Zennaro, "Numerical Methods for Delay Differential Equations", Oxford, 2003, chapter 3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators.cells import gauss_rule
from susp_ctrl.delay_systems.integrators.input_signals import Inputs
from susp_ctrl.delay_systems.integrators.kinks import MANY_KNOTS, propagated_kinks
from susp_ctrl.delay_systems.integrators.panels import CellGroup, PanelSolver
from susp_ctrl.delay_systems.integrators.signal_memory import SignalMemory
from susp_ctrl.delay_systems.integrators.trajectory import Past, Run
from susp_ctrl.delay_systems.model import FoldedLoop

_EPS = float(np.finfo(float).eps)
_NODES = 24
_FEW_NODES = (6, 8, 12, 16, 24)  # where many kinks make the cells short
_MOST_TURNS = 8  # lengths in the pattern of a panel
_MOST_CELLS = 64  # cells of a panel in smooth stretches
_MOST_VALUES = 1_500_000  # values of one signal group in a panel: bounds the memory
_LOUDEST_NOISE = 1e-6  # relative size of coefficients that can pass for noise
_SMALLEST = 2.0**-30  # cells are not refined below this fraction of the first length


class _Refine(Exception):  # noqa: N818  a signal between panel and march, never seen outside
    def __init__(self, factor: float, tail: float) -> None:
        self.factor, self.tail = factor, tail


def run(loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, past: Past, rtol: float) -> Run:
    """Simulate one system for one or several inputs at once.

    Parameters
    ----------
    loop : FoldedLoop
        Plant with unit gains and positive delays.
    inputs : sequence of Inputs
        One for each case; all cases share the cells.
    timepts : ndarray
        Increasing output times, none before ``past.start``.
    past : Past
        Initial state and history.
    rtol : float
        Wanted error relative to each output's peak.

    Raises
    ------
    OverflowError
        The response of an unstable loop leaves the range of floating point numbers.
    """
    tolerance = 1e-2 * rtol
    best, least = None, np.inf
    for _ in range(3):
        found = _March(loop, inputs, timepts, past, rtol, tolerance).run()
        worst = float(np.max(found.relative_error, initial=0.0))
        helped = worst < 0.3 * least
        if best is None or worst < least:
            best, least = found, worst
        if worst <= rtol or not helped or tolerance <= 1e-15:
            break
        tolerance = max(1e-16, 0.1 * tolerance * rtol / worst)
    assert best is not None  # the loop runs at least once
    return best


class _March:
    """From edge to edge, in panels whose cells are as long as the accuracy allows."""

    def __init__(
        self,
        loop: FoldedLoop,
        inputs: Sequence[Inputs],
        timepts: FloatArray,
        past: Past,
        rtol: float,
        tolerance: float,
    ) -> None:
        self.plant, self.delays = loop.plant, loop.delays
        self.inputs, self.timepts, self.past = inputs, timepts, past
        self.tolerance, self.most_noise = max(tolerance, 4.0 * _EPS), max(0.1 * rtol, 1e-12)
        cases = self.cases = len(inputs)
        # a run that is asked for nothing but its start still takes one cell
        self.end = max(float(timepts[-1]), past.start + 1e-9)
        span = max(abs(self.end), float(np.max(self.delays, initial=0.0)))
        self.near = 4096 * _EPS * span
        self._plan(rtol)
        self.memory = SignalMemory(self.delays, self.rule, past, cases)
        self.solver = PanelSolver(loop, inputs, self.rule, self.memory, span)
        xi = self.solver.coordinates.into @ past.state
        self.xi = np.tile(np.concatenate([xi.real, xi.imag]), (1, 2))
        n, p, q, T = self.plant.n_states, self.plant.n_outputs, self.plant.n_inputs, timepts.size
        self.y, self.x, self.u = (np.empty((size, T, cases)) for size in (p, n, q))
        self.written = 0
        self.error, self.peak, self.rounding = (np.zeros((p, cases)) for _ in range(3))
        self.z_peak, self.u_peak = np.zeros((self.delays.size, cases)), np.zeros((q, cases))
        self.x_peak = np.abs(past.state) * np.ones((n, cases))
        self.most, self.wait, self.backoff, self.trial = 8, 0, 1, False
        self.gaps = np.diff(self.edges)
        self.accept = ""  # why cells are taken whose coefficients do not decay: "noise" or "small"

    def _plan(self, rtol: float) -> None:
        """Choose nodes and first cell length, and place the kinks."""
        plant, start = self.plant, self.past.start
        closed = plant.closed_matrix(np.ones(plant.n_channels, dtype=complex))
        rates = [0.0, *np.abs(plant.eigenvalues), *np.abs(np.linalg.eigvals(closed))]
        bands = [i.bandwidth for i in self.inputs if i.bandwidth is not None]
        self.omega = max(*rates, *bands, 1.0 / (self.end - start))
        times = [t for i in self.inputs for t in (i.breakpoints, i.sample_times)]
        sources = np.unique(np.concatenate([[0.0], *times]))
        sources = sources[(sources > start) & (sources < self.end)]
        self.rule = gauss_rule(_NODES)
        knots = np.zeros(0)
        if sources.size > MANY_KNOTS:
            # too many to follow each through all delays: one delay, and the cells' error control sees to the rest
            knots, sources = sources, sources[:0]
            step = float(np.median(np.diff(knots)))
            phase = 0.5 * self.omega * step
            few = [n for n in _FEW_NODES if gauss_rule(n).phase_resolved(self.tolerance) >= 3.0 * phase]
            self.rule = gauss_rule(few[0] if few else _NODES)
        self.length = 1.8 * self.rule.phase_resolved(self.tolerance) / self.omega
        self.nominal = self.length
        self.smallest = _SMALLEST * min(self.length, self.end - start)
        resolved = 2.0 * self.rule.size / min(self.length, self.end - start)
        cut = max(1e-2 * rtol, 1e-15)
        kinks = propagated_kinks(
            plant, self.delays, {*sources, *self.past.kinks}, self.end, resolved, cut, self.near
        )
        kinks = np.concatenate([kinks, knots, *(knots + d for d in np.unique(self.delays))])
        kinks = np.unique(kinks[(kinks > start + self.near) & (kinks < self.end - self.near)])
        kinks = kinks[np.diff(kinks, prepend=start) > self.near]
        self.edges = np.concatenate([[start], kinks, [self.end]])

    def run(self) -> Run:
        """March from edge to edge."""
        gap, time = 0, float(self.edges[0])
        tries: list[tuple[float, float]] = []  # lengths refused so far and their tails
        while gap < self.gaps.size:
            starts, lengths, next_time, next_gap = self._next_panel(gap, time)
            longest = float(np.max(lengths))
            try:
                growth = self._panel(starts, lengths, next_time)
            except _Refine as refine:
                tries.append((longest, refine.tail))
                self._refine(tries, refine.factor)
                continue
            self.accept, tries = "", []
            time, gap = next_time, next_gap
            self.most = min(2 * self.most, _MOST_CELLS)
            self.wait, self.trial = self.wait - 1, False
            if growth >= 1.25:
                cap = 2.0 if self.length < self.nominal else 1.25
                self.length = max(self.length, min(growth, cap) * longest)
            elif self.length < self.nominal and self.wait <= 0:
                # what keeps the estimate down may be rounding; a refusal makes the next trial wait longer
                self.length, self.trial = min(self.nominal, 2.0 * self.length), True
        r, longest_delay = self.solver.coordinates.size, float(np.max(self.delays, initial=0.0))
        state = (self.solver.coordinates.back @ (self.xi[:r] + 1j * self.xi[r:])).real[:, : self.cases]
        kinks = tuple(float(t) for t in self.edges if t >= self.end - longest_delay)
        past = self.memory.as_past(self.end, state, kinks)
        cells = self.memory.count - 1
        return Run(self.y, self.x, self.u, self.error, self.peak, past, cells, self.rounding)

    def _refine(self, tries: list[tuple[float, float]], factor: float) -> None:
        """Shorten the cells, or accept them as they are where that does not help."""
        (first, tail_first), (last, tail_last) = tries[0], tries[-1]
        self.backoff = 2 * self.backoff if self.trial else 1
        self.wait, self.trial = self.backoff, False
        self.most = min(self.most, 8)
        if last <= self.smallest:
            self.accept = "small"
        elif (
            len(tries) > 8 and tail_last > tail_first * np.sqrt(last / first) and tail_last <= _LOUDEST_NOISE
        ):
            # rounding, or noise of the input: it does not fall with the length as the tail of a kink does
            self.accept, self.length = "noise", first
            if tail_last <= self.most_noise:
                self.tolerance = max(self.tolerance, 4.0 * tail_last)
        else:
            self.length = last * factor

    def _next_panel(self, gap: int, time: float) -> tuple[FloatArray, FloatArray, float, int]:
        """Return starts (cells, turns), lengths (turns,), and time and gap after the next panel."""
        left = float(self.edges[gap + 1]) - time
        parts = max(1, int(np.ceil(left / self.length * (1.0 - 1e-9))))
        if parts > self.most:
            starts = time + self.length * np.arange(self.most)
            return starts[:, None], np.array([self.length]), time + self.length * self.most, gap
        turns, run = (1, 1) if time > self.edges[gap] else self._pattern(gap)
        gaps = self.gaps[gap : gap + turns] if run > 1 else np.array([left])
        firsts = self.edges[gap : gap + turns * run].reshape(run, turns) if run > 1 else np.array([[time]])
        pieces = np.maximum(1, np.ceil(gaps / self.length * (1.0 - 1e-9))).astype(int)
        lengths = np.repeat(gaps / pieces, pieces)
        inside = np.concatenate([np.arange(n) for n in pieces])
        starts = np.repeat(firsts, pieces, axis=1) + inside * lengths
        if np.ptp(lengths) <= self.solver.rounding:
            starts, lengths = starts.reshape(-1, 1), lengths[:1]
        after = gap + turns * run
        return starts, lengths, float(self.edges[after]), after

    def _pattern(self, gap: int) -> tuple[int, int]:
        """Return after how many gaps their lengths repeat, and how many times they do."""
        ahead = max(1, _MOST_VALUES // (self.rule.size * max(1, sum(self.plant.D11.shape)) * self.cases))
        gaps = self.gaps[gap : gap + min(ahead, 4096)]
        long = gaps > 8.0 * self.length
        gaps = gaps[: int(np.argmax(long))] if np.any(long) else gaps
        best = (1, 1)
        for turns in range(1, _MOST_TURNS + 1):
            if gaps.size < 2 * turns or (turns > 1 and np.sum(gaps[:turns]) * 4.0 > self.solver.shortest):
                break
            differ = np.abs(gaps[turns:] - gaps[:-turns]) > self.solver.rounding
            same = int(np.argmax(differ)) if np.any(differ) else differ.size
            run = 1 + same // turns
            if run > 1 and turns * run > 2 * best[0] * best[1]:
                best = (turns, run)
        return best

    def _panel(self, starts: FloatArray, lengths: FloatArray, end: float) -> float:
        """Take a panel; return by how much its cells may grow, or raise `_Refine`."""
        plant, solver, cases = self.plant, self.solver, self.cases
        noise = 64.0 * _EPS + 2.0 * _EPS * self.omega * abs(end)
        worst, u_peak = 0.0, self.u_peak
        groups = [solver.group(starts[:, j], float(length)) for j, length in enumerate(lengths)]
        for g in groups:
            u_peak = np.maximum(u_peak, _size(g.u))
            worst = self._check(g.u, u_peak, noise * u_peak, g, worst)
        with np.errstate(over="ignore", invalid="ignore"):
            xi = solver.solve(groups, self.xi)
        if not (np.all(np.isfinite(xi)) and all(np.all(np.isfinite(g.z)) for g in groups)):
            raise OverflowError(
                f"the response exceeds the range of floating point numbers near t = {starts[0, 0]:.6g} s: "
                "the system is unstable, shorten the run"
            )
        full, r = slice(0, cases), solver.coordinates.size
        rounding = self.rounding
        error, y_peak, z_peak, x_peak = self.error, self.peak, self.z_peak, self.x_peak
        results: list[tuple[CellGroup, FloatArray, FloatArray]] = []
        for g in groups:
            x, y = solver.states_and_outputs(g)
            results.append((g, x, y))
            y_peak, z_peak = (
                np.maximum(y_peak, _size(y[..., full])),
                np.maximum(z_peak, _size(g.z[..., full])),
            )
            x_peak, w_peak = np.maximum(x_peak, _size(x[..., full])), _size(g.w[..., full])
            # states are differences of coordinates, whose rounding they carry
            size = np.max(np.abs(g.xi[:r] + 1j * g.xi[r:]), axis=1, initial=0.0)
            size = np.maximum(size, np.abs(xi[:r] + 1j * xi[r:]))[:, full]
            # where drives cancel (a symmetric car on a symmetric road does not roll) the rounding of each remains
            c = solver.coordinates
            size = size + g.length * (np.abs(c.B1) @ u_peak + np.abs(c.B2) @ w_peak)
            x_size = np.abs(solver.coordinates.back) @ size + x_peak
            z_size = abs(plant.C2) @ x_size + abs(plant.D21) @ u_peak + abs(plant.D22) @ w_peak
            y_size = abs(plant.C1) @ x_size + abs(plant.D11) @ u_peak
            y_size += abs(plant.D12) @ np.maximum(z_size, w_peak)
            rounding = np.maximum(rounding, noise * y_size)
            worst = self._check(y[..., full], y_peak, noise * y_size, g, worst)
            worst = self._check(g.z[..., full], z_peak, noise * z_size, g, worst)
            if self.accept != "small":
                # a cell as small as they get holds a kink: its own error lasts no time
                error = np.maximum(error, _size(y[..., full] - solver.truncated(y[..., cases:])))
        self.error, self.peak, self.z_peak, self.x_peak, self.u_peak = error, y_peak, z_peak, x_peak, u_peak
        self.xi, self.rounding = xi, rounding
        self.memory.count += starts.size
        self._write(results, end)
        return float((1.0 / max(worst, 1e-300)) ** (1.0 / self.rule.size) * 0.85)

    def _check(
        self, signal: FloatArray, peak: FloatArray, floor: FloatArray, g: CellGroup, worst: float
    ) -> float:
        """Raise `_Refine` where the two highest coefficients are too large; return their relative size.

        `signal` has shape (signals, N, cells, cases); one is the size allowed. What lies below `floor`, or within
        the rounding of the time itself, is rounding.
        """
        signals, N, cells, cases = signal.shape
        flat = signal.reshape(signals, N, cells * cases)
        tails = np.sum(np.abs(self.rule.to_coefficients[-2:] @ flat), axis=1)
        tails = np.max(tails.reshape(signals, cells, cases), axis=1, initial=0.0)
        rise = np.max(np.ptp(signal, axis=1), axis=1, initial=0.0) if signals else floor
        late = 4.0 * _EPS * abs(float(g.starts[-1])) / g.length
        rounding = floor + late * rise
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = np.where(tails > rounding, (tails - rounding) / (self.tolerance * peak), 0.0)
            share = np.where(tails > 0.0, tails / (self.tolerance * peak + rounding), 0.0)
        largest = float(np.max(excess, initial=0.0))
        if largest > 1.0 and not self.accept:
            factor = (1.0 / largest) ** (1.0 / self.rule.size) * 0.9 if np.isfinite(largest) else 0.3
            raise _Refine(float(np.clip(factor, 0.3, 0.8)), largest * self.tolerance)
        return max(worst, float(np.max(share, initial=0.0)))

    def _write(self, results: list[tuple[CellGroup, FloatArray, FloatArray]], end: float) -> None:
        """Interpolate the panel's signals at the output times that fall into it."""
        a = self.written
        b = self.timepts.size
        if end < self.end:
            b = int(np.searchsorted(self.timepts, end - self.near, side="left"))
        if b <= a:
            return
        times, turns = self.timepts[a:b], len(results)
        starts = np.stack([g.starts for g, _, _ in results], axis=1).ravel()
        cell = np.clip(np.searchsorted(starts - self.near, times, side="right") - 1, 0, starts.size - 1)
        for j, (g, x, y) in enumerate(results):
            rows_of = np.flatnonzero(cell % turns == j) if turns > 1 else np.arange(times.size)
            here = cell[rows_of] // turns
            across = self.rule.rows(2.0 * (times[rows_of] - g.starts[here]) / g.length - 1.0)
            targets = ((self.y, y[..., : self.cases]), (self.x, x[..., : self.cases]), (self.u, g.u))
            if rows_of.size >= 4 * g.starts.size and turns == 1:
                bounds = np.searchsorted(here, np.arange(g.starts.size + 1))
                for i in range(g.starts.size):
                    i0, i1 = int(bounds[i]), int(bounds[i + 1])
                    if i1 > i0:
                        for target, signal in targets:
                            target[:, a + i0 : a + i1] = across[i0:i1] @ signal[:, :, i]
            else:
                for target, signal in targets:
                    target[:, a + rows_of] = np.einsum("tn,sntc->stc", across, signal[:, :, here])
        self.written = b


def _size(signal: FloatArray) -> FloatArray:
    """Largest magnitude over nodes and cells."""
    return np.max(np.abs(signal), axis=(1, 2), initial=0.0)
