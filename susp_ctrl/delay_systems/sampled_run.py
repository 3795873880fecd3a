r"""Exact simulation under inputs given as samples on a uniform grid, at rest before the start.

The cells are the sampling intervals (`susp_ctrl.delay_systems.uniform_cells`), whose number does not enter the
work in Python: as many cells as the shortest delay is long are taken by one matrix product and one recursion for
each coordinate of the plant. The forced response to the samples is exact; what is approximated are the delayed
signals, by polynomials on each cell, and a companion of lower degree estimates that error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.signal

from susp_ctrl.delay_systems.cells import GaussRule, PlantCoordinates, gauss_rule
from susp_ctrl.delay_systems.folding import FoldedLoop
from susp_ctrl.delay_systems.input_signals import Inputs
from susp_ctrl.delay_systems.lft import ComplexArray, FloatArray
from susp_ctrl.delay_systems.run import Past, Run
from susp_ctrl.delay_systems.uniform_cells import FASTEST_DECAY, UniformCells

_EPS = float(np.finfo(float).eps)
_NODES = (6, 8, 10, 14, 20)
_FEWEST_CELLS = 8  # shortest delay in cells below which blocks are too short to pay
_LONGEST_BLOCK = 1024
_KEPT_CELLS = 16384  # cells of the delayed signals held at once, beyond the longest delay
_HOPELESS = 1e3  # excess of the error at which a run is broken off
_FIRST_LOOK = 4096  # cells before that


def run_sampled(
    loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, start: float, rtol: float
) -> Run | None:
    """Simulate from rest under samples at `timepts`; None where the cells of this method do not suit.

    Parameters
    ----------
    loop : FoldedLoop
        Plant with unit gains and positive delays.
    inputs : sequence of Inputs
        One for each case, given by samples only.
    timepts : ndarray
        Uniform times of samples and outputs.
    start : float
        The first of them.
    rtol : float
        Wanted error relative to each output's peak.

    Raises
    ------
    OverflowError
        The response of an unstable loop leaves the range of floating point numbers.
    """
    plant, delays = loop
    count = timepts.size
    if count < 2 or len({i.hold for i in inputs}) > 1 or np.any(plant.D22):
        return None
    length = float(timepts[-1] - timepts[0]) / (count - 1)
    span = max(float(timepts[-1]), float(np.max(delays, initial=0.0)))
    rounding = 16.0 * _EPS * span
    fastest = float(np.max(np.abs(plant.eigenvalues), initial=0.0))
    uneven = float(np.max(np.abs(timepts - (start + length * np.arange(count)))))
    if uneven > max(rounding, 1e-2 * rtol / max(fastest, 1e-300)):
        return None
    if fastest * length > FASTEST_DECAY or np.any(delays < _FEWEST_CELLS * length):
        return None
    coordinates = PlantCoordinates(plant)
    for nodes in _NODES:
        rule = gauss_rule(nodes)
        # the companion has two coefficients less, and its difference is to stay far below the tolerance
        if gauss_rule(nodes - 2).phase_resolved(1e-2 * rtol) < 0.5 * fastest * length:
            continue
        cells = UniformCells(plant, delays, coordinates, rule, length, rounding)
        run = _SampledMarch(loop, cells, inputs, timepts, rtol).run()
        if run is not None:
            return run
    return None


class _SampledMarch:
    def __init__(
        self,
        loop: FoldedLoop,
        cells: UniformCells,
        inputs: Sequence[Inputs],
        timepts: FloatArray,
        rtol: float,
    ) -> None:
        self.plant, self.delays, self.cells, self.timepts, self.rtol = *loop, cells, timepts, rtol
        self.inputs, self.cases = inputs, len(inputs)
        self.rows = sorted({row for i in inputs for part in i.parts for row in part.rows})
        self.samples = np.zeros((len(self.rows), timepts.size, self.cases))
        for k, signals in enumerate(inputs):
            for part in signals.parts:
                assert part.samples is not None  # the caller gives sampled inputs only
                self.samples[[self.rows.index(row) for row in part.rows], :, k] = part.samples
        self.driven = cells.from_samples(inputs[0].hold, self.rows)
        p, n, T = self.plant.n_outputs, self.plant.n_states, timepts.size
        self.y, self.x = np.empty((p, T, self.cases)), np.empty((n, T, self.cases))
        self.error = np.zeros((p, self.cases))
        self.peak = np.zeros((p, self.cases))
        self.xi_peak = np.zeros((cells.coordinates.size, self.cases))
        self.w_peak = np.zeros((self.delays.size, self.cases))
        self.reach = int(np.max(cells.whole, initial=0)) + 1
        # delayed signals, held[:, :, i] on cell i - offset; before the start they are zero
        K, N, m = self.delays.size, cells.rule.size, 2 * self.cases
        self.held = np.zeros((K, N, self.reach + min(_KEPT_CELLS, T), m))
        self.offset = -self.reach

    def run(self) -> Run | None:
        """March in blocks that see only what lies before them; None where the error is too large."""
        r, T = self.cells.coordinates.size, self.timepts.size
        block = min(_LONGEST_BLOCK, int(np.min(self.cells.whole, initial=_LONGEST_BLOCK)))
        known = np.zeros((r, 2 * self.cases), dtype=complex)
        last = known
        for a in range(0, T, block):
            b = min(a + block, T)
            xi = self._block(a, b, known)
            last, known = xi[:, -2], xi[:, -1]
            if not np.all(np.isfinite(known)):
                raise OverflowError(
                    f"the response exceeds the range of floating point numbers near t = {self.timepts[a]:.6g} s: "
                    "the system is unstable, shorten the run"
                )
            if a <= _FIRST_LOOK < b:
                bearable = _HOPELESS * (self.rtol * self.peak + self._rounding())
                if np.any(self.error > bearable):
                    return None
        rounding = self._rounding()
        if np.any(self.error > self.rtol * self.peak + rounding):
            return None
        given = np.zeros((self.plant.n_inputs, T, self.cases))
        given[self.rows] = self.samples
        end = (self.cells.coordinates.back @ last[:, : self.cases]).real
        return Run(self.y, self.x, given, self.error, self.peak, self._past(end), T - 1, rounding)

    def _block(self, a: int, b: int, known: ComplexArray) -> ComplexArray:
        """Take cells a to b; return the coordinates at their starts and at the last one's end."""
        cells, plant, cases = self.cells, self.plant, self.cases
        K, N, r, P, m = self.delays.size, cells.rule.size, cells.coordinates.size, b - a, known.shape[1]
        if b - self.offset > self.held.shape[2]:
            kept = a - self.reach - self.offset
            self.held[:, :, : self.reach] = self.held[:, :, kept : kept + self.reach].copy()
            self.offset = a - self.reach
        sources = np.empty((K, 2, N, P, m))
        for k in range(K):
            newer = a - int(cells.whole[k]) - self.offset
            sources[k, 0] = self.held[k, :, newer - 1 : newer - 1 + P]
            sources[k, 1] = self.held[k, :, newer : newer + P]
        local = (cells.from_delayed @ sources.reshape(2 * K * N, P * m)).reshape(-1, P, m)
        here = self.samples[:, a:b]
        after = self.samples[:, np.minimum(np.arange(a + 1, b + 1), self.timepts.size - 1)]
        both = np.concatenate([here, after]).reshape(-1, P * cases)
        given = (self.driven @ both).reshape(-1, P, cases)
        local[: K * N + 2 * r, :, :cases] += given
        local[: K * N + 2 * r, :, cases:] += given
        drive = local[K * N : K * N + r] + 1j * local[K * N + r : K * N + 2 * r]
        xi = linear_recursion(cells.step, drive, known, cells.coordinates.diagonal)
        starts = np.concatenate([xi.real, xi.imag])[:, :-1]
        z = local[: K * N] + np.tensordot(cells.z_free, starts, axes=1)
        held = self.held[:, :, a - self.offset : b - self.offset]
        held[:] = z.reshape(K, N, P, m)
        companion = held[..., cases:].reshape(K, N, P * cases)
        held[..., cases:] = (cells.rule.truncation @ companion).reshape(K, N, P, cases)
        back = np.hstack([cells.coordinates.back.real, -cells.coordinates.back.imag])
        y = np.tensordot(plant.C1 @ back, starts, axes=1)
        y += np.tensordot(plant.D12, local[K * N + 2 * r :], axes=1)
        error = np.max(np.abs(y[..., :cases] - y[..., cases:]), axis=1, initial=0.0)
        self.y[:, a:b] = y[..., :cases]
        self.y[:, a:b] += np.tensordot(plant.D11[:, self.rows], here, axes=1)
        self.x[:, a:b] = np.tensordot(back, starts[..., :cases], axes=1)
        self.error = np.maximum(self.error, error)
        self.peak = np.maximum(self.peak, np.max(np.abs(self.y[:, a:b]), axis=1, initial=0.0))
        self.xi_peak = np.maximum(self.xi_peak, np.max(np.abs(xi[..., :cases]), axis=1))
        w_peak = np.max(np.abs(local[K * N + 2 * r :, :, :cases]), axis=1, initial=0.0)
        self.w_peak = np.maximum(self.w_peak, w_peak)
        return xi

    def _rounding(self) -> FloatArray:
        """Rounding of each output from that of the signals it is a sum of, where these may cancel."""
        c, plant, end = self.cells.coordinates, self.plant, float(self.timepts[-1])
        poles = np.diag(c.T)
        fastest = float(np.max(np.abs(poles), initial=0.0))
        # the rounding of drives that cancel stays in a mode as long as the mode remembers
        memory = 1.0 / np.maximum(np.abs(poles.real), 1.0 / end)[:, None]
        u_peak = np.max(np.abs(self.samples), axis=1, initial=0.0)
        drive = np.abs(c.B1[:, self.rows]) @ u_peak + np.abs(c.B2) @ self.w_peak
        size = np.abs(c.back) @ (self.xi_peak + memory * drive)
        y_size = np.abs(plant.C1) @ size + np.abs(plant.D11[:, self.rows]) @ u_peak
        y_size += np.abs(plant.D12) @ self.w_peak
        return np.asarray((64.0 * _EPS + 2.0 * _EPS * fastest * end) * y_size)

    def _past(self, state: FloatArray) -> Past:
        """Return what a run that goes on has to know."""
        length, T, cases = self.cells.length, self.timepts.size, self.cases
        start, end = float(self.timepts[0]), float(self.timepts[-1])
        first = max(0, T - 1 - self.reach)
        z = self.held[:, :, first - self.offset : T - 1 - self.offset, :cases].copy()
        rule: GaussRule = self.cells.rule

        def delayed(times: FloatArray) -> FloatArray:
            place = (times - start) / length
            cell = np.clip(np.floor(place).astype(int), first, T - 2)
            rows = rule.rows(2.0 * (place - cell) - 1.0)
            values = np.einsum("an,knac->kac", rows, z[:, :, cell - first])
            values[:, place < 0.0] = 0.0
            return values

        kinks = tuple(self.timepts[first:].tolist())
        return Past(end, state, delayed if self.delays.size else None, kinks)


def linear_recursion(
    step: ComplexArray, drive: ComplexArray, start: ComplexArray, diagonal: Any
) -> ComplexArray:
    """Return xi of ``xi[:, i+1] = step @ xi[:, i] + drive[:, i]``, step triangular, shape (r, cells + 1, columns)."""
    r, P, m = drive.shape
    xi = np.empty((r, P + 1, m), dtype=complex)
    xi[:, 0] = start
    for i in range(r - 1, -1, -1):
        forcing = drive[i]
        if not diagonal:
            forcing = forcing + np.tensordot(step[i, i + 1 :], xi[i + 1 :, :-1], axes=1)
        pole = step[i, i]
        xi[i, 1:], _ = scipy.signal.lfilter([1.0], [1.0, -pole], forcing, axis=0, zi=pole * start[i][None])
    return xi
