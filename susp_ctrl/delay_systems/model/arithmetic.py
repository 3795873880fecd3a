r"""Algebra of systems with delays: series, parallel, feedback, append, selection; exact and closed.

Systems are put side by side and joined by a constant law between their outputs y and inputs u,

.. math:: u = K y + R v, \qquad y_{new} = L y,

which leaves the delays where they are: the result has the delays of all parts, in order. Every operand may be a
`DelayLTI`, a `control.StateSpace`, a `control.TransferFunction`, a number or a matrix.

References
----------
.. [1] K. Zhou, J. C. Doyle, K. Glover, "Robust and Optimal Control", Prentice Hall, 1996, section 10.4: an
   interconnection of linear fractional forms is one again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.delay_systems.model.lft import FloatArray, Realization
from susp_ctrl.delay_systems.model.signal_names import (
    are_generic,
    checked_names,
    name_list,
    names_together,
    positions,
)
from susp_ctrl.delay_systems.model.system import DelayLTI, as_delay_lti
from susp_ctrl.errors import InputError


def delay(
    tau: float | ArrayLike,
    *,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    name: str | None = None,
) -> DelayLTI:
    r"""Return a pure delay, :math:`y(t) = u(t - \tau)`, :math:`H(s) = e^{-s\tau}`.

    Parameters
    ----------
    tau : float or array_like
        Delay in seconds, not negative; several give a diagonal system with one signal each.
    inputs, outputs : str or sequence of str, optional
        Signal names.
    name : str, optional
        System name.

    Returns
    -------
    DelayLTI
        A system without states.

    Raises
    ------
    InputError
        A negative or infinite delay.

    Examples
    --------
    >>> import control as ct, susp_ctrl as sc
    >>> G = ct.tf([1], [1, 1])
    >>> sensitivity = sc.feedback(1, G * (sc.delay(2) + sc.delay(3)))
    """
    taus = validation.vector("tau", tau, at_least=0.0)
    k = taus.size
    empty, unit, zero = np.zeros((0, k)), np.eye(k), np.zeros((k, k))
    realization = Realization(np.zeros((0, 0)), empty, empty, empty.T, empty.T, zero, unit, unit, zero)
    return DelayLTI(realization, taus, inputs=name_list(inputs), outputs=name_list(outputs), name=name)


def series(first: Any, *others: Any, **names: Any) -> DelayLTI:
    """Connect systems in series: the signal runs through `first`, then the others (``... * second * first``).

    Parameters
    ----------
    first, *others : DelayLTI, control system, number or matrix
        A single-input single-output part is repeated on every signal where its neighbour has several.
    **names
        ``inputs``, ``outputs``, ``states``, ``name`` of the result.

    Returns
    -------
    DelayLTI

    Raises
    ------
    InputError
        Numbers of signals that do not fit.
    """
    result = as_delay_lti(first, "first")
    for k, other in enumerate(others):
        result = multiply(as_delay_lti(other, f"others[{k}]"), result)
    return _renamed(result, names)


def parallel(first: Any, *others: Any, **names: Any) -> DelayLTI:
    """Add systems: same inputs, sum of the outputs (``first + second + ...``).

    Parameters
    ----------
    first, *others : DelayLTI, control system, number or matrix
        A single-input single-output part acts on every pair where the others have several.
    **names
        ``inputs``, ``outputs``, ``states``, ``name`` of the result.

    Returns
    -------
    DelayLTI

    Raises
    ------
    InputError
        Numbers of signals that do not fit.
    """
    result = as_delay_lti(first, "first")
    for k, other in enumerate(others):
        result = add(result, as_delay_lti(other, f"others[{k}]"))
    return _renamed(result, names)


def append(first: Any, *others: Any, **names: Any) -> DelayLTI:
    """Put systems side by side: inputs and outputs are those of all parts, in order.

    Parameters
    ----------
    first, *others : DelayLTI, control system, number or matrix
        The parts; a name that occurs twice gets a number.
    **names
        ``inputs``, ``outputs``, ``states``, ``name`` of the result.

    Returns
    -------
    DelayLTI
    """
    result = as_delay_lti(first, "first")
    for k, other in enumerate(others):
        result = _beside(result, as_delay_lti(other, f"others[{k}]"))
    return _renamed(result, names)


def feedback(sys1: Any, sys2: Any = 1, sign: float = -1, **names: Any) -> DelayLTI:
    """Close a loop: ``y = sys1 (u + sign * sys2 y)``, delays exact.

    Parameters
    ----------
    sys1 : DelayLTI, control system, number or matrix
        Forward path.
    sys2 : DelayLTI, control system, number or matrix, optional
        Return path; a number stands for that gain on every signal of a square `sys1`.
    sign : float, optional
        -1 for negative feedback (default), 1 for positive.
    **names
        ``inputs``, ``outputs``, ``states``, ``name`` of the result.

    Returns
    -------
    DelayLTI
        Inputs and outputs of `sys1`, delays of both.

    Raises
    ------
    InputError
        Numbers of signals that do not fit, or a delay-free algebraic loop with unit gain.
    NeutralLoopError
        Delayed feed-through around the loop, for example ``feedback(delay(1), 0.5)``.
    """
    weight = validation.number("sign", sign)
    if abs(weight) != 1.0:
        raise InputError(
            f"sign = {weight:g} is not allowed: -1 (negative feedback) or 1 (positive) is needed"
        )
    forward, back = as_delay_lti(sys1, "sys1"), as_delay_lti(sys2, "sys2")
    if back.issiso() and back.nstates == 0 and not forward.issiso():
        back = _repeated(back, forward.noutputs)
    elif forward.issiso() and forward.nstates == 0 and not back.issiso():
        forward = _repeated(forward, back.ninputs)
    if back.ninputs != forward.noutputs or back.noutputs != forward.ninputs:
        raise InputError(
            f"sys2 has {back.ninputs} inputs and {back.noutputs} outputs: {forward.noutputs} inputs and "
            f"{forward.ninputs} outputs are needed to close the loop around sys1"
        )
    p, q = forward.noutputs, forward.ninputs
    both = _beside(forward, back)
    law = np.block([[np.zeros((q, p)), weight * np.eye(q)], [np.eye(p), np.zeros((p, q))]])
    labels = {"inputs": forward.input_labels, "outputs": forward.output_labels}
    result = _joined(both, law, np.vstack([np.eye(q), np.zeros((p, q))]), np.eye(p, p + q), **labels)
    return _renamed(result, names)


def multiply(left: DelayLTI, right: DelayLTI) -> DelayLTI:
    """Return ``left(s) right(s)``: the signal runs through `right` first."""
    if left.issiso() and right.noutputs != 1:
        left = _repeated(left, right.noutputs)
    elif right.issiso() and left.ninputs != 1:
        right = _repeated(right, left.ninputs)
    if left.ninputs != right.noutputs:
        raise InputError(f"series: {right.noutputs} outputs cannot drive {left.ninputs} inputs")
    p, m, q = left.noutputs, left.ninputs, right.ninputs
    law = np.zeros((m + q, p + m))
    law[:m, p:] = np.eye(m)
    entry = np.vstack([np.zeros((m, q)), np.eye(q)])
    # a part that only delays or scales each signal leaves it what it was: its neighbour's names stay
    inputs = left.input_labels if _keeps_signals(right) else right.input_labels
    outputs = right.output_labels if _keeps_signals(left) else left.output_labels
    return _joined(_beside(left, right), law, entry, np.eye(p, p + m), inputs=inputs, outputs=outputs)


def add(left: DelayLTI, right: DelayLTI) -> DelayLTI:
    """Return ``left(s) + right(s)``."""
    if left.issiso() and not right.issiso():
        left = transformed(left, np.ones((right.noutputs, 1)), np.ones((1, right.ninputs)))
    elif right.issiso() and not left.issiso():
        right = transformed(right, np.ones((left.noutputs, 1)), np.ones((1, left.ninputs)))
    if (left.noutputs, left.ninputs) != (right.noutputs, right.ninputs):
        raise InputError(
            f"parallel: {left.noutputs} outputs and {left.ninputs} inputs cannot be added to "
            f"{right.noutputs} outputs and {right.ninputs} inputs"
        )
    p, q = left.noutputs, left.ninputs
    named = right if are_generic(left.input_labels) and are_generic(left.output_labels) else left
    result = transformed(_beside(left, right), np.hstack([np.eye(p)] * 2), np.vstack([np.eye(q)] * 2))
    return _renamed(result, {"inputs": named.input_labels, "outputs": named.output_labels})


def subtract(left: DelayLTI, right: DelayLTI) -> DelayLTI:
    """Return ``left(s) - right(s)``."""
    return add(left, negated(right))


def negated(sys: DelayLTI) -> DelayLTI:
    """Return ``-H(s)``."""
    labels = sys.input_labels, sys.output_labels
    return transformed(sys, -np.eye(sys.noutputs), np.eye(sys.ninputs), *labels)


def transformed(
    sys: DelayLTI,
    left: FloatArray,
    right: FloatArray,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> DelayLTI:
    """Return ``left H(s) right`` with constant matrices."""
    r = sys.realization
    realization = Realization(
        r.A, r.B1 @ right, r.B2, left @ r.C1, r.C2, left @ r.D11 @ right, left @ r.D12, r.D21 @ right, r.D22
    )
    return _rebuilt(sys, realization, inputs, outputs)


def select(sys: DelayLTI, key: Any) -> DelayLTI:
    """Return the part of a system from some inputs to some outputs, as ``sys[outputs, inputs]`` does.

    Parameters
    ----------
    sys : DelayLTI
        The system.
    key : tuple
        Outputs and inputs: name, number, slice of numbers, or a list of names and numbers.

    Raises
    ------
    InputError
        Not two entries, or an unknown signal (the message names the nearest one).
    """
    if not isinstance(key, tuple) or len(key) != 2:
        raise InputError("indexing needs two entries, sys[outputs, inputs]")
    rows = positions("output", key[0], sys.output_labels)
    columns = positions("input", key[1], sys.input_labels)
    r = sys.realization
    realization = Realization(
        A=r.A,
        B1=r.B1[:, columns],
        B2=r.B2,
        C1=r.C1[rows],
        C2=r.C2,
        D11=r.D11[np.ix_(rows, columns)],
        D12=r.D12[rows],
        D21=r.D21[:, columns],
        D22=r.D22,
    )
    labels = [sys.input_labels[k] for k in columns], [sys.output_labels[k] for k in rows]
    return _rebuilt(sys, realization, *labels, name=f"{sys.name}$indexed")


def _joined(
    sys: DelayLTI, law: FloatArray, entry: FloatArray, exit_: FloatArray, **labels: Sequence[str]
) -> DelayLTI:
    """Close ``u = law y + entry v`` around a system and return it from v to ``exit_ y``."""
    r = sys.realization
    around = np.eye(r.n_inputs) - law @ r.D11
    if np.linalg.cond(around) > 1e14:
        raise InputError(
            "the connection is an algebraic loop with unit gain: it is ill-posed, no solution exists"
        )
    u_x, u_w, u_v = (np.linalg.solve(around, m) for m in (law @ r.C1, law @ r.D12, entry))
    realization = Realization(
        A=r.A + r.B1 @ u_x,
        B1=r.B1 @ u_v,
        B2=r.B2 + r.B1 @ u_w,
        C1=exit_ @ (r.C1 + r.D11 @ u_x),
        C2=r.C2 + r.D21 @ u_x,
        D11=exit_ @ (r.D11 @ u_v),
        D12=exit_ @ (r.D12 + r.D11 @ u_w),
        D21=r.D21 @ u_v,
        D22=r.D22 + r.D21 @ u_w,
    )
    return _rebuilt(sys, realization, labels["inputs"], labels["outputs"])


def _beside(left: DelayLTI, right: DelayLTI) -> DelayLTI:
    a, b = left.realization, right.realization
    blocks = {
        field: _block_diagonal(getattr(a, field), getattr(b, field))
        for field in Realization.__dataclass_fields__
    }
    return DelayLTI(
        Realization(**blocks),
        np.append(left.delays, right.delays),
        np.append(left.gains, right.gains),
        (*left.widths, *right.widths),
        inputs=names_together(left.input_labels, right.input_labels),
        outputs=names_together(left.output_labels, right.output_labels),
        states=names_together(left.state_labels, right.state_labels),
    )


def _block_diagonal(a: FloatArray, b: FloatArray) -> FloatArray:
    result = np.zeros((a.shape[0] + b.shape[0], a.shape[1] + b.shape[1]))
    result[: a.shape[0], : a.shape[1]] = a
    result[a.shape[0] :, a.shape[1] :] = b
    return result


def _rebuilt(
    sys: DelayLTI,
    realization: Realization,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
    name: str | None = None,
) -> DelayLTI:
    return DelayLTI(
        realization,
        sys.delays,
        sys.gains,
        sys.widths,
        inputs=inputs,
        outputs=outputs,
        states=sys.state_labels,
        name=name,
    )


def _repeated(sys: DelayLTI, times: int) -> DelayLTI:
    result = sys
    for _ in range(times - 1):
        result = _beside(result, sys)
    return result


def _renamed(sys: DelayLTI, names: dict[str, Any]) -> DelayLTI:
    labels = {k: v for k, v in checked_names(names).items() if v is not None}
    return sys.with_names(**labels) if labels else sys


def _keeps_signals(sys: DelayLTI) -> bool:
    """A gain or delay on each signal by itself, without names of its own."""
    if sys.nstates or sys.ninputs != sys.noutputs:
        return False
    if not (are_generic(sys.input_labels) and are_generic(sys.output_labels)):
        return False
    r = sys.realization
    # paths from an input to an output: directly, or through any number of delayed signals in a row
    through = np.abs(r.D22) > 0.0
    reach = np.linalg.matrix_power(through + np.eye(r.n_channels), max(r.n_channels, 1)) > 0.0
    paths = np.abs(r.D11) + np.abs(r.D12) @ reach @ np.abs(r.D21)
    return not np.any(paths[~np.eye(sys.ninputs, dtype=bool)])
