r"""The return difference of a loop near a frequency: Taylor polynomials with a bound of what they miss.

Whatever the margins ask of a loop L with one input and output is a linear condition on

.. math:: S_\pm(j\omega) = \frac{1}{1 \pm L(j\omega)}, \qquad
    |L| = 1 \Leftrightarrow \mathrm{Re}\, S_\pm = \tfrac12, \qquad
    L \in \mathbb{R} \Leftrightarrow \mathrm{Im}\, S_\pm = 0 .

A pole of L is a zero of S, so integrators and undamped modes are no obstacle, and of S+ and S- at least one is of
modulus one or less. For the second condition L may have any weight, which keeps the digits of small and large gains.
With the states x, the delayed signals w and the input u as unknowns, S is u in

.. math::

    \begin{bmatrix} sI - A & -B_2 & -B_1 \\ -E C_2 & I - E D_{22} & -E D_{21} \\
    \pm C_1 & \pm D_{12} & 1 \pm D_{11} \end{bmatrix} \begin{bmatrix} x \\ w \\ u \end{bmatrix} = e_{last},
    \qquad E = \mathrm{diag}(e^{-s\tau_k}),

a matrix K that is entire in the frequency. Its expansion about a centre gives that of S, and a bound on the matrix
within a disc, entry by entry and so free of units, gives the remainder. With weight zero the same unknowns give L,
and S follows as the reciprocal of a series: that is sharper away from poles of L. Without delays all of it holds in
:math:`\nu = 1/\omega` about zero, that is about infinite frequency.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import shortest_path

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.frequency.response_bounds import state_scale
from susp_ctrl.delay_systems.model import FoldedLoop, inverses, perron_bound

_ORDER = 6
_EPSILON = float(np.finfo(float).eps)
_ROUNDINGS = 16.0
_LARGEST_NOISE = 1e-8


class Expansion(NamedTuple):
    """Taylor coefficients of S about centres, shape (points, order + 1), and how far rounding moves them.

    `remainder` (points,) bounds what the polynomial misses within twice the half width of each interval, complex
    frequencies included; infinite where nothing is known.
    """

    coefficients: ComplexArray
    rounding: FloatArray
    remainder: FloatArray

    @property
    def order(self) -> int:
        """Highest power."""
        return self.coefficients.shape[1] - 1


class _Unknowns(NamedTuple):
    """Coefficients of the unknowns in ``delta / unit``, (points, order + 1, size), and what bounds their rest."""

    states: ComplexArray
    errors: FloatArray
    resolvent: FloatArray
    linear: FloatArray
    unit: float


class ReturnDifference:
    """K of one loop with one input and output.

    Parameters
    ----------
    loop : FoldedLoop
        The open loop.
    """

    def __init__(self, loop: FoldedLoop) -> None:
        plant, self.delays = loop
        self.n, m = plant.n_states, plant.n_channels
        # closed through the delay behind the output too: without any cycle the units would be arbitrary
        C1 = np.abs(plant.C1) + np.abs(plant.D12) @ np.abs(plant.C2)
        scale = state_scale(plant.A, np.hstack([plant.B2, plant.B1]), np.vstack([plant.C2, C1]))
        self.A = plant.A * scale / scale[:, None]
        self.into = np.hstack([plant.B2, plant.B1]) / scale[:, None]
        self.around = np.hstack([plant.C2 * scale, plant.D22, plant.D21])
        self.out = np.hstack([plant.C1 * scale, plant.D12, plant.D11])[0]
        self.size = self.n + m + 1
        self.elimination = _order(np.vstack([np.hstack([self.A, self.into]), self.around])[:, :-1])

    def values(self, omega: FloatArray, weight: FloatArray) -> ComplexArray:
        """Return S at frequencies (rad/s), with L multiplied by weights; infinite where 1 + weight L vanishes."""
        return self._inverses(self._matrices(omega, weight))[:, -1, -1]

    def expansion(self, omega: FloatArray, weight: FloatArray, half: FloatArray | None = None) -> Expansion:
        """Expand S, with L multiplied by weights, about frequencies; `half` are half widths for the remainder."""
        K = self._matrices(omega, weight)
        unknowns = self._unknowns(K, self._inverses(K), self._by_frequency, _ORDER, 1.0)
        rest = np.zeros((omega.size, self.size)) if half is None else self._rest(unknowns, 2.0 * half)
        return Expansion(unknowns.states[:, :, -1], unknowns.errors[:, :, -1], rest[:, -1])

    def expansion_within(
        self, omega: FloatArray, half: FloatArray, any_weight: bool
    ) -> tuple[Expansion, FloatArray]:
        """Expand S on intervals, and return the weight of L chosen for each.

        Its sign brings L into the right half plane, so that 1 + L has no zero near; its size is one or, with
        `any_weight`, such that L is near to size one. Where L varies by its own size the weight stays closer to one,
        the more so the smaller the interval is: about a pole or zero the weighted function must come to look linear.
        """
        K = self._matrices(omega, np.zeros(omega.size))
        unknowns = self._unknowns(K, self._inverses(K), self._by_frequency, _ORDER, 1.0)
        with np.errstate(invalid="ignore"):
            L, wrong = unknowns.states @ self.out, unknowns.errors @ np.abs(self.out)
            missed = self._rest(unknowns, 2.0 * half) @ np.abs(self.out)
        weight = np.where(L[:, 0].real >= 0.0, 1.0, -1.0)
        if any_weight:
            with np.errstate(all="ignore"):
                size = np.abs(L[:, 0])
                room = 1.0 + 8.0 * np.abs(L[:, 1] / L[:, 0]) * np.sqrt(half * omega)
                scale = np.clip(1.0, 1.0 / (size * room), room / size)
                # nothing but rounding is no value to bring to size one
                scale = np.fmin(scale, np.fmax(_LARGEST_NOISE / wrong[:, 0], 1.0))
            weight *= np.where(np.isfinite(scale) & (scale > 0.0), scale, 1.0)
        found = _reciprocal(
            weight[:, None] * L, np.abs(weight[:, None]) * wrong, np.abs(weight) * missed, half
        )
        near_pole = np.flatnonzero(~np.isfinite(found.remainder))
        if near_pole.size:
            directly = self.expansion(omega[near_pole], weight[near_pole], half[near_pole])
            for part, own in zip(found, directly, strict=True):
                part[near_pole] = own
        return found, weight

    def expansion_at_zero(self, half: FloatArray, any_weight: bool) -> tuple[Expansion, float]:
        """Expand S about zero, for several half widths in a unit that is returned.

        The order is such that without delays a function whose coefficients vanish is zero everywhere.
        """
        zero = np.zeros(1)
        weight = self.expansion_within(zero, zero, any_weight)[1]
        K = self._matrices(zero, weight)
        return self._at_end(K, self._inverses(K), self._by_frequency, half)

    def expansion_at_infinity(self, half: FloatArray) -> tuple[Expansion, float]:
        """Expand S in ``1/omega`` about zero, without delays, for several half widths in a unit that is returned."""
        n, out = self.n, self.out if self.out[-1] >= 0.0 else -self.out
        K = np.eye(self.size, dtype=complex)
        K[:n, :n] *= 1j
        K[-1] += out
        # the inverse of this triangle in closed form: what is exactly zero tells the relative degree
        X = np.eye(self.size, dtype=complex)
        X[:n, :n] *= -1j
        X[-1, :n], X[-1, -1] = 1j * out[:n] / K[-1, -1], 1.0 / K[-1, -1]
        linear = np.zeros((self.size, self.size), dtype=complex)
        linear[:n, :n], linear[:n, n:] = -self.A, -self.into
        return self._at_end(K[None], X[None], linear, half)

    def _at_end(
        self, K: ComplexArray, X: ComplexArray, linear: ComplexArray, half: FloatArray
    ) -> tuple[Expansion, float]:
        """Expand about one end; without delays g has a numerator whose degree this order exceeds."""
        change = np.abs(linear)
        change[self.n : -1] += self.delays[:, None] * np.abs(self.around)
        with np.errstate(all="ignore"):
            radius = float(perron_bound(np.abs(X) @ change)[0])
        # where K changes by its own size: high powers stay within the range of numbers
        unit = 1.0 / radius if 0.0 < radius < np.inf else 1.0
        unknowns = self._unknowns(K, X, linear, 2 * (self.size + 1), unit)
        remainder = self._rest(unknowns, 2.0 * half)[:, -1]
        return Expansion(unknowns.states[:, :, -1], unknowns.errors[:, :, -1], remainder), unit

    def _matrices(self, omega: FloatArray, weight: FloatArray) -> ComplexArray:
        n = self.n
        K = np.zeros((omega.size, self.size, self.size), dtype=complex)
        K[:, :n, :n] = 1j * omega[:, None, None] * np.eye(n) - self.A
        K[:, :n, n:] = -self.into
        K[:, n:-1, :] = -np.exp(-1j * np.multiply.outer(omega, self.delays))[:, :, None] * self.around
        K[:, -1, :] = weight[:, None] * self.out
        K[:, n:, n:] += np.eye(self.size - n)
        return K

    def _inverses(self, K: ComplexArray) -> ComplexArray:
        """Invert matrices in the order of signals in which elimination keeps to the loop's own zeros.

        What drives a signal comes after it, so that K without its last row is block triangular and no pivot is taken
        from another block: a chain of integrators is inverted by substitution, exact to rounding of each entry.
        """
        X = np.empty_like(K)
        order = self.elimination
        X[:, order[:, None], order] = inverses(K[:, order[:, None], order])
        return X

    @property
    def _by_frequency(self) -> ComplexArray:
        """The derivative of the part of K that is linear in the frequency."""
        linear = np.zeros((self.size, self.size), dtype=complex)
        linear[: self.n, : self.n] = 1j * np.eye(self.n)
        return linear

    def _unknowns(
        self, K: ComplexArray, X: ComplexArray, linear: ComplexArray, order: int, unit: float
    ) -> _Unknowns:
        """Solve ``(K + delta K' + ...) (x_0 + delta x_1 + ...) = e_last`` for one power after another."""
        n, delayed = self.n, K[:, self.n : -1].copy()
        delayed -= np.eye(self.size)[n:-1]
        size_X, size_K = np.abs(X), np.abs(K)
        size_1, size_delayed = unit * np.abs(linear), np.abs(delayed)
        states, right = [X[:, :, -1]], np.zeros_like(X[:, :, -1])
        errors: list[FloatArray] = []
        with np.errstate(all="ignore"):
            for k in range(order + 1):
                wrong = np.zeros(right.shape)
                if k:
                    right, wrong = -unit * (states[-1] @ linear.T), errors[-1] @ size_1.T
                    turn = np.ones_like(self.delays, dtype=complex)
                    for i in range(1, k + 1):
                        turn = turn * (-1j * unit * self.delays / i)
                        right[:, n:-1] -= turn * (delayed @ states[k - i][:, :, None])[:, :, 0]
                        wrong[:, n:-1] += np.abs(turn) * (size_delayed @ errors[k - i][:, :, None])[:, :, 0]
                    states.append((X @ right[:, :, None])[:, :, 0])
                summed = (size_K @ np.abs(states[k])[:, :, None])[:, :, 0] + np.abs(right)
                wrong += _ROUNDINGS * _EPSILON * summed
                errors.append((size_X @ wrong[:, :, None])[:, :, 0])
        return _Unknowns(np.stack(states, axis=1), np.stack(errors, axis=1), size_X, size_1, unit)

    def _rest(self, unknowns: _Unknowns, reach: FloatArray) -> FloatArray:
        """Bound the unknowns minus their polynomials for complex ``|delta / unit| <= reach``, shape (reaches, size).

        One reach for each point, or several about one.
        """
        x, X, linear = np.abs(unknowns.states), unknowns.resolvent, unknowns.linear
        order = x.shape[1] - 1
        turned, around, n = np.multiply.outer(reach * unknowns.unit, self.delays), np.abs(self.around), self.n
        missed = np.zeros((reach.size, self.size))
        change = reach[:, None, None] * linear
        with np.errstate(all="ignore"):
            missed += reach[:, None] ** (order + 1) * (x[:, order] @ linear.T)
            growth = np.exp(turned)
            change[:, n:-1] += np.expm1(turned)[:, :, None] * around
            rest = growth.copy()
            for q in range(1, order + 2):
                # what the series of e^{-j tau delta} has from the power q on
                rest = rest * turned / q
                moved = x[:, order + 1 - q] @ around.T
                missed[:, n:-1] += reach[:, None] ** (order + 1 - q) * rest * moved
            contraction = X @ change
            right = np.stack([np.ones_like(missed), (X @ missed[:, :, None])[:, :, 0]], axis=2)
            left = np.eye(self.size) - contraction
            finite = np.isfinite(left).all(axis=(1, 2)) & np.isfinite(right).all(axis=(1, 2))
            usable = np.flatnonzero(finite)
            usable = usable[np.linalg.det(left[usable]) > 0.0]
            solved = np.linalg.solve(left[usable], right[usable])
        result = np.full((reach.size, self.size), np.inf)
        # u >= 1 with contraction u = u - 1 < u proves that the series of powers converges
        certain = np.all(solved[:, :, 0] >= 1.0 - 1e-9, axis=1)
        result[usable] = np.where(certain[:, None], solved[:, :, 1], np.inf)
        return result


def _order(driven_by: FloatArray) -> np.ndarray:
    """Order signals, the input last, such that each comes before those that drive it and do not depend on it."""
    drives = np.isfinite(shortest_path(driven_by != 0.0, unweighted=True))
    return np.append(np.argsort(-drives.sum(axis=1), kind="stable"), len(driven_by))


def _reciprocal(L: ComplexArray, wrong: FloatArray, missed: FloatArray, half: FloatArray) -> Expansion:
    """Expand ``S = 1/(1 + L)`` from the coefficients of L, their errors and the bound of what they miss.

    With P the polynomial of S and ``(1 + L) P = 1 - e`` it is ``S - P = e P / (1 - e)``.
    """
    order = L.shape[1] - 1
    S, errors = np.zeros_like(L), np.zeros_like(wrong)
    with np.errstate(all="ignore"):
        S[:, 0] = 1.0 / (1.0 + L[:, 0])
        size = np.abs(S[:, 0])
        errors[:, 0] = size**2 * wrong[:, 0] + _EPSILON * size
        for k in range(1, order + 1):
            S[:, k] = -S[:, 0] * (L[:, 1 : k + 1] * S[:, k - 1 :: -1][:, :k]).sum(axis=1)
            moved = np.abs(L[:, 1 : k + 1]) * errors[:, k - 1 :: -1][:, :k]
            moved += wrong[:, 1 : k + 1] * np.abs(S[:, k - 1 :: -1][:, :k])
            errors[:, k] = size * moved.sum(axis=1) + np.abs(S[:, k]) * (errors[:, 0] / size + _EPSILON)
        reach = 2.0 * half[:, None] ** 1
        power = reach ** np.arange(2 * order + 1)
        largest = (np.abs(S) * power[:, : order + 1]).sum(axis=1)
        e = missed * largest
        for k in range(order + 1, 2 * order + 1):
            beyond = (L[:, k - order :] * S[:, : k - order - 1 : -1]).sum(axis=1)
            e += np.abs(beyond) * power[:, k]
        remainder = np.where(e < 0.5, 2.0 * e * largest, np.inf)
    return Expansion(S, errors, remainder)
