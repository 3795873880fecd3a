r"""Finding every crossing of the imaginary axis along a line in the space of delays, without counting any root.

A root on the axis at :math:`j\omega` for the delays ``start + tau direction`` is a zero of
:math:`\det W(\omega, \tau)` (see `delay_line`). Three ways find all of them, each with its own proof:

* all delays multiples of one: an eigenvalue problem (`axis_zeros`), exact;
* the varying delays multiples of one, others fixed: branch and bound over frequency and the angle of one turn
  (`branch_and_bound`);
* any other line: branch and bound over frequency and tau.

What is found here knows nothing of roots or counts of roots: it can contradict them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.crossings.axis_zeros import Zeros, chain_zeros, unit_chain
from susp_ctrl.delay_systems.crossings.branch_and_bound import Work, search_zeros
from susp_ctrl.delay_systems.crossings.delay_line import DelayLine, roots_always_on_axis
from susp_ctrl.delay_systems.crossings.small_gain import Bands, small_gain_bands
from susp_ctrl.errors import TooMuchWorkError

# Largest eigenvalue problem of the exact way; above it branch and bound is faster.
_LARGEST_PENCIL = 200
MOST_CROSSINGS = 50_000
"""Crossings that one sweep may have."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Crossings along the line, one entry per place: degree, and the change ``roots`` of unstable roots.

    `complete` tells that the search proves that none is missing, `none_ever` that there is none for any tau.
    """

    tau: FloatArray
    omega: FloatArray
    degree: np.ndarray
    roots: np.ndarray
    complete: bool
    none_ever: bool
    method: str

    def joined(self, tau: FloatArray, omega: FloatArray, degree: np.ndarray, roots: np.ndarray) -> Crossings:
        """Return these crossings and others."""
        return replace(
            self,
            tau=np.append(self.tau, tau),
            omega=np.append(self.omega, omega),
            degree=np.append(self.degree, degree),
            roots=np.append(self.roots, roots),
        )


class CrossingSearch:
    """The search along one line.

    Parameters
    ----------
    line : DelayLine
        The loop and its delays.
    work : Work, optional
        What all ways together may spend.

    Attributes
    ----------
    axis_roots : tuple of float
        Frequencies (rad/s) of roots that no delay moves off the axis: they do not cross.
    work : Work
        What all ways together may still spend.
    """

    def __init__(self, line: DelayLine, work: Work | None = None) -> None:
        self.line, self.axis_roots, self.work = line, roots_always_on_axis(line), work or Work()

    @cached_property
    def bands(self) -> Bands:
        """Frequencies outside which no root is ever on the axis."""
        return small_gain_bands(self.line.matrices)

    def ways(self) -> list[Callable[[], Crossings]]:
        """Return the ways of finding that suit the line, the best first."""
        line = self.line
        if not line.varies or line.matrices.n_states == 0:
            return [lambda: _nothing_found("no delay in a loop varies")]
        if self.bands.centre.size == 0:
            return [lambda: _nothing_found("small gain at every frequency: no crossing for any delays")]
        ways = []
        if line.multiples is not None:
            size = 2 * line.matrices.n_states * int(line.multiples.sum())
            if line.offset is not None and size <= _LARGEST_PENCIL:
                ways.append(self._by_pencil)
            ways.append(self._by_angle)
        ways.append(self._by_delay)
        return ways

    def between(self, low: float, high: float) -> Zeros:
        """Return the crossings (omega, tau) that branch and bound finds with tau between two values."""
        return self._search_in_tau(low, high)[0]

    def _by_pencil(self) -> Crossings:
        """All delays are multiples of one: exact."""
        line = self.line
        assert line.multiples is not None
        chain = unit_chain(line.matrices, line.multiples)
        zeros, floor = chain_zeros(chain, line.matrices, line.by_angle())
        complete = self.line.free_up_to(floor, except_at_zero=0.0 in self.axis_roots)
        return self._unrolled(zeros, complete, complete and floor == 0.0, "exact: matrix pencil")

    def _by_angle(self) -> Crossings:
        """The varying delays are multiples of one, others are fixed: search one turn of the angle."""
        line = self.line
        latest = (self.line.up_to + (line.offset or 0.0)) * (line.step or 0.0)
        options: dict[str, Any] = {"turn": 2.0 * np.pi, "lowest": self._lowest(), "work": self.work}
        turn = (0.0, 2.0 * np.pi)
        search = search_zeros(
            line.matrices, line.by_angle(), self.bands, turn, latest=latest * (1 + 1e-9), **options
        )
        none_ever = False
        if search.complete and search.zeros.omega.size == 0:
            beyond = search_zeros(line.matrices, line.by_angle(), self.bands, turn, **options)
            none_ever = beyond.complete and beyond.zeros.omega.size == 0
        return self._unrolled(search.zeros, search.complete, none_ever, "branch and bound over one turn")

    def _by_delay(self) -> Crossings:
        """Search frequency and tau directly."""
        found, complete = self._search_in_tau(0.0, self.line.up_to)
        tau = np.clip(found.y, 0.0, self.line.up_to)
        return Crossings(
            tau, found.omega, found.degree, 2 * found.degree, complete, False, "branch and bound"
        )

    def _search_in_tau(self, low: float, high: float) -> tuple[Zeros, bool]:
        line = self.line
        options: dict[str, Any] = {"lowest": self._lowest(), "work": self.work}
        search = search_zeros(line.matrices, line.by_delay(), self.bands, (low, high), **options)
        return self._genuine(search.zeros), search.complete

    def _lowest(self) -> float:
        """With a root at s = 0 for every tau the search cannot come arbitrarily near zero frequency."""
        return 1e-6 * self._highest() if self.axis_roots else 0.0

    def _highest(self) -> float:
        return float((self.bands.centre + self.bands.half).max())

    def _unrolled(self, zeros: Zeros, complete: bool, exact: bool, method: str) -> Crossings:
        """Turn angles into every delay up to the end."""
        zeros = self._genuine(zeros)
        expected = float(np.sum(zeros.omega)) * (self.line.step or 0.0) * self.line.up_to / (2.0 * np.pi)
        if expected > MOST_CROSSINGS:
            raise TooMuchWorkError(
                f"up_to = {self.line.up_to:g} would give some {expected:.3g} crossings: "
                f"at most {MOST_CROSSINGS:,} are listed, a smaller end is needed"
            )
        tau, omega, degree = [np.zeros(0)], [np.zeros(0)], [np.zeros(0, dtype=int)]
        for w, theta, sign in zip(*zeros, strict=True):
            delays = self.line.delays_of_angle(float(w), float(theta))
            tau.append(delays)
            omega.append(np.full(delays.size, w))
            degree.append(np.full(delays.size, sign, dtype=int))
        degrees = np.concatenate(degree)
        return Crossings(
            np.concatenate(tau), np.concatenate(omega), degrees, 2 * degrees,
            complete, exact and zeros.omega.size == 0, method,
        )  # fmt: skip

    def _genuine(self, zeros: Zeros) -> Zeros:
        """Drop roots that stay on the axis for every tau: they do not cross."""
        if not self.axis_roots or zeros.omega.size == 0:
            return zeros
        fixed = np.array(self.axis_roots)
        near = 1e-7 * np.where(fixed > 0.0, fixed, self._highest())
        crossing = np.all(np.abs(zeros.omega[:, None] - fixed) > near, axis=1)
        return Zeros(*(part[crossing] for part in zeros))


def _nothing_found(method: str) -> Crossings:
    """Return no crossings, proven to be all there are for any tau."""
    empty, whole = np.zeros(0), np.zeros(0, dtype=int)
    return Crossings(empty, empty, whole, whole, True, True, method)
