r"""Time simulation of linear systems with exact delays: arguments, method and response.

.. math::

    \dot x = A x + B_1 u + B_2 w, \quad y = C_1 x + D_{11} u + D_{12} w, \quad
    w_k(t) = z_k(t - \tau_k), \quad z = C_2 x + D_{21} u + D_{22} w.

Method of steps [1]_: on a stretch no longer than the shortest delay, w is known from the past, so that what remains is
an ordinary linear system with known forcing, whose solution over a time h is

.. math:: x(t + h) = e^{A h} x(t) + \int_0^h e^{A (h - \theta)} (B_1 u + B_2 w)(t + \theta) \, d\theta .

Where u or the history has a kink or a jump, so has the response, and it comes back after each delay, one derivative
smoother each time (a retarded system smooths). Between these breakpoints everything is smooth and polynomials converge
faster than any power of their degree [2]_: the integral is taken exactly for polynomial forcing.

References
----------
.. [1] A. Bellen, M. Zennaro, "Numerical Methods for Delay Differential Equations", Oxford, 2003, chapter 3.
.. [2] L. N. Trefethen, "Approximation Theory and Approximation Practice", SIAM, 2013, chapters 7 and 8.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.approximation import approximated
from susp_ctrl.delay_systems.integrators import (
    Inputs,
    Past,
    Run,
    TooCoarseError,
    as_inputs,
    kinked_march,
    method_of_steps,
    sampled_march,
    side_by_side,
    superposed,
    with_last_instant,
)
from susp_ctrl.delay_systems.model import DelaySystem, FoldedLoop
from susp_ctrl.delay_systems.simulation.history import past_of
from susp_ctrl.delay_systems.simulation.input_band import input_band
from susp_ctrl.delay_systems.simulation.simulation_response import (
    Origin,
    SimulationResponse,
    simulation_response,
)
from susp_ctrl.errors import InputError

_METHODS = ("exact", "pade", "spectral")
SHORTEST_RUN = 1e-15
"""Least end of a run (s)."""
# The marches from rest, the fastest first.
FROM_REST = (sampled_march, kinked_march)
_TOGETHER = 16  # cases taken through the same cells at once: more gain nothing and need memory


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
    resolution: float | None = None,
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
    method : {"exact", "pade", "spectral"}
        Exact delays; ``sys.pade(order)``; or a spectral line for each delay.
    order : int or sequence of int, optional
        Order of the approximation, for all delays or one for each of ``sys.delays``; by default chosen for the
        plant's oscillations and the input's band, below which 99.9 % of its energy during the run lies.
    history : None, array_like, callable, "steady" or SimulationResponse, optional
        State before t = 0: zero; constant, shape (n_states,); ``t -> (n_states, len(t))`` on [-longest delay, 0]
        (the sum of delays in series where a delayed signal is delayed again); "steady": the steady motion under
        inputs that are sums of sines for all t; or the response of an earlier run of this system, which is
        continued from its end.
    hold : {"linear", "zero"}
        What input arrays do between their samples: joined by lines, or held.
    breakpoints : array_like, optional
        Times (s) of kinks and jumps of the inputs that the callables do not announce.
    resolution : float, optional
        Longest time (s) between two looks at inputs and a history given as callables; at least a millionth of the
        run, by default a thousandth of it (of the longest delay for the history).
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
    TooMuchWorkError
        An input is so rough that more cells would be needed than are allowed (30 000, or 30 for each that a smooth
        input with the same announced kinks needs); the message says how far the run came.
    OverflowError
        The response of an unstable system leaves the range of floating point numbers.

    Warns
    -----
    PadeOrderWarning
        The order is too low for the input's band or the plant, the message names the order needed; or that band
        cannot be told, the message names the one taken.
    RuntimeWarning
        The estimated error exceeds `rtol`.

    Notes
    -----
    Between kinks the delayed signals are known smooth functions, so each stretch is an ordinary forced linear
    system [1]_. Outputs at a jump are those just after it.

    The inputs of the response are the callables' values at `timepts`. A feature of a callable, such as a short pulse,
    is resolved if it lasts longer than `resolution`, if a time of `timepts` falls into it, or if its beginning and end
    are announced as breakpoints, as the bumps and records of `susp_ctrl.road` announce theirs; a shorter one may be
    passed over.

    References
    ----------
    .. [1] A. Bellen, M. Zennaro, "Numerical Methods for Delay Differential Equations", Oxford, 2003, chapter 3.
    """
    system = DelaySystem.of(sys, "sys")
    validation.one_of("method", method, _METHODS)
    times = _checked_times(timepts, hold, resolution, rtol)
    signals = as_inputs(inputs, system.input_labels, times, hold, breakpoints, resolution=resolution)
    if method != "exact":
        if history is not None:
            raise InputError(
                f"history is not allowed with method = {method!r}: its delays have no history but zero"
            )
        band = input_band(signals, 0.0, float(times[-1]))
        system, order = _approximated(system, method, order, band)
    elif order is not None:
        raise InputError(
            f"order = {order!r} is not allowed with method = {method!r}: exact delays have no order"
        )
    past = past_of(system, history, signals)
    _check_start(times, past, signals)
    origin = Origin(
        system, _march(system, [signals], past, rtol), past.start, rtol, kinks=signals.breakpoints
    )
    return simulation_response(origin, origin.march(times), times, method, order)


