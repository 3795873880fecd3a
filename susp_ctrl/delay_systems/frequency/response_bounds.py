r"""How far a response can move near a sampled frequency: bounds that need no further samples.

With the delayed signals as unknowns beside the states the loop is

.. math::

    M(s) v = N(s) u, \quad y = L v + D_{11} u, \quad
    M = \begin{bmatrix} sI - A & -B_2 \\ -E C_2 & I - E D_{22} \end{bmatrix}, \quad
    N = \begin{bmatrix} B_1 \\ E D_{21} \end{bmatrix}, \quad L = [C_1 \; D_{12}].

From :math:`j\omega` to :math:`j(\omega + \delta)`, :math:`|\delta| \le h`, the delays turn by at most
:math:`\tau h`, so M and N stay within known distance of their linear expansions, entry by entry, and so does

.. math:: H(j(\omega + \delta)) = H + \delta H' + \text{remainder}, \quad |\text{remainder}| \le h^2 \ldots
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import FoldedLoop, balancing, direct_paths, inverses, loop_rate


class LocalResponse(NamedTuple):
    """Response and derivative by frequency at centres, with a bound of what the linear expansion misses.

    Shapes (points, outputs, inputs), remainder (points,): largest singular value, inf where nothing is known.
    """

    value: np.ndarray
    derivative: np.ndarray
    remainder: FloatArray

    def upper_bound(self, half: FloatArray) -> FloatArray:
        """Largest singular value within `half` of each centre cannot exceed this.

        The largest singular value of a matrix that is linear in the frequency is convex: its ends decide.
        """
        h = half[:, None, None]
        ends = np.maximum(_gain(self.value + h * self.derivative), _gain(self.value - h * self.derivative))
        return ends + self.remainder


def in_even_units(loop: FoldedLoop) -> FoldedLoop:
    """Return the loop in units of states and delayed signals in which bounds entry by entry are sharp."""
    plant, (n, p, q) = loop.plant, (loop.plant.n_states, loop.plant.n_outputs, loop.plant.n_inputs)
    rate = loop_rate(np.block([[plant.A, plant.B2], [plant.C2, plant.D22]]), n)
    # with every output led to every input there is a way out of, and into, every state and signal at work
    size = np.zeros((n + q + p + plant.n_channels,) * 2)
    driving = np.append(np.arange(n + q), np.arange(n + q + p, len(size)))
    driven = np.append(np.arange(n), np.arange(n + q, len(size)))
    size[np.ix_(driven, driving)] = np.abs(plant.matrix)
    size[n : n + q, n + q : n + q + p] = 1.0
    size[:n] /= rate
    scale = balancing(size)
    scale[n : n + q + p] = 1.0
    return FoldedLoop(plant.rebuilt(plant.matrix / scale[driven, None] * scale[driving]), loop.delays)


def local_response(loop: FoldedLoop, omega: FloatArray, half: FloatArray) -> LocalResponse:
    """Expand the response of a loop about centres, with a bound on ``|omega' - omega| <= half``.

    Parameters
    ----------
    loop : FoldedLoop
        The loop, without gains, in even units.
    omega, half : ndarray, shape (points,)
        Centres and half widths (rad/s).
    """
    plant, tau = loop
    n, size = plant.n_states, plant.n_states + plant.n_channels
    X, L, v, dv = _expanded(loop, np.asarray(1j * omega, dtype=complex))
    value, derivative = plant.D11 + L @ v, 1j * (L @ dv)

    reach, steps = np.abs(X), half[:, None, None]
    delayed = np.hstack([np.abs(plant.C2), np.abs(plant.D22)])
    first = np.zeros((size, size))
    first[:n, :n], first[n:] = np.eye(n), tau[:, None] * delayed
    second, second_input = np.zeros((size, size)), np.zeros((size, plant.n_inputs))
    second[n:], second_input[n:] = (
        0.5 * tau[:, None] ** 2 * delayed,
        0.5 * tau[:, None] ** 2 * np.abs(plant.D21),
    )
    missed = steps**2 * (second_input + second @ np.abs(v) + first @ np.abs(dv))
    contraction = reach @ first * steps
    # the sum of its powers, if there is one: x > 0 with G x < x certifies a radius below one (Collatz and Wielandt),
    # and unlike a norm that does not depend on the units of states, signals and time
    inverse = inverses(np.eye(size) - contraction).real
    x = inverse.sum(axis=2, keepdims=True)
    with np.errstate(invalid="ignore", over="ignore"):
        certain = np.all((x > 0.0) & (contraction @ x < x), axis=(1, 2))
    beyond = np.abs(L) @ inverse[certain] @ reach[certain] @ missed[certain]
    remainder = np.full(omega.size, np.inf)
    remainder[certain] = np.sqrt((beyond**2).sum(axis=(1, 2)))
    return LocalResponse(value, derivative, remainder)


def _expanded(
    loop: FoldedLoop, s: ComplexArray
) -> tuple[ComplexArray, FloatArray, ComplexArray, ComplexArray]:
    """Return ``M^-1``, L, and the unknowns v with their derivative dv/ds."""
    plant, tau = loop
    n, m, k = plant.n_states, plant.n_channels, s.size
    E, one = loop.exponentials(s)[:, :, None], np.eye(n + m)
    around, driven = np.hstack([plant.C2, plant.D22]), plant.D21
    M, N = np.zeros((k, n + m, n + m), dtype=complex), np.zeros((k, n + m, plant.n_inputs), dtype=complex)
    M[:, :n] = s[:, None, None] * one[:n] - np.hstack([plant.A, plant.B2])
    M[:, n:] = one[n:] - E * around
    N[:, :n], N[:, n:] = plant.B1, E * driven
    turn = -tau[:, None] * E
    M1, N1 = np.zeros_like(M), np.zeros_like(N)
    M1[:, :n], M1[:, n:], N1[:, n:] = one[:n], -turn * around, turn * driven
    X = inverses(M)
    v = X @ N
    return X, np.hstack([plant.C1, plant.D12]), v, X @ (N1 - M1 @ v)


class TailBound(NamedTuple):
    """Beyond the frequency `start`, ``sigma(H) <= direct + slope/(omega - start)``.

    `direct` bounds what passes without any state, delayed or not; `undelayed` is its part without delays, which
    is the limit of the response where nothing delayed passes directly.
    """

    direct: float
    slope: float
    start: float
    undelayed: float

    def at(self, omega: float) -> float:
        """Bound of the largest singular value at all frequencies from `omega` on."""
        if self.slope == 0.0:
            return self.direct
        return self.direct + self.slope / (omega - self.start) if omega > self.start else np.inf


def tail_bound(loop: FoldedLoop) -> TailBound:
    """Bound the response of a loop in even units at high frequencies, for all delays at once.

    Beyond ``rho = ||A + B2 E (I - E D22)^-1 C2||`` the state follows as ``1/(omega - rho)``.
    """
    plant, _ = loop
    # signs of paths that cancel can hide a cycle from the test of the class but not from the sum of their sizes
    if np.any(np.linalg.matrix_power(np.abs(plant.D22), plant.n_channels) > 0.0) and plant.n_channels:
        return TailBound(np.inf, np.inf, np.inf, np.inf)
    around = direct_paths(plant.D22)
    A, B1, B2, C1, C2, D12, D21 = (
        np.abs(x) for x in (plant.A, plant.B1, plant.B2, plant.C1, plant.C2, plant.D12, plant.D21)
    )
    loop_norm = _norm(A + B2 @ around @ C2)
    slope = _norm(C1 + D12 @ around @ C2) * _norm(B1 + B2 @ around @ D21)
    direct = _norm(np.abs(plant.D11) + D12 @ around @ D21)
    return TailBound(direct, slope, loop_norm, _norm(plant.D11))


def state_scale(A: FloatArray, B: FloatArray, C: FloatArray) -> FloatArray:
    """Units of the states in which the loop's matrix has even magnitudes."""
    return balancing(np.abs(A) + np.abs(B) @ np.abs(C))


