r"""The characteristic matrix itself in balls, for loops whose determinant has too many terms to be written out.

With C an approximate inverse of T(j w) and ``C T(j (w + h)) = I + Y(h)`` the expansion of the determinant by rows
gives :math:`|\det(I + Y) - 1| \le \prod_i (1 + R_i) - 1`, R_i the row sums of ``|Y|`` after any diagonal similarity:
where that is below one, f stays within a disc around f(j w) that leaves out zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from susp_ctrl.delay_systems.model import SystemMatrix
from susp_ctrl.delay_systems.proof.balls import Ball, flint, is_zero, magnitudes

_ORDER = 3


@dataclass(frozen=True, eq=False)
class DelayMatrix:
    """``T(s) = sum M s**power * gain * exp(-s lag)``; its determinant is the characteristic function.

    Attributes
    ----------
    terms : tuple of (int, ball, ball, flint.arb_mat)
        Power, gain, lag (s) and matrix.
    size : int
        Order of the matrix.
    """

    terms: tuple[tuple[int, Ball, Ball, Ball], ...]
    size: int

    @classmethod
    def of(
        cls, system: SystemMatrix, delays: Sequence[Ball], gains: Sequence[Ball], line: Ball
    ) -> DelayMatrix:
        """Take ``s -> T(s + line)`` of a system matrix."""
        n = system.unknowns
        terms = []
        for (power, k), whole in system.terms.items():
            gain, lag = (flint.arb(1), flint.arb(0)) if k is None else (gains[k], delays[k])
            matrix = flint.arb_mat(whole[:n, :n].tolist())
            moved = (flint.arb_poly([line, 1]) ** power).coeffs() if not is_zero(line) else [0] * power + [1]
            for p, share in enumerate(moved):
                if not is_zero(share):
                    terms.append((p, gain * share * (-line * lag).exp(), lag, matrix))
        return cls(tuple(terms), n)

    @cached_property
    def degrees(self) -> list[int]:
        """Highest power of s in every column."""
        found = [0] * self.size
        for power, _, _, matrix in self.terms:
            for row in matrix.tolist():
                for j, entry in enumerate(row):
                    if not is_zero(entry):
                        found[j] = max(found[j], power)
        return found

    @property
    def degree(self) -> int:
        """Number of roots without delays."""
        return sum(self.degrees)

    @cached_property
    def _leading_matrix(self) -> Ball:
        total = [[flint.arb(0)] * self.size for _ in range(self.size)]
        for power, gain, lag, matrix in self.terms:
            if is_zero(lag):
                for i, row in enumerate(matrix.tolist()):
                    for j, entry in enumerate(row):
                        if power == self.degrees[j]:
                            total[i][j] += gain * entry
        return flint.arb_mat(total)

    @cached_property
    def leading(self) -> Ball:
        """Coefficient of the highest power of s without delay."""
        return self._leading_matrix.det()

    def value(self, omega: Ball) -> Ball:
        """Return ``det T(j omega)``."""
        return self._taylor(omega, 1)[0].det()

    def _taylor(self, omega: Ball, order: int) -> list[Ball]:
        """Return the first matrix coefficients of ``h -> T(j (omega + h))``."""
        total = [flint.acb_mat(self.size, self.size) for _ in range(order)]
        for power, gain, lag, matrix in self.terms:
            line = flint.acb_poly([flint.acb(0, omega), flint.acb(0, 1)]) ** power
            if not is_zero(lag):
                turn = flint.acb(0, -lag)
                exponential = [gain * (turn * omega).exp()]
                for k in range(1, order):
                    exponential.append(exponential[-1] * turn / k)
                line = line * flint.acb_poly(exponential)
            else:
                line = line * gain
            for k, weight in enumerate(line.coeffs()[:order]):
                total[k] += flint.acb_mat(matrix) * weight
        return total

    def free_length(self, here: Ball, far: Ball) -> float | None:
        """Return a length over which the determinant stays in a disc around its value here, zero outside."""
        taylor = self._taylor(here, _ORDER)
        try:
            inverse = taylor[0].inv().mid()
        except ZeroDivisionError:
            return None
        one = flint.acb_mat([[int(i == j) for j in range(self.size)] for i in range(self.size)])
        first = [magnitudes(inverse * taylor[0] - one), *(magnitudes(inverse * T) for T in taylor[1:-1])]
        slope = np.array([[float(v) for v in row] for row in first[1].tolist()])
        radius = float(np.max(np.abs(np.linalg.eigvals(slope)), initial=0.0))
        length = min(2.0 * float(far), 0.6 / radius if radius > 0.0 else np.inf)
        least = max(float(here), float(far) * 2.0**-180) * 2.0**-60
        while length > least:
            rest = magnitudes(inverse * self._taylor(here + flint.arb(length / 2, length / 2), _ORDER)[-1])
            h = flint.arb(length)
            total = first[0] + first[1] * h + rest * h ** (_ORDER - 1)
            if _within_unit_disc(total):
                return length
            length /= 2.0
        return None

    def far(self) -> Ball | None:
        """Return a radius beyond which, in the closed right half plane, ``|f/(c s^N) - 1| < 1``."""
        try:
            inverse = magnitudes(self._leading_matrix.inv())
        except ZeroDivisionError:
            return None
        radius = flint.arb(2) ** -400
        while radius < flint.arb(2) ** 1000:
            total = [[flint.arb(0)] * self.size for _ in range(self.size)]
            for power, gain, lag, matrix in self.terms:
                for i, row in enumerate(matrix.tolist()):
                    for j, entry in enumerate(row):
                        if not is_zero(entry) and not (is_zero(lag) and power == self.degrees[j]):
                            weight = gain.abs_upper() * radius ** (power - self.degrees[j])
                            total[i][j] += entry.abs_upper() * weight
            if _within_unit_disc(inverse * flint.arb_mat(total)):
                return radius
            radius *= 2
        return None


def _within_unit_disc(bound: Ball) -> bool:
    """Tell whether ``|det(I + Y) - 1| < 1`` for all Y below a bound of their magnitudes."""
    rough = np.array([[float(v) for v in row] for row in bound.tolist()])
    if not np.all(np.isfinite(rough)):
        return False
    scale = np.ones(len(rough))
    for _ in range(8):  # towards the vector of Perron, which makes the row sums equal
        image = rough @ scale
        scale = image / max(float(image.max()), 1e-300) + 1e-3 * scale
    x = flint.arb_mat([[float(v)] for v in scale])
    product = flint.arb(1)
    for row, own in zip((bound * x).tolist(), x.tolist(), strict=True):
        product *= 1 + row[0] / own[0]
    return bool(product < 2)
