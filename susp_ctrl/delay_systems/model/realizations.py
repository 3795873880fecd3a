r"""State space for what users write down: transfer functions, matrices with delays, plants with delayed signals.

A transfer function becomes a companion form whose entries are its own coefficients, each rounded once: time is scaled
by a power of two, and nothing is trimmed, however small. Matrices with delays,

.. math::

    \dot x(t) = A_0 x(t) + \sum_k A_k x(t - \tau_k) + B u(t) + \sum_j B_j u(t - d_j), \qquad y = C x + D u,

are factored, ``A_k = U_k V_k``, with as few signals as reproduce every single entry to rounding. No decision depends
on the units of time, states or signals, and each realisation is compared with the numbers that were given.
"""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real
from typing import Any

import control
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model.lft import Realization, sample_plant
from susp_ctrl.delay_systems.model.rounding import balancing
from susp_ctrl.delay_systems.model.system_matrix import SystemMatrix
from susp_ctrl.errors import InputError

# Roundings within which every entry of a factored matrix is kept, and relative to what rounding of the coefficients
# does the error at which a realisation is refused.
_ENTRY_ROUNDINGS = 8.0
_COMPARED = 1e-9


StateDelays = tuple[list[FloatArray], FloatArray, FloatArray, FloatArray, list[FloatArray]]
"""A_0, A_1, ...; B; C; D; and the delayed input matrices."""


def checked_state_delays(
    A: Sequence[ArrayLike],
    delays: ArrayLike,
    B: ArrayLike | None,
    C: ArrayLike | None,
    D: ArrayLike | None,
    input_terms: Sequence[tuple[ArrayLike, float]],
) -> tuple[StateDelays, FloatArray]:
    """Return the matrices of a system with state and input delays, and all delays; see `from_state_delays`."""
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
    given = (matrices, B1, C1, D11, [Bj for Bj, _ in delayed_inputs])
    return given, np.append(tau, [d for _, d in delayed_inputs])


def state_delay_realization(
    A: Sequence[FloatArray], B: FloatArray, C: FloatArray, D: FloatArray, delayed_inputs: Sequence[FloatArray]
) -> tuple[Realization, tuple[int, ...]]:
    """Return the plant and the widths of its delayed signals; see `checked_state_delays`."""
    n, q = B.shape
    factors = [_rank_factors(m) for m in A[1:]]
    input_factors = [_rank_factors(m) for m in delayed_inputs]
    widths = tuple(U.shape[1] for U, _ in (*factors, *input_factors))
    into = np.hstack([np.zeros((n, 0)), *(U for U, _ in (*factors, *input_factors))])
    from_state = np.vstack([np.zeros((0, n)), *(V for _, V in factors)])
    from_input = np.vstack([np.zeros((0, q)), *(V for _, V in input_factors)])
    direct = np.zeros((C.shape[0], into.shape[1]))
    out = scipy.linalg.block_diag(from_state, from_input)
    whole = np.block([[A[0], B, into], [C, D, direct], [out, np.zeros((into.shape[1],) * 2)]])
    return Realization.from_matrix(whole, n, C.shape[0], q), widths


def _input_term(j: int, term: Any, n: int) -> tuple[FloatArray, float]:
    pair = validation.sequence(f"input_terms[{j}]", term)
    if len(pair) != 2:
        raise InputError(f"input_terms[{j}] has {len(pair)} entries: a pair (matrix, delay) is needed")
    return (
        validation.matrix(f"input_terms[{j}]", pair[0], rows=n),
        validation.delay(f"input_terms[{j}] delay", pair[1]),
    )


