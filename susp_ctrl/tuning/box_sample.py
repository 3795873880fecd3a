"""A sample of the designs a search may meet: they show which frequencies matter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from susp_ctrl.arrays import FloatArray
from susp_ctrl.tuning.feasibility import StabilityTest

SIZE = 32
_CANDIDATES, _BATCHES, _FEW = 48, 8, 8  # the few stand in where no stable design is found


def box_sample(
    lower: FloatArray,
    upper: FloatArray,
    delay_factors: FloatArray,
    fixed: tuple[FloatArray, FloatArray],
    test: StabilityTest,
) -> tuple[FloatArray, FloatArray]:
    """Return gains and delays (n, channels) of designs of a box, stable ones as far as some are found.

    Parameters
    ----------
    lower, upper : ndarray, shape (2 m,)
        The box of ``[gains..., delays...]``.
    delay_factors : ndarray, shape (corners, m)
        What the delays may be multiplied by.
    fixed : (ndarray, ndarray)
        Gains and delays of the vehicle's own channels, which come first.
    test : StabilityTest
    """
    rng = np.random.default_rng(0)
    m = lower.size // 2
    idle = np.concatenate([np.zeros(m), lower[m:]])[None]
    found: list[FloatArray] = [idle[_stable(idle, fixed, test)]]
    for _ in range(_BATCHES):
        points = lower + rng.random((_CANDIDATES, 2 * m)) * (upper - lower)
        # large gains are seldom stable: every second design has smaller ones; every fourth the longest delays
        points[::2, :m] *= 10.0 ** (-2.0 * rng.random((points[::2].shape[0], 1)))
        points[::4, m:] = upper[m:]
        points = np.clip(points, lower, upper)
        points[:, m:] *= delay_factors[rng.integers(len(delay_factors), size=_CANDIDATES)]
        found.append(points[_stable(points, fixed, test)])
        if sum(map(len, found)) >= SIZE:
            break
    chosen = np.concatenate(found)[:SIZE]
    return _spread(chosen if len(chosen) else points[:_FEW], fixed)


def _stable(
    points: FloatArray, fixed: tuple[FloatArray, FloatArray], test: StabilityTest
) -> NDArray[np.bool_]:
    return np.asarray(test.violations(*_spread(points, fixed)) == 0)


def _spread(points: FloatArray, fixed: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return gains and delays of designs, those of the vehicle's own channels first."""
    gains, delays = (
        np.hstack([np.tile(own, (len(points), 1)), part])
        for own, part in zip(fixed, np.split(points, 2, axis=1), strict=True)
    )
    return gains, delays
