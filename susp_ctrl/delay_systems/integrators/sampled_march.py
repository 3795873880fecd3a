r"""Exact simulation under inputs given as samples on a uniform grid, at rest before the start.

The cells are the sampling intervals (`uniform_march`). The forced response to the samples
is exact; what is approximated are the delayed signals, by polynomials on each cell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators.cells import PlantCoordinates, gauss_rule
from susp_ctrl.delay_systems.integrators.input_signals import Inputs
from susp_ctrl.delay_systems.integrators.trajectory import Run
from susp_ctrl.delay_systems.integrators.uniform_cells import FASTEST_DECAY, UniformCells
from susp_ctrl.delay_systems.integrators.uniform_march import TooCoarseError, UniformMarch
from susp_ctrl.delay_systems.model import FoldedLoop

_EPS = float(np.finfo(float).eps)
_NODES = (6, 8, 10, 14, 20)
_FEWEST_CELLS = 8  # shortest delay in cells below which blocks are too short to pay


def share(inputs: Sequence[Inputs]) -> tuple[list[Inputs], list[Inputs]]:
    """Return what this march takes of the inputs, those given by samples, and the rest."""
    own, others = zip(*(i.without_samples() for i in inputs), strict=True)
    return list(own), list(others)


def suits(loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, start: float, rtol: float) -> bool:
    """Tell whether every case is driven by samples on one uniform grid with cells that suit the loop."""
    plant, delays = loop
    if timepts.size < 2 or np.any(plant.D22):
        return False
    if not all(i.knots is not None and np.array_equal(i.knots, timepts) for i in inputs):
        return False
    if len({i.hold for i in inputs}) > 1:
        return False
    length, fastest = _length(timepts), plant.fastest
    uneven = float(np.max(np.abs(timepts - (start + length * np.arange(timepts.size)))))
    # a sample that is late changes the input by the slope between samples, and the response by its own rate
    shortest = min(length, 1.0 / fastest) if fastest > 0.0 else length
    allowed = max(_rounding(timepts, delays), 1e-2 * rtol * shortest)
    return (
        uneven <= allowed
        and fastest * length <= FASTEST_DECAY
        and bool(np.all(delays >= _FEWEST_CELLS * length))
    )


def run(loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, start: float, rtol: float) -> Run:
    """Simulate from rest under samples at `timepts`.

    Parameters
    ----------
    loop : FoldedLoop
        Plant with unit gains and positive delays.
    inputs : sequence of Inputs
        One for each case; this march's share.
    timepts : ndarray
        Uniform times of samples and outputs.
    start : float
        The first of them.
    rtol : float
        Wanted error relative to each output's peak.

    Raises
    ------
    TooCoarseError
        No number of nodes holds the tolerance.
    OverflowError
        The response of an unstable loop leaves the range of floating point numbers.
    """
    plant, delays = loop
    coordinates, length, failed = PlantCoordinates(plant), _length(timepts), TooCoarseError(np.inf)
    for nodes in _NODES:
        # the companion has two coefficients less, and its difference is to stay far below the tolerance
        if gauss_rule(nodes - 2).phase_resolved(1e-2 * rtol) < 0.5 * plant.fastest * length:
            continue
        rounding = _rounding(timepts, delays)
        cells = UniformCells(plant, delays, coordinates, gauss_rule(nodes), length, rounding)
        try:
            return _SampledMarch(loop, cells, inputs, timepts, rtol).run()
        except TooCoarseError as problem:
            failed = problem
    raise failed


def _length(timepts: FloatArray) -> float:
    return float(timepts[-1] - timepts[0]) / (timepts.size - 1)


def _rounding(timepts: FloatArray, delays: FloatArray) -> float:
    return 16.0 * _EPS * max(float(timepts[-1]), float(np.max(delays, initial=0.0)))


class _SampledMarch(UniformMarch):
    def __init__(
        self,
        loop: FoldedLoop,
        cells: UniformCells,
        inputs: Sequence[Inputs],
        timepts: FloatArray,
        rtol: float,
    ) -> None:
        rows = sorted({row for i in inputs for part in i.parts for row in part.rows})
        # beyond the last sample stands a cell that only its start is taken of
        counts = (timepts.size, timepts.size - 1)
        super().__init__(loop, cells, rows, len(inputs), float(timepts[0]), timepts, counts, rtol)
        self.samples = np.zeros((len(rows), timepts.size, self.cases))
        for k, signals in enumerate(inputs):
            for part in signals.parts:
                assert part.samples is not None  # the caller gives sampled inputs only
                self.samples[[rows.index(row) for row in part.rows], :, k] = part.samples
        self.u[rows] = self.samples
        self.u_peak = np.max(np.abs(self.samples), axis=1, initial=0.0)
        self.driven = cells.from_samples(inputs[0].hold, rows)

    def _forced(self, a: int, b: int) -> FloatArray:
        after = self.samples[:, np.minimum(np.arange(a + 1, b + 1), self.timepts.size - 1)]
        both = np.concatenate([self.samples[:, a:b], after]).reshape(2 * len(self.rows), (b - a) * self.cases)
        given = (self.driven @ both).reshape(len(self.driven), b - a, self.cases)
        return np.concatenate([given, given], axis=2)

    def _write(self, a: int, b: int, starts: FloatArray, w: FloatArray, sources: FloatArray) -> FloatArray:
        plant, cases = self.plant, self.cases
        y = np.tensordot(plant.C1 @ self.back, starts, axes=1)
        y += np.tensordot(plant.D12, w, axes=1)
        here = self.y[:, a:b]
        here[:] = y[..., :cases]
        here += np.tensordot(plant.D11[:, self.rows], self.samples[:, a:b], axes=1)
        self.x[:, a:b] = np.tensordot(self.back, starts[..., :cases], axes=1)
        self.peak = np.maximum(self.peak, np.max(np.abs(here), axis=1, initial=0.0))
        return y
