r"""Exact simulation under inputs given as samples on a uniform grid, at rest before the start.

The cells are the sampling intervals (`uniform_march`). The forced response to the samples
is exact; what is approximated are the delayed signals, by polynomials on each cell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from susp_ctrl.delay_systems.integrators.cells import PlantCoordinates, gauss_rule
from susp_ctrl.delay_systems.integrators.input_signals import Inputs
from susp_ctrl.delay_systems.integrators.trajectory import Run
from susp_ctrl.delay_systems.integrators.uniform_cells import FASTEST_DECAY, UniformCells
from susp_ctrl.delay_systems.integrators.uniform_march import UniformMarch
from susp_ctrl.delay_systems.model.folding import FoldedLoop
from susp_ctrl.delay_systems.model.lft import FloatArray

_EPS = float(np.finfo(float).eps)
_NODES = (6, 8, 10, 14, 20)
_FEWEST_CELLS = 8  # shortest delay in cells below which blocks are too short to pay


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
        both = np.concatenate([self.samples[:, a:b], after]).reshape(-1, (b - a) * self.cases)
        given = (self.driven @ both).reshape(-1, b - a, self.cases)
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
