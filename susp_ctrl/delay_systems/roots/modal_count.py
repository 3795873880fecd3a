r"""The argument principle for many states and few delayed signals, in the modes of A.

With ``A V = V L`` the return matrix of the signals is a sum of partial fractions,

.. math:: T(s) = I - G(s) E(s), \qquad G(s) = D + \sum_i \frac{c_i b_i^T}{s - \lambda_i}, \qquad
    \det K(s) = \det(sI - A) \det T(s),

so that the roots right of a line are the poles there plus the turns of :math:`\det T` along it. A step needs numbers
of the order of the signals and n residues instead of the inverse of a matrix of order n. V need not be accurate:
with the computed one ``A = V (L + R) V^-1`` exactly, and :math:`|R|`, together with the rounding of every entry of A,
moves G by at most :math:`|c (s-L)^{-1}|\, (|R| + \epsilon |V^{-1}||A||V|)\, |(s-L)^{-1} b|` to first order. Where that
is too much to tell, as with a defective A, nothing is counted here.

References
----------
.. [1] L. N. Trefethen, M. Embree, "Spectra and Pseudospectra", Princeton University Press, 2005, chapter 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import (
    CharacteristicMatrix,
    Modes,
    Points,
    direct_paths,
    distance_to_far_right,
)
from susp_ctrl.delay_systems.model.rounding import rounding_of_sums

# Share of the distance to a pole that rounding may move it.
_NEAR_A_POLE = 0.1


class Step(NamedTuple):
    """Return matrices in the middle of steps, their slopes, and bounds entry by entry over the whole step.

    `all_orders` bounds the change of T, `rest` that beyond the first order, `rounding` what rounding makes of T;
    `clear` tells where no pole is near.
    """

    T: Points
    slope: Points
    all_orders: FloatArray
    rest: FloatArray
    rounding: FloatArray
    clear: np.ndarray


@dataclass(frozen=True, eq=False)
class ModalLoop:
    """The loop seen from a line ``Re s = line``: poles relative to it, residues with the growth of the delays."""

    modes: Modes
    D: FloatArray
    delays: FloatArray

    @classmethod
    def of(cls, K: CharacteristicMatrix, line: float) -> ModalLoop | None:
        """Take the modes of K; None where it has none of use."""
        if K.modes is None:
            return None
        growth = np.exp(-line * K.delays)
        moved = K.modes._replace(
            poles=K.modes.poles - line, into=K.modes.into * growth, into_terms=K.modes.into_terms * growth
        )
        return cls(moved, K.D * growth, K.delays)

    @cached_property
    def residues(self) -> Points:
        """``c_i b_i^T``, shape (n, m * m)."""
        return self.modes.residues.reshape(self.modes.poles.size, -1)

    @property
    def poles_right(self) -> int:
        """Number of poles right of the line."""
        return int(np.sum(self.modes.poles.real > 0.0))

    @property
    def certain(self) -> bool:
        """Whether rounding moves no pole over the line."""
        return bool(np.all(self.modes.defect.sum(axis=1) < _NEAR_A_POLE * np.abs(self.modes.poles.real)))

    @cached_property
    def reach(self) -> float:
        """Modulus beyond which neither a pole nor a root lies right of the line, to a tenth."""
        if not self._small_beyond(0.0):
            outer = float(np.abs(self.modes.poles).max(initial=0.0)) or 1.0
            while not self._small_beyond(outer):
                outer *= 2.0
            within, beyond = 0.0, outer
            while beyond > 1.1 * within and beyond > 1e-12 * outer:
                radius = np.sqrt(beyond) * np.sqrt(within) if within > 0.0 else 0.03 * beyond
                within, beyond = (within, radius) if self._small_beyond(radius) else (radius, beyond)
            return beyond
        return 0.0

    def _small_beyond(self, radius: float) -> bool:
        distance = distance_to_far_right(self.modes.poles, radius)
        if not np.all(distance > 0.0):
            return False
        through = (np.abs(self.residues).T @ (1.0 / distance)).reshape(self.D.shape)
        return bool(np.max(np.abs(np.linalg.eigvals(direct_paths(self.D) @ through))) < 0.99)

    def return_matrices(self, omega: FloatArray) -> Points:
        """Return T at ``line + j omega``, shape (points, m, m)."""
        return np.eye(self.delays.size) - self._plant(
            1.0 / (1j * omega[:, None] - self.modes.poles)
        ) * self._E(omega)

    def step(self, middle: FloatArray, half: FloatArray) -> Step:
        """Return T and its bounds on ``line + j(middle +- half)``."""
        modes, m, entry = self.modes, self.delays.size, rounding_of_sums(1)
        resolvent = 1.0 / (1j * middle[:, None] - modes.poles)
        size = np.abs(resolvent)
        distance = 1.0 / size - half[:, None]
        clear = np.all(distance > _NEAR_A_POLE * half[:, None], axis=1)
        near = 1.0 / np.where(distance > 0.0, distance, 1.0)
        E, turn = self._E(middle), (half[:, None] * self.delays)[:, None, :]
        G = self._plant(resolvent)
        slope = -(resolvent**2 @ self.residues).reshape(-1, m, m)
        beyond = (half[:, None] ** 2 * size**2 * near @ np.abs(self.residues)).reshape(-1, m, m)
        change = half[:, None, None] * np.abs(slope) + beyond
        rest = beyond + half[:, None, None] * np.abs(slope) * turn + 0.5 * np.abs(G) * turn**2
        out, into = np.abs(modes.out) * near[:, None, :], np.abs(modes.into)
        from_poles = out @ modes.defect @ (near[:, :, None] * into)
        through = (modes.out_terms * near[:, None, :]) @ into + out @ modes.into_terms
        phases = (1.0 + middle[:, None] * self.delays)[:, None, :]
        rounding = from_poles / (1.0 - _NEAR_A_POLE) + entry * (through + np.abs(G) * phases)
        clear &= np.max(self.modes.defect.sum(axis=1) * near, axis=1) < _NEAR_A_POLE
        return Step(
            np.eye(m) - G * E, 1j * (self.delays * G - slope) * E,
            change + np.minimum(2.0, turn) * np.abs(G), rest, rounding, clear,
        )  # fmt: skip

    def _plant(self, resolvent: Points) -> Points:
        return (resolvent @ self.residues).reshape(-1, *self.D.shape) + self.D

    def _E(self, omega: FloatArray) -> NDArray[Any]:
        return np.exp(-1j * omega[:, None] * self.delays)[:, None, :]
