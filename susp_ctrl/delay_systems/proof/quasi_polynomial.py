r"""The characteristic function of a loop as a quasi-polynomial with coefficients in balls.

.. math:: f(s) = \det T(s) = \sum_\alpha P_\alpha(s) \prod_k \left(g_k e^{-s \tau_k}\right)^{\alpha_k}

T is the user's own matrix of polynomials and delays. The determinant has degree at most r_k in ``z_k = g_k e^{-s
tau_k}``, r_k the rank of what the delay multiplies, so exact evaluation at integers and interpolation give every
:math:`P_\alpha`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from susp_ctrl.delay_systems.model import SystemMatrix
from susp_ctrl.delay_systems.proof.balls import Ball, flint, inverse_vandermonde, is_zero, rank

_ORDER = 12
# Intervals narrower than this part of their place are a root, as far as the numbers tell.
_NARROWEST = 2.0**-60


@dataclass(frozen=True, eq=False)
class QuasiPolynomial:
    """Terms ``P(s) * weight * exp(-s lag)``.

    Attributes
    ----------
    polynomials : tuple of flint.arb_poly
    lags : tuple of balls
        Sums of delays (s), not negative.
    degree : int
        Degree of the term without lag; no other term has a higher one.
    """

    polynomials: tuple[Ball, ...]
    lags: tuple[Ball, ...]
    degree: int

    @cached_property
    def _turns(self) -> list[tuple[Ball, Ball, Ball]]:
        """Polynomial, ``-j lag`` and the series of ``exp(-j lag h)`` of every term."""
        found = []
        for polynomial, lag in zip(self.polynomials, self.lags, strict=True):
            turn, series = flint.acb(0, -lag), [flint.acb(1)]
            for k in range(1, _ORDER):
                series.append(series[-1] * turn / k)
            found.append((flint.acb_poly(polynomial), turn, flint.acb_poly(series)))
        return found

    def around(self, omega: Ball) -> list[Ball]:
        """Return the first Taylor coefficients of ``h -> f(j (omega + h))``."""
        total = flint.acb_poly([0])
        line = flint.acb_poly([flint.acb(0, omega), flint.acb(0, 1)])
        for (polynomial, turn, series), lag in zip(self._turns, self.lags, strict=True):
            shifted = polynomial(line)
            if not is_zero(lag):
                shifted = (shifted * series) * (turn * omega).exp()
            total += shifted.truncate(_ORDER)
        coefficients = total.coeffs()
        return coefficients + [flint.acb(0)] * (_ORDER - len(coefficients))

    def value(self, omega: Ball) -> Ball:
        """Return ``f(j omega)``."""
        start = flint.acb(0, omega)
        terms = zip(self._turns, self.lags, strict=True)
        return sum(
            (p(start) if is_zero(lag) else p(start) * (turn * omega).exp() for (p, turn, _), lag in terms),
            flint.acb(0),
        )

    def free_length(self, here: float, far: Ball) -> float | None:
        """Return a length over which f stays within a disc around its value here that leaves out zero."""
        start = flint.arb(here)
        least = max(here * _NARROWEST, float(far) * _NARROWEST**4)
        lengths = [self._by_magnitudes(start, float(far), least), self._by_taylor(start, float(far), least)]
        return max((length for length in lengths if length is not None), default=None)

    def _by_taylor(self, start: Ball, far: float, least: float) -> float | None:
        taylor = self.around(start)
        size = taylor[0].abs_lower()
        if not size > 0:
            return None
        length = _longest([_root_of_ratio(c, size, k) for k, c in enumerate(taylor[1:], 1)], far)
        while length > least:
            rest = self.around(start + flint.arb(length / 2, length / 2))[-1].abs_upper()
            h = flint.arb(length)
            total = sum((c.abs_upper() * h**k for k, c in enumerate(taylor[1:-1], 1)), flint.arb(0))
            if total + rest * h ** (_ORDER - 1) < size:
                return length
            length /= 2.0
        return None

    def _by_magnitudes(self, start: Ball, far: float, least: float) -> float | None:
        """As by Taylor's series, but of the delayed terms only the magnitudes: many turns of small terms at once."""
        size = self.value(start).abs_lower()
        line = flint.acb_poly([flint.acb(0, start), flint.acb(0, 1)])
        sums = [flint.arb(0)] * (self.degree + 1)
        for place, (polynomial, _, _) in enumerate(self._turns):
            for k, coefficient in enumerate(polynomial(line).coeffs()):
                sums[k] += coefficient.abs_upper() * (2 if place else int(k > 0))
        room = size - sums[0]
        if not room > 0:
            return None
        length = _longest([_root_of_ratio(c, room, k) for k, c in enumerate(sums[1:], 1)], far)
        while length > least:
            h = flint.arb(length)
            if sum((c * h**k for k, c in enumerate(sums)), flint.arb(0)) < size:
                return length
            length /= 2.0
        return None

    @property
    def leading(self) -> Ball:
        """Coefficient of ``s**degree`` of the term without lag."""
        return self.polynomials[0][self.degree]

    def far(self) -> Ball | None:
        """Return a radius beyond which, in the closed right half plane, ``|f/(c s^N) - 1| < 1``."""
        N, c = self.degree, self.leading.abs_lower()
        if not c > 0:
            return None
        sums = [flint.arb(0)] * (N + 1)
        for place, polynomial in enumerate(self.polynomials):
            for k, coefficient in enumerate(polynomial.coeffs()):
                if place or k != N:
                    sums[k] += coefficient.abs_upper()
        radius = flint.arb(2) ** -400
        while radius < flint.arb(2) ** 1000:
            if sum((size * radius ** (k - N) for k, size in enumerate(sums)), flint.arb(0)) < c:
                return radius
            radius *= 2
        return None


