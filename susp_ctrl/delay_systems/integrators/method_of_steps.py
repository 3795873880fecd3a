r"""Exact time simulation: a spectral method of steps on cells between kinks.

Between kinks every signal is smooth. The time axis is cut at the kinks (`kinks`) and
into cells; on a cell the delayed signals are polynomials known from earlier cells (or, for delays shorter than
the cell, from the cell itself) and the plant answers exactly to polynomial forcing
(`cells`). Cells of one length share their operators and are taken in panels, so that
Python is busy once per cell or less, never once per sample.

The cells' length follows the decay of the Legendre coefficients, and the polynomials of inputs and history are held
against what the caller gave at the output times and at irregular times between them: what falls between the nodes of
a cell is seen there. Beside the solution runs a companion that uses every input and every delayed signal without its
two highest coefficients; the difference estimates the error. The number of cells is bounded beforehand.

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
from susp_ctrl.delay_systems.integrators.panels import CellGroup, PanelSolver, Places, ends, places
from susp_ctrl.delay_systems.integrators.refinement import MOST_CELLS, TINY, CellLength, TooLong
from susp_ctrl.delay_systems.integrators.trajectory import Past, Run, SignalMemory
from susp_ctrl.delay_systems.model import FoldedLoop
from susp_ctrl.errors import TooMuchWorkError

_EPS = float(np.finfo(float).eps)
_NODES = 24
_WELL_HELD = 1e-10
_FEW_NODES = (6, 8, 12, 16, 24)  # where many kinks make the cells short
_MOST_TURNS = 8  # lengths in the pattern of a panel
_MOST_VALUES = 1_500_000  # values of one signal group in a panel: bounds the memory


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
    TooMuchWorkError
        The inputs are so rough that the bound on the number of cells is met.
    OverflowError
        The response of an unstable loop leaves the range of floating point numbers.
    """
    tolerance = 1e-2 * rtol
    best, least = None, np.inf
    for _ in range(3):
        try:
            found = _March(loop, inputs, timepts, past, rtol, tolerance).run()
        except TooMuchWorkError:
            if best is None:
                raise
            break
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
        cases = self.cases = len(inputs)
        # a run that is asked for nothing but its start still takes one cell
        self.end = max(float(timepts[-1]), past.start + 1e-9)
        span = max(abs(self.end), float(np.max(self.delays, initial=0.0)))
        self.near = 4096 * _EPS * span
        self._plan(rtol, tolerance)
        self.memory = SignalMemory(self.delays, self.rule, past, cases, 1e-2 * self.cells.nominal)
        self.solver = PanelSolver(loop, inputs, self.rule, self.memory, span)
        xi = self.solver.coordinates.into @ past.state
        self.xi = np.tile(np.concatenate([xi.real, xi.imag]), (1, 2))
        n, p, q, T = self.plant.n_states, self.plant.n_outputs, self.plant.n_inputs, timepts.size
        self.y, self.x = np.empty((p, T, cases)), np.empty((n, T, cases))
        # where cells hold sums of many sines well enough these need no second evaluation
        evaluate = Inputs.given if tolerance <= _WELL_HELD else Inputs.at
        self.u = np.stack([evaluate(i, timepts) for i in inputs], axis=-1)
        self.error, self.peak, self.rounding = (np.zeros((p, cases)) for _ in range(3))
        self.z_peak, self.u_peak = np.zeros((self.delays.size, cases)), np.zeros((q, cases))
        self.x_peak = np.abs(past.state) * np.ones((n, cases))
        self.many = np.flatnonzero(np.any(np.isnan(self.u), axis=(1, 2)))  # rows of many sines
        self._watch_inputs()
        self._watch_history()
        self.gaps = np.diff(self.edges)

    def _plan(self, rtol: float, tolerance: float) -> None:
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
            few = [n for n in _FEW_NODES if gauss_rule(n).phase_resolved(tolerance) >= 3.0 * phase]
            self.rule = gauss_rule(few[0] if few else _NODES)
        length = 1.8 * self.rule.phase_resolved(tolerance) / self.omega
        resolved = 2.0 * self.rule.size / min(length, self.end - start)
        cut = max(1e-2 * rtol, 1e-15)
        kinks = propagated_kinks(
            plant, self.delays, {*sources, *self.past.kinks}, self.end, resolved, cut, self.near
        )
        kinks = np.concatenate([kinks, knots, *(knots + d for d in np.unique(self.delays))])
        kinks = np.unique(kinks[(kinks > start + self.near) & (kinks < self.end - self.near)])
        kinks = kinks[np.diff(kinks, prepend=start) > self.near]
        self.edges = np.concatenate([[start], kinks, [self.end]])
        self.cells = CellLength(self.rule, length, self.end - start, self.edges.size, tolerance, rtol)

    def _watch_inputs(self) -> None:
        """Collect what the callables are at the output times, and at times between them."""
        self.rows = sorted({row for i in self.inputs for row in i.watched_rows})
        self.looks: list[tuple[FloatArray, FloatArray]] = []
        if not self.rows:
            return
        all_times = np.concatenate([i.looks(self.timepts, self.past.start) for i in self.inputs])
        between = np.setdiff1d(all_times, self.timepts)
        given = np.stack([i.given(between) for i in self.inputs], axis=-1)
        for times, values in ((self.timepts, self.u[self.rows]), (between, given[self.rows])):
            self.u_peak[self.rows] = np.fmax(
                self.u_peak[self.rows], np.nanmax(np.abs(values), axis=1, initial=0.0)
            )
            if times.size:
                self.looks.append((times, self._off_edges(times, values)))

    def _watch_history(self) -> None:
        """Collect what a history given as a function is before the start, at the times when it acts."""
        self.history: list[tuple[FloatArray, FloatArray]] = []
        if self.past.looks is None or self.past.delayed is None or not self.delays.size:
            return
        times = self.past.looks
        before = self.past.delayed(times) * np.ones(self.cases)
        self.z_peak = np.max(np.abs(before), axis=1)
        for values, delay in zip(before[:, None], self.delays, strict=True):
            self.history.append((times + delay, self._off_edges(times + delay, values)))

    def _off_edges(self, times: FloatArray, values: FloatArray) -> FloatArray:
        """Return the values with nan at kinks and jumps, where there is nothing to compare."""
        after = np.clip(np.searchsorted(self.edges, times), 1, self.edges.size - 1)
        gap = np.minimum(np.abs(times - self.edges[after - 1]), np.abs(times - self.edges[after]))
        return np.where(gap[:, None] > self.near, values, np.nan)

    def run(self) -> Run:
        """March from edge to edge."""
        gap, time = 0, float(self.edges[0])
        while gap < self.gaps.size:
            starts, lengths, next_time, next_gap = self._next_panel(gap, time)
            longest = float(np.max(lengths))
            self.cells.begin(starts.size, time, self.end)
            try:
                worst = self._panel(starts, lengths, next_time)
            except TooLong as problem:
                self.cells.refuse(longest, problem)
                continue
            time, gap = next_time, next_gap
            self.cells.take(longest, worst)
        r, longest_delay = self.solver.coordinates.size, float(np.max(self.delays, initial=0.0))
        state = (self.solver.coordinates.back @ (self.xi[:r] + 1j * self.xi[r:])).real[:, : self.cases]
        kinks = tuple(float(t) for t in self.edges if t >= self.end - longest_delay)
        past = self.memory.as_past(self.end, state, kinks)
        cells = self.memory.count - 1
        return Run(self.y, self.x, self.u, self.error, self.peak, past, cells, self.rounding)

    def _next_panel(self, gap: int, time: float) -> tuple[FloatArray, FloatArray, float, int]:
        """Return starts (cells, turns), lengths (turns,), and time and gap after the next panel."""
        left = float(self.edges[gap + 1]) - time
        parts = max(1, int(np.ceil(left / self.cells.length * (1.0 - 1e-9))))
        if parts > self.cells.most:
            length, most = self.cells.length, self.cells.most
            starts: FloatArray = time + length * np.arange(most, dtype=float)
            return starts[:, None], np.array([length]), float(time + length * most), gap
        turns, run = (1, 1) if time > self.edges[gap] else self._pattern(gap)
        gaps = self.gaps[gap : gap + turns] if run > 1 else np.array([left])
        firsts = self.edges[gap : gap + turns * run].reshape(run, turns) if run > 1 else np.array([[time]])
        pieces = np.maximum(1, np.ceil(gaps / self.cells.length * (1.0 - 1e-9))).astype(int)
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
        # after a refusal what is ahead may be refused again
        trusted = 4096 if self.cells.most == MOST_CELLS else self.cells.most
        gaps = self.gaps[gap : gap + min(ahead, trusted)]
        long = gaps > 8.0 * self.cells.length
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
        """Take a panel; return the relative size of its highest coefficients, or raise `TooLong`."""
        plant, solver, cases, check = self.plant, self.solver, self.cases, self.cells.check
        noise = 64.0 * _EPS + 2.0 * _EPS * self.omega * abs(end)
        worst, u_peak = 0.0, self.u_peak
        groups = [solver.group(starts[:, j], float(length)) for j, length in enumerate(lengths)]
        within = self._window(self.timepts, starts[0, 0], end)
        targets = places(groups, self.timepts[within], self.rule, self.near)
        for g in groups:
            u_peak = np.maximum(u_peak, _size(g.u))
            worst = check(g.u, u_peak, noise * (u_peak + TINY), g, worst, brief=True)
        peak = u_peak[self.rows]
        for k, (times, values) in enumerate(self.looks):
            here = within if k == 0 else self._window(times, starts[0, 0], end)
            spots = targets if k == 0 else places(groups, times[here], self.rule, self.near)
            for g, spot in zip(groups, spots, strict=True):
                self.cells.compare(g.u[self.rows], values[:, here], peak, noise * (peak + TINY), g, spot)
        for g in groups if self.rows else ():
            times, spot = ends(g, self.rule)
            values = np.stack([i.given(times)[self.rows] for i in self.inputs], axis=-1)
            self.cells.compare(g.u[self.rows], values, peak, noise * (peak + TINY), g, spot)
        with np.errstate(over="ignore", invalid="ignore"):
            xi = solver.solve(groups, self.xi)
        if not (np.all(np.isfinite(xi)) and all(np.all(np.isfinite(g.z)) for g in groups)):
            raise OverflowError(
                f"the response exceeds the range of floating point numbers near t = {starts[0, 0]:.6g} s: "
                "the system is unstable, shorten the run"
            )
        for k, (times, values) in enumerate(self.history):
            if starts[0, 0] > times[-1] - self.near:
                continue
            here, peak = self._window(times, starts[0, 0], end), self.z_peak[[k]]
            for g, spot in zip(groups, places(groups, times[here], self.rule, self.near), strict=True):
                w = g.w[[k], :, :, :cases]
                worst = check(w, peak, noise * (peak + TINY), g, worst, brief=True)
                self.cells.compare(w, values[:, here], peak, noise * (peak + TINY), g, spot)
                at, spot = ends(g, self.rule)
                early = at - self.delays[k] < self.past.start
                before = np.full((1, at.size, cases), np.nan)
                before[0, early] = self.past.delayed(at[early] - self.delays[k])[k]  # type: ignore[misc]
                self.cells.compare(w, before, peak, noise * (peak + TINY), g, spot)
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
            size = np.max(np.abs(g.xi[:r] + 1j * g.xi[r:]), axis=1, initial=TINY)
            size = np.maximum(size, np.abs(xi[:r] + 1j * xi[r:]))[:, full]
            # where drives cancel (a symmetric car on a symmetric road does not roll) the rounding of each remains
            c = solver.coordinates
            size = size + g.length * (np.abs(c.B1) @ u_peak + np.abs(c.B2) @ w_peak)
            x_size = np.abs(solver.coordinates.back) @ size + x_peak
            z_size = abs(plant.C2) @ x_size + abs(plant.D21) @ u_peak + abs(plant.D22) @ w_peak
            y_size = abs(plant.C1) @ x_size + abs(plant.D11) @ u_peak
            y_size += abs(plant.D12) @ np.maximum(z_size, w_peak)
            rounding = np.maximum(rounding, noise * y_size)
            worst = check(y[..., full], y_peak, noise * (y_size + TINY), g, worst)
            worst = check(g.z[..., full], z_peak, noise * (z_size + TINY), g, worst)
            if self.cells.accept != "small":
                # a cell as small as they get holds a kink: its own error lasts no time
                error = np.maximum(error, _size(y[..., full] - self.rule.companion(y[..., cases:])))
        self.error, self.peak, self.z_peak, self.x_peak, self.u_peak = error, y_peak, z_peak, x_peak, u_peak
        self.xi, self.rounding = xi, rounding
        self.memory.count += starts.size
        self._write(results, targets, within)
        return worst

    def _window(self, times: FloatArray, start: float, end: float) -> slice:
        """Return which of `times` fall into a panel."""
        last = times.size if end >= self.end else int(np.searchsorted(times, end - self.near))
        return slice(int(np.searchsorted(times, start - self.near)), last)

    def _write(
        self, results: list[tuple[CellGroup, FloatArray, FloatArray]], targets: list[Places], within: slice
    ) -> None:
        """Interpolate the panel's signals at the output times that fall into it."""
        for (g, x, y), spots in zip(results, targets, strict=True):
            here = within.start + spots.times
            self.y[:, here] = spots.values(y[..., : self.cases])
            self.x[:, here] = spots.values(x[..., : self.cases])
            for row in self.many:
                self.u[row, here] = spots.values(g.u[[row]])[0]


def _size(signal: FloatArray) -> FloatArray:
    """Largest magnitude over nodes and cells."""
    return np.max(np.abs(signal), axis=(1, 2), initial=0.0)
