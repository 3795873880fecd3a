r"""Arithmetic of systems with delays: sum, product, feedback, selection; exact and closed.

Systems are put side by side and joined by a constant law between their outputs y and inputs u,

.. math:: u = K y + R v, \qquad y_{new} = L y,

which leaves the delays where they are: the result has the delays of all parts, in order, and the class of the first
part. The systems are `DelaySystem`, which takes its operators from here.

References
----------
.. [1] K. Zhou, J. C. Doyle, K. Glover, "Robust and Optimal Control", Prentice Hall, 1996, section 10.4: an
   interconnection of linear fractional forms is one again.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
import scipy.linalg
from control.lti import LTI

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model.lft import Realization, closed
from susp_ctrl.delay_systems.model.signal_names import are_generic, names_together, positions
from susp_ctrl.delay_systems.model.system_matrix import SystemMatrix
from susp_ctrl.errors import InputError

System = TypeVar("System", bound=LTI)


def multiply(left: System, right: System) -> System:
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
    both = beside(left, right)
    return joined(both, law, entry, np.eye(p, p + m), inputs=inputs, outputs=outputs)


def add(left: System, right: System) -> System:
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
    both = beside(left, right)
    labels = {"inputs": named.input_labels, "outputs": named.output_labels}
    return transformed(both, np.hstack([np.eye(p)] * 2), np.vstack([np.eye(q)] * 2), **labels)


def subtract(left: System, right: System) -> System:
    """Return ``left(s) - right(s)``."""
    return add(left, negated(right))


def negated(sys: System) -> System:
    """Return ``-H(s)``."""
    labels = {"inputs": sys.input_labels, "outputs": sys.output_labels}
    return transformed(sys, -np.eye(sys.noutputs), np.eye(sys.ninputs), **labels)


def closed_around(forward: System, back: System, sign: float) -> System:
    """Return the loop ``y = forward (u + sign back y)``; see `susp_ctrl.feedback`."""
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
    law = np.block([[np.zeros((q, p)), sign * np.eye(q)], [np.eye(p), np.zeros((p, q))]])
    entry = np.vstack([np.eye(q), np.zeros((p, q))])
    labels = {"inputs": forward.input_labels, "outputs": forward.output_labels}
    return joined(beside(forward, back), law, entry, np.eye(p, p + q), **labels)


def transformed(sys: System, left: FloatArray, right: FloatArray, **labels: Any) -> System:
    """Return ``left H(s) right`` with constant matrices."""
    r = sys.realization
    n, m = np.eye(r.n_states), np.eye(r.n_channels)
    whole = scipy.linalg.block_diag(n, left, m) @ r.matrix @ scipy.linalg.block_diag(n, right, m)
    matrix = None if sys.written is None else sys.written.transformed(left, right)
    return sys.with_parts(r.rebuilt(whole, left.shape[0], right.shape[1]), matrix, **labels)


def selected(sys: System, key: Any) -> System:
    """Return the part of a system from some inputs to some outputs, as ``sys[outputs, inputs]`` does.

    Parameters
    ----------
    sys : DelaySystem
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
    labels = {
        "inputs": names_together([], [sys.input_labels[k] for k in columns]),
        "outputs": names_together([], [sys.output_labels[k] for k in rows]),
    }
    chosen = np.eye(sys.noutputs)[rows], np.eye(sys.ninputs)[:, columns]
    matrix = None if sys.written is None else sys.written.transformed(*chosen)
    return sys.with_parts(
        sys.realization.between(rows, columns), matrix, **labels, name=f"{sys.name}$indexed"
    )


def beside(left: System, right: System) -> System:
    """Return both systems as one, inputs and outputs in order; a name that occurs twice gets a number."""
    a, b = left.realization, right.realization
    blocks = {
        field.name: scipy.linalg.block_diag(getattr(a, field.name), getattr(b, field.name))
        for field in fields(Realization)
    }
    both = type(left)(
        Realization(**blocks),
        np.append(left.delays, right.delays),
        np.append(left.gains, right.gains),
        (*left.widths, *right.widths),
        inputs=names_together(left.input_labels, right.input_labels),
        outputs=names_together(left.output_labels, right.output_labels),
        states=names_together(left.state_labels, right.state_labels),
    )
    if left.written is None and right.written is None:
        return both
    return both.with_written(_system_matrix(left).beside(_system_matrix(right)))


def _system_matrix(sys: System) -> SystemMatrix:
    return sys.written or SystemMatrix.of_realization(sys.realization, sys.widths)


def joined(sys: System, law: FloatArray, entry: FloatArray, exit_: FloatArray, **labels: Any) -> System:
    """Close ``u = law y + entry v`` around a system and return it from v to ``exit_ y``."""
    matrix = None if sys.written is None else sys.written.joined(law, entry, exit_)
    return sys.with_parts(_joined(sys.realization, law, entry, exit_), matrix, **labels)


def _joined(r: Realization, law: FloatArray, entry: FloatArray, exit_: FloatArray) -> Realization:
    around = law @ r.D11
    if np.linalg.cond(np.eye(r.n_inputs) - around) > 1e14:
        raise InputError(
            "the connection is an algebraic loop with unit gain: it is ill-posed, no solution exists"
        )
    n, p, m, q = r.n_states, r.n_outputs, r.n_channels, entry.shape[1]
    open_ = np.block([
        [r.A, np.zeros((n, q)), r.B2], [r.C1, np.zeros((p, q)), r.D12], [r.C2, np.zeros((m, q)), r.D22]
    ])  # fmt: skip
    whole = closed(
        open_, np.vstack([r.B1, r.D11, r.D21]), np.hstack([law @ r.C1, entry, law @ r.D12]), around
    )
    return r.rebuilt(scipy.linalg.block_diag(np.eye(n), exit_, np.eye(m)) @ whole, exit_.shape[0], q)


def _repeated(sys: System, times: int) -> System:
    result = sys
    for _ in range(times - 1):
        result = beside(result, sys)
    return result


def _keeps_signals(sys: System) -> bool:
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
