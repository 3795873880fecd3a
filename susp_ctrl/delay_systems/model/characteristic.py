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
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model.folding import FoldedLoop, direct_paths, loop_balancing
from susp_ctrl.delay_systems.model.lft import Realization, closed, return_solve, sample_plant
from susp_ctrl.delay_systems.model.loop_signals import shared_lines, signals_in_a_chain, signals_in_a_loop
from susp_ctrl.delay_systems.model.perron import certified_radius
from susp_ctrl.delay_systems.model.rounding import eigenvalues_with_uncertainty, rounding_of_sums
from susp_ctrl.errors import InputError

Points = NDArray[np.complexfloating[Any, Any]]

# e^{-s tau} beyond this has no digits left beside the other terms, and squares of it overflow.
_LARGEST_EXPONENT = 300.0


# From so many states on, so many for each delayed signal, the modes of A are worth their computation.
_MANY_STATES, _FEW_SIGNALS = 24, 8


class Modes(NamedTuple):
    r"""``A V = V L``: poles, ``V^-1 B`` and ``C V``, sizes of their terms, and the defect of the computed V.

    ``A = V (L + R) V^-1`` exactly, :math:`|R|` and the effect of a rounding of every entry of A being below `defect`.
    """

    poles: Points
    into: Points
    out: Points
    into_terms: FloatArray
    out_terms: FloatArray
    defect: FloatArray

    @property
    def residues(self) -> Points:
        """``c_i b_i^T`` of every pole, shape (poles, channels, channels)."""
        return self.out.T[:, :, None] * self.into[:, None, :]


