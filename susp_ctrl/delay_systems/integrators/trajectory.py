"""What a simulation starts from and what it leaves behind, whatever the method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from susp_ctrl.arrays import FloatArray


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
    """

    start: float
    state: FloatArray
    delayed: Callable[[FloatArray], FloatArray] | None = None
    kinks: tuple[float, ...] = ()

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

    return Past(pasts[0].start, state, delayed, kinks)


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
