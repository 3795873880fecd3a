r"""Systems given by state matrices with delays, as the literature writes them.

.. math::

    \dot x(t) = A_0 x(t) + \sum_k A_k x(t - \tau_k) + B u(t) + \sum_j B_j u(t - d_j), \qquad y = C x + D u

Each delayed matrix is factored as ``A_k = U_k V_k`` with as few signals as its rank, so that a delay that acts
on one state costs one delayed signal.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model.lft import Realization
from susp_ctrl.errors import InputError


def state_delay_realization(
    A: Sequence[ArrayLike],
    delays: ArrayLike,
    B: ArrayLike | None,
    C: ArrayLike | None,
    D: ArrayLike | None,
    input_terms: Sequence[tuple[ArrayLike, float]],
) -> tuple[Realization, FloatArray, tuple[int, ...]]:
    """Return plant, delays and block widths of a system with state and input delays.

    Parameters
    ----------
    A : sequence of array_like, each (n, n)
        ``[A0, A1, ...]``; ``A[1:]`` pairs with `delays`.
    delays : array_like
        Delays of ``A[1:]`` in seconds.
    B, C, D : array_like, optional
        Undelayed matrices (n, q), (p, n), (p, q). Without `B` (and `input_terms`) the system has no input;
        without `C` the outputs are the states; without `D` it is zero.
    input_terms : sequence of (array_like (n, q), float)
        Delayed input matrices with their delays.

    Raises
    ------
    InputError
        Shapes or numbers that do not fit.
    """
    if isinstance(A, np.ndarray) and A.ndim == 2:
        raise InputError("A is one matrix: a sequence [A0, A1, ...] is needed")
    A = validation.sequence("A", A)
    if len(A) == 0:
        raise InputError("A is empty: a sequence [A0, A1, ...] is needed")
    tau = validation.delays("delays", delays)
    if tau.size != len(A) - 1:
        raise InputError(
            f"delays has {tau.size} entries: one for each of the {len(A) - 1} matrices A[1:] is needed"
        )
    n = validation.matrix("A[0]", A[0]).shape[0]
    matrices = [validation.matrix(f"A[{k}]", m, rows=n, columns=n) for k, m in enumerate(A)]
    delayed_inputs = [
        _input_term(j, term, n) for j, term in enumerate(validation.sequence("input_terms", input_terms))
    ]
    if B is not None:
        B1 = validation.matrix("B", B, rows=n)
    else:
        B1 = np.zeros((n, delayed_inputs[0][0].shape[1] if delayed_inputs else 0))
    q = B1.shape[1]
    C1 = np.eye(n) if C is None else validation.matrix("C", C, columns=n)
    D11 = np.zeros((C1.shape[0], q)) if D is None else validation.matrix("D", D, rows=C1.shape[0], columns=q)
    for j, (Bj, _) in enumerate(delayed_inputs):
        validation.matrix(f"input_terms[{j}]", Bj, rows=n, columns=q)

    factors = [_rank_factors(m) for m in matrices[1:]]
    input_factors = [_rank_factors(Bj) for Bj, _ in delayed_inputs]
    widths = tuple(U.shape[1] for U, _ in (*factors, *input_factors))
    into = np.hstack([np.zeros((n, 0)), *(U for U, _ in (*factors, *input_factors))])
    from_state = np.vstack([np.zeros((0, n)), *(V for _, V in factors)])
    from_input = np.vstack([np.zeros((0, q)), *(V for _, V in input_factors)])
    direct = np.zeros((C1.shape[0], into.shape[1]))
    out = scipy.linalg.block_diag(from_state, from_input)
    whole = np.block([[matrices[0], B1, into], [C1, D11, direct], [out, np.zeros((into.shape[1],) * 2)]])
    realization = Realization.from_matrix(whole, n, C1.shape[0], q)
    return realization, np.append(tau, [d for _, d in delayed_inputs]), widths


def _input_term(j: int, term: Any, n: int) -> tuple[FloatArray, float]:
    pair = validation.sequence(f"input_terms[{j}]", term)
    if len(pair) != 2:
        raise InputError(f"input_terms[{j}] has {len(pair)} entries: a pair (matrix, delay) is needed")
    return (
        validation.matrix(f"input_terms[{j}]", pair[0], rows=n),
        validation.delay(f"input_terms[{j}] delay", pair[1]),
    )


def _rank_factors(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return U, V with ``matrix = U V`` and as many columns of U as the rank.

    Where the non-zero rows (or columns) are as few as the rank the factors are exact; else the singular value
    decomposition gives them to rounding.
    """
    rows = np.flatnonzero(np.any(matrix != 0.0, axis=1))
    columns = np.flatnonzero(np.any(matrix != 0.0, axis=0))
    left, values, right = np.linalg.svd(matrix, full_matrices=False)
    rank = int(np.sum(values > max(matrix.shape) * np.finfo(float).eps * values[:1].sum()))
    if rank == rows.size:
        return np.eye(matrix.shape[0])[:, rows], matrix[rows]
    if rank == columns.size:
        return matrix[:, columns], np.eye(matrix.shape[1])[columns]
    root = np.sqrt(values[:rank])
    return left[:, :rank] * root, root[:, None] * right[:rank]


