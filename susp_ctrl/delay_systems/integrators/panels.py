r"""A panel: consecutive cells taken together.

The cells of a panel repeat a pattern of a few lengths (mostly one). What does not depend on the order of the
cells, the response to inputs and the outputs, is computed for all cells of one length at once; the march from
cell to cell is one small matrix product per cell, or, where all delayed signals are known beforehand, one
recursion along the panel for each coordinate of the plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.integrators.cells import CellOperator, GaussRule, PlantCoordinates, cell_operator
from susp_ctrl.delay_systems.integrators.input_signals import Inputs
from susp_ctrl.delay_systems.integrators.trajectory import SignalMemory
from susp_ctrl.delay_systems.model import FoldedLoop

_MOST_OPERATORS = 256
# Fewer cells than this are taken one by one faster than by recursions along them.
_WORTH_A_SCAN = 12
_INSIDE = 1e-7  # of a cell


@dataclass
class CellGroup:
    """All cells of one length in a panel; signals have shape (signals, N, cells, columns)."""

    starts: FloatArray
    length: float
    operator: CellOperator
    u: FloatArray
    U: FloatArray
    forcing: ComplexArray
    given: FloatArray
    w: FloatArray
    z: FloatArray
    xi: FloatArray


@dataclass
class Places:
    """Where times fall into the cells of one length: numbers of times and cells, and rows that interpolate there."""

    times: NDArray[np.intp]
    cells: NDArray[np.intp]
    across: FloatArray

    def values(self, signal: FloatArray) -> FloatArray:
        """Return a signal of shape (signals, N, cells, columns) at the times, shape (signals, times, columns)."""
        count = signal.shape[2]
        if self.times.size < 4 * count:
            return np.asarray(np.einsum("tn,sntc->stc", self.across, signal[:, :, self.cells]))
        bounds = np.searchsorted(self.cells, np.arange(count + 1))
        found = np.empty((signal.shape[0], self.times.size, signal.shape[3]))
        for i in range(count):
            some = slice(bounds[i], bounds[i + 1])
            found[:, some] = self.across[some] @ signal[:, :, i]
        return found


def ends(g: CellGroup, rule: GaussRule) -> tuple[FloatArray, Places]:
    """Return times just inside the ends of all cells: a jump there lies before the first or after the last node."""
    count = g.starts.size
    inside = np.maximum(_INSIDE * g.length, 32.0 * np.finfo(float).eps * np.abs(g.starts))
    inside = np.minimum(inside, 0.5 * g.length)
    times = np.stack([g.starts + inside, g.starts + (g.length - inside)], axis=1).ravel()
    cells = np.repeat(np.arange(count), 2)
    point = 2.0 * (times - g.starts[cells]) / g.length - 1.0
    return times, Places(np.arange(2 * count), cells, rule.rows(point))


def places(groups: Sequence[CellGroup], times: FloatArray, rule: GaussRule, near: float) -> list[Places]:
    """Return where increasing times inside a panel fall; one that is `near` a start belongs to that cell."""
    turns = len(groups)
    starts = np.stack([g.starts for g in groups], axis=1).ravel()
    cell = np.clip(np.searchsorted(starts - near, times, side="right") - 1, 0, starts.size - 1)
    found = []
    for j, g in enumerate(groups):
        chosen = np.flatnonzero(cell % turns == j) if turns > 1 else np.arange(times.size)
        here = cell[chosen] // turns
        across = rule.rows(2.0 * (times[chosen] - g.starts[here]) / g.length - 1.0)
        found.append(Places(chosen, here, across))
    return found


class PanelSolver:
    """Solves panels of one loop.

    Parameters
    ----------
    loop : FoldedLoop
        Plant with unit gains and positive delays.
    inputs : sequence of Inputs
        One for each case.
    rule : GaussRule
        Nodes of the cells.
    memory : SignalMemory
        Delayed signals so far; the solver records into it.
    span : float
        Longest time that occurs, which sets the rounding of times.
    """

    def __init__(
        self, loop: FoldedLoop, inputs: Sequence[Inputs], rule: GaussRule, memory: SignalMemory, span: float
    ) -> None:
        self.plant, self.delays, self.inputs, self.rule, self.memory = *loop, inputs, rule, memory
        self.coordinates = PlantCoordinates(self.plant)
        self.shortest = float(np.min(self.delays, initial=np.inf))
        self.cases = len(inputs)
        self.rounding = 16.0 * float(np.finfo(float).eps) * span
        self._operators: dict[int, CellOperator] = {}

    def group(self, starts: FloatArray, length: float) -> CellGroup:
        """Evaluate the inputs on cells of one length."""
        offsets = 0.5 * length * (1.0 + self.rule.nodes)
        u = np.stack([i.on_cells(starts, offsets) for i in self.inputs], axis=-1)
        U = np.concatenate([u, self.rule.companion(u, length < self.memory.short)], axis=-1)
        empty, later = np.empty(0), np.empty(0, dtype=complex)
        return CellGroup(starts, length, self._operator(length), u, U, later, empty, empty, empty, empty)

    def solve(self, groups: Sequence[CellGroup], start: FloatArray) -> FloatArray:
        """March through a panel whose cells take turns in `groups`; return the coordinates at its end.

        Parameters
        ----------
        groups : sequence of CellGroup
            The k-th cells of all groups follow each other, then the (k+1)-th cells.
        start : ndarray, shape (2 r, columns)
            Real and imaginary parts of the coordinates at the start.
        """
        c, K, N, m = self.coordinates, self.delays.size, self.rule.size, 2 * self.cases
        turns, P = len(groups), groups[0].starts.size
        for g in groups:
            self._respond_to_inputs(g)
        starts = np.stack([g.starts for g in groups], axis=1)
        first = self.memory.announce(starts.ravel(), np.tile([g.length for g in groups], P))
        reach = self.shortest / sum(g.length for g in groups) * (1.0 - 1e-12)
        block = P if K == 0 else int(np.clip(reach, 1, P))
        scanned = (
            c.diagonal and block * turns >= _WORTH_A_SCAN and all(g.operator.own is None for g in groups)
        )
        known = start
        for a in range(0, P, block):
            b = min(a + block, P)
            earlier = []
            for j, g in enumerate(groups):
                cells = first + turns * np.arange(a, b) + j
                offsets = 0.5 * g.length * (1.0 + self.rule.nodes)
                w = self.memory.earlier(g.starts[a:b], offsets, cells, first + turns * b)
                earlier.append(w.reshape(K * N, b - a, m))
            known = (self._scan if scanned else self._one_by_one)(groups, earlier, slice(a, b), known)
            z = np.empty((K, N, (b - a) * turns, m))
            for j, g in enumerate(groups):
                if g.operator.own is not None:
                    inside = g.z[:, :, a:b].reshape(K * N, b - a, m)
                    earlier[j] = earlier[j] + np.tensordot(g.operator.own, inside, axes=1)
                g.w[:, :, a:b] = earlier[j].reshape(K, N, b - a, m)
                z[:, :, j::turns] = g.z[:, :, a:b]
            self.memory.record(slice(first + turns * a, first + turns * b), z)
        return known

    def states_and_outputs(self, g: CellGroup) -> tuple[FloatArray, FloatArray]:
        """Return x and y at the nodes of a solved group."""
        c, plant, r = self.coordinates, self.plant, self.coordinates.size
        P, m = g.starts.size, 2 * self.cases
        forcing = g.forcing + np.tensordot(c.B2, g.w, axes=1).reshape(r, self.rule.size, P * m)
        start: ComplexArray = (g.xi[:r] + 1j * g.xi[r:]).reshape(r, P * m)
        nodes, _ = g.operator.response.respond(forcing, start)
        x = np.tensordot(c.back, nodes, axes=1).real.reshape(plant.n_states, self.rule.size, P, m)
        y = np.tensordot(plant.C1, x, axes=1)
        y += np.tensordot(plant.D11, g.U, axes=1)
        y += np.tensordot(plant.D12, g.w, axes=1)
        return x, y

    def _operator(self, length: float) -> CellOperator:
        key = round(length / self.rounding)
        if key not in self._operators:
            if len(self._operators) > _MOST_OPERATORS:
                self._operators.clear()
            self._operators[key] = cell_operator(self.plant, self.delays, self.coordinates, self.rule, length)
        return self._operators[key]

    def _respond_to_inputs(self, g: CellGroup) -> None:
        """Prepare a group: response of z and of the cell's end to the inputs alone."""
        c, plant, K, N = self.coordinates, self.plant, self.delays.size, self.rule.size
        P, m, r = g.starts.size, 2 * self.cases, self.coordinates.size
        g.forcing = np.tensordot(c.B1, g.U, axes=1).reshape(r, N, P * m).astype(complex, copy=False)
        nodes, end = g.operator.response.respond(g.forcing, np.zeros((r, P * m), dtype=complex))
        z = np.tensordot(plant.C2 @ c.back, nodes, axes=1).real
        z += np.tensordot(plant.D21, g.U.reshape(plant.n_inputs, N, P * m), axes=1)
        given = np.concatenate([z.reshape(K * N, P * m), end.real, end.imag]).reshape(K * N + 2 * r, P, m)
        if g.operator.input_to_march is not None:
            given = np.tensordot(g.operator.input_to_march, given, axes=1)
        g.given = given
        g.w, g.z, g.xi = np.empty((K, N, P, m)), np.empty((K, N, P, m)), np.empty((2 * r, P, m))

    def _one_by_one(
        self, groups: Sequence[CellGroup], earlier: Sequence[FloatArray], cells: slice, known: FloatArray
    ) -> FloatArray:
        K, N = self.delays.size, self.rule.size
        KN, m = K * N, known.shape[1]
        vector = np.empty((KN + known.shape[0], m))
        for i in range(cells.start, cells.stop):
            for g, w in zip(groups, earlier, strict=True):
                vector[:KN], vector[KN:] = w[:, i - cells.start], known
                g.xi[:, i] = known
                result = g.operator.march @ vector
                result += g.given[:, i]
                g.z[:, :, i] = result[:KN].reshape(K, N, m)
                known = result[KN:]
        return known

    def _scan(
        self, groups: Sequence[CellGroup], earlier: Sequence[FloatArray], cells: slice, known: FloatArray
    ) -> FloatArray:
        """Take many cells whose delayed signals are all known: one recursion for each coordinate."""
        KN, r = self.delays.size * self.rule.size, self.coordinates.size
        local: list[FloatArray] = []
        factor = np.ones(r, dtype=complex)
        drive: Any = 0.0
        for g, w in zip(groups, earlier, strict=True):
            local.append(np.tensordot(g.operator.march[:, :KN], w, axes=1) + g.given[:, cells])
            e = g.operator.response.end_free
            drive = e[:, None, None] * drive + local[-1][KN : KN + r] + 1j * local[-1][KN + r :]
            factor = factor * e
        start = known[:r] + 1j * known[r:]
        states = np.empty((r, cells.stop - cells.start + 1, known.shape[1]), dtype=complex)
        states[:, 0] = start
        for i in range(r):
            states[i, 1:], _ = scipy.signal.lfilter(
                [1.0], [1.0, -factor[i]], drive[i], axis=0, zi=factor[i] * start[i][None]
            )
        here = states[:, :-1]
        for g, own in zip(groups, local, strict=True):
            xi = np.concatenate([here.real, here.imag])
            g.xi[:, cells] = xi
            z = own[:KN] + np.tensordot(g.operator.march[:KN, KN:], xi, axes=1)
            g.z[:, :, cells] = z.reshape(g.z[:, :, cells].shape)
            here = g.operator.response.end_free[:, None, None] * here + own[KN : KN + r] + 1j * own[KN + r :]
        return np.concatenate([states[:, -1].real, states[:, -1].imag])
