"""What a simulation starts from, what it remembers on its way and what it leaves behind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators.cells import GaussRule
from susp_ctrl.delay_systems.integrators.input_signals import Inputs
from susp_ctrl.delay_systems.model import FoldedLoop

# Share of an output's peak above which it jumps.
_JUMP = 1e-7


@dataclass(frozen=True)
class Past:
    """What happened before the start of a run.

    Attributes
    ----------
    start : float
        Time at which the run begins.
    state : ndarray, shape (n_states, cases)
        State at the start.
    delayed : callable or None
        ``times -> z (channels, times, cases)`` before the start; None for zero.
    kinks : tuple of float
        Times at which the delayed signals are not smooth, the start included where history and run do not fit.
    looks : ndarray or None
        Times before the start at which polynomials are held against `delayed`, where a caller's function gives it.
    """

    start: float
    state: FloatArray
    delayed: Callable[[FloatArray], FloatArray] | None = None
    kinks: tuple[float, ...] = ()
    looks: FloatArray | None = None

    def case(self, number: int) -> Past:
        """Return the past of one case."""
        if self.state.shape[1] == 1:
            return self
        delayed = self.delayed
        own = slice(number, number + 1)
        alone = None if delayed is None else lambda times: delayed(times)[:, :, own]
        return Past(self.start, self.state[:, own], alone, self.kinks)


def side_by_side(pasts: Sequence[Past]) -> Past:
    """Return the pasts of several cases, which start at one time, as one."""
    if len(pasts) == 1:
        return pasts[0]
    kinks = tuple(sorted({t for past in pasts for t in past.kinks}))
    state = np.hstack([past.state for past in pasts])
    if all(past.delayed is None for past in pasts):
        return Past(pasts[0].start, state, None, kinks)
    known = [past.delayed for past in pasts if past.delayed is not None]

    def delayed(times: FloatArray) -> FloatArray:
        return np.concatenate([one(times) for one in known], axis=2)

    return Past(pasts[0].start, state, delayed, kinks, pasts[0].looks)


@dataclass(frozen=True)
class Run:
    """A finished run: samples of all signals, error estimate, and the memory to go on from.

    Attributes
    ----------
    outputs, states, inputs : ndarray, shape (signals, times, cases)
        Samples at the output times.
    error, peak : ndarray, shape (outputs, cases)
        Estimated largest error, absolute, and largest magnitude.
    rounding : ndarray or float, shape (outputs, cases)
        Part of the error that is rounding of larger signals, which no accuracy of the method removes.
    past : Past
        Where a following run begins.
    cells : int
        Number of cells taken.
    """

    outputs: FloatArray
    states: FloatArray
    inputs: FloatArray
    error: FloatArray
    peak: FloatArray
    past: Past
    cells: int
    rounding: FloatArray | float = 0.0

    @property
    def relative_error(self) -> FloatArray:
        """Error beyond rounding relative to each output's peak, shape (outputs, cases); zero for a zero output."""
        return np.maximum(self.error - self.rounding, 0.0) / np.maximum(self.peak, np.finfo(float).tiny)


def with_last_instant(loop: FoldedLoop, inputs: Sequence[Inputs], run: Run, end: float) -> Run:
    """Return a run whose last outputs are those after a jump at the last instant, as everywhere else.

    The cell that ends there knows the inputs before it: ``y = C x + D u + D_12 w`` with what holds from then on.
    Outputs that do not jump stay as they were marched.
    """
    plant, tau = loop
    past = run.past
    if tau.size and past.delayed is None and np.any(plant.D12):
        return run
    u = np.stack([one.at(np.array([end]))[:, 0] for one in inputs], axis=-1)
    y = plant.C1 @ run.states[:, -1] + plant.D11 @ u
    if past.delayed is not None and np.any(plant.D12):
        y = y + plant.D12 @ np.stack([past.delayed(np.array([end - d]))[k, 0] for k, d in enumerate(tau)])
    jumps = np.abs(y - run.outputs[:, -1]) > np.maximum(_JUMP * run.peak, 1e3 * (run.error + run.rounding))
    if not np.any(jumps):
        return run
    outputs = run.outputs.copy()
    outputs[:, -1] = np.where(jumps, y, outputs[:, -1])
    return replace(run, outputs=outputs, peak=np.maximum(run.peak, np.abs(outputs[:, -1])))


def superposed(one: Run, other: Run) -> Run:
    """Return the sum of two runs of one system over the same times."""
    outputs = one.outputs + other.outputs
    a, b = one.past, other.past
    parts = [past.delayed for past in (a, b) if past.delayed is not None]

    def delayed(times: FloatArray) -> FloatArray:
        return np.asarray(sum(part(times) for part in parts))

    kinks = tuple(sorted({*a.kinks, *b.kinks}))
    return Run(
        outputs,
        one.states + other.states,
        one.inputs + other.inputs,
        one.error + other.error,
        np.max(np.abs(outputs), axis=1, initial=0.0),
        Past(a.start, a.state + b.state, delayed if parts else None, kinks),
        one.cells + other.cells,
        one.rounding + other.rounding,
    )