class HighFrequencySeries(NamedTuple):
    r"""A response with one input and output as a power series in :math:`\nu = 1/\omega`, for all delays at once.

    .. math:: H = \sum_{k \le K} ((-j)^k c_k + d_k) \nu^k + \ldots, \qquad |d_k| \le r_k

    The terms c, in which nothing delayed takes part, alternate between real and imaginary.
    """

    undelayed: FloatArray
    delayed: FloatArray
    around: FloatArray
    into: FloatArray
    out: FloatArray

    @classmethod
    def of(cls, loop: FoldedLoop) -> HighFrequencySeries:
        """Return the series of a loop, two terms longer than it has states."""
        plant, _ = loop
        paths, scale = direct_paths(plant.D22), state_scale(plant.A, plant.B2, plant.C2)
        A, B2, B1 = plant.A * scale / scale[:, None], plant.B2 / scale[:, None], plant.B1[:, 0] / scale
        C1, C2, D12 = plant.C1[0] * scale, np.abs(plant.C2) * scale, np.abs(plant.D12[0])
        back = np.abs(B2) @ paths
        x, moved, signals = np.zeros_like(B1), np.zeros_like(B1), paths @ np.abs(plant.D21[:, 0])
        into, terms = np.abs(B1) + np.abs(B2) @ signals, [(plant.D11[0, 0], D12 @ signals)]
        for k in range(plant.n_states + 2):
            x, moved = A @ x + (B1 if k == 0 else 0.0), np.abs(A) @ moved + np.abs(B2) @ signals
            signals = paths @ C2 @ (np.abs(x) + moved)
            terms.append((C1 @ x, np.abs(C1) @ moved + D12 @ signals))
        undelayed, delayed = np.array(terms, dtype=float).T
        return cls(undelayed, delayed, np.abs(A) + back @ C2, into, np.abs(C1) + D12 @ paths @ C2)

    def frequencies(self) -> FloatArray:
        """Return frequencies, increasing, at which the series converges."""
        fastest = float(np.max(np.abs(np.linalg.eigvals(self.around)), initial=0.0)) or 1.0
        return 1.001 * fastest * 2.0 ** np.arange(0.5, 60.0, 0.5)

    def sizes(self, omega: float) -> tuple[FloatArray, FloatArray]:
        """Bound the terms at a frequency: those without delays, and others of each order with, last, the rest."""
        nu, order = 1.0 / omega, self.undelayed.size
        power = nu ** np.arange(order)
        one = np.eye(self.into.size)
        states = np.linalg.solve(one - nu * self.around, nu * self.into)
        rest = self.out @ np.linalg.matrix_power(nu * self.around, order - 1) @ states
        return np.abs(self.undelayed) * power, np.append(self.delayed * power, rest)

    def end_of_gain(self, level: float) -> float:
        """Return a frequency from which on the gain stays below, or above, a level; infinite where none is known."""
        for omega in self.frequencies():
            size, others = self.sizes(omega)
            beside = size[1:].sum() + others.sum()
            if size[0] + beside < level or size[0] - beside > level:
                return float(omega)
        return np.inf

    def end_of_negative_values(self) -> float:
        """Return a frequency from which on the response is never real and negative; infinite where none is known.

        One term that outweighs all others of its order or more keeps the imaginary part from zero, or the real part
        positive.
        """
        for omega in self.frequencies():
            size, others = self.sizes(omega)
            for parity in (0, 1):
                own = np.flatnonzero(self.undelayed[parity::2]) * 2 + parity
                if own.size == 0 or np.any(self.delayed[: own[0]] > 0.0):
                    continue
                # (-j)^k is real and positive at every fourth power
                positive = parity == 1 or (self.undelayed[own[0]] > 0.0) == (own[0] % 4 == 0)
                if positive and size[own[0]] > size[own[1:]].sum() + others.sum():
                    return float(omega)
        return np.inf


def _norm(matrix: FloatArray) -> float:
    return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0


def _gain(matrices: np.ndarray) -> FloatArray:
    """Largest singular value of each matrix."""
    if min(matrices.shape[1:]) == 1:
        return np.sqrt((np.abs(matrices) ** 2).sum(axis=(1, 2)))
    return np.linalg.norm(matrices, 2, axis=(1, 2))
