"""Connections: pure delays, series, parallel, feedback, systems side by side; exact and closed.

Every operand may be a `DelayLTI`, a `control.StateSpace`, a `control.TransferFunction`, a number or a matrix. The
arithmetic itself is in `susp_ctrl.delay_systems.model.arithmetic`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.delay_systems.model import Realization, arithmetic, name_list


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
    taus = validation.delays("tau", tau)
    k = taus.size
    through = np.eye(2 * k)[np.r_[k : 2 * k, :k]]
    return DelayLTI(
        Realization.from_matrix(through, 0, k, k),
        taus,
        inputs=name_list(inputs),
        outputs=name_list(outputs),
        name=name,
    )


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
    result = DelayLTI.of(first, "first")
    for k, other in enumerate(others):
        result = arithmetic.multiply(DelayLTI.of(other, f"others[{k}]"), result)
    return result.renamed(names)


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
    result = DelayLTI.of(first, "first")
    for k, other in enumerate(others):
        result = arithmetic.add(result, DelayLTI.of(other, f"others[{k}]"))
    return result.renamed(names)


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
    result = DelayLTI.of(first, "first")
    for k, other in enumerate(others):
        result = arithmetic.beside(result, DelayLTI.of(other, f"others[{k}]"))
    return result.renamed(names)


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
    return DelayLTI.of(sys1, "sys1").feedback(sys2, sign, **names)