class SignalMemory:
    """Delayed signals z on the cells of a run; cell 0 stands for everything before it.

    Parameters
    ----------
    delays : ndarray, shape (channels,)
        Positive delays in seconds.
    rule : GaussRule
        Nodes of the cells.
    past : Past
        What happened before.
    cases : int
        Number of cases; each has a second column, its companion of lower degree.
    short : float
        Length (s) below which cells may be so short because a drive jumps there.
    """

    def __init__(self, delays: FloatArray, rule: GaussRule, past: Past, cases: int, short: float) -> None:
        self.delays, self.rule, self.past, self.cases, self.short = delays, rule, past, cases, short
        self.count = 1
        self.starts, self.lengths = np.full(1024, -np.inf), np.full(1024, np.inf)
        self.values = np.zeros((1024, delays.size, rule.size, 2 * cases))

    def announce(self, starts: FloatArray, lengths: FloatArray) -> int:
        """Place cells after those that are kept; return the number of the first one."""
        first, last = self.count, self.count + starts.size
        held = self.starts.size
        if last > held:
            more = max(last, 2 * held) - held
            self.values = np.concatenate([self.values, np.zeros((more, *self.values.shape[1:]))])
            self.starts = np.append(self.starts, np.zeros(more))
            self.lengths = np.append(self.lengths, np.zeros(more))
        self.starts[first:last], self.lengths[first:last] = starts, lengths
        return first

    def record(self, cells: slice, z: FloatArray) -> None:
        """Remember z, shape (channels, N, cells, columns); the companions lose their highest coefficients."""
        kept = self.values[cells]
        kept[:] = z.transpose(2, 0, 1, 3)
        kept[..., self.cases :] = self.rule.truncation @ kept[..., self.cases :]

    def earlier(self, starts: FloatArray, offsets: FloatArray, cells: np.ndarray, known: int) -> FloatArray:
        """Return z(t - tau) at the nodes as far as it comes from before each cell.

        Parameters
        ----------
        starts : ndarray, shape (cells,)
            Starts of the cells.
        offsets : ndarray, shape (N,)
            Nodes relative to the start.
        cells : ndarray of int, shape (cells,)
            Numbers of the cells.
        known : int
            Cells that are placed: all up to the last of `cells`.

        Returns
        -------
        ndarray, shape (channels, N, cells, columns)
        """
        shape = (self.delays.size, offsets.size, starts.size)
        times = offsets[:, None] + starts - self.delays[:, None, None]
        source = np.searchsorted(self.starts[:known], times, side="right") - 1
        past = times < self.past.start
        source[(source == cells) | past] = 0
        live = source > 0
        values = np.zeros((*shape, self.values.shape[-1]))
        number = source[live]
        point = 2.0 * (times[live] - self.starts[number]) / self.lengths[number] - 1.0
        held, channels, *node_values = self.values.shape
        flat = self.values.reshape(held * channels, *node_values)
        channel = np.broadcast_to(np.arange(shape[0])[:, None, None], shape)[live]
        values[live] = np.einsum("an,anm->am", self.rule.rows(point), flat[number * shape[0] + channel])
        if self.past.delayed is not None and np.any(past):
            for k in range(shape[0]):
                if np.any(past[k]):
                    before = self.past.delayed(times[k][past[k]])[k]
                    values[k][past[k]] = np.concatenate([before, before], axis=-1)
                if self.past.looks is not None and np.any(old := np.all(past[k], axis=0)):
                    before = values[k][:, old, self.cases :]
                    jumps = bool(offsets[-1] < self.short)
                    values[k][:, old, self.cases :] = self.rule.companion(before, jumps)
        return values

    def as_past(self, end: float, state: FloatArray, kinks: tuple[float, ...]) -> Past:
        """Return what a run that begins at `end` has to know."""
        count, rule, before = self.count, self.rule, self.past.delayed
        starts, lengths = self.starts[:count], self.lengths[:count]
        kept = self.values[:count, :, :, : self.cases]

        def delayed(times: FloatArray) -> FloatArray:
            source = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, count - 1)
            values = np.zeros((kept.shape[1], times.size, kept.shape[3]))
            live = source > 0
            point = 2.0 * (times[live] - starts[source[live]]) / lengths[source[live]] - 1.0
            values[:, live] = np.einsum("an,aknm->kam", rule.rows(point), kept[source[live]])
            if before is not None and not np.all(live):
                values[:, ~live] = before(times[~live])
            return values

        return Past(end, state, delayed, kinks)