@dataclass(frozen=True, eq=False)
class Expansion:
    """The determinant of a system matrix as a polynomial in s and in ``z_k = g_k exp(-s tau_k)``.

    Attributes
    ----------
    polynomials : mapping of tuple of int to list of balls
        Coefficients of s for every set of exponents of z.
    active : tuple of int
        Numbers of the delays that the exponents belong to.
    degree : int
        Degree in s.
    """

    polynomials: dict[tuple[int, ...], list[Ball]]
    active: tuple[int, ...]
    degree: int

    @classmethod
    def of(cls, system: SystemMatrix, most: int) -> Expansion | None:
        """Expand det T by evaluation at integers; None where that takes more than `most` determinants."""
        n = system.unknowns
        blocks: dict[int | None, dict[int, np.ndarray]] = {}
        for (power, k), matrix in system.terms.items():
            part = matrix[:n, :n]
            if np.any(part != 0.0):
                blocks.setdefault(k, {})[power] = part
        active = tuple(sorted(k for k in blocks if k is not None))
        degree = _degree(blocks, n)
        shape = (degree + 1, *(rank(list(blocks[k].values())) + 1 for k in active))
        if np.prod(shape, dtype=float) > most:
            return None
        nodes = [_nodes(size) for size in shape]
        values: Any = np.empty(shape, dtype=object)
        parts = [(power, k, flint.arb_mat(M.tolist())) for k in blocks for power, M in blocks[k].items()]
        for place in itertools.product(*map(range, shape)):
            s, *z = (own[k] for own, k in zip(nodes, place, strict=True))
            turns: dict[int | None, int] = dict(zip(active, z, strict=True))
            total = flint.arb_mat(n, n)
            for power, k, matrix in parts:
                weight = s**power * turns.get(k, 1)
                if weight:
                    total += matrix * flint.arb(weight)
            values[place] = total.det()
        for axis, own in enumerate(nodes):
            values = np.moveaxis(np.tensordot(inverse_vandermonde(own), values, axes=(1, axis)), 0, axis)
        exponents = itertools.product(*(range(size) for size in shape[1:]))
        return cls({alpha: list(values[(slice(None), *alpha)]) for alpha in exponents}, active, degree)

    def at(self, delays: Sequence[Ball], gains: Sequence[Ball], line: Ball) -> QuasiPolynomial:
        """Return ``s -> f(s + line)`` for delays and gains, one ball for each delay of the system."""
        undelayed, terms = flint.arb_poly([0]), []
        for alpha, coefficients in self.polynomials.items():
            weight, lag = flint.arb(1), flint.arb(0)
            for k, exponent in zip(self.active, alpha, strict=True):
                weight *= gains[k] ** exponent
                lag += delays[k] * exponent
            polynomial = flint.arb_poly(coefficients) * (weight * (-line * lag).exp())
            if not is_zero(line):
                polynomial = polynomial(flint.arb_poly([line, 1]))
            if is_zero(lag):
                undelayed += polynomial
            elif any(not is_zero(coefficient) for coefficient in coefficients):  # what may be zero stays
                terms.append((polynomial, lag))
        polynomials = (undelayed, *(p for p, _ in terms))
        return QuasiPolynomial(polynomials, (flint.arb(0), *(lag for _, lag in terms)), self.degree)


def _degree(blocks: dict[int | None, dict[int, np.ndarray]], n: int) -> int:
    """Sum over the columns of the highest power of s: the degree where the loop is not neutral."""
    highest = np.zeros(n, dtype=int)
    for parts in blocks.values():
        for power, matrix in parts.items():
            present = np.any(matrix != 0.0, axis=0)
            highest[present] = np.maximum(highest[present], power)
    return int(highest.sum())


def _nodes(size: int) -> list[int]:
    """Integers around zero: 0, 1, -1, 2, ..."""
    return [(k + 1) // 2 * (1 if k % 2 else -1) for k in range(size)]


def _root_of_ratio(coefficient: Ball, size: Ball, k: int) -> float:
    ratio = coefficient.abs_upper() / size
    return float(ratio.mid().root(k)) if ratio.mid() > 0 else 0.0


def _longest(rates: list[float], most: float) -> float:
    """Return the largest power-of-two-like length with ``sum (rate_k length)^k <= 0.8``, at most twice `most`."""
    high = 2.0 * most
    top = max(rates, default=0.0)
    if top <= 0.0:
        return high
    low, high = 0.2 / top, min(1.0 / top, high)
    if low > high:
        return high
    for _ in range(20):
        middle = 0.5 * (low + high)
        good = sum((rate * middle) ** k for k, rate in enumerate(rates, 1)) <= 0.8
        low, high = (middle, high) if good else (low, middle)
    return low
