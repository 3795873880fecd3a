"""What a run remembers of its delayed signals: their polynomials on every cell taken so far."""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators.cells import GaussRule
from susp_ctrl.delay_systems.integrators.trajectory import Past


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
    """

    def __init__(self, delays: FloatArray, rule: GaussRule, past: Past, cases: int) -> None:
        self.delays, self.rule, self.past, self.cases = delays, rule, past, cases
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
