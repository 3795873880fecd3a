r"""The system matrix: a system in the polynomials and matrices that the user wrote down, before any realisation.

.. math::

    T(s)\, v = U(s)\, u, \qquad y = V(s)\, v + W(s)\, u

with entries that are polynomials in s times ``g_k e^{-s tau_k}`` [1]_. A transfer function n/d is ``T = d, U = 1,
V = n``; state delays are ``T = sI - A_0 - \sum A_k e^{-s tau_k}``; a delay is ``W = e^{-s tau}``. Joined systems only
put these beside each other, so that ``det T`` is the characteristic function in the user's own numbers: no companion
form, no factors of delayed matrices, no balancing. What a realisation loses, this keeps.

References
----------
.. [1] H. H. Rosenbrock, "State-Space and Multivariable Theory", Nelson, 1970: the system matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
import scipy.linalg
import scipy.special

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model.characteristic import Points
from susp_ctrl.delay_systems.model.lft import Realization

Term = tuple[int, int | None]
"""Power of s, and the number of the delay that goes with it."""


@dataclass(frozen=True, eq=False)
class SystemMatrix:
    """``[[T, U], [V, W]]`` as a sum of constant matrices times ``s**power`` times ``g_k exp(-s tau_k)``.

    Attributes
    ----------
    terms : mapping of (int, int or None) to ndarray
        Matrices of the power and the delay; all of one shape.
    unknowns : int
        Size of v.
    delays : int
        Number of delays that the terms count.
    """

    terms: Mapping[Term, FloatArray]
    unknowns: int
    delays: int = 0

    @classmethod
    def of_transfer_function(cls, system: control.TransferFunction) -> SystemMatrix:
        """Take every entry by itself: ``d v = u_j``, ``y_i = sum n v``."""
        entries = [(i, j) for i in range(system.noutputs) for j in range(system.ninputs)]
        k, p, q = len(entries), system.noutputs, system.ninputs
        terms: dict[Term, FloatArray] = {}
        for v, (i, j) in enumerate(entries):
            for row, coefficients in zip(
                (v, k + i), _without_common_factor(system.den[i][j], system.num[i][j]), strict=True
            ):
                for power, value in enumerate(coefficients[::-1].tolist()):
                    terms.setdefault((power, None), np.zeros((k + p, k + q)))[row, v] = value
            terms.setdefault((0, None), np.zeros((k + p, k + q)))[v, k + j] = 1.0
        return cls(terms, k)

    @classmethod
    def of_state_delays(
        cls,
        A: Sequence[FloatArray],
        B: FloatArray,
        C: FloatArray,
        D: FloatArray,
        delayed_inputs: Sequence[FloatArray],
    ) -> SystemMatrix:
        """Take ``x' = A_0 x + sum A_k x(t - tau_k) + B u + sum B_j u(t - d_j)``, ``y = C x + D u``."""
        n, nothing = A[0].shape[0], np.zeros_like(D)
        terms: dict[Term, FloatArray] = {
            (1, None): scipy.linalg.block_diag(np.eye(n), nothing),
            (0, None): np.block([[-A[0], B], [C, D]]),
        }
        for k, matrix in enumerate(A[1:]):
            terms[0, k] = scipy.linalg.block_diag(-matrix, nothing)
        for k, matrix in enumerate(delayed_inputs, len(A) - 1):
            terms[0, k] = np.block([[np.zeros((n, n)), matrix], [np.zeros_like(C), nothing]])
        return cls(terms, n, len(A) - 1 + len(delayed_inputs))

    @classmethod
    def of_realization(cls, plant: Realization, widths: Sequence[int]) -> SystemMatrix:
        """Take a plant closed through delayed signals: v is the state, and what leaves the delays."""
        n, m, p, q = plant.n_states, plant.n_channels, plant.n_outputs, plant.n_inputs
        whole = np.zeros((n + m + p, n + m + q))
        whole[:n] = np.hstack([-plant.A, -plant.B2, plant.B1])
        whole[n : n + m, n : n + m] = np.eye(m)
        whole[n + m :] = np.hstack([plant.C1, plant.D12, plant.D11])
        terms: dict[Term, FloatArray] = {(0, None): whole}
        if n:
            terms[1, None] = np.eye(*whole.shape) * (np.arange(n + m + q) < n)
        ends = np.cumsum(widths, dtype=int)
        for k, (end, width) in enumerate(zip(ends, widths, strict=True)):
            rows = np.arange(end - width, end)
            delayed = np.zeros_like(whole)
            delayed[n + rows] = np.hstack([-plant.C2, -plant.D22, plant.D21])[rows]
            terms[0, k] = delayed
        return cls(terms, n + m, len(widths))

    @property
    def outputs(self) -> int:
        """Number of outputs y."""
        return next(iter(self.terms.values())).shape[0] - self.unknowns

    @property
    def inputs(self) -> int:
        """Number of inputs u."""
        return next(iter(self.terms.values())).shape[1] - self.unknowns

    def beside(self, other: SystemMatrix) -> SystemMatrix:
        """Return both systems as one; the delays of `other` count on from those of this one."""
        moved = {(p, None if k is None else k + self.delays): m for (p, k), m in other.terms.items()}
        terms: dict[Term, FloatArray] = {}
        for key in self.terms.keys() | moved.keys():
            (T1, U1, V1, W1), (T2, U2, V2, W2) = self._parts(self.terms, key), other._parts(moved, key)
            both = (scipy.linalg.block_diag(*pair) for pair in ((T1, T2), (U1, U2), (V1, V2), (W1, W2)))
            terms[key] = _whole(*both)
        return SystemMatrix(terms, self.unknowns + other.unknowns, self.delays + other.delays)

    def transformed(self, left: FloatArray, right: FloatArray) -> SystemMatrix:
        """Return the system ``left H right``."""
        return self._mapped(lambda T, U, V, W: (T, U @ right, left @ V, left @ W @ right), self.unknowns)

    def joined(self, law: FloatArray, entry: FloatArray, exit_: FloatArray) -> SystemMatrix:
        """Close ``u = law y + entry r`` and return the system from r to ``exit_ y``: the outputs join v."""
        n, p, q = self.unknowns, self.outputs, entry.shape[1]

        def close(T: Any, U: Any, V: Any, W: Any) -> tuple[Any, ...]:
            nothing = np.zeros((exit_.shape[0], n + p)), np.zeros((exit_.shape[0], q))
            return np.block([[T, -U @ law], [-V, -W @ law]]), np.vstack([U @ entry, W @ entry]), *nothing

        result = self._mapped(close, n + p)
        constant = dict(result.terms)
        here = constant.setdefault((0, None), np.zeros((n + p + exit_.shape[0], n + p + q))).copy()
        here[n : n + p, n : n + p] += np.eye(p)
        here[n + p :, n : n + p] = exit_
        return SystemMatrix(constant | {(0, None): here}, n + p, self.delays)

    def _mapped(self, change: Any, unknowns: int) -> SystemMatrix:
        terms = {key: _whole(*change(*self._parts(self.terms, key))) for key in self.terms}
        return SystemMatrix(terms, unknowns, self.delays)

    def _parts(self, terms: Mapping[Term, FloatArray], key: Term) -> tuple[FloatArray, ...]:
        n, whole = self.unknowns, terms.get(key)
        if whole is None:
            whole = np.zeros((n + self.outputs, n + self.inputs))
        return whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]

    def response(self, s: ComplexArray, delays: FloatArray, gains: FloatArray) -> ComplexArray:
        """Return ``V T^-1 U + W`` at points s, shape (points, outputs, inputs)."""
        total = np.zeros((s.size, self.unknowns + self.outputs, self.unknowns + self.inputs), dtype=complex)
        for (power, k), matrix in self.terms.items():
            weight = s**power if k is None else s**power * gains[k] * np.exp(-s * delays[k])
            total += weight[:, None, None] * matrix
        n = self.unknowns
        T, U, V, W = total[:, :n, :n], total[:, :n, n:], total[:, n:, :n], total[:, n:, n:]
        return np.asarray(V @ np.linalg.solve(T, U) + W)

    def closed_by(self, delays: FloatArray, gains: FloatArray) -> DelayPolynomials:
        """Return T with the numbers of the delays and gains."""
        return DelayPolynomials.of(self, delays, gains)


