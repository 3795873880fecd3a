r"""Exact time simulation: a spectral method of steps on cells between kinks.

Between kinks every signal is smooth. The time axis is cut at the kinks (`susp_ctrl.delay_systems.kinks`) and
into cells; on a cell the delayed signals are polynomials known from earlier cells (or, for delays shorter than
the cell, from the cell itself) and the plant answers exactly to polynomial forcing
(`susp_ctrl.delay_systems.cells`). Cells of one length share their operators and are taken in panels, so that
Python is busy once per cell or less, never once per sample.

The cells' length follows the decay of the Legendre coefficients. Beside the solution runs a companion that uses
every input and every delayed signal without its two highest coefficients; the difference estimates the error.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.signal

from susp_ctrl.delay_systems.cells import CellOperator, PlantCoordinates, cell_operator, gauss_rule
from susp_ctrl.delay_systems.folding import FoldedLoop
from susp_ctrl.delay_systems.input_signals import Inputs
from susp_ctrl.delay_systems.kinks import propagated_kinks
from susp_ctrl.delay_systems.lft import FloatArray
from susp_ctrl.delay_systems.run import Past, Run

_EPS = float(np.finfo(float).eps)
_NODES = 24
_FEW_NODES = (6, 8, 12, 16, 24)
_MOST_CELLS = 64  # cells of a panel in smooth stretches
_MOST_VALUES = 1_500_000  # values of one signal group in a panel: bounds the memory
_SMALLEST = 2.0**-16  # cells are not refined below this fraction of the first length


class _Refine(Exception):  # noqa: N818  a signal between panel and march, never seen outside
    def __init__(self, factor: float, tail: float) -> None:
        self.factor, self.tail = factor, tail


def run_exact(
    loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, past: Past, rtol: float
) -> Run:
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
    for _ in range(3):
        march = _March(loop, inputs, timepts, past, rtol, tolerance)
        run = march.run()
        worst = float(np.max(run.relative_error, initial=0.0))
        if worst <= rtol or tolerance <= 1e-15:
            break
        tolerance = max(1e-16, 0.1 * tolerance * rtol / worst)
    return run


class _March:
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
        self.tolerance = max(tolerance, 4.0 * _EPS)
        self.cases = len(inputs)
        self.coordinates = PlantCoordinates(self.plant)
        self.end = float(timepts[-1])
        if self.end <= past.start:
            self.end = past.start + 1e-9  # one point: the start itself
        self.near = 4096 * _EPS * max(abs(self.end), float(np.max(self.delays, initial=0.0)))
        self._plan(rtol)
        K, N, n = self.plant.n_channels, self.rule.size, self.plant.n_states
        self.K, self.N = K, N
        self.minimum = float(np.min(self.delays, initial=np.inf))
        self.operators: dict[int, CellOperator] = {}
        m = 2 * self.cases
        # cell 0 stands for everything before the start: its values are zero
        self.count = 1
        self.cell_start, self.cell_length = np.full(1024, -np.inf), np.full(1024, np.inf)
        self.store = np.zeros((1024, K, N, m))
        xi = self.coordinates.into @ past.state
        self.xi = np.concatenate([xi.real, xi.imag])
        self.xi = np.hstack([self.xi, self.xi])
        p, q = self.plant.n_outputs, self.plant.n_inputs
        T = timepts.size
        self.y, self.x = np.empty((p, T, self.cases)), np.empty((n, T, self.cases))
        self.u = np.empty((q, T, self.cases))
        self.written = 0
        self.error, self.peak = np.zeros((p, self.cases)), np.zeros((p, self.cases))
        self.z_peak, self.u_peak = np.zeros((K, self.cases)), np.zeros((q, self.cases))
        self.x_peak = np.max(np.abs(past.state), axis=0, initial=0.0) * np.ones((n, self.cases))
        self.accepted_noise = False

    def _plan(self, rtol: float) -> None:
        """Choose nodes and first cell length, and place the kinks."""
        plant, start = self.plant, self.past.start
        closed = plant.closed_matrix(np.ones(plant.n_channels, dtype=complex))
        rates = [0.0, *np.abs(plant.eigenvalues), *np.abs(np.linalg.eigvals(closed))]
        bands = [i.bandwidth for i in self.inputs if i.bandwidth is not None]
        self.omega = max(*rates, *bands, 1.0 / (self.end - start))
        sources = {float(t) for i in self.inputs for t in i.breakpoints if start < t}
        sources |= set(self.past.kinks)
        knots = [i.knots for i in self.inputs if i.knots is not None]
        edges = np.unique(np.concatenate(knots)) if knots else np.zeros(0)
        self.rule = gauss_rule(_NODES)
        many = np.array(sorted(sources)) if edges.size == 0 else edges
        if many.size > 200:
            step = float(np.median(np.diff(many)))
            enough = (
                n
                for n in _FEW_NODES
                if gauss_rule(n).phase_resolved(self.tolerance) >= 0.5 * self.omega * step
            )
            self.rule = gauss_rule(next(enough, _NODES))
        self.length = 2.0 * self.rule.phase_resolved(self.tolerance) / self.omega
        self.smallest = _SMALLEST * min(self.length, self.end - start)
        resolved = 2.0 * self.rule.size / min(self.length, self.end - start)
        cut = max(1e-3 * rtol, 1e-15)
        kinks = propagated_kinks(plant, self.delays, sources, self.end, resolved, cut, self.near)
        if edges.size:
            direct = np.flatnonzero(np.any(plant.D21 != 0.0, axis=1))
            kinks = np.concatenate([kinks, edges, *(edges + self.delays[k] for k in direct)])
        kinks = np.unique(kinks[(kinks > start + self.near) & (kinks < self.end - self.near)])
        kinks = kinks[np.diff(kinks, prepend=start) > self.near]
        self.edges = np.concatenate([[start], kinks, [self.end]])

    def run(self) -> Run:
        """March from edge to edge."""
        gap, time = 0, float(self.edges[0])
        most, previous_tail = 8, np.inf
        gaps = np.diff(self.edges)
        while gap < gaps.size:
            left = float(self.edges[gap + 1]) - time
            begun = time > self.edges[gap]
            parts = max(1, int(np.ceil(left / self.length * (1.0 - 1e-9))))
            most = min(most, max(1, _MOST_VALUES // (self.N * max(1, sum(self.plant.D11.shape)))))
            if parts > most:
                run, length = 1, self.length
                starts = time + length * np.arange(most)
                next_time, next_gap = time + length * most, gap
            else:
                limit = gap + 1 if begun else min(gap + max(1, most * 32 // parts), gaps.size)
                alike = np.abs(gaps[gap:limit] - left) <= self.near
                run = 1 if begun else int(np.argmin(alike)) if not np.all(alike) else alike.size
                run = max(run, 1)
                length = left / parts
                firsts = np.append(time, self.edges[gap + 1 : gap + run])
                starts = (firsts[:, None] + length * np.arange(parts)).ravel()
                next_time, next_gap = float(self.edges[gap + run]), gap + run
            try:
                growth = self._panel(starts, length, next_time)
            except _Refine as refine:
                small = length <= self.smallest
                noise = refine.tail > 0.25 * previous_tail and refine.tail <= 1e-6
                self.accepted_noise = small or noise
                previous_tail = refine.tail
                most = min(most, 8)
                self.length = length * (1.0 if self.accepted_noise else refine.factor)
                continue
            self.accepted_noise, previous_tail = False, np.inf
            time, gap = next_time, next_gap
            most = min(2 * most, _MOST_CELLS)
            if growth >= 1.25:
                self.length = max(self.length, min(growth, 2.0) * length)
        history = self._memory()
        return Run(self.y, self.x, self.u, self.error, self.peak, history, self.count - 1)

    def _operator(self, length: float) -> CellOperator:
        key = round(length / self.near)
        if key not in self.operators:
            if len(self.operators) > 256:
                self.operators.clear()
            self.operators[key] = cell_operator(self.plant, self.delays, self.coordinates, self.rule, length)
        return self.operators[key]

    def _panel(self, starts: FloatArray, length: float, end: float) -> float:
        """Take cells of one length; return by how much their length may grow, or raise `_Refine`."""
        plant, rule, c = self.plant, self.rule, self.coordinates
        P, N, K, cases = starts.size, self.N, self.K, self.cases
        offsets = 0.5 * length * (1.0 + rule.nodes)
        u = np.stack([i.on_cells(starts, offsets) for i in self.inputs], axis=-1)
        u_peak = np.maximum(self.u_peak, np.max(np.abs(u), axis=(1, 2), initial=0.0))
        noise = 64.0 * _EPS + 2.0 * _EPS * self.omega * abs(end)
        worst = self._check(self._tails(u), u_peak, noise * u_peak, 0.0)
        U = np.concatenate([u, (rule.truncation @ u.reshape(-1, N, P * cases)).reshape(u.shape)], axis=-1)

        operator = self._operator(length)
        m, r = 2 * cases, c.size
        forcing = np.tensordot(c.B1, U, axes=1).reshape(r, N, P * m)
        at_nodes, at_end = operator.response.respond(forcing, np.zeros((r, P * m), dtype=complex))
        z = np.tensordot(plant.C2 @ c.back, at_nodes, axes=1).real + np.tensordot(
            plant.D21, U.reshape(-1, N, P * m), axes=1
        )
        given = np.concatenate([z.reshape(K * N, P * m), at_end.real, at_end.imag]).reshape(-1, P, m)
        if operator.input_to_march is not None:
            given = np.tensordot(operator.input_to_march, given, axes=1)
        with np.errstate(over="ignore", invalid="ignore"):
            w, xi, z, xi_end = self._march_cells(starts, length, offsets, operator, given)
            if not (np.all(np.isfinite(xi_end)) and np.all(np.isfinite(z))):
                raise OverflowError(
                    f"the response exceeds the range of floating point numbers near t = {starts[0]:.6g} s: "
                    "the system is unstable, shorten the run"
                )
        forcing += np.tensordot(c.B2, w, axes=1).reshape(r, N, P * m)
        at_nodes, _ = operator.response.respond(forcing, (xi[:r] + 1j * xi[r:]).reshape(r, P * m))
        x = np.tensordot(c.back, at_nodes, axes=1).real.reshape(-1, N, P, m)
        y = (
            np.tensordot(plant.C1, x, axes=1)
            + np.tensordot(plant.D11, U, axes=1)
            + np.tensordot(plant.D12, w, axes=1)
        )

        full = slice(0, cases)
        y_peak = np.maximum(self.peak, np.max(np.abs(y[..., full]), axis=(1, 2), initial=0.0))
        z_peak = np.maximum(self.z_peak, np.max(np.abs(z[..., full]), axis=(1, 2), initial=0.0))
        x_peak = np.maximum(self.x_peak, np.max(np.abs(x[..., full]), axis=(1, 2), initial=0.0))
        w_peak = np.maximum(z_peak, np.max(np.abs(w[..., full]), axis=(1, 2), initial=0.0))
        # states are differences of coordinates, whose rounding they carry
        size = np.abs(xi_end[:r] + 1j * xi_end[r:]), np.max(np.abs(xi[:r] + 1j * xi[r:]), axis=1, initial=0.0)
        x_size = np.abs(c.back) @ np.maximum(*size)[:, full] + x_peak
        z_size = abs(plant.C2) @ x_size + abs(plant.D21) @ u_peak + abs(plant.D22) @ w_peak
        y_size = (
            abs(plant.C1) @ x_size + abs(plant.D11) @ u_peak + abs(plant.D12) @ np.maximum(z_size, w_peak)
        )
        worst = self._check(self._tails(y[..., full]), y_peak, noise * y_size, worst)
        worst = self._check(self._tails(z[..., full]), z_peak, noise * z_size, worst)

        companion = (rule.truncation @ y[..., cases:].reshape(-1, N, P * cases)).reshape(y[..., full].shape)
        error = np.max(np.abs(y[..., full] - companion), axis=(1, 2), initial=0.0)
        self.error = np.maximum(self.error, error)
        self.peak, self.z_peak, self.x_peak, self.u_peak = y_peak, z_peak, x_peak, u_peak
        self.xi = xi_end
        self.count += P
        self._write(starts, length, end, y[..., full], x[..., full], u)
        return (1.0 / max(worst, 1e-300)) ** (1.0 / N) * 0.85

    def _tails(self, signal: FloatArray) -> FloatArray:
        """Size of the two highest Legendre coefficients, largest over the panel's cells."""
        signals, N, P, cases = signal.shape
        tail = self.rule.to_coefficients[-2:] @ signal.reshape(signals, N, P * cases)
        return np.max(np.sum(np.abs(tail), axis=1).reshape(signals, P, cases), axis=1, initial=0.0)

    def _check(self, tails: FloatArray, peak: FloatArray, floor: FloatArray, worst: float) -> float:
        """Return the largest tail relative to what is allowed, or raise `_Refine` where it exceeds one."""
        above = np.maximum(tails - floor, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(above > 0.0, above / (self.tolerance * peak), 0.0)
        largest = float(np.max(ratio, initial=0.0))
        if largest > 1.0 and not self.accepted_noise:
            factor = (1.0 / largest) ** (1.0 / self.N) * 0.9 if np.isfinite(largest) else 0.3
            raise _Refine(float(np.clip(factor, 0.3, 0.8)), largest * self.tolerance)
        return max(worst, largest)

    def _march_cells(
        self,
        starts: FloatArray,
        length: float,
        offsets: FloatArray,
        operator: CellOperator,
        given: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """March through a panel: delayed signals w, coordinates at the cells' starts, z, coordinates at the end."""
        P, N, K, m, r = starts.size, self.N, self.K, 2 * self.cases, self.coordinates.size
        first = self.count
        self._reserve(first + P)
        self.cell_start[first : first + P], self.cell_length[first : first + P] = starts, length
        w, z, xi = np.empty((K, N, P, m)), np.empty((K, N, P, m)), np.empty((2 * r, P, m))
        block = P if K == 0 else int(np.clip(self.minimum / length * (1.0 - 1e-12), 1, P))
        known = self.xi
        KN = K * N
        for a in range(0, P, block):
            b = min(a + block, P)
            earlier = self._earlier(starts[a:b], offsets, first + a).reshape(KN, b - a, m)
            if b - a >= 12 and operator.own is None and self.coordinates.diagonal:
                known = self._scan(operator, earlier, given[:, a:b], known, xi[:, a:b], z[:, :, a:b])
            else:
                vector = np.empty((KN + 2 * r, m))
                for j in range(a, b):
                    vector[:KN], vector[KN:] = earlier[:, j - a], known
                    xi[:, j] = known
                    result = operator.march @ vector
                    result += given[:, j]
                    z[:, :, j] = result[:KN].reshape(K, N, m)
                    known = result[KN:]
            inside = earlier
            if operator.own is not None:
                inside = earlier + np.tensordot(operator.own, z[:, :, a:b].reshape(KN, b - a, m), axes=1)
            w[:, :, a:b] = inside.reshape(K, N, b - a, m)
            stored = self.store[first + a : first + b]
            stored[:] = z[:, :, a:b].transpose(2, 0, 1, 3)
            stored[..., self.cases :] = self.rule.truncation @ stored[..., self.cases :]
        return w, xi, z, known

    def _scan(
        self,
        operator: CellOperator,
        earlier: FloatArray,
        given: FloatArray,
        known: FloatArray,
        xi: FloatArray,
        z: FloatArray,
    ) -> FloatArray:
        """Take many cells whose delayed signals are all known: one recursion for each coordinate."""
        K, N, cells, m = z.shape
        KN, r = K * N, self.coordinates.size
        local = np.tensordot(operator.march[:, :KN], earlier, axes=1) + given
        drive = local[KN : KN + r] + 1j * local[KN + r :]
        start = known[:r] + 1j * known[r:]
        states = np.empty((r, cells + 1, m), dtype=complex)
        states[:, 0] = start
        for i in range(r):
            e = operator.response.end_free[i]
            states[i, 1:], _ = scipy.signal.lfilter([1.0], [1.0, -e], drive[i], axis=0, zi=e * start[i][None])
        xi[:r], xi[r:] = states[:, :-1].real, states[:, :-1].imag
        z[:] = (local[:KN] + np.tensordot(operator.march[:KN, KN:], xi, axes=1)).reshape(z.shape)
        return np.concatenate([states[:, -1].real, states[:, -1].imag])

    def _earlier(self, starts: FloatArray, offsets: FloatArray, first: int) -> FloatArray:
        """Return z(t - tau) at the nodes as far as it comes from cells before each cell, (K, N, cells, m)."""
        K, N, m = self.K, self.N, 2 * self.cases
        cells = starts.size
        times = offsets[:, None] + starts - self.delays[:, None, None]
        source = np.searchsorted(self.cell_start[: first + cells], times, side="right") - 1
        own = source == first + np.arange(cells)
        past = times < self.past.start
        source[own | past] = 0
        live = source > 0
        values = np.zeros((K, N, cells, m))
        point = 2.0 * (times[live] - self.cell_start[source[live]]) / self.cell_length[source[live]] - 1.0
        flat = self.store.reshape(-1, N, m)
        channel = np.broadcast_to(np.arange(K)[:, None, None], source.shape)[live]
        values[live] = np.einsum("an,anm->am", self.rule.rows(point), flat[source[live] * K + channel])
        if self.past.delayed is not None and np.any(past):
            for k in range(K):
                if np.any(past[k]):
                    before = self.past.delayed(times[k][past[k]])[k]
                    values[k][past[k]] = np.concatenate([before, before], axis=-1)
        return values

    def _reserve(self, cells: int) -> None:
        if cells > self.store.shape[0]:
            more = max(cells, 2 * self.store.shape[0]) - self.store.shape[0]
            self.store = np.concatenate([self.store, np.zeros((more, *self.store.shape[1:]))])
            self.cell_start = np.append(self.cell_start, np.zeros(more))
            self.cell_length = np.append(self.cell_length, np.zeros(more))

    def _write(
        self, starts: FloatArray, length: float, end: float, y: FloatArray, x: FloatArray, u: FloatArray
    ) -> None:
        """Interpolate the panel's signals at the output times that fall into it."""
        a = self.written
        last = end >= self.end
        b = self.timepts.size if last else int(np.searchsorted(self.timepts, end - self.near, side="left"))
        if b <= a:
            return
        times = self.timepts[a:b]
        cell = np.clip(np.searchsorted(starts - self.near, times, side="right") - 1, 0, starts.size - 1)
        rows = self.rule.rows(2.0 * (times - starts[cell]) / length - 1.0)
        targets = ((self.y, y), (self.x, x), (self.u, u))
        if times.size >= 4 * starts.size:
            bounds = np.searchsorted(cell, np.arange(starts.size + 1))
            for j in range(starts.size):
                i0, i1 = int(bounds[j]), int(bounds[j + 1])
                if i1 > i0:
                    for target, signal in targets:
                        target[:, a + i0 : a + i1] = rows[i0:i1] @ signal[:, :, j]
        else:
            for target, signal in targets:
                target[:, a:b] = np.einsum("tn,sntc->stc", rows, signal[:, :, cell])
        self.written = b

    def _memory(self) -> Past:
        r, cases = self.coordinates.size, self.cases
        state = (self.coordinates.back @ (self.xi[:r] + 1j * self.xi[r:])).real[:, :cases]
        count, rule, earlier = self.count, self.rule, self.past
        starts, lengths = self.cell_start[:count], self.cell_length[:count]
        store = self.store[:count, :, :, :cases]

        def delayed(times: FloatArray) -> FloatArray:
            source = np.searchsorted(starts, times, side="right") - 1
            source = np.clip(source, 0, count - 1)
            values = np.zeros((store.shape[1], times.size, cases))
            live = source > 0
            point = 2.0 * (times[live] - starts[source[live]]) / lengths[source[live]] - 1.0
            values[:, live] = np.einsum("an,aknm->kam", rule.rows(point), store[source[live]])
            if earlier.delayed is not None and not np.all(live):
                values[:, ~live] = earlier.delayed(times[~live])
            return values

        longest = float(np.max(self.delays, initial=0.0))
        kinks = tuple(float(t) for t in self.edges if t >= self.end - longest)
        return Past(self.end, state, delayed, kinks)
