r"""The characteristic matrix of a loop with delays, entire in s.

.. math:: K(s) = sI - A - B_2 E (I - D_{22} E)^{-1} C_2,  \qquad  E = \mathrm{diag}(e^{-s\tau_k})

Its determinant is an entire function whose zeros, with their multiplicities, are the characteristic roots:
also those that no delay moves, and those at poles of the undelayed plant, where ``det(I - P22 E)`` is of no use.
`D22` has no cycle (the loop is retarded), so the inverse is a polynomial in E.

References
----------
.. [1] W. Michiels, S.-I. Niculescu, "Stability, Control, and Computation for Time-Delay Systems", SIAM, 2014,
   chapters 1 and 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from susp_ctrl.delay_systems.model.lft import FloatArray
from susp_ctrl.delay_systems.model.system import FoldedLoop
from susp_ctrl.errors import InputError

Points = NDArray[np.complexfloating[Any, Any]]

# e^{-s tau} beyond this has no digits left beside the other terms, and squares of it overflow.
_LARGEST_EXPONENT = 300.0


@dataclass(frozen=True, eq=False)
class CharacteristicMatrix:
    """K(s) of a folded loop, with bounds that hold entry by entry."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    delays: FloatArray

    @classmethod
    def of(cls, loop: FoldedLoop) -> CharacteristicMatrix:
        """Take K(s) from a folded loop: states scaled to even magnitudes, signals that lead nowhere dropped.

        A delayed signal that no path leads back to is in no loop and moves no root.
        """
        plant = loop.plant
        if plant.n_states == 0:
            none = np.zeros((0, 0))
            return cls(plant.A, none, none, none, np.zeros(0))
        looped = _in_a_loop(plant.A, plant.B2, plant.C2, plant.D22)
        B, C, D = plant.B2[:, looped], plant.C2[looped], plant.D22[np.ix_(looped, looped)]
        magnitudes = np.abs(plant.A) + np.abs(B) @ np.abs(C)
        _, (scale, _) = scipy.linalg.matrix_balance(magnitudes, permute=False, separate=True)
        return cls(plant.A * scale / scale[:, None], B / scale[:, None], C * scale, D, loop.delays[looped])

    @property
    def n_states(self) -> int:
        """Order of K."""
        return self.A.shape[0]

    @property
    def n_channels(self) -> int:
        """Number of delayed signals."""
        return self.delays.size

    def shifted(self, line: float) -> CharacteristicMatrix:
        """Return K(s + line): roots right of `line` become roots in the right half plane."""
        if line == 0.0:
            return self
        exponent = -line * self.delays
        if np.any(exponent > _LARGEST_EXPONENT):
            raise InputError(
                f"right_of = {line:g} is not allowed: with a delay of {self.delays.max():g} s at least "
                f"{-_LARGEST_EXPONENT / self.delays.max():.3g} is needed"
            )
        growth = np.exp(exponent)
        return CharacteristicMatrix(
            self.A - line * np.eye(self.n_states), self.B * growth, self.C, self.D * growth, self.delays
        )

    def closed(self, s: Points) -> Points:
        """Return ``A + B2 E (I - D22 E)^-1 C2`` at points s, shape (points, states, states)."""
        E = np.exp(-np.asarray(s, dtype=complex)[:, None] * self.delays)
        return self.A + (self.B * E[:, None, :]) @ self._after_line(E)

    def __call__(self, s: Points) -> Points:
        """Return K at points s, shape (points, states, states)."""
        return np.asarray(s, dtype=complex)[:, None, None] * np.eye(self.n_states) - self.closed(s)

    def with_derivative(self, s: Points) -> tuple[Points, Points]:
        """Return K and dK/ds at points s."""
        points = np.asarray(s, dtype=complex)
        E = np.exp(-points[:, None] * self.delays)
        from_state = self._after_line(E)
        into_state: Any = self.B * E[:, None, :]
        identity = np.eye(self.n_states)
        K = points[:, None, None] * identity - self.A - into_state @ from_state
        if np.any(self.D):
            # B (I - E D)^-1, solved through the transposed system
            around = np.eye(self.n_channels) - self.D.T * E[:, None, :]
            passed = np.linalg.solve(around, np.broadcast_to(self.B.T, (points.size, *self.B.T.shape)))
            into_state = np.swapaxes(passed, 1, 2) * E[:, None, :]
        return K, identity + (into_state * self.delays) @ from_state

    def _after_line(self, E: Points) -> Points:
        """(I - D22 E)^-1 C2: from the state to the signals that enter the delays."""
        if not np.any(self.D):
            return np.broadcast_to(self.C.astype(complex), (E.shape[0], *self.C.shape))
        around = np.eye(self.n_channels) - self.D * E[:, None, :]
        return np.linalg.solve(around, np.broadcast_to(self.C, (E.shape[0], *self.C.shape)))

    @cached_property
    def absolute_parts(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """``|A|``, ``|B2| Q`` and ``Q |C2|`` with ``Q = (I - |D22|)^-1 >= |(I - D22 E)^-1|`` for all |E| <= 1."""
        Q = self._direct_series
        return np.abs(self.A), np.abs(self.B) @ Q, Q @ np.abs(self.C)

    @cached_property
    def _direct_series(self) -> FloatArray:
        """``(I - |D22|)^-1``: all direct paths from one delayed signal to another."""
        Q = np.eye(self.n_channels)
        power = np.abs(self.D)
        for _ in range(self.n_channels - 1):  # nilpotent: the series ends
            Q = Q + power
            power = power @ np.abs(self.D)
        return Q

    @cached_property
    def right_reach(self) -> float:
        r"""Modulus beyond which no root with non-negative real part lies; a fast stable pole does not raise it.

        Such a root makes :math:`\det(I - P_{22} E) = 0` with :math:`|E| \le 1`, or is a pole itself. In the Schur
        basis of A the entries of :math:`(sI - T)^{-1}` are bounded by those of a triangular matrix with the distances
        from the poles to the region beyond on its diagonal.
        """
        largest = self.root_bound
        if self.n_channels == 0 or largest == 0.0:
            return largest
        T, U = scipy.linalg.schur(self.A, output="complex")
        poles, off = np.diag(T), np.abs(np.triu(T, 1))
        Q = self._direct_series
        into, out = np.abs(U.conj().T @ self.B) @ Q, np.abs(self.C @ U)
        beyond, within = largest, 0.0
        # to a tenth; the bound is monotone in the radius
        while beyond > 1.1 * within and beyond > 1e-12 * largest:
            radius = np.sqrt(beyond * within) if within > 0.0 else 0.03 * beyond
            distance = _distance_to_far_right(poles, radius)
            clear = bool(np.all(distance > 0.0))
            if clear:
                passed = np.linalg.solve(np.diag(distance) - off, into)
                clear = bool(np.max(np.abs(np.linalg.eigvals(out @ passed))) < 0.99)
            beyond, within = (radius, within) if clear else (beyond, radius)
        return beyond

    @cached_property
    def root_bound(self) -> float:
        r"""Largest modulus that a root with non-negative real part can have.

        Such a root is an eigenvalue of ``A + B2 E (I - D22 E)^-1 C2`` with :math:`|E| \le 1`, a matrix whose
        entries are bounded by those of a non-negative one; the latter's spectral radius bounds the root. The bound
        is taken in the given basis and in the Schur basis of A, where it is sharp for small gains.
        """
        if self.n_states == 0:
            return 0.0
        A, _, C = self.absolute_parts
        T, U = scipy.linalg.schur(self.A, output="complex")
        Q = np.linalg.solve(np.eye(self.n_channels) - np.abs(self.D), np.eye(self.n_channels))
        in_schur_basis = np.abs(np.triu(T)) + np.abs(U.conj().T @ self.B) @ Q @ np.abs(self.C @ U)
        given = A + np.abs(self.B) @ C
        return min(_spectral_radius_bound(given), _spectral_radius_bound(in_schur_basis))


def _distance_to_far_right(poles: Points, radius: float) -> FloatArray:
    """Distance from each pole to the points s with Re s >= 0 and |s| >= radius."""
    height = np.abs(poles.imag)
    # from the left the nearest point lies on the axis, from inside the half disc on its arc
    below = np.maximum(radius - height, 0.0)
    beside = np.hypot(poles.real, below)
    inside = np.maximum(radius - np.abs(poles), 0.0)
    return np.where(poles.real <= 0.0, beside, inside)


def _in_a_loop(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> np.ndarray:
    """Tell which delayed signals a chain of non-zero entries leads back to."""
    reach = np.block([[A, B], [C, D]]) != 0.0
    size = 1
    while size < reach.shape[0]:
        reach = reach | (reach.astype(np.float32) @ reach.astype(np.float32) > 0.0)
        size *= 2
    return np.asarray(np.diag(reach)[A.shape[0] :])


def _spectral_radius_bound(M: FloatArray) -> float:
    """Return a number not below the spectral radius of a non-negative matrix, within about one percent of it."""
    n = M.shape[0]
    candidate = 1.01 * float(np.max(np.abs(np.linalg.eigvals(M)))) + 1e-6 * float(np.linalg.norm(M) / n)
    if candidate == 0.0:
        return 0.0
    while True:
        # x > 0 with M x < candidate x certifies the bound (Collatz and Wielandt)
        x = np.linalg.solve(candidate * np.eye(n) - M, np.ones(n))
        if np.all(x > 0) and np.all(M @ x < candidate * x):
            return candidate
        candidate *= 1.1