def _without_common_factor(den: FloatArray, num: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bring the largest coefficient of a denominator near one, by a power of two where that rounds nothing."""
    given = [np.trim_zeros(np.atleast_1d(part), "f") for part in (den, num)]
    exponent = int(np.frexp(np.max(np.abs(given[0])))[1])
    scaled = [np.ldexp(part, -exponent) for part in given]
    kept = all(np.array_equal(np.ldexp(new, exponent), old) for new, old in zip(scaled, given, strict=True))
    first, second = scaled if kept else given
    return first, second


def _whole(T: FloatArray, U: FloatArray, V: FloatArray, W: FloatArray) -> FloatArray:
    return np.asarray(np.vstack([np.hstack([T, U]), np.hstack([V, W])]))


@dataclass(frozen=True, eq=False)
class DelayPolynomials:
    r"""The matrix :math:`T(s) = \sum_d e^{-s\tau_d} \sum_p s^p\, T_{dp}`, whose determinant has the roots of a loop.

    Attributes
    ----------
    coefficients : ndarray, shape (delays, powers, n, n)
        T_dp; the first delay is zero.
    delays : ndarray, shape (delays,)
        In seconds.
    """

    coefficients: FloatArray
    delays: FloatArray

    @classmethod
    def of(cls, system: SystemMatrix, delays: FloatArray, gains: FloatArray) -> DelayPolynomials:
        """Take T of a system matrix; equal delays are added up."""
        n = system.unknowns
        distinct, place = np.unique(np.append(0.0, delays), return_inverse=True)
        powers = 1 + max((power for power, _ in system.terms), default=0)
        coefficients = np.zeros((distinct.size, powers, n, n))
        for (power, k), matrix in system.terms.items():
            where, weight = (0, 1.0) if k is None else (place[k + 1], gains[k])
            coefficients[where, power] += weight * matrix[:n, :n]
        return cls(coefficients, distinct)

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.coefficients.shape[-1]

    @property
    def degrees(self) -> np.ndarray:
        """Highest power of s in every column; their sum is the number of roots without delays."""
        present = np.any(self.coefficients != 0.0, axis=(0, 2))
        powers = np.arange(present.shape[0])[:, None]
        return np.asarray(np.max(np.where(present, powers, 0), axis=0, initial=0))

    def __call__(self, s: Points) -> Points:
        """Return T at points s, shape (points, n, n)."""
        powers = np.asarray(s, dtype=complex)[:, None] ** np.arange(self.coefficients.shape[1])
        weights = np.exp(-np.multiply.outer(s, self.delays))[:, :, None] * powers[:, None, :]
        return np.tensordot(weights, self.coefficients.astype(complex), axes=2)

    def sizes(self, omega: FloatArray) -> FloatArray:
        """Return the sum of the magnitudes of all terms of T(jw), times ``1 + w tau`` where they are delayed."""
        powers = omega[:, None] ** np.arange(self.coefficients.shape[1])
        weights = (1.0 + np.multiply.outer(omega, self.delays))[:, :, None] * powers[:, None, :]
        return np.asarray(np.tensordot(weights, np.abs(self.coefficients), axes=2))

    def variation(self, omega: FloatArray, half: FloatArray) -> FloatArray:
        """Bound ``|T(s) - T(jw)|`` entry by entry for all s on the axis within `half` of jw, by Taylor's series."""
        count = self.coefficients.shape[1]
        s = 1j * omega[:, None]
        total = np.zeros((omega.size, self.size, self.size))
        turned = np.minimum(2.0, np.multiply.outer(half, self.delays))
        for order in range(count):
            powers = np.arange(count - order)
            factors = scipy.special.binom(powers + order, order) * s**powers
            derivative = np.abs(np.einsum("op,dpij->odij", factors, self.coefficients[:, order:]))
            weight = turned if order == 0 else np.broadcast_to(half[:, None] ** order, turned.shape)
            total += np.einsum("od,odij->oij", weight, derivative)
        return total
