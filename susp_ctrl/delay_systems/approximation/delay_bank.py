"""A bank of ordinary systems in place of the delays, and the loop closed around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import control
import numpy as np
import scipy.linalg

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import DelaySystem, closed, state_space
from susp_ctrl.errors import InputError

Orders = int | Sequence[int]


class OneDelay(NamedTuple):
    """State-space matrices that stand for one delay."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray


def with_delays_replaced(
    sys: DelaySystem, orders: np.ndarray, one_delay: Callable[[int, float], OneDelay], name: str
) -> control.StateSpace:
    """Close the undelayed plant of a system with ordinary systems in place of its delays.

    Parameters
    ----------
    sys : DelaySystem
        The system whose plant, inputs and outputs are kept.
    orders : ndarray of int, shape (channels,)
        Order for every delayed signal; the signals with order zero pass directly.
    one_delay : callable
        ``(order, delay) -> OneDelay``.
    name : str
        Name of the additional states, which follow those of `sys`.

    Returns
    -------
    control.StateSpace
        With one input ``idle`` that acts on nothing if `sys` has no input.
    """
    r = sys.realization
    parts = [OneDelay(*(np.zeros((0, 0)),) * 4)]
    for order, tau, gain in zip(orders, sys.channel_delays, sys.channel_gains, strict=True):
        A, B, C, D = one_delay(int(order), float(tau)) if order else _DIRECT
        parts.append(OneDelay(A, B, gain * C, gain * D))
    A, B, C, D = (scipy.linalg.block_diag(*blocks) for blocks in zip(*parts, strict=True))
    n, k, q = r.n_states, A.shape[0], r.n_inputs
    # the states of the bank stand behind those of the plant; w = C x_bank + D z closes the loop
    rows = np.block([
        [r.A, r.B2 @ C, r.B1],
        [np.zeros((k, n)), A, np.zeros((k, q))],
        [r.C1, r.D12 @ C, r.D11],
    ])  # fmt: skip
    into, out = np.vstack([r.B2 @ D, B, r.D12 @ D]), np.hstack([r.C2, r.D22 @ C, r.D21])
    bands = np.split(closed(rows, into, out, r.D22 @ D), [n + k])
    (A, B), (C, D) = (np.split(band, [n + k], axis=1) for band in bands)
    names = [f"{name}[{c}][{j}]" for c, order in enumerate(orders) for j in range(order)]
    states = [*sys.state_labels, *names]
    return state_space(A, B, C, D, inputs=sys.input_labels, outputs=sys.output_labels, states=states)


_DIRECT = OneDelay(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))


def channel_orders(sys: DelaySystem, order: Orders, highest: int) -> np.ndarray:
    """Return the order of every delayed signal, zero where it needs no states.

    Raises
    ------
    InputError
        An order outside 1 to `highest`, or not one for each delay.
    """
    if isinstance(order, (Sequence, np.ndarray)):
        given = validation.sequence("order", order)
        if len(given) != sys.delays.size:
            raise InputError(
                f"order has {len(given)} entries: one for each of {sys.delays.size} delays is needed"
            )
        checked = [
            validation.integer(f"order[{k}]", n, at_least=1, at_most=highest) for k, n in enumerate(given)
        ]
    else:
        checked = [validation.integer("order", order, at_least=1, at_most=highest)] * sys.delays.size
    return np.where(at_work(sys), np.repeat(np.array(checked, dtype=int), sys.widths), 0).astype(int)


def at_work(sys: DelaySystem) -> np.ndarray:
    """Tell which delayed signals have a delay and act on something."""
    r = sys.realization
    acts = np.any(np.vstack([r.B2, r.D12, r.D22]) * sys.channel_gains != 0.0, axis=0)
    return np.asarray(acts & (sys.channel_delays > 0.0))