def state_space_of(system: control.TransferFunction, name: str = "system") -> control.StateSpace:
    """Return a state-space realisation of a continuous-time transfer function or matrix of them.

    Each entry of a matrix is realised by itself (python-control needs Slycot for a joint realisation), so the
    result can have more states than the least possible; its response is the same.

    Parameters
    ----------
    system : control.TransferFunction
        Proper in every entry.
    name : str, optional
        Name of the argument in error messages.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InputError
        Discrete time, or an entry with more zeros than poles.
    """
    if system.dt not in (0, None):
        raise InputError(f"{name} has dt = {system.dt}: only continuous time (dt = 0) is possible")
    A, B = np.zeros((0, 0)), np.zeros((0, system.ninputs))
    C, D = np.zeros((system.noutputs, 0)), np.zeros((system.noutputs, system.ninputs))
    for i in range(system.noutputs):
        for j in range(system.ninputs):
            num, den = (np.trim_zeros(np.atleast_1d(c[i][j]), "f") for c in (system.num, system.den))
            if num.size > den.size:
                raise InputError(
                    f"{name} is improper from input {j} to output {i} (degree {num.size - 1} over "
                    f"{den.size - 1}): a proper transfer function is needed"
                )
            if num.size == 0:
                continue
            entry = control.ss(control.tf(num, den))
            n, total = entry.nstates, A.shape[0]
            A = np.block([[A, np.zeros((total, n))], [np.zeros((n, total)), entry.A]])
            column, row = np.zeros((n, system.ninputs)), np.zeros((system.noutputs, n))
            column[:, [j]], row[[i]] = entry.B, entry.C
            B, C = np.vstack([B, column]), np.hstack([C, row])
            D[i, j] = entry.D[0, 0]
    return control.StateSpace(
        A, B, C, D, inputs=system.input_labels, outputs=system.output_labels, name=system.name
    )


def state_space(
    A: np.ndarray,
    B: np.ndarray,
    C: np.ndarray,
    D: np.ndarray,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str],
) -> control.StateSpace:
    """Return a `control.StateSpace`; a system without inputs gets one named ``idle`` that acts on nothing.

    python-control cannot hold a system without inputs.
    """
    if not inputs:
        B, D, inputs = np.zeros((A.shape[0], 1)), np.zeros((C.shape[0], 1)), ["idle"]
    return control.StateSpace(A, B, C, D, inputs=list(inputs), outputs=list(outputs), states=list(states))


def split_off_channels(system: control.StateSpace, channels: int) -> Realization:
    """Split an ordinary system into external signals and, last, `channels` delayed ones."""
    if not isinstance(system, control.StateSpace):
        raise InputError(f"plant is a {type(system).__name__}: a control.StateSpace is needed")
    if system.dt not in (0, None):
        raise InputError(f"plant has dt = {system.dt}: only continuous time (dt = 0) is possible")
    p, q = system.noutputs - channels, system.ninputs - channels
    if p < 0 or q < 0:
        raise InputError(
            f"plant has {system.ninputs} inputs and {system.noutputs} outputs: "
            f"at least {channels} of each, for the delayed signals, are needed"
        )
    matrix = np.block([[system.A, system.B], [system.C, system.D]])
    return Realization.from_matrix(matrix, system.nstates, p, q)
