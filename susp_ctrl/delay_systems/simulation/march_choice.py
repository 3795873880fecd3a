"""Which march takes which inputs: each declares what suits it, and here one is chosen.

The responses to different inputs and to the past add up. What has very many kinks is marched from rest over cells of
one length, the rest by the method of steps, which takes everything.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators import (
    Inputs,
    Past,
    Run,
    TooCoarseError,
    kinked_march,
    method_of_steps,
    sampled_march,
    superposed,
)
from susp_ctrl.delay_systems.model import FoldedLoop

# The marches from rest, the fastest first.
FROM_REST = (sampled_march, kinked_march)


def run_exact(
    loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, past: Past, rtol: float
) -> Run:
    """Simulate one system with exact delays for one or several inputs at once.

    Parameters
    ----------
    loop : FoldedLoop
        Plant with unit gains and positive delays.
    inputs : sequence of Inputs
        One for each case; all cases share the cells.
    timepts : ndarray
        Increasing output times, none before ``past.start``.
    past : Past
        Initial state and history.
    rtol : float
        Wanted error relative to each output's peak.

    Raises
    ------
    OverflowError
        The response of an unstable loop leaves the range of floating point numbers.
    """
    for march in FROM_REST:
        own, others = march.share(inputs)
        if not march.suits(loop, own, timepts, past.start, rtol):
            continue
        try:
            run = march.run(loop, own, timepts, past.start, rtol)
        except TooCoarseError:
            continue
        quiet = past.delayed is None and not np.any(past.state) and not any(i.parts for i in others)
        return run if quiet else superposed(run, run_exact(loop, others, timepts, past, rtol))
    return method_of_steps.run(loop, inputs, timepts, past, rtol)