def _rank_factors(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return U, V with ``matrix = U V`` and few columns of U, whatever the units of rows and columns.

    Rows that are combinations of others to within rounding of every single entry are expressed by them. Otherwise
    the non-zero rows, or the non-zero columns if they are fewer, are the signals, and the factors are exact.
    """
    rows = np.flatnonzero(np.any(matrix != 0.0, axis=1))
    columns = np.flatnonzero(np.any(matrix != 0.0, axis=0))
    factors = (np.eye(matrix.shape[0])[:, rows], matrix[rows])
    if columns.size < rows.size:
        factors = (matrix[:, columns], np.eye(matrix.shape[1])[columns])
    if min(rows.size, columns.size) < 2:
        return factors
    core = matrix[np.ix_(rows, columns)]
    left, right = _even_scales(core)
    _, R, order = scipy.linalg.qr((core * left[:, None] * right).T, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(R))
    rank = int(np.sum(sizes > max(core.shape) * np.finfo(float).eps * sizes[0]))
    if rank == min(core.shape):
        return factors
    # the chosen rows stay what they are, the others are combinations of them
    U = np.zeros((matrix.shape[0], rank))
    weights = scipy.linalg.solve_triangular(R[:rank, :rank], R[:rank, rank:]).T
    U[rows[order]] = np.vstack([np.eye(rank), weights * left[order[:rank]] / left[order[rank:], None]])
    V = matrix[rows[order[:rank]]]
    kept = np.all(np.abs(U @ V - matrix) <= _ENTRY_ROUNDINGS * np.finfo(float).eps * np.abs(matrix))
    return (U, V) if kept else factors


def _even_scales(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return powers of two that bring the largest entry of every row and column near one."""
    exponents = np.log2(np.abs(matrix), out=np.full(matrix.shape, -np.inf), where=matrix != 0.0)
    left, right = np.zeros(matrix.shape[0]), np.zeros(matrix.shape[1])
    for _ in range(3):
        left -= np.max(exponents + left[:, None] + right, axis=1)
        right -= np.max(exponents + left[:, None] + right, axis=0)
    return np.exp2(np.rint(left)), np.exp2(np.rint(right))


def taken_in(
    system: Any, name: str
) -> tuple[control.StateSpace | Realization, SystemMatrix | None, str | None]:
    """Return the plant of a system, number or matrix, what it was written in if not that, and its name.

    Raises
    ------
    InputError
        A discrete-time system, frequency data, or something that is no linear system.
    """
    if isinstance(system, control.TransferFunction):
        return state_space_of(system, name), SystemMatrix.of_transfer_function(system), system.name
    if isinstance(system, control.StateSpace):
        return system, None, system.name
    if is_number_like(system):
        D = validation.matrix(name, system)
        return Realization.from_matrix(D, 0, *D.shape), None, None
    raise InputError(
        f"{name} is a {type(system).__name__}: a linear continuous-time system or a number is needed"
    )


def is_number_like(value: Any) -> bool:
    """Whether a value can stand for a constant gain; truth values and complex numbers cannot."""
    if isinstance(value, (bool, np.bool_, np.complexfloating)):
        return False
    return isinstance(value, (Real, np.number, np.ndarray, list, tuple))


def state_space_of(system: control.TransferFunction, name: str = "system") -> control.StateSpace:
    """Return a state-space realisation of a continuous-time transfer function or matrix of them.

    Each entry of a matrix is realised by itself, so the result can have more states than the least possible; its
    response is the same.

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
        Discrete time, an entry with more zeros than poles, or coefficients so far apart that no realisation in
        double precision has the response that they give.
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
            entry, into, out, D[i, j] = _companion_form(num, den)
            _compare(f"{name} from input {j} to output {i}", num, den, entry, into, out, D[i, j])
            n = into.size
            A = scipy.linalg.block_diag(A, entry)
            column, row = np.zeros((n, system.ninputs)), np.zeros((system.noutputs, n))
            column[:, j], row[i] = into, out
            B, C = np.vstack([B, column]), np.hstack([C, row])
    return control.StateSpace(
        A, B, C, D, inputs=system.input_labels, outputs=system.output_labels, name=system.name
    )


def _companion_form(num: FloatArray, den: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return A, b, c, d of ``num/den`` in a time in which no coefficient of the polynomial exceeds the leading one."""
    n = den.size - 1
    with np.errstate(divide="ignore"):
        sizes = np.log2(np.abs(den)) - np.log2(abs(den[0]))
    ratios = sizes[1:] / np.arange(1.0, n + 1.0)
    exponent = int(np.ceil(np.max(ratios, initial=-np.inf))) if np.any(den[1:]) else 0
    powers = -exponent * np.arange(n + 1)
    a = _scaled(den, powers) / den[0]
    b = _scaled(np.append(np.zeros(n + 1 - num.size), num), powers) / den[0]
    A = np.zeros((n, n))
    A[:1], A[1:, :-1] = -a[1:], np.eye(n - 1) if n else 0.0
    A *= np.ldexp(1.0, exponent)
    c = (b[1:] - b[0] * a[1:]) * np.ldexp(1.0, exponent)
    into = np.eye(n)[0] if n else np.zeros(0)
    if n:
        scale = balancing(A)
        A, into, c = A / scale[:, None] * scale, into / scale, c * scale
    return A, into, c, float(b[0])


def _scaled(coefficients: FloatArray, powers: np.ndarray) -> FloatArray:
    return np.asarray(np.ldexp(coefficients, powers))


def _compare(
    name: str, num: FloatArray, den: FloatArray, A: FloatArray, b: FloatArray, c: FloatArray, d: float
) -> None:
    """Compare a realisation with the coefficients it was made from, on the axis around all poles and zeros."""
    corners = np.abs(np.concatenate([np.roots(den), np.roots(num)])) if den.size > 1 else np.zeros(0)
    corners = corners[(corners > 0.0) & np.isfinite(corners)]
    omega = (
        np.unique(np.concatenate([corners, 0.1 * corners, 10.0 * corners])) if corners.size else np.ones(1)
    )
    s = 1j * omega
    plant = Realization.from_matrix(np.block([[A, b[:, None]], [c, d]]), b.size, 1, 1)
    found = sample_plant(plant, s).p11[:, 0, 0]
    with np.errstate(all="ignore"):
        below, scale = np.polyval(den, s), np.polyval(np.abs(den), omega)
        given = np.polyval(num, s) / below
        # what rounding of the coefficients themselves does to the value, in units of the rounding, and a margin for
        # values far below the direct feedthrough, of which they are a small difference
        doubt = (np.polyval(np.abs(num), omega) + np.abs(given) * scale) / np.abs(below)
        error = np.abs(found - given) / (doubt + 1e3 * np.abs(given))
    # where the numbers overflow, or on a pole, there is nothing to compare
    known = np.isfinite(given) & np.isfinite(doubt) & (np.abs(below) > 1e-8 * scale)
    worst = np.flatnonzero(known & ~(error <= _COMPARED))
    if worst.size or not np.all(np.isfinite(A)) or not np.all(np.isfinite(c)):
        raise InputError(
            f"{name}: no state space in double precision has the response of these coefficients: give it as a "
            "product of transfer functions of lower order, or in another unit of time"
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
