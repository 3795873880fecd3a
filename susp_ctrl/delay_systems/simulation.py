r"""Time simulation of linear systems with exact delays: arguments, method and response.

.. math::

    \dot x = A x + B_1 u + B_2 w, \quad y = C_1 x + D_{11} u + D_{12} w, \quad
    w_k(t) = z_k(t - \tau_k), \quad z = C_2 x + D_{21} u + D_{22} w.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.delay_systems.approximate_methods import approximation
from susp_ctrl.delay_systems.delay_lti import DelayLTI, as_delay_lti
from susp_ctrl.delay_systems.input_signals import Inputs, announced_breakpoints, as_inputs
from susp_ctrl.delay_systems.lft import FloatArray, Realization
from susp_ctrl.delay_systems.method_of_steps import run_exact
from susp_ctrl.delay_systems.reference_method import run_reference
from susp_ctrl.delay_systems.run import Past, Run
from susp_ctrl.errors import InputError

_METHODS = ("exact", "reference", "pade", "spectral")
_DELAYS_EXACT = ("exact", "reference")


class SimulationResponse(control.TimeResponseData):
    """A `control.TimeResponseData` that knows its error and can be continued.

    Attributes
    ----------
    error_estimate : ndarray, shape (n_outputs,)
        Estimated largest error of each output, absolute.
    method : str
        Method that made it.
    order : int or sequence of int or None
        Order of the approximation, for the approximate methods.
    past : object
        Memory of the delayed signals; pass the response as `history` to go on from its end.
    """

    error_estimate: FloatArray
    method: str
    order: Any
    past: Any


def simulate(
    sys: Any,
    timepts: ArrayLike,
    inputs: Any = None,
    method: str = "exact",
    *,
    order: Any = None,
    history: Any = None,
    hold: str = "linear",
    breakpoints: ArrayLike = (),
    rtol: float = 1e-8,
) -> SimulationResponse:
    r"""Simulate a system with exact delays.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        Continuous-time system.
    timepts : array_like, shape (n_times,)
        Increasing times (s), not negative; they need not be uniform. The run always begins at t = 0 (or where
        the run in `history` ended).
    inputs : dict, array_like or callable, optional
        Dictionary name -> callable ``t -> (len(t),)``, array (n_times,) or number, missing inputs being zero;
        or an array (n_inputs, n_times); or a callable ``t -> (n_inputs, len(t))``. Inputs are zero for t < 0.
        A callable may carry the attributes ``breakpoints`` (times of its kinks and jumps, s), ``bandwidth``
        (rad/s) and ``sines`` = (omegas, amplitudes, phases), meaning ``sum a sin(omega t + phi)`` for all t.
    method : {"exact", "reference", "pade", "spectral"}
        Exact delays, fast, or slowly and by an independent method to about 1e-12; ``sys.pade(order)``; or a
        spectral line for each delay.
    order : int or sequence of int, optional
        Order of the approximation, for all delays or one for each of ``sys.delays``; by default chosen for the
        input's bandwidth and the plant's natural frequencies.
    history : None, array_like, callable or SimulationResponse, optional
        State before t = 0: zero; constant, shape (n_states,); ``t -> (n_states, len(t))`` on [-longest delay, 0]
        (the sum of delays in series where a delayed signal is delayed again); or the response of an earlier run
        of this system, which is continued from its end.
    hold : {"linear", "zero"}
        What input arrays do between their samples: joined by lines, or held.
    breakpoints : array_like, optional
        Times (s) of kinks and jumps of the inputs that the callables do not announce.
    rtol : float, optional
        Error wanted, relative to each output's peak; between 1e-13 and 1e-2.

    Returns
    -------
    SimulationResponse
        A `control.TimeResponseData` with the system's input, output and state names, and
        `error_estimate`.

    Raises
    ------
    InputError
        An argument is not allowed; the message names it.
    OverflowError
        The response of an unstable system leaves the range of floating point numbers.

    Warns
    -----
    PadeOrderWarning
        The order is too low for the input's band or the plant; the message names the order needed.
    RuntimeWarning
        The estimated error exceeds `rtol`.

    Notes
    -----
    Between kinks the delayed signals are known smooth functions, so each stretch is an ordinary forced linear
    system [1]_. Values at a jump are those just after it.

    References
    ----------
    .. [1] A. Bellen, M. Zennaro, "Numerical Methods for Delay Differential Equations", Oxford, 2003, chapter 3.
    """
    system = as_delay_lti(sys, "sys")
    times = validation.increasing("timepts", timepts, at_least=0.0)
    validation.one_of("method", method, _METHODS)
    validation.one_of("hold", hold, ("linear", "zero"))
    validation.number("rtol", rtol, at_least=1e-13, at_most=1e-2)
    signals = as_inputs(inputs, system.input_labels, times, hold, breakpoints)
    if method not in _DELAYS_EXACT:
        if history is not None:
            raise InputError(
                f"history is not allowed with method = {method!r}: its delays have no history but zero"
            )
        system, order = _approximated(system, method, order, signals)
    elif order is not None:
        raise InputError(
            f"order = {order!r} is not allowed with method = {method!r}: exact delays have no order"
        )
    past = past_of(system, history)
    _check_start(times, past, signals)
    if method == "reference":
        run = run_reference(system.folded, [signals], times, past)
    else:
        run = run_exact(system.folded, [signals], times, past, rtol)
    return _response(system, times, run, method, order, rtol)


def _approximated(system: DelayLTI, method: str, order: Any, signals: Inputs) -> tuple[DelayLTI, Any]:
    ordinary, chosen = approximation(system, method, order, signals.bandwidth)
    return as_delay_lti(ordinary), chosen


def past_of(system: DelayLTI, history: Any) -> Past:
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
        return Past(0.0, state, _delayed_before(system, function), (*kinks.tolist(), 0.0))
    if isinstance(history, str):
        raise InputError(
            f"history = {history!r} is not allowed: None, an array, a callable or a response is needed"
        )
    constant = validation.vector("history", history, size=n)[:, None]
    return Past(0.0, constant, _delayed_before(system, lambda t: np.repeat(constant, t.size, axis=1)), (0.0,))


def _history_values(history: Any, times: FloatArray, n: int) -> FloatArray:
    values = np.asarray(history(times), dtype=float)
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
    system: DelayLTI, state: Callable[[FloatArray], FloatArray]
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


def _check_start(times: FloatArray, past: Past, signals: Inputs) -> None:
    if times[0] < past.start:
        raise InputError(
            f"timepts[0] = {times[0]:g} is not allowed: the run in history ended at {past.start:g} s"
        )
    if signals.knots is not None and times[0] > past.start:
        raise InputError(
            f"timepts[0] = {times[0]:g} is not allowed: input arrays must begin at t = {past.start:g} s"
        )


def _response(
    system: DelayLTI, times: FloatArray, run: Run, method: str, order: Any, rtol: float
) -> SimulationResponse:
    response = SimulationResponse(
        times,
        run.outputs[:, :, 0],
        run.states[:, :, 0],
        run.inputs[:, :, 0] if system.ninputs else None,
        issiso=system.noutputs == 1 and system.ninputs <= 1,
        output_labels=system.output_labels,
        state_labels=system.state_labels,
        input_labels=system.input_labels if system.ninputs else None,
        sysname=system.name,
        plot_inputs=False,
    )
    response.error_estimate = run.error[:, 0]
    response.method, response.order, response.past = method, order, run.past
    relative = run.relative_error[:, 0]
    if np.any(relative > rtol):
        worst = int(np.argmax(relative))
        warnings.warn(
            f"the estimated error {run.error[worst, 0]:.2g} of {system.output_labels[worst]} exceeds rtol = {rtol:g} "
            f"of its peak {run.peak[worst, 0]:.2g}: an input may have kinks that are not announced (breakpoints)",
            RuntimeWarning,
            stacklevel=3,
        )
    return response
