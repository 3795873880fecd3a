r"""What an approximation of the delays costs, order by order, against the exact system.

Every error is taken against the system with exact delays, and every order shows whether the approximation would
have called the loop stable.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import control
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.delay_systems.pade import HIGHEST_ORDER, pade_approximation
from susp_ctrl.errors import InputError


def compare_pade(
    sys: DelayLTI,
    orders: Iterable[int],
    omega: ArrayLike,
    timepts: ArrayLike | None = None,
    inputs: Any = None,
) -> pd.DataFrame:
    r"""Compare the Padé approximation of several orders with the exact system.

    Parameters
    ----------
    sys : DelayLTI
        System with exact delays.
    orders : iterable of int
        Orders from 1 to 60, common to all delays.
    omega : array_like
        Frequencies (rad/s) of the band, increasing, not negative.
    timepts, inputs : optional
        Time points (s) and inputs as `simulate` takes them; with both given the time error is added.

    Returns
    -------
    pandas.DataFrame
        One row per order:

        order
            Order of the approximation.
        frequency_error
            :math:`\max_{ij} \max_\omega |\hat H_{ij} - H_{ij}| / \max_\omega |H_{ij}|`: the largest error in the
            band relative to the peak in the band, of the worst pair of output i and input j. Pairs without
            response and points where the exact response is infinite are left out.

    Raises
    ------
    InputError
        An order outside 1 to 60, an empty or falling band.
    """
    checked = _orders(orders)
    band = validation.increasing("omega", omega, at_least=0.0)
    points = 1j * band
    exact = _matrix(sys, points)
    rows = []
    for order in checked:
        approximation = pade_approximation(sys, order)
        rows.append(
            {"order": order, "frequency_error": relative_error(_matrix(approximation, points), exact)}
        )
    return pd.DataFrame(rows)


def relative_error(values: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest error along the last axis relative to the peak there, over the worst signal.

    Parameters
    ----------
    values, exact : ndarray, shape (..., points)
        Signals along the last axis. Signals that are zero throughout and points where `exact` is not finite are
        left out.

    Returns
    -------
    float
        nan if nothing is left to compare; inf if `values` is not finite where `exact` is.
    """
    finite = np.isfinite(exact)
    with np.errstate(invalid="ignore"):
        error = np.where(finite, np.abs(values - exact), 0.0).max(axis=-1)
    peak = np.where(finite, np.abs(exact), 0.0).max(axis=-1)
    if not np.any(peak > 0.0):
        return float("nan")
    worst = np.max(error[peak > 0.0] / peak[peak > 0.0])
    return float("inf") if np.isnan(worst) else float(worst)


def _orders(orders: Iterable[int]) -> list[int]:
    given = [orders] if np.ndim(orders) == 0 else list(orders)  # type: ignore[arg-type]
    if not given:
        raise InputError("orders is empty: at least one order is needed")
    return [
        validation.integer(f"orders[{k}]", order, at_least=1, at_most=HIGHEST_ORDER)
        for k, order in enumerate(given)
    ]


def _matrix(sys: DelayLTI | control.StateSpace, points: np.ndarray) -> np.ndarray:
    """Response of shape (outputs, inputs, points), also of a single-input single-output system."""
    return np.asarray(sys(points, squeeze=False, warn_infinite=False))
