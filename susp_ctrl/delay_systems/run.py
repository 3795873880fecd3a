"""What a simulation starts from and what it leaves behind, whatever the method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from susp_ctrl.delay_systems.lft import FloatArray


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


@dataclass(frozen=True)
class Run:
    """A finished run: samples of all signals, error estimate, and the memory to go on from.

    Attributes
    ----------
    outputs, states, inputs : ndarray, shape (signals, times, cases)
        Samples at the output times.
    error, peak : ndarray, shape (outputs, cases)
        Estimated largest error, absolute, and largest magnitude.
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

    @property
    def relative_error(self) -> FloatArray:
        """Error relative to each output's peak, shape (outputs, cases); zero for an output that is zero."""
        return self.error / np.maximum(self.peak, np.finfo(float).tiny)
