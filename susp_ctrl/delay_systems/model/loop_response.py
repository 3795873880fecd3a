"""Response of a closed loop at given points, exact delays or any replacement of them."""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import ComplexArray
from susp_ctrl.delay_systems.model.lft import Realization, lft_response, sample_plant

# Near a pole of P that the loop moves, P22 is large and H comes from P by cancellation. Beyond this size (three
# digits) the closed matrix is solved directly.
_LARGE_RETURN = 1e3


def loop_response(plant: Realization, s: ComplexArray, E: ComplexArray) -> ComplexArray:
    """Return ``P11 + P12 E (I - P22 E)^-1 P21`` at points s, also at and near poles of P.

    Parameters
    ----------
    plant : Realization
        The undelayed plant P.
    s : ndarray of complex, shape (points,)
        Points of the complex plane.
    E : ndarray of complex, shape (points, channels)
        What stands for the delay of each channel, ``g_k e^{-s tau_k}`` or an approximation of it.

    Returns
    -------
    ndarray of complex, shape (points, outputs, inputs)
    """
    P = sample_plant(plant, s)
    with np.errstate(invalid="ignore", over="ignore"):
        values = lft_response(P, E)
    around_pairs = np.abs(P.p22 * np.swapaxes(P.p22, 1, 2)).max(axis=(1, 2), initial=0.0)
    direct = ~(around_pairs < _LARGE_RETURN**2) | ~np.isfinite(values).all(axis=(1, 2))
    if np.any(direct):
        values[direct] = _evaluate_directly(plant, s[direct], E[direct])
    return values


def _evaluate_directly(plant: Realization, s: ComplexArray, E: ComplexArray) -> ComplexArray:
    """Solve the closed loop's matrix itself: valid at poles of the open plant, slower."""
    A, B, C, D = plant.closed_plant(E)
    away = s[:, None, None] * np.eye(plant.n_states) - A
    regular = np.ones(s.size, dtype=bool)
    try:
        state = np.linalg.solve(away, B)
    except np.linalg.LinAlgError:
        regular = np.linalg.cond(away) < 1e15
        state = np.zeros(B.shape, dtype=complex)
        state[regular] = np.linalg.solve(away[regular], B[regular])
    values: ComplexArray = C @ state + D
    # at a pole of the loop, as python-control has it
    values[~regular] = complex(np.inf, np.nan)
    return values
