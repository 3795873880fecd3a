"""The past of a run, from whatever a caller gives as `history`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators import LOOKS, Inputs, Past, announced_breakpoints, looking_times
from susp_ctrl.delay_systems.model import DelaySystem, Realization
from susp_ctrl.delay_systems.simulation.simulation_response import SimulationResponse
from susp_ctrl.delay_systems.simulation.sinusoidal import phasors, sum_of_lines
from susp_ctrl.errors import InputError


def past_of(system: DelaySystem, history: Any, signals: Inputs) -> Past:
    """Return the past a caller describes by `history`."""
    n = system.nstates
    if history is None:
        return Past(0.0, np.zeros((n, 1)), None, (0.0,))
    if isinstance(history, SimulationResponse):
        past = getattr(history, "past", None)
        if past is None or past.state.shape[0] != n:
            raise InputError(
                "history cannot be continued: the response of an exact run of this system is needed"
            )
        return past
    if callable(history):
        state = _history_values(history, np.zeros(1), n)
        kinks = validation.vector("history.breakpoints", announced_breakpoints(history))
        function: Callable[[FloatArray], FloatArray] = lambda t: _history_values(history, t, n)  # noqa: E731
        longest = float(np.max(system.folded.delays, initial=0.0))
        step = 0.5 * (longest / LOOKS if signals.resolution is None else signals.resolution)
        looks = looking_times(np.array([-longest, 0.0]), step) if longest > 0.0 else None
        return Past(0.0, state, _delayed_before(system, function), (*kinks.tolist(), 0.0), looks)
    if isinstance(history, str):
        validation.one_of("history", history, ("steady",))
        lines = phasors(system, signals, "history = 'steady'")

        def steady(times: FloatArray) -> FloatArray:
            return sum_of_lines(lines.omegas, lines.delayed, times)[:, :, None]

        return Past(0.0, np.imag(lines.states.sum(axis=1))[:, None], steady, ())
    constant = validation.vector("history", history, size=n)[:, None]
    return Past(0.0, constant, _delayed_before(system, lambda t: np.repeat(constant, t.size, axis=1)), (0.0,))


def _history_values(history: Any, times: FloatArray, n: int) -> FloatArray:
    values = validation.array("what history returns", history(times), finite=False)
    if values.ndim == 1 and n == 1:
        values = values[None]
    if values.shape != (n, times.size):
        raise InputError(
            f"history returns shape {values.shape} for {times.size} times: ({n}, {times.size}) is needed"
        )
    if not np.all(np.isfinite(values)):
        raise InputError("history returns numbers that are not finite")
    return values


def _delayed_before(
    system: DelaySystem, state: Callable[[FloatArray], FloatArray]
) -> Callable[[FloatArray], FloatArray]:
    """Return z before the run, ``z = C2 x + D22 w``, from the state's history."""
    plant, delays = system.folded
    return lambda times: _z_before(plant, delays, state, times)[:, :, None]


def _z_before(
    plant: Realization, delays: FloatArray, state: Callable[[FloatArray], FloatArray], times: FloatArray
) -> FloatArray:
    z = plant.C2 @ state(times)
    for k in np.flatnonzero(np.any(plant.D22 != 0.0, axis=0)):
        # D22 is nilpotent, so that this ends
        into = np.flatnonzero(plant.D22[:, k])
        earlier = _z_row_before(plant, delays, state, times - delays[k], int(k))
        z[into] += plant.D22[into, k][:, None] * earlier
    return z


def _z_row_before(
    plant: Realization,
    delays: FloatArray,
    state: Callable[[FloatArray], FloatArray],
    times: FloatArray,
    row: int,
) -> FloatArray:
    z = plant.C2[row] @ state(times)
    for k in np.flatnonzero(plant.D22[row]):
        z = z + plant.D22[row, k] * _z_row_before(plant, delays, state, times - delays[k], int(k))
    return z
