r"""The linear fractional form: an ordinary plant closed through delayed signals.

Every loop with delays is an undelayed system ``P`` with inputs ``[u; w]`` and outputs ``[y; z]``,

.. math::

    \dot x = A x + B_1 u + B_2 w, \quad y = C_1 x + D_{11} u + D_{12} w, \quad
    z = C_2 x + D_{21} u + D_{22} w, \quad w_k(t) = g_k z_k(t - \tau_k),

whose response is a linear fractional transformation of the delays,

.. math::

    H(s) = P_{11} + P_{12} E (I - P_{22} E)^{-1} P_{21},  \qquad  E(s) = \mathrm{diag}(g_k e^{-s \tau_k}).

``P`` contains neither gains nor delays, so it is sampled once (`sample_plant`) and evaluated for any number of
them (`lft_response`).

References
----------
.. [1] K. Zhou, J. C. Doyle, K. Glover, "Robust and Optimal Control", Prentice Hall, 1996, chapter 10.
.. [2] A. J. Laub, "Efficient multivariable frequency response computations", IEEE Trans. Automatic Control
   26(2), 1981: one reduction of A serves all frequencies. Here it is the complex Schur form, which is backward
   stable whether or not A can be diagonalised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model.rounding import balancing

# Near a pole of P that the loop moves, P22 is large and H comes from P by cancellation. Beyond this size (three
# digits) the closed matrix is solved directly.
_LARGE_RETURN = 1e3
# Poles further apart than this are looked at, and the relative error of outputs that the Schur form may leave.
_WIDE = 1e3
_KEPT = 1e-12


def closed(m11: NDArray[Any], m12: NDArray[Any], m21: NDArray[Any], m22: NDArray[Any]) -> NDArray[Any]:
    """Return ``M11 + M12 (I - M22)^-1 M21``: the second outputs of M fed back to its second inputs.

    Every closed loop here is this one formula: what stands between the signals (a gain, ``e^{-s tau}``, an
    interconnection) is multiplied into the columns `m12` and `m22` beforehand. Leading axes broadcast.
    """
    return m11 + m12 @ return_solve(m22, m21)


def return_solve(m22: NDArray[Any], right_side: NDArray[Any]) -> NDArray[Any]:
    """Solve ``(I - M22) X = right_side``; one and two signals in closed form, not finite where singular."""
    signals = m22.shape[-1]
    if m22.ndim == 2 and not np.any(m22):
        return right_side
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if signals == 1:
            return right_side / (1.0 - m22)
        if signals == 2:
            m11, m12, m21 = 1.0 - m22[..., 0, 0], m22[..., 0, 1], m22[..., 1, 0]
            last = 1.0 - m22[..., 1, 1]
            inverse_det = (1.0 / (m11 * last - m12 * m21))[..., None]
            r1, r2 = right_side[..., 0, :], right_side[..., 1, :]
            first = (last[..., None] * r1 + m12[..., None] * r2) * inverse_det
            second = (m21[..., None] * r1 + m11[..., None] * r2) * inverse_det
            return np.stack([first, second], axis=-2)
        return np.linalg.solve(np.eye(signals) - m22, right_side)


class SchurBasis(NamedTuple):
    """``A = back @ triangular @ into`` with ``back @ into = I``."""

    triangular: ComplexArray
    into: ComplexArray
    back: ComplexArray


@dataclass(frozen=True, eq=False)
class Realization:
    """Matrices of the undelayed plant P, split by external signals (1) and delayed signals (2)."""

    A: FloatArray
    B1: FloatArray
    B2: FloatArray
    C1: FloatArray
    C2: FloatArray
    D11: FloatArray
    D12: FloatArray
    D21: FloatArray
    D22: FloatArray

    def __post_init__(self) -> None:
        for field in fields(self):
            array = np.array(getattr(self, field.name), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, field.name, array)

    @classmethod
    def between_channels(cls, A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> Realization:
        """Return a plant that has delayed signals only: ``x' = A x + B w, z = C x + D w``."""
        return cls.from_matrix(np.block([[A, B], [C, D]]), A.shape[0], 0, 0)

    @classmethod
    def from_matrix(cls, matrix: FloatArray, states: int, outputs: int, inputs: int) -> Realization:
        """Take apart ``[[A, B1, B2], [C1, D11, D12], [C2, D21, D22]]``."""
        rows, columns = (states, states + outputs), (states, states + inputs)
        parts = [np.split(band, columns, axis=1) for band in np.split(matrix, rows)]
        (A, B1, B2), (C1, D11, D12), (C2, D21, D22) = parts
        return cls(A, B1, B2, C1, C2, D11, D12, D21, D22)

    @property
    def matrix(self) -> FloatArray:
        """All blocks as one matrix, see `from_matrix`."""
        return np.block(
            [[self.A, self.B1, self.B2], [self.C1, self.D11, self.D12], [self.C2, self.D21, self.D22]]
        )

    def rebuilt(
        self, matrix: FloatArray, outputs: int | None = None, inputs: int | None = None
    ) -> Realization:
        """Return a plant with the same states and, if not told otherwise, signals from its one matrix."""
        p, q = self.n_outputs if outputs is None else outputs, self.n_inputs if inputs is None else inputs
        return Realization.from_matrix(matrix, self.n_states, p, q)

    def between(self, outputs: Sequence[int], inputs: Sequence[int]) -> Realization:
        """Return the plant from some external inputs to some external outputs."""
        n, p, q = self.n_states, self.n_outputs, self.n_inputs
        rows = [*range(n), *(n + k for k in outputs), *range(n + p, n + p + self.n_channels)]
        columns = [*range(n), *(n + k for k in inputs), *range(n + q, n + q + self.n_channels)]
        return self.rebuilt(self.matrix[np.ix_(rows, columns)], len(outputs), len(inputs))

    @property
    def n_states(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def n_inputs(self) -> int:
        """Number of external inputs u."""
        return self.D11.shape[1]

    @property
    def n_outputs(self) -> int:
        """Number of external outputs y."""
        return self.D11.shape[0]

    @property
    def n_channels(self) -> int:
        """Number of delayed signals."""
        return self.D22.shape[0]

    @cached_property
    def schur(self) -> SchurBasis:
        """The complex Schur form of A, balanced first."""
        if self.n_states == 0:
            return SchurBasis(*(np.zeros((0, 0), dtype=complex) for _ in range(3)))
        scale = balancing(self.A)
        T, Q = scipy.linalg.schur(self.A / scale[:, None] * scale, output="complex")
        return SchurBasis(T, Q.conj().T / scale, scale[:, None] * Q)

    @property
    def eigenvalues(self) -> ComplexArray:
        """Eigenvalues of A."""
        return np.diag(self.schur.triangular)

    @cached_property
    def has_graded_states(self) -> bool:
        """Whether states differ so much in size that the unitary basis of the Schur form loses outputs in rounding.

        The poles of a companion form can lie many orders apart. Asked around every pole, by solving directly.
        """
        sizes = np.unique(np.abs(self.eigenvalues))
        # a unitary basis keeps what is within these digits of the largest state
        if sizes.size < 2 or sizes[-1] < _WIDE * max(sizes[0], 1e-300):
            return False
        s = 1j * np.concatenate([sizes, 3.0 * sizes, 1e3 * sizes[-1:]])
        B, C = np.hstack([self.B1, self.B2]), np.vstack([self.C1, self.C2])
        direct = _solve_directly(self.A, s, B)
        error = np.abs(_times(C, _solve_by_schur(self, s, B) - direct))
        size = _times(np.abs(C), np.abs(direct))
        return bool(np.any(np.isfinite(size) & (size > 0.0) & ~(error <= _KEPT * size)))

    @property
    def fastest(self) -> float:
        """Largest modulus of an eigenvalue of A (rad/s); zero without states."""
        return float(np.max(np.abs(self.eigenvalues), initial=0.0))

    def closed_matrix(self, E: NDArray[Any]) -> NDArray[Any]:
        """Return ``A + B2 E (I - D22 E)^-1 C2`` for `E` of shape (..., channels): shape (..., states, states)."""
        return closed(self.A, self.B2 * E[..., None, :], self.C2, self.D22 * E[..., None, :])

    def closed_plant(self, E: NDArray[Any]) -> tuple[NDArray[Any], ...]:
        """Return A, B, C, D with the delayed signals closed by `E`, each of shape (..., rows, columns)."""
        n, e = self.n_states, E[..., None, :]
        whole = self.matrix
        rest, k = whole.shape[0] - self.n_channels, whole.shape[1] - self.n_channels
        M = closed(whole[:rest, :k], whole[:rest, k:] * e, whole[rest:, :k], whole[rest:, k:] * e)
        return M[..., :n, :n], M[..., :n, n:], M[..., n:, :n], M[..., n:, n:]


def inverses(matrices: np.ndarray) -> ComplexArray:
    """Invert many matrices; a singular one gives infinite entries."""
    if matrices.shape[-1] == 1:
        with np.errstate(all="ignore"):
            return np.asarray(1.0 / matrices, dtype=complex)
    try:
        return np.asarray(np.linalg.inv(matrices), dtype=complex)
    except np.linalg.LinAlgError:
        singular = np.linalg.det(matrices) == 0.0
        result = np.full_like(matrices, np.inf)
        result[~singular] = np.linalg.inv(matrices[~singular])
        return result


def around_resonances(poles: NDArray[Any], offsets: NDArray[Any], narrowest: float = 0.0) -> FloatArray:
    """Return frequencies at `offsets`, in half widths, around the resonance of every pole, unsorted."""
    width = np.maximum(np.abs(poles.real), narrowest)
    return np.asarray(np.abs(poles.imag)[:, None] + width[:, None] * offsets).ravel()


class SampledPlant(NamedTuple):
    """P at given points s: four blocks with axes (point, output, input)."""

    p11: ComplexArray
    p12: ComplexArray
    p21: ComplexArray
    p22: ComplexArray


def sample_plant(plant: Realization, s: ArrayLike) -> SampledPlant:
    """Evaluate ``P(s) = D + C (sI - A)^-1 B`` at many points at once.

    One Schur form serves all points; the triangular systems are solved for all of them together, and one step of
    iterative refinement on A itself removes the rounding of the change of basis. A plant with states of very
    different sizes is solved point by point instead.

    Parameters
    ----------
    plant : Realization
        The undelayed plant.
    s : array_like of complex, shape (n_points,)
        Points of the complex plane; at an eigenvalue of A the result is not finite.

    Returns
    -------
    SampledPlant
        Blocks of shape (n_points, outputs, inputs). In memory the points are contiguous.
    """
    points = np.atleast_1d(np.asarray(s, dtype=complex))
    B, C = np.hstack([plant.B1, plant.B2]), np.vstack([plant.C1, plant.C2])
    graded = plant.has_graded_states
    state = _solve_directly(plant.A, points, B) if graded else _solve_by_schur(plant, points, B)
    with np.errstate(invalid="ignore", over="ignore"):
        values = _times(C, state)
    p, q = plant.n_outputs, plant.n_inputs
    values[:p, :q] += plant.D11[..., None]
    values[:p, q:] += plant.D12[..., None]
    values[p:, :q] += plant.D21[..., None]
    values[p:, q:] += plant.D22[..., None]
    by_point = np.moveaxis(values, -1, 0)
    return SampledPlant(by_point[:, :p, :q], by_point[:, :p, q:], by_point[:, p:, :q], by_point[:, p:, q:])


def _solve_by_schur(plant: Realization, points: ComplexArray, B: FloatArray) -> ComplexArray:
    """Return ``(sI - A)^-1 B``, shape (states, columns, points)."""
    _, into, back = plant.schur
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        state = _times(back, _solve_triangular(plant.schur.triangular, points, (into @ B)[..., None]))
        residual = B[..., None] - points * state + _times(plant.A, state)
        state += _times(back, _solve_triangular(plant.schur.triangular, points, _times(into, residual)))
    return state


def _solve_directly(A: FloatArray, points: ComplexArray, B: FloatArray) -> ComplexArray:
    """Return ``(sI - A)^-1 B``, shape (states, columns, points), by elimination at every point."""
    matrices = points[:, None, None] * np.eye(A.shape[0]) - A
    try:
        state = np.linalg.solve(matrices, B)
    except np.linalg.LinAlgError:
        singular = np.linalg.det(matrices) == 0.0
        state = np.full((points.size, *B.shape), complex(np.nan, np.nan))
        state[~singular] = np.linalg.solve(matrices[~singular], B)
    return np.ascontiguousarray(np.moveaxis(state, 0, -1))


def _times(matrix: NDArray[Any], stack: ComplexArray) -> ComplexArray:
    """Multiply the first axis of a stack (n, columns, points)."""
    flat = matrix @ stack.reshape(stack.shape[0], stack.shape[1] * stack.shape[2])
    return flat.reshape(matrix.shape[0], *stack.shape[1:])


def _solve_triangular(T: ComplexArray, points: ComplexArray, right_side: ComplexArray) -> ComplexArray:
    """Solve ``(s I - T) X = right_side`` by back substitution at all points s together."""
    n, columns, _ = right_side.shape
    X = np.empty((n, columns, points.size), dtype=complex)
    for i in range(n - 1, -1, -1):
        X[i] = (right_side[i] + np.tensordot(T[i, i + 1 :], X[i + 1 :], axes=1)) / (points - T[i, i])
    return X


def lft_response(P: SampledPlant, E: ComplexArray) -> ComplexArray:
    """Return ``P11 + P12 E (I - P22 E)^-1 P21`` for many gains and delays at once.

    Parameters
    ----------
    P : SampledPlant
        Blocks of shape (frequencies, rows, columns).
    E : ndarray of complex, shape (..., frequencies, channels)
        ``g_k e^{-s tau_k}``; leading axes are particles, cases, samples.

    Returns
    -------
    ndarray of complex, shape (..., frequencies, outputs, inputs)
        The closed response; not finite where ``I - P22 E`` is singular.
    """
    e = E[..., None, :]
    return np.asarray(closed(P.p11, P.p12 * e, P.p21, P.p22 * e))


def return_determinant(p22: ComplexArray, E: ComplexArray) -> ComplexArray:
    """Return ``det(I - P22 E)``, shape ``E.shape[:-1]``; one and two channels in closed form."""
    channels = E.shape[-1]
    if channels == 0:
        return np.ones(E.shape[:-1], dtype=complex)
    if channels == 1:
        return 1.0 - p22[..., 0, 0] * E[..., 0]
    if channels == 2:
        e1, e2 = E[..., 0], E[..., 1]
        return (1.0 - p22[..., 0, 0] * e1) * (1.0 - p22[..., 1, 1] * e2) - (
            p22[..., 0, 1] * p22[..., 1, 0] * e1 * e2
        )
    determinant: ComplexArray = np.linalg.det(np.eye(channels) - p22 * E[..., None, :])
    return determinant


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