def simulate_many(
    systems: Any,
    timepts: ArrayLike,
    inputs: Any = None,
    *,
    history: Any = None,
    hold: str = "linear",
    breakpoints: ArrayLike = (),
    resolution: float | None = None,
    rtol: float = 1e-8,
) -> list[SimulationResponse]:
    """Simulate many systems, or one under many inputs, with exact delays.

    Cases that share a system are taken through the same cells together, which is several times faster than one
    after the other.

    Parameters
    ----------
    systems : system or sequence of systems
        As `simulate` takes them. One system serves all inputs.
    timepts : array_like, shape (n_times,)
        Increasing times (s), common to all cases.
    inputs : sequence, dict or callable, optional
        A list or tuple with one entry for each case, each as `simulate` takes it; a single dictionary or callable
        serves all systems.
    history : optional
        As in `simulate`, common to all cases; responses cannot be continued here.
    hold, breakpoints, resolution, rtol
        As in `simulate`.

    Returns
    -------
    list of SimulationResponse
        One for each case, in order.

    Raises
    ------
    InputError
        An argument is not allowed, or systems and inputs differ in number.
    OverflowError
        A response leaves the range of floating point numbers.
    """
    models = list(systems) if isinstance(systems, Sequence) else [systems]
    loads = list(inputs) if isinstance(inputs, list | tuple) else [inputs]
    cases = max(len(models), len(loads))
    if len(models) not in (1, cases) or len(loads) not in (1, cases) or not models or not loads:
        raise InputError(
            f"inputs has {len(loads)} cases for {len(models)} systems: one for each, or one for all"
        )
    for k, load in enumerate(loads):
        if not (load is None or callable(load) or isinstance(load, Mapping)) and not hasattr(load, "ndim"):
            raise InputError(
                f"inputs[{k}] is a {type(load).__name__}: a dictionary, callable or array is needed"
            )
    if isinstance(history, SimulationResponse):
        raise InputError("history is a response: continue runs one by one with simulate")
    times = _checked_times(timepts, hold, resolution, rtol)
    models = models * (cases if len(models) == 1 else 1)
    loads = loads * (cases if len(loads) == 1 else 1)
    groups: dict[int, list[int]] = {}
    for k, model in enumerate(models):
        groups.setdefault(id(model), []).append(k)
    responses: dict[int, SimulationResponse] = {}
    for members in groups.values():
        system = DelaySystem.of(models[members[0]], f"systems[{members[0]}]")
        for a in range(0, len(members), _TOGETHER):
            some = members[a : a + _TOGETHER]
            signals = [
                as_inputs(loads[k], system.input_labels, times, hold, breakpoints, f"inputs[{k}]", resolution)
                for k in some
            ]
            pasts = [past_of(system, history, s) for s in signals]
            for past, s in zip(pasts, signals, strict=True):
                _check_start(times, past, s)
            past = side_by_side(pasts)
            kinks = np.unique(np.concatenate([s.breakpoints for s in signals]))
            origin = Origin(system, _march(system, signals, past, rtol), past.start, rtol, kinks=kinks)
            run = origin.march(times)
            for j, k in enumerate(some):
                responses[k] = simulation_response(origin, run, times, "exact", None, j)
    return [responses[k] for k in range(cases)]


def _march(
    system: DelaySystem, inputs: Sequence[Inputs], past: Past, rtol: float
) -> Callable[[FloatArray], Run]:
    loop = system.folded

    def march(timepts: FloatArray) -> Run:
        run = _run_exact(loop, inputs, timepts, past, rtol)
        return with_last_instant(loop, inputs, run, float(timepts[-1]))

    return march


def _run_exact(
    loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, past: Past, rtol: float
) -> Run:
    """Let the first march that suits take its share of the inputs from rest, and the others the rest and the past.

    The method of steps takes everything. The responses to different inputs and to the past add up.
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
        return run if quiet else superposed(run, _run_exact(loop, others, timepts, past, rtol))
    return method_of_steps.run(loop, inputs, timepts, past, rtol)


def _checked_times(timepts: ArrayLike, hold: str, resolution: float | None, rtol: float) -> FloatArray:
    validation.one_of("hold", hold, ("linear", "zero"))
    validation.number("rtol", rtol, at_least=1e-13, at_most=1e-2)
    times = validation.increasing("timepts", timepts, at_least=0.0)
    last = float(times[-1])
    if last and not SHORTEST_RUN <= last <= validation.LONGEST_DELAY:
        raise InputError(
            f"timepts[-1] = {last:g} is not allowed: zero, or from {SHORTEST_RUN:g} to "
            f"{validation.LONGEST_DELAY:g} s is needed"
        )
    if resolution is not None:
        validation.number("resolution", resolution, at_least=1e-6 * float(times[-1]), above=0.0)
    return times


def _approximated(
    system: DelaySystem, method: str, order: Any, band: tuple[float, bool]
) -> tuple[DelaySystem, Any]:
    ordinary, chosen = approximated(system, method, order, band)
    return DelaySystem.of(ordinary), chosen


def _check_start(times: FloatArray, past: Past, signals: Inputs) -> None:
    if times[0] < past.start:
        raise InputError(
            f"timepts[0] = {times[0]:g} is not allowed: the run in history ended at {past.start:g} s"
        )
    if signals.knots is not None and times[0] > past.start:
        raise InputError(
            f"timepts[0] = {times[0]:g} is not allowed: input arrays must begin at t = {past.start:g} s"
        )
