r"""The linear fractional form: an ordinary plant closed through delayed signals.

Every loop with delays is an undelayed system ``P`` with inputs ``[u; w]`` and outputs ``[y; z]``,

.. math::

    \dot x &= A x + B_1 u + B_2 w \\
    y      &= C_1 x + D_{11} u + D_{12} w \\
    z      &= C_2 x + D_{21} u + D_{22} w,  \qquad  w_k(t) = g_k z_k(t - \tau_k),

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

from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


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
    def schur(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Triangular T, and the matrices [B1 B2] and [C1; C2] in the same (balanced, complex Schur) basis."""
        B, C = np.hstack([self.B1, self.B2]), np.vstack([self.C1, self.C2])
        if self.n_states == 0:
            return self.A.astype(complex), B.astype(complex), C.astype(complex)
        balanced, (scale, _) = scipy.linalg.matrix_balance(self.A, permute=False, separate=True)
        T, Q = scipy.linalg.schur(balanced, output="complex")
        return T, Q.conj().T @ (B / scale[:, None]), (C * scale) @ Q

    @property
    def eigenvalues(self) -> ComplexArray:
        """Eigenvalues of A."""
        return np.diag(self.schur[0])

    def closed_matrix(self, E: ComplexArray) -> ComplexArray:
        """Return ``A + B2 E (I - D22 E)^-1 C2`` for `E` of shape (..., channels): shape (..., states, states)."""
        around = np.eye(self.n_channels) - self.D22 * E[..., None, :]
        delayed = np.linalg.solve(around, np.broadcast_to(self.C2, (*E.shape[:-1], *self.C2.shape)))
        closed: ComplexArray = self.A + (self.B2 * E[..., None, :]) @ delayed
        return closed


class SampledPlant(NamedTuple):
    """P at given points s: four blocks with axes (point, output, input)."""

    p11: ComplexArray
    p12: ComplexArray
    p21: ComplexArray
    p22: ComplexArray


def sample_plant(plant: Realization, s: ArrayLike) -> SampledPlant:
    """Evaluate ``P(s) = D + C (sI - A)^-1 B`` at many points at once.

    One Schur form serves all points; the triangular systems are solved for all of them together.

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
    T, B, C = plant.schur
    n, columns = B.shape
    solution = np.empty((n, columns, points.size), dtype=complex)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for i in range(n - 1, -1, -1):
            right_side = np.broadcast_to(B[i][:, None], (columns, points.size))
            if i + 1 < n:
                right_side = right_side + np.tensordot(T[i, i + 1 :], solution[i + 1 :], axes=1)
            solution[i] = right_side / (points - T[i, i])
        values = (C @ solution.reshape(n, columns * points.size)).reshape(C.shape[0], columns, points.size)
    p, q = plant.n_outputs, plant.n_inputs
    values[:p, :q] += plant.D11[..., None]
    values[:p, q:] += plant.D12[..., None]
    values[p:, :q] += plant.D21[..., None]
    values[p:, q:] += plant.D22[..., None]
    by_point = np.moveaxis(values, -1, 0)
    return SampledPlant(by_point[:, :p, :q], by_point[:, :p, q:], by_point[:, p:, :q], by_point[:, p:, q:])


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
    return P.p11 + (P.p12 * E[..., None, :]) @ return_solve(P.p22, E, P.p21)


def return_solve(p22: ComplexArray, E: ComplexArray, right_side: ComplexArray) -> ComplexArray:
    """Solve ``(I - P22 E) X = right_side``; one and two channels in closed form."""
    channels = E.shape[-1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if channels == 0:
            return np.broadcast_to(right_side, (*E.shape[:-1], 0, right_side.shape[-1]))
        if channels == 1:
            return right_side / (1.0 - p22 * E[..., None, :])
        if channels == 2:
            e1, e2 = E[..., 0], E[..., 1]
            m11, m22 = 1.0 - p22[..., 0, 0] * e1, 1.0 - p22[..., 1, 1] * e2
            m12, m21 = p22[..., 0, 1] * e2, p22[..., 1, 0] * e1
            inverse_det = (1.0 / (m11 * m22 - m12 * m21))[..., None]
            r1, r2 = right_side[..., 0, :], right_side[..., 1, :]
            first = (m22[..., None] * r1 + m12[..., None] * r2) * inverse_det
            second = (m21[..., None] * r1 + m11[..., None] * r2) * inverse_det
            return np.stack([first, second], axis=-2)
        return np.linalg.solve(np.eye(channels) - p22 * E[..., None, :], right_side).astype(complex, copy=False)


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
