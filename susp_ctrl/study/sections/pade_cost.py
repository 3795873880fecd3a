"""What Padé approximations cost in time, order by order, beside the exact delays."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import DelayLTI, characteristic_roots, simulate
from susp_ctrl.errors import PadeOrderWarning
from susp_ctrl.study.sections.time import build_road, record_times
from susp_ctrl.study.sections.workbench import FloatArray, Workbench
from susp_ctrl.study.settings.simulation import PadeSettings, TimeSettings

_ROOTS = 8  # exact roots that are asked for; an approximation always gives all of its own


def pade_cost(
    bench: Workbench, key: str, settings: PadeSettings, case: TimeSettings, omega: FloatArray
) -> pd.DataFrame:
    """Measure simulation, roots and frequency response with exact delays and with every order.

    Each time is the best of `settings.cost_repeats` runs and begins with the loop as the user has it: building the
    approximation is a part of its cost.

    Parameters
    ----------
    bench : Workbench
    key : str
        Design.
    settings : PadeSettings
    case : TimeSettings
        The road and record of the simulation.
    omega : ndarray, shape (n,)
        Frequencies of the response (rad/s).

    Returns
    -------
    DataFrame
        As `PadeCase.cost`.
    """
    loop = bench.loop(key)
    road = build_road(case.road, bench.speed)
    times = case.lead_in + record_times(case)
    inputs = road.inputs(bench.lags)

    def cost(work: Callable[[], object]) -> float:
        return _best(work, settings.cost_repeats)

    rows = [
        (
            0,
            loop.realization.n_states,
            cost(lambda: simulate(loop, times, inputs)),
            cost(lambda: characteristic_roots(loop, _ROOTS)),
            cost(lambda: loop.frequency_response(omega)),
        )
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PadeOrderWarning)
        for order in settings.orders:
            rows.append(
                (
                    order,
                    loop.pade(order).nstates,
                    cost(lambda n=order: _simulated(loop, times, inputs, n)),  # type: ignore[misc]
                    cost(lambda n=order: np.linalg.eigvals(loop.pade(n).A)),  # type: ignore[misc]
                    cost(lambda n=order: loop.pade(n).frequency_response(omega)),  # type: ignore[misc]
                )
            )
    table = pd.DataFrame(rows, columns=["order", "states", "simulation_s", "roots_s", "frequency_s"])
    for name in ("simulation", "roots", "frequency"):
        table[f"{name}_ratio"] = table[f"{name}_s"] / table[f"{name}_s"].iloc[0]
    return table


def _simulated(loop: DelayLTI, times: FloatArray, inputs: Any, order: int) -> None:
    with suppress(
        OverflowError
    ):  # an order that makes the loop unstable costs what it costs until it overflows
        simulate(loop, times, inputs, method="pade", order=order)


def _best(work: Callable[[], object], repeats: int) -> float:
    durations = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        durations.append(time.perf_counter() - started)
    return min(durations)
