r"""The march over cells of one length from rest, whatever drives them.

As many cells as the shortest delay is long are taken by one matrix product and one recursion for each coordinate
of the plant (`uniform_cells`); what does not depend on the march, drives and outputs, is taken for many such blocks at
once. Beside the solution runs a companion whose delayed signals
lack the two highest coefficients on each cell; the difference estimates the error.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import scipy.signal

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.integrators.trajectory import Past, Run
from susp_ctrl.delay_systems.integrators.uniform_cells import UniformCells
from susp_ctrl.delay_systems.model import FoldedLoop

_EPS = float(np.finfo(float).eps)
_LONGEST_BLOCK = 1024
_BLOCKS_TOGETHER = 256  # cells of short blocks whose drives and outputs are computed at once
_KEPT_CELLS = 16384  # cells of the delayed signals held at once, beyond the longest delay
_HOPELESS = 1e3  # excess of the error at which a run is broken off
_FIRST_LOOK = 4096  # cells before that


class TooCoarseError(Exception):
    """The cells of a march do not hold the tolerance; carries the error by which they miss it."""

    def __init__(self, excess: float) -> None:
        super().__init__(f"{excess:g} times the tolerance")
        self.excess = excess


class UniformMarch(ABC):
    """A run from rest on uniform cells.

    Parameters
    ----------
    loop : FoldedLoop
        Plant with unit gains and positive delays.
    cells : UniformCells
        Its operators.
    rows : list of int
        Driven inputs.
    cases : int
        Number of cases; columns are the cases and then their companions.
    start : float
        Where the first cell begins (s).
    timepts : ndarray
        Output times.
    counts : tuple of int
        Cells to take, and number of those that are over at the end of the run.
    rtol : float
        Wanted error relative to each output's peak.
    """

    caution = 1.0  # factor on the difference of the companion

    def __init__(
        self,
        loop: FoldedLoop,
        cells: UniformCells,
        rows: list[int],
        cases: int,
        start: float,
        timepts: FloatArray,
        counts: tuple[int, int],
        rtol: float,
    ) -> None:
        self.plant, self.delays, self.cells, self.timepts, self.rtol = *loop, cells, timepts, rtol
        self.rows, self.cases, self.start = rows, cases, start
        self.count, self.over = counts
        p, n, q, T = self.plant.n_outputs, self.plant.n_states, self.plant.n_inputs, timepts.size
        self.y, self.x, self.u = np.empty((p, T, cases)), np.empty((n, T, cases)), np.zeros((q, T, cases))
        self.error, self.peak = np.zeros((p, cases)), np.zeros((p, cases))
        self.xi_peak = np.zeros((cells.coordinates.size, cases))
        self.w_peak, self.u_peak = np.zeros((self.delays.size, cases)), np.zeros((len(rows), cases))
        c = cells.coordinates
        self.back = np.hstack([c.back.real, -c.back.imag])  # x from [Re xi; Im xi]
        self.reach = int(np.max(cells.whole, initial=0)) + 1
        # delayed signals, held[:, :, i] on cell i + offset; before the start they are zero
        K, N = self.delays.size, cells.rule.size
        self.held = np.zeros((K, N, self.reach + min(_KEPT_CELLS, self.count), 2 * cases))
        self.offset = -self.reach

    @abstractmethod
    def _forced(self, a: int, b: int) -> FloatArray:
        """Response of cells a to b to the inputs: z at the nodes, drive of xi (real, imaginary)."""

    @abstractmethod
    def _write(self, a: int, b: int, starts: FloatArray, w: FloatArray, sources: FloatArray) -> FloatArray:
        """Fill in the outputs that fall into cells a to b; return y with all columns, without direct inputs."""

    def run(self) -> Run:
        """March in blocks that see only what lies before them.

        Raises
        ------
        TooCoarseError
            The error is larger than `rtol` allows.
        OverflowError
            The response of an unstable loop leaves the range of floating point numbers.
        """
        r = self.cells.coordinates.size
        self.block = min(_LONGEST_BLOCK, int(np.min(self.cells.whole, initial=_LONGEST_BLOCK)))
        together = self.block * max(1, _BLOCKS_TOGETHER // self.block)
        known = np.zeros((r, 2 * self.cases), dtype=complex)
        state = known
        for a in range(0, self.count, together):
            b = min(a + together, self.count)
            with np.errstate(over="ignore", invalid="ignore"):
                xi = self._blocks(a, b, known)
            known = xi[:, -1]
            if a <= self.over <= b:
                state = xi[:, self.over - a]
            if not np.all(np.isfinite(known)):
                raise OverflowError(
                    "the response exceeds the range of floating point numbers near "
                    f"t = {self.start + a * self.cells.length:.6g} s: the system is unstable, shorten the run"
                )
            if a <= _FIRST_LOOK < b:
                bearable = _HOPELESS * (self.rtol * self.peak + self._rounding())
                if np.any(self.error > bearable):
                    raise self._too_coarse()
        rounding = self._rounding()
        if np.any(self.error > self.rtol * self.peak + rounding):
            raise self._too_coarse()
        end = (self.cells.coordinates.back @ state[:, : self.cases]).real
        return Run(self.y, self.x, self.u, self.error, self.peak, self._past(end), self.over, rounding)

    def _too_coarse(self) -> TooCoarseError:
        return TooCoarseError(
            float(np.max(self.error / np.maximum(self.rtol * self.peak, np.finfo(float).tiny)))
        )

    def _blocks(self, a: int, b: int, known: ComplexArray) -> ComplexArray:
        """Take cells a to b; return the coordinates at their starts and at the last one's end."""
        if b - self.offset > self.held.shape[2]:
            kept = a - self.reach - self.offset
            self.held[:, :, : self.reach] = self.held[:, :, kept : kept + self.reach].copy()
            self.offset = a - self.reach
        forced, taken = self._forced(a, b), []
        for first in range(a, b, self.block):
            last = min(first + self.block, b)
            taken.append(self._block(first, last, known, forced[:, first - a : last - a]))
            known = taken[-1][0][:, -1]
        xi = np.concatenate([*(one[0][:, :-1] for one in taken), known[:, None]], axis=1)
        w, sources = (np.concatenate([one[k] for one in taken], axis=1) for k in (1, 2))
        starts = np.concatenate([xi.real, xi.imag])[:, :-1]
        cases = self.cases
        self.xi_peak = np.maximum(self.xi_peak, np.max(np.abs(xi[..., :cases]), axis=1))
        self.w_peak = np.maximum(self.w_peak, np.max(np.abs(w[..., :cases]), axis=1, initial=0.0))
        y = self._write(a, b, starts, w, sources)
        error = np.max(np.abs(y[..., :cases] - y[..., cases:]), axis=1, initial=0.0)
        self.error = np.maximum(self.error, self.caution * error)
        return xi

    def _block(
        self, a: int, b: int, known: ComplexArray, forced: FloatArray
    ) -> tuple[ComplexArray, FloatArray, FloatArray]:
        """Take cells a to b that see only what lies before a; return xi, w at their starts, and what they saw."""
        cells, cases = self.cells, self.cases
        K, N, r, P, m = self.delays.size, cells.rule.size, cells.coordinates.size, b - a, known.shape[1]
        sources = np.empty((K, 2, N, P, m))
        for k in range(K):
            newer = a - int(cells.whole[k]) - self.offset
            sources[k, 0] = self.held[k, :, newer - 1 : newer - 1 + P]
            sources[k, 1] = self.held[k, :, newer : newer + P]
        flat = sources.reshape(2 * K * N, P * m)
        local = (cells.from_delayed @ flat).reshape(len(cells.from_delayed), P, m)
        local[: K * N + 2 * r] += forced
        drive = local[K * N : K * N + r] + 1j * local[K * N + r : K * N + 2 * r]
        xi = linear_recursion(cells.step, drive, known, cells.coordinates.diagonal)
        starts = np.concatenate([xi.real, xi.imag])[:, :-1]
        z = local[: K * N] + np.tensordot(cells.z_free, starts, axes=1)
        held = self.held[:, :, a - self.offset : b - self.offset]
        held[:] = z.reshape(K, N, P, m)
        companion = held[..., cases:].reshape(K, N, P * cases)
        held[..., cases:] = (cells.rule.truncation @ companion).reshape(K, N, P, cases)
        return xi, local[K * N + 2 * r :], flat

    def _rounding(self) -> FloatArray:
        """Rounding of each output from that of the signals it is a sum of, where these may cancel."""
        c, plant, end = self.cells.coordinates, self.plant, float(self.timepts[-1])
        poles = np.diag(c.T)
        fastest = float(np.max(np.abs(poles), initial=0.0))
        # the rounding of drives that cancel stays in a mode as long as the mode remembers
        memory = 1.0 / np.maximum(np.abs(poles.real), 1.0 / end)[:, None]
        drive = np.abs(c.B1[:, self.rows]) @ self.u_peak + np.abs(c.B2) @ self.w_peak
        size = np.abs(c.back) @ (self.xi_peak + memory * drive)
        y_size = np.abs(plant.C1) @ size + np.abs(plant.D11[:, self.rows]) @ self.u_peak
        y_size += np.abs(plant.D12) @ self.w_peak
        return np.asarray((64.0 * _EPS + 2.0 * _EPS * fastest * end) * y_size)

    def _past(self, state: FloatArray) -> Past:
        """Return what a run that goes on has to know."""
        length, start, rule, over = self.cells.length, self.start, self.cells.rule, self.over
        first = max(0, over - self.reach)
        z = self.held[:, :, first - self.offset : over - self.offset, : self.cases].copy()

        def delayed(times: FloatArray) -> FloatArray:
            place = (times - start) / length
            cell = np.clip(np.floor(place).astype(int), first, over - 1)
            point = 2.0 * (np.clip(place, first, over) - cell) - 1.0
            values = np.einsum("an,knac->kac", rule.rows(point), z[:, :, cell - first])
            values[:, place < 0.0] = 0.0
            return values

        kinks = tuple((start + length * np.arange(first, over + 1)).tolist())
        return Past(float(self.timepts[-1]), state, delayed if self.delays.size else None, kinks)


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
