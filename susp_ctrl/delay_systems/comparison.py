r"""What an approximation of the delays costs, order by order, against the exact system.

Two approximations by ordinary systems stand side by side: Padé (all-pass, its error is phase) and the Chebyshev
discretisation of the delayed signals (spectral). Every error is taken against exact delays, and every order shows
whether the approximation would have called the loop stable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from numbers import Integral
from typing import Any, NamedTuple

import control
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.approximation import HIGHEST_ORDER, pade_approximation, spectral_approximation
from susp_ctrl.delay_systems.connections import delay
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.delay_systems.model import loop_response
from susp_ctrl.delay_systems.roots import characteristic_roots
from susp_ctrl.delay_systems.simulation import simulate
from susp_ctrl.delay_systems.verdict import stability
from susp_ctrl.errors import InputError

Approximation = Callable[[DelayLTI, int], control.StateSpace]


class ExactResults(NamedTuple):
    """What every order is compared with: response over the band, rightmost root, verdict, time response."""

    band: FloatArray
    response: np.ndarray
    rightmost_root: complex
    stable: bool | None
    time_response: np.ndarray | None


def compare_pade(
    sys: DelayLTI,
    orders: Iterable[int],
    omega: ArrayLike,
    timepts: ArrayLike | None = None,
    inputs: Any = None,
) -> pd.DataFrame:
    r"""Compare Padé and spectral approximations of several orders with the exact system.

    Parameters
    ----------
    sys : DelayLTI
        System with exact delays.
    orders : iterable of int
        Orders from 1 to 60, common to all delays.
    omega : array_like
        Frequencies (rad/s) of the band, increasing, not negative.
    timepts, inputs : optional
        Time points (s) and inputs as `simulate` takes them; with them the time errors are added.

    Returns
    -------
    pandas.DataFrame
        One row per order:

        order
            Padé order, and number of Chebyshev points of the spectral approximation.
        frequency_error
            :math:`\max_{ij} \max_\omega |\hat H_{ij} - H_{ij}| / \max_\omega |H_{ij}|`: the largest error in the
            band relative to the peak in the band, of the worst pair of output i and input j. Pairs without
            response and points where the exact response is infinite are left out.
        rightmost_root_error
            Distance (rad/s) of the rightmost root of the approximation from that of the exact system, both in
            the upper half plane; nan for a system without roots.
        time_error
            :math:`\max_i \max_t |\hat y_i - y_i| / \max_t |y_i|`, only with `timepts`; infinite where the
            approximation overflows.
        stable
            Whether the approximation has all its eigenvalues left of the axis.
        exact_stable
            Whether the exact system is stable (None: undecided).
        spectral_frequency_error, spectral_rightmost_root_error, spectral_time_error, spectral_stable
            The same for the spectral approximation.

    Raises
    ------
    InputError
        An order outside 1 to 60, an empty or falling band, inputs without time points.

    Notes
    -----
    Both need about ``omega tau / 2`` to resolve the frequency omega and converge faster than any power of the
    order beyond that, Padé of the same order faster; Chebyshev points go to any order and damp what they do not
    resolve, where Padé keeps the gain and loses the phase.
    """
    system = DelayLTI.of(sys, "sys")
    checked = _orders(orders)
    band = validation.increasing("omega", omega, at_least=0.0)
    if timepts is None and inputs is not None:
        raise InputError("inputs are given without timepts: the time error needs both")
    exact = ExactResults(
        band=band,
        response=system(1j * band, squeeze=False),
        rightmost_root=_rightmost(characteristic_roots(system, 1)),
        stable=stability(system).stable,
        time_response=None if timepts is None else _simulated(system, timepts, inputs),
    )
    rows = []
    for order in checked:
        pade = _errors(system, pade_approximation, order, exact, timepts, inputs)
        spectral = _errors(system, spectral_approximation, order, exact, timepts, inputs)
        rows.append(
            {"order": order, **pade, "exact_stable": exact.stable}
            | {f"spectral_{name}": value for name, value in spectral.items()}
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
    with np.errstate(invalid="ignore", over="ignore"):
        error = np.where(finite, np.abs(values - np.where(finite, exact, 0.0)), 0.0).max(axis=-1)
    peak = np.where(finite, np.abs(exact), 0.0).max(axis=-1)
    if not np.any(peak > 0.0):
        return float("nan")
    worst = np.max(error[peak > 0.0] / peak[peak > 0.0])
    return float("inf") if np.isnan(worst) else float(worst)


def _errors(
    system: DelayLTI,
    approximate: Approximation,
    order: int,
    exact: ExactResults,
    timepts: ArrayLike | None,
    inputs: Any,
) -> dict[str, float | bool]:
    approximation = approximate(system, order)
    eigenvalues = np.linalg.eigvals(approximation.A)
    found: dict[str, float | bool] = {
        "frequency_error": relative_error(
            _approximate_response(system, approximate, order, exact.band), exact.response
        ),
        "rightmost_root_error": float(abs(_rightmost(eigenvalues) - exact.rightmost_root)),
    }
    if exact.time_response is not None:
        try:
            values = _simulated(DelayLTI.of(approximation), timepts, inputs)
            found["time_error"] = relative_error(values, exact.time_response)
        except OverflowError:
            # the approximation is unstable and leaves the range of numbers
            found["time_error"] = float("inf")
    # an eigenvalue on the axis comes out on either side of it by rounding
    rounding = np.finfo(float).eps * float(np.linalg.norm(approximation.A)) if eigenvalues.size else 0.0
    found["stable"] = bool(np.all(eigenvalues.real < -rounding))
    return found


def _approximate_response(
    system: DelayLTI, approximate: Approximation, order: int, band: FloatArray
) -> np.ndarray:
    """Response with each ``e^{-s tau}`` replaced by the approximation of that delay alone.

    It is that of the whole approximation without a matrix of its size at every frequency.
    """
    loop, points = system.folded, np.asarray(1j * band, dtype=np.complex128)
    taus, of_channel = np.unique(loop.delays, return_inverse=True)
    single = [DelayLTI.of(approximate(delay(tau), order))(points) for tau in taus]
    E = np.array(single).reshape(taus.size, points.size)[of_channel].T
    return np.moveaxis(loop_response(loop.plant, points, E), 0, -1)


def _rightmost(roots: np.ndarray) -> complex:
    """The rightmost root in the closed upper half plane; nan without roots."""
    upper = roots[roots.imag >= 0.0]
    return complex(upper[np.argmax(upper.real)]) if upper.size else complex("nan")


def _simulated(system: DelayLTI, timepts: Any, inputs: Any) -> np.ndarray:
    return np.atleast_2d(np.asarray(simulate(system, timepts, inputs).outputs))


def _orders(orders: Iterable[int]) -> list[int]:
    given = [orders] if isinstance(orders, Integral) else validation.sequence("orders", orders)
    if not given:
        raise InputError("orders is empty: at least one order is needed")
    return [
        validation.integer(f"orders[{k}]", order, at_least=1, at_most=HIGHEST_ORDER)
        for k, order in enumerate(given)
    ]
