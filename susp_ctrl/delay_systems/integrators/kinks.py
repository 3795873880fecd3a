r"""Where the solution is not smooth: kinks and jumps, carried through the delays as far as they matter.

A kink of a delayed signal returns one delay later, smoothed by the plant. What a cell of length h with N nodes
cannot resolve are frequencies above ``omega* = 2N/h``; there one pass from channel l to channel k weakens it by
``|P22_kl(j omega*)|``. A kink is followed until the product of these weights falls below a tolerance.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import Realization, balancing, sample_plant

# Many incommensurate delays combine to very many kinks, each of them weak: the cells' error control sees to the rest.
_MOST_KINKS = 3000
# With more kinks in the inputs than this each is followed through one delay only.
MANY_KNOTS = 100


def propagated_kinks(
    plant: Realization,
    delays: FloatArray,
    sources: Iterable[float],
    end: float,
    omega: float,
    cut: float,
    nearest: float,
) -> FloatArray:
    """Return the times of all kinks in the delayed signals that matter, sources included.

    Parameters
    ----------
    plant : Realization
        Folded plant.
    delays : ndarray, shape (channels,)
        Positive delays in seconds.
    sources : iterable of float
        Times of kinks in input or history.
    end : float
        End of the run; later kinks are dropped.
    omega : float
        Frequency above which cells do not resolve (rad/s).
    cut : float
        Weight below which a kink is dropped; a source has weight one.
    nearest : float
        Kinks closer than this are taken as one.

    Returns
    -------
    ndarray
        Increasing times.
    """
    K = delays.size
    start_times = sorted({float(t) for t in sources if t < end})
    if K == 0:
        return _merged(np.array(start_times), nearest)
    weight = np.abs(sample_plant(plant, np.array([1j * omega])).p22[0])
    weight = np.where(np.isfinite(weight), weight, 1.0)
    # units of the channels do not matter: the weights are compared in balanced units
    units = balancing(weight)
    weight = weight / units[:, None] * units
    heap: list[tuple[float, int]] = [(t, -1) for t in start_times]
    heapq.heapify(heap)
    weights_of: dict[int, FloatArray] = {-1: np.ones(K)}
    found: list[float] = []
    number = 0
    while heap and len(found) < _MOST_KINKS:
        time, key = heapq.heappop(heap)
        here = weights_of[key] if key < 0 else weights_of.pop(key)
        while heap and heap[0][0] - time <= nearest:
            _, other = heapq.heappop(heap)
            here = np.maximum(here, weights_of[other] if other < 0 else weights_of.pop(other))
        found.append(time)
        for k in np.flatnonzero(here > cut):
            if time + delays[k] < end:
                weights_of[number] = here[k] * weight[:, k]
                heapq.heappush(heap, (time + float(delays[k]), number))
                number += 1
    found.extend(t for t, key in heap if key < 0)
    return _merged(np.array(sorted(found)), nearest)


def _merged(times: FloatArray, nearest: float) -> FloatArray:
    if times.size == 0:
        return times
    return times[np.append(True, np.diff(times) > nearest)]
