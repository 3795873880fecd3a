r"""Exact simulation under inputs with very many kinks anywhere, at rest before the start.

Samples on uneven grids and measured roads have kinks that no grid of cells meets. The cells here are uniform
(`susp_ctrl.delay_systems.integrators.uniform_march`) and the inputs enter them exactly, by Gauss quadrature of

.. math:: \int_0^s e^{T(s - \sigma)} B_1 u(\sigma)\, d\sigma

from kink to kink. The delayed signals, which the plant has smoothed, are polynomials on each cell; where the kinks
left in them are too strong, which the companion of lower degree shows, shorter cells follow. Where a callable is not
what the quadrature took it for, the method of steps takes over.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.integrators.cells import PlantCoordinates, gauss_rule
from susp_ctrl.delay_systems.integrators.input_signals import Inputs
from susp_ctrl.delay_systems.integrators.kinks import MANY_KNOTS
from susp_ctrl.delay_systems.integrators.trajectory import Run
from susp_ctrl.delay_systems.integrators.uniform_cells import UniformCells
from susp_ctrl.delay_systems.integrators.uniform_march import TooCoarseError, UniformMarch
from susp_ctrl.delay_systems.model import FoldedLoop

_EPS = float(np.finfo(float).eps)
_NODES = 10
_POINTS = 6  # of the quadrature between kinks; the companion takes what four coefficients hold
_FEWEST_CELLS = 2  # shortest delay in cells
_MISS = 1e-5  # of an input's peak that the quadrature's polynomial may be off between kinks
_MOST_DECAY = 4.0  # of a mode over a cell: its inverse multiplies rounding
_MOST_CELLS = 64  # for each kink


def share(inputs: Sequence[Inputs]) -> tuple[list[Inputs], list[Inputs]]:
    """Return what this march takes of the inputs, those that have known kinks, and the others."""
    own, others = zip(*(i.without_smooth() for i in inputs), strict=True)
    return list(own), list(others)


def suits(loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, start: float, rtol: float) -> bool:
    """Tell whether there are so many kinks that cells between all of them would be slower, and no direct paths."""
    plant = loop.plant
    return (
        max(i.breakpoints.size + i.sample_times.size for i in inputs) > MANY_KNOTS
        and any(i.parts for i in inputs)
        and float(timepts[-1]) > start
        and not np.any(plant.D22)
        and not np.any(plant.D21[:, _rows(inputs)])
        and PlantCoordinates(plant).diagonal
    )


def run(loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, start: float, rtol: float) -> Run:
    """Simulate from rest.

    Parameters
    ----------
    loop : FoldedLoop
        Plant with unit gains and positive delays.
    inputs : sequence of Inputs
        One for each case, with announced kinks; this march's share.
    timepts : ndarray
        Increasing output times.
    start : float
        Where the run begins (s).
    rtol : float
        Wanted error relative to each output's peak.

    Raises
    ------
    TooCoarseError
        So many cells would be needed that the method of steps pays as well, or a callable is not what the
        quadrature takes it for.
    OverflowError
        The response of an unstable loop leaves the range of floating point numbers.
    """
    plant, delays = loop
    span, rows, coordinates = float(timepts[-1]) - start, _rows(inputs), PlantCoordinates(plant)
    knots = np.unique(np.concatenate([t for i in inputs for t in (i.breakpoints, i.sample_times)]))
    knots = knots[(knots > start) & (knots < timepts[-1])]
    fastest = max(plant.fastest, 1e-300)
    longest = [
        span / max(1, knots.size),
        2.0 * gauss_rule(_NODES - 2).phase_resolved(1e-2 * rtol) / fastest,
        _MOST_DECAY / fastest,
        float(np.min(delays, initial=np.inf)) / _FEWEST_CELLS,
    ]
    count, failed = int(np.ceil(span / min(longest))), TooCoarseError(np.inf)
    rounding = 16.0 * _EPS * max(float(timepts[-1]), float(np.max(delays, initial=0.0)))
    while count <= _MOST_CELLS * knots.size:
        cells = UniformCells(plant, delays, coordinates, gauss_rule(_NODES), span / count, rounding)
        try:
            return _KinkedMarch(loop, cells, inputs, rows, knots, timepts, start, count, rtol).run()
        except TooCoarseError as problem:
            failed = problem
        if not np.isfinite(failed.excess):
            break
        # kinks that the plant has smoothed once or twice: the error falls with a power of two to three
        count *= int(np.clip(np.ceil(1.2 * failed.excess**0.4), 2, 8))
    raise failed


def _rows(inputs: Sequence[Inputs]) -> list[int]:
    return sorted({row for i in inputs for part in i.parts for row in part.rows})


class _KinkedMarch(UniformMarch):
    caution = 4.0  # a kink inside a cell leaves an error beyond what the two highest coefficients hold

    def __init__(
        self,
        loop: FoldedLoop,
        cells: UniformCells,
        inputs: Sequence[Inputs],
        rows: list[int],
        knots: FloatArray,
        timepts: FloatArray,
        start: float,
        count: int,
        rtol: float,
    ) -> None:
        super().__init__(loop, cells, rows, len(inputs), start, timepts, (count, count), rtol)
        self.inputs, self.knots, self.written = inputs, knots, 0
        self.given = np.stack([i.given(timepts) for i in inputs], axis=-1)
        self.looks = np.unique(np.concatenate([i.looks(timepts, start) for i in inputs]))
        at_looks = self.given
        if self.looks.size > timepts.size:
            at_looks = np.stack([i.given(self.looks) for i in inputs], axis=-1)
        after = np.searchsorted(knots, self.looks)
        gap = np.minimum(
            np.abs(self.looks - knots[np.maximum(after - 1, 0)]),
            np.abs(self.looks - knots[np.minimum(after, knots.size - 1)]),
        )
        self.held_against = np.where(gap[:, None] > cells.rounding, at_looks[rows], np.nan)
        self.u_peak = np.nanmax(np.abs(self.held_against), axis=1, initial=0.0)
        self.poles = np.diag(cells.coordinates.T)
        self.quadrature = gauss_rule(_POINTS)
        nodes, r, columns = cells.reach[:-1].shape
        reach = cells.reach[:-1].reshape(nodes * r, columns)
        self.to_nodes = np.vstack([reach.real, reach.imag])

    def _forced(self, a: int, b: int) -> FloatArray:
        cells, length, P = self.cells, self.cells.length, b - a
        edges: FloatArray = self.start + length * np.arange(a, b + 1, dtype=float)
        targets = edges[:-1, None] + cells.targets
        until = self.timepts.size
        if b < self.count:
            until = int(np.searchsorted(self.timepts, edges[-1]))
        wanted = np.clip(self.timepts[self.written : until], edges[0], edges[-1])
        first, last = np.searchsorted(self.knots, edges[[0, -1]])
        times = np.sort(np.concatenate([edges, targets.ravel(), wanted, self.knots[first:last]]))
        total = self._cumulated(times, edges)
        # since the start of the cell, seen from there
        begun = total[:, np.searchsorted(times, edges[:-1])]
        since = total[:, np.searchsorted(times, targets)] - begun[:, :, None]
        forced = np.exp(np.multiply.outer(self.poles, cells.targets))[:, None, :, None] * since
        cell = np.clip(((wanted - edges[0]) / length).astype(int), 0, P - 1)
        self._wanted = (wanted, cell, wanted - edges[cell])
        self._at_wanted = total[:, np.searchsorted(times, wanted)] - begun[:, cell]
        z = np.tensordot(self.plant.C2 @ cells.coordinates.back, forced[:, :, :-1], axes=1).real
        end = forced[:, :, -1]
        flat = z.transpose(0, 2, 1, 3).reshape(z.shape[0] * z.shape[2], P, end.shape[2])
        return np.concatenate([flat, end.real, end.imag])

    def _cumulated(self, times: FloatArray, edges: FloatArray) -> ComplexArray:
        """Integral of ``e^{-T s} B1 u`` from the first of `times`, s from the start of the cell it passes."""
        rule, left, half = self.quadrature, times[:-1], 0.5 * np.diff(times)
        points = left[:, None] + half[:, None] * (1.0 + rule.nodes)
        cell = np.clip(((left + half - edges[0]) / self.cells.length).astype(int), 0, edges.size - 2)
        kernel = np.exp(-np.multiply.outer(self.poles, points - edges[cell][:, None]))
        kernel *= half[:, None] * rule.weights
        u = np.stack([signals.at(points)[self.rows] for signals in self.inputs], axis=-1)
        self.u_peak = np.maximum(self.u_peak, np.max(np.abs(u), axis=(1, 2)))
        self._compare(times, u)
        u = np.concatenate([u, rule.truncation @ u], axis=-1)
        drive = np.zeros((self.poles.size, left.size, u.shape[-1]), dtype=complex)
        for j, row in enumerate(self.rows):
            into = np.einsum("rma,mac->rmc", kernel, u[j])
            drive += self.cells.coordinates.B1[:, row][:, None, None] * into
        total = np.zeros((drive.shape[0], times.size, drive.shape[2]), dtype=complex)
        np.cumsum(drive, axis=1, out=total[:, 1:])
        return total

    def _compare(self, times: FloatArray, u: FloatArray) -> None:
        """Raise `TooCoarseError` where polynomials between `times` are not what was given."""
        first, last = np.searchsorted(self.looks, times[[0, -1]])
        looks = self.looks[first:last]
        # a look at the border of two pieces is held against both
        for side in ("left", "right"):
            piece = np.clip(np.searchsorted(times, looks, side=side) - 1, 0, times.size - 2)
            width = times[piece + 1] - times[piece]
            point = 2.0 * (looks - times[piece]) / np.where(width > 0.0, width, np.inf) - 1.0
            values = np.einsum("tn,stnc->stc", self.quadrature.rows(point), u[:, piece])
            miss = np.abs(values - self.held_against[:, first:last])
            if np.any(miss[:, width > 0.0] > _MISS * self.u_peak[:, None]):
                raise TooCoarseError(np.inf)

    def _write(self, a: int, b: int, starts: FloatArray, w: FloatArray, sources: FloatArray) -> FloatArray:
        cells, rule, cases, plant = self.cells, self.cells.rule, self.cases, self.plant
        wanted, cell, late = self._wanted
        r, m, here = self.poles.size, 2 * cases, slice(self.written, self.written + wanted.size)
        self.written += wanted.size
        across = rule.rows(2.0 * late / cells.length - 1.0)
        begin = (starts[:r] + 1j * starts[r:])[:, cell]
        xi = np.exp(np.multiply.outer(self.poles, late))[..., None] * (begin + self._at_wanted)
        parts = (self.to_nodes @ sources).reshape(2, rule.size, r, b - a, m)
        shorter = across @ rule.truncation
        for columns, rows in ((slice(0, cases), across), (slice(cases, m), shorter)):
            through = np.einsum("tn,inrtc->irtc", rows, parts[:, :, :, cell, columns])
            xi[:, :, columns] += through[0] + 1j * through[1]
        x = np.tensordot(cells.coordinates.back, xi, axes=1).real
        y = np.tensordot(plant.C1, x, axes=1)
        for k in np.flatnonzero(np.any(plant.D12, axis=0)):
            place = (wanted - self.start - self.delays[k]) / cells.length
            source = np.clip(np.floor(place).astype(int), self.offset, b - 1)
            rows = rule.rows(2.0 * (place - source) - 1.0)
            delayed = np.einsum("tn,ntc->tc", rows, self.held[k][:, source - self.offset])
            delayed[place < 0.0] = 0.0
            y += plant.D12[:, k][:, None, None] * delayed
        self.x[:, here], self.y[:, here] = x[..., :cases], y[..., :cases]
        self.u[:, here] = self.given[:, here]
        self.y[:, here] += np.tensordot(plant.D11, self.u[:, here], axes=1)
        self.peak = np.maximum(self.peak, np.max(np.abs(self.y[:, here]), axis=1, initial=0.0))
        return y