@dataclass(frozen=True, eq=False)
class CharacteristicMatrix:
    """The loop seen from its delayed signals, ``x' = A x + B w, z = C x + D w``, and K(s) with bounds entry by entry.

    States and signals are scaled to even magnitudes by powers of two, gains are absorbed.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    delays: FloatArray

    @classmethod
    def of(cls, loop: FoldedLoop) -> CharacteristicMatrix:
        """Take K(s) from a folded loop: everything scaled to even magnitudes, signals that lead nowhere dropped.

        A delayed signal that no path leads back to is in no loop and moves no root; signals of one delay that are
        multiples of each other, or act as such, are one (`susp_ctrl.delay_systems.model.loop_signals`).
        """
        plant, tau = loop
        n = plant.n_states
        if n == 0:
            return cls(plant.A, plant.B2[:, :0], plant.C2[:0], plant.D22[:0, :0], tau[:0])
        whole = np.block([[plant.A, plant.B2], [plant.C2, plant.D22]])
        whole, tau = _only(signals_in_a_chain(whole, n), whole, n, tau)
        whole, tau = shared_lines(whole, n, tau)
        # all channels closed with weight one: pattern and size of the whole loop decide the scaling
        scale = loop_balancing(whole, n)
        whole = whole / scale[:, None] * scale
        whole, tau = _only(signals_in_a_loop(whole, n, tau), whole, n, tau)
        return cls(whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:], tau)

    @property
    def n_states(self) -> int:
        """Order of K."""
        return self.A.shape[0]

    @property
    def n_channels(self) -> int:
        """Number of delayed signals."""
        return self.D.shape[0]

    @cached_property
    def plant(self) -> Realization:
        """The same as a plant that has delayed signals only."""
        return Realization.between_channels(self.A, self.B, self.C, self.D)

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return ``P22(jw) = D + C (jw - A)^-1 B``, shape (frequencies, channels, channels)."""
        return sample_plant(self.plant, 1j * omega).p22

    def closed(self, E: NDArray[Any]) -> NDArray[Any]:
        """Return ``A + B E (I - D E)^-1 C`` for `E` of shape (..., channels): shape (..., states, states)."""
        return closed(self.A, self.B * E[..., None, :], self.C, self._around(E))

    def undelayed_eigenvalues(self) -> tuple[ComplexArray, FloatArray]:
        """Return the eigenvalues with every channel closed without delay, and how far rounding may move each."""
        one = np.eye(self.n_channels)
        terms = np.abs(self.A) + np.abs(self.B) @ np.abs(np.linalg.inv(one - self.D)) @ np.abs(self.C)
        return eigenvalues_with_uncertainty(self.closed(np.ones(self.n_channels)), terms)

    def _around(self, E: NDArray[Any]) -> NDArray[Any]:
        return self.D * E[..., None, :] if np.any(self.D) else self.D

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

    def exponentials(self, s: Points) -> Points:
        """Return ``e^{-s tau_k}``, shape (points, channels)."""
        return np.exp(-np.asarray(s, dtype=complex)[:, None] * self.delays)

    def __call__(self, s: Points) -> Points:
        """Return K at points s, shape (points, states, states)."""
        E = self.exponentials(s)
        return np.asarray(s, dtype=complex)[:, None, None] * np.eye(self.n_states) - self.closed(E)

    def with_derivative(self, s: Points) -> tuple[Points, Points]:
        """Return K and dK/ds at points s."""
        E, identity = self.exponentials(s), np.eye(self.n_states)
        into, passed, out = self.paths(E)
        K = np.asarray(s, dtype=complex)[:, None, None] * identity - self.A - into @ out
        return K, identity + (passed * self.delays) @ out

    def paths(self, E: Points) -> tuple[Points, Points, Points]:
        """Return ``B E``, ``B E (I - D E)^-1`` and ``(I - D E)^-1 C`` for `E` of shape (points, channels).

        The first with the last closes the loop, and a change of E acts between the other two, relative to E.
        """
        into: Any = self.B * E[:, None, :]
        out: Any = return_solve(self._around(E), self.C)
        if not np.any(self.D):
            return into, into, out
        # B (I - E D)^-1, solved through the transposed system
        passed = return_solve(self.D.T * E[:, None, :], self.B.T)
        return into, np.swapaxes(passed, -2, -1) * E[:, None, :], out

    @cached_property
    def absolute_parts(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """``|A|``, ``|B2| Q`` and ``Q |C2|`` with ``Q = (I - |D22|)^-1 >= |(I - D22 E)^-1|`` for all |E| <= 1."""
        Q = direct_paths(self.D)
        return np.abs(self.A), np.abs(self.B) @ Q, Q @ np.abs(self.C)

    @cached_property
    def modes(self) -> Modes | None:
        """The modes of A where there are many states and few signals, but some; None else, or if they are no basis."""
        if self.n_channels == 0 or self.n_states < max(_MANY_STATES, _FEW_SIGNALS * self.n_channels):
            return None
        poles, V = np.linalg.eig(self.A)
        try:
            inverse = np.linalg.inv(V)
        except np.linalg.LinAlgError:
            return None
        terms = np.abs(self.A) @ np.abs(V) + np.abs(V) * np.abs(poles)
        defect = np.abs(inverse @ (self.A @ V - V * poles)) + rounding_of_sums(1) * np.abs(inverse) @ terms
        if not np.all(np.isfinite(defect)):
            return None
        into_terms, out_terms = np.abs(inverse) @ np.abs(self.B), np.abs(self.C) @ np.abs(V)
        return Modes(
            poles.astype(complex),
            (inverse @ self.B).astype(complex),
            self.C @ V,
            into_terms,
            out_terms,
            defect,
        )

    def second_order(self, turn: FloatArray) -> FloatArray:
        r"""Bound what K changes beyond the first order where each phase turns by up to `turn`, entry by entry.

        A chain of delayed signals turns by the sum of theirs, and :math:`|e^{-jx} - 1 + jx| \le x^2/2`: half the
        square of each, and the product of every two that follow each other.
        """
        _, into, out = self.absolute_parts
        turned = into * turn[:, None, :]
        rest = (0.5 * turned * turn[:, None, :]) @ out
        if np.any(self.D):
            between = direct_paths(self.D) - np.eye(self.n_channels)
            rest = rest + (turned @ between * turn[:, None, :]) @ out
        return rest

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
        Q = direct_paths(self.D)
        into, out = np.abs(U.conj().T @ self.B) @ Q, np.abs(self.C @ U)
        beyond, within = largest, 0.0
        # to a tenth; the bound is monotone in the radius
        while beyond > 1.1 * within and beyond > 1e-12 * largest:
            radius = np.sqrt(beyond) * np.sqrt(within) if within > 0.0 else 0.03 * beyond
            distance = distance_to_far_right(poles, radius)
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
        Q = direct_paths(self.D)
        in_schur_basis = np.abs(np.triu(T)) + np.abs(U.conj().T @ self.B) @ Q @ np.abs(self.C @ U)
        given = A + np.abs(self.B) @ C
        return min(certified_radius(given), certified_radius(in_schur_basis))


def distance_to_far_right(poles: Points, radius: float) -> FloatArray:
    """Distance from each pole to the points s with Re s >= 0 and |s| >= radius."""
    height = np.abs(poles.imag)
    # from the left the nearest point lies on the axis, from inside the half disc on its arc
    below = np.maximum(radius - height, 0.0)
    beside = np.hypot(poles.real, below)
    inside = np.maximum(radius - np.abs(poles), 0.0)
    return np.where(poles.real <= 0.0, beside, inside)


def _only(signals: np.ndarray, whole: FloatArray, n: int, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Keep some of the delayed signals of ``[[A, B], [C, D]]``."""
    kept = np.append(np.arange(n), n + signals)
    return whole[np.ix_(kept, kept)], tau[signals]
