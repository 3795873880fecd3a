"""Frequencies at which the responses of a whole box of designs are known well enough, found on a sample of it.

Where a response is sharp or ripples depends on the plant, the weights and the delays of the box. So panels are
halved, and gaps of a grid filled, until nothing changes for the sampled designs any more; what the integrands
do not need costs no node.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import TooMuchWorkError
from susp_ctrl.tuning.objectives.resonance_rule import NODES_PER_PANEL, panel_rule

MOST_NODES = 20_000
# Change of J by the halving of one panel; the error after it is smaller by orders. On the half car random
# designs are then known to 1e-5.
PANEL_TOLERANCE = 1e-5
# Part of the peak by which the search may miss it between two frequencies: it is found exactly in the end.
PEAK_TOLERANCE = 5e-4
COMPETING = 0.9

#: Frequencies (f,) to values of the sampled designs, (n, f, rows).
Integrand = Callable[[FloatArray], FloatArray]


def integration_nodes(
    edges: FloatArray, integrand: Integrand, sensitivity: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights for the integrals of all sampled designs.

    Parameters
    ----------
    edges : ndarray
        Ends of the first panels.
    integrand : callable
        Frequencies (f,) to (n, f, rows).
    sensitivity : callable
        Integrals (n, rows) to the relative change of J with each of them, (n, rows).

    Raises
    ------
    TooMuchWorkError
        If more than 20 000 nodes are needed.
    """
    low, high = edges[:-1], edges[1:]
    whole = _panel_integrals(integrand, low, high)
    total = whole.sum(axis=1)
    starts: list[FloatArray] = []
    while low.size:
        _check_work(NODES_PER_PANEL * (sum(map(len, starts)) + low.size), edges)
        middle = 0.5 * (low + high)
        left, right = np.split(
            _panel_integrals(integrand, np.append(low, middle), np.append(middle, high)), 2, axis=1
        )
        change = left + right - whole
        total = total + change.sum(axis=1)
        of_value = (np.abs(change) * sensitivity(total)[:, None]).sum(axis=-1)
        rough = of_value.max(axis=0) > PANEL_TOLERANCE
        starts.append(low[~rough])
        low, high = np.append(low[rough], middle[rough]), np.append(middle[rough], high[rough])
        whole = np.concatenate([left[:, rough], right[:, rough]], axis=1)
    ends = np.append(np.sort(np.concatenate(starts)), edges[-1])
    return panel_rule(ends[:-1], ends[1:])


def peak_nodes(grid: FloatArray, lines: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return a grid, filled up where the peak of a sampled design lies between its frequencies.

    Parameters
    ----------
    grid : ndarray
    lines : callable
        Frequencies (f,) to J of the sampled designs there, (n, f).

    Raises
    ------
    TooMuchWorkError
        If more than 20 000 frequencies are needed.
    """
    values = lines(grid)
    fresh = np.ones(grid.size - 1, dtype=bool)
    while np.any(fresh):
        gaps = np.flatnonzero(fresh)
        middle = 0.5 * (grid[gaps] + grid[gaps + 1])
        between = lines(middle)
        ends = np.maximum(values[:, gaps], values[:, gaps + 1])
        top = np.maximum(values.max(axis=1), between.max(axis=1))[:, None]
        # only what may become the highest line matters: several peaks compete in the end
        missed = (between > (1.0 + PEAK_TOLERANCE) * ends) & (between > COMPETING * top)
        chosen = np.any(missed, axis=0)
        grid, order = _merged(grid, middle[chosen])
        values = np.concatenate([values, between[:, chosen]], axis=1)[:, order]
        _check_work(grid.size, grid)
        new = order >= grid.size - np.count_nonzero(chosen)
        fresh = new[1:] | new[:-1]
    return grid


def _merged(grid: FloatArray, added: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    both = np.append(grid, added)
    order = np.argsort(both, kind="stable")
    return both[order], order


def _panel_integrals(integrand: Integrand, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the integrals over panels, shape (n, panels, rows)."""
    omega, weights = panel_rule(low, high)
    values = integrand(omega) * weights[:, None]
    return np.asarray(values.reshape(len(values), low.size, NODES_PER_PANEL, -1).sum(axis=2))


def _check_work(count: int, frequencies: FloatArray) -> None:
    if count > MOST_NODES:
        raise TooMuchWorkError(
            f"more than {MOST_NODES} frequencies are needed between {frequencies[0]:g} and "
            f"{frequencies[-1]:g} rad/s for the responses in this box: smaller delay_bounds or gain_bounds, "
            "more damping or a narrower band make it less"
        )
