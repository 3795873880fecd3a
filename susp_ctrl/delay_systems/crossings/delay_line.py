r"""A line in the space of delays, and the characteristic equation along it.

On the imaginary axis the loop closed through ``w = E z`` has a root at :math:`j\omega` exactly where

.. math::

    W(\omega, y) = \begin{bmatrix} j\omega I - A & -B \\ -E C & I - E D \end{bmatrix},\qquad
    E = \mathrm{diag}(e^{-j\varphi_k(\omega, y)})

is singular. Unlike ``I - P(jw) E`` it has no poles, so an eigenvalue of A on the axis is no obstacle. Two
coordinates y are in use:

* `DelayCoordinate`: y is the parameter tau of the line, :math:`\varphi_k = \omega (s_k + d_k y)`;
* `AngleCoordinate`: where all varying delays are integer multiples of one, y is its angle
  :math:`\theta = \omega h \tau`, :math:`\varphi_k = \omega s_k + n_k y`: one turn stands for every tau.

The degree of the map ``(omega, y) -> det W`` around a zero is the number of roots that cross from left to right
there as tau grows, minus those that cross back, in both coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Protocol

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import (
    CharacteristicMatrix,
    DelaySystem,
    distance_to_singular,
    eigenvalues_with_uncertainty,
    fold,
)

_LARGEST_MULTIPLE = 12
# Share of a line at which its delays are looked at: no ratio of small numbers.
_GENERIC = 0.6180339887498949
# Relative changes of the data that make the characteristic matrix singular: at s = 0, and at a pole on the axis,
# which is known to some digits less.
_SINGULAR = 1e-13
_STAYS = 1e-11


class Coordinate(Protocol):
    """Phases of the delayed signals as functions of frequency and of y."""

    def of(self, signals: np.ndarray) -> Coordinate:
        """Return the coordinate of some of the signals."""

    def phases(self, omega: FloatArray, y: FloatArray) -> FloatArray:
        """Return phi_k, shape (points, channels)."""

    def slopes(self, omega: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of phi_k with respect to omega and to y."""

    def mixed(self) -> FloatArray:
        """Return the derivative of phi_k with respect to both; no other second derivative exists."""


@dataclass(frozen=True, eq=False)
class DelayCoordinate:
    """y = tau: delays ``start + direction y``."""

    start: FloatArray
    direction: FloatArray

    def of(self, signals: np.ndarray) -> DelayCoordinate:
        """Return the coordinate of some of the signals."""
        return DelayCoordinate(self.start[signals], self.direction[signals])

    def phases(self, omega: FloatArray, y: FloatArray) -> FloatArray:
        """Return omega (start + direction y)."""
        return omega[:, None] * (self.start + self.direction * y[:, None])

    def slopes(self, omega: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the delays, and omega times the direction."""
        return self.start + self.direction * y[:, None], omega[:, None] * self.direction

    def mixed(self) -> FloatArray:
        """Return the direction."""
        return self.direction


@dataclass(frozen=True, eq=False)
class AngleCoordinate:
    """y = theta: phases ``omega start + multiples theta``."""

    start: FloatArray
    multiples: FloatArray

    def of(self, signals: np.ndarray) -> AngleCoordinate:
        """Return the coordinate of some of the signals."""
        return AngleCoordinate(self.start[signals], self.multiples[signals])

    def phases(self, omega: FloatArray, y: FloatArray) -> FloatArray:
        """Return omega start + multiples y."""
        return omega[:, None] * self.start + self.multiples * y[:, None]

    def slopes(self, omega: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return start, and the multiples."""
        shape = (omega.size, self.start.size)
        return np.broadcast_to(self.start, shape), np.broadcast_to(self.multiples, shape)

    def mixed(self) -> FloatArray:
        """Return zeros."""
        return np.zeros_like(self.start)


@dataclass(frozen=True, eq=False)
class DelayLine:
    """The loop along ``delays(tau) = start + tau direction``, ``0 <= tau <= up_to``.

    `start` and `direction` here belong to the signals in the loop (blocks spread out). `step` and `multiples`
    are set where all varying delays grow as integer multiples of `step`; `offset` where, besides, ``start`` is
    ``offset`` times `direction`, so that nothing but multiples of one delay is left.
    """

    matrices: CharacteristicMatrix
    start: FloatArray
    direction: FloatArray
    up_to: float
    step: float | None
    multiples: FloatArray | None
    offset: float | None

    @classmethod
    def of(cls, sys: DelaySystem, direction: FloatArray, start: FloatArray, up_to: float) -> DelayLine:
        """Fold the loop along a line: channels that never have a delay are closed, those outside the loop dropped."""
        per_channel = np.repeat(start, sys.widths), np.repeat(direction, sys.widths)
        delayed = (per_channel[0] != 0.0) | (per_channel[1] != 0.0)
        # fold() closes channels of delay zero; what holds at this place on the line holds everywhere, except by chance
        place = np.where(delayed, per_channel[0] + _GENERIC * up_to * per_channel[1], 0.0)
        matrices = CharacteristicMatrix.of(fold(sys.realization, sys.channel_gains, place))
        owner = np.array([np.flatnonzero(place == delay)[0] for delay in matrices.delays], dtype=int)
        s, d = per_channel[0][owner], per_channel[1][owner]
        matrices = replace(matrices, delays=s)
        step, multiples = _commensurate(d)
        return cls(matrices, s, d, up_to, step, multiples, _offset(s, d) if step is not None else None)

    @property
    def varies(self) -> bool:
        """Whether any delay in the loop depends on tau."""
        return bool(np.any(self.direction != 0.0))

    def by_delay(self) -> DelayCoordinate:
        """Return the coordinate y = tau."""
        return DelayCoordinate(self.start, self.direction)

    def by_angle(self) -> AngleCoordinate:
        """Return the coordinate y = theta; needs `multiples`."""
        if self.multiples is None or self.step is None:
            raise ValueError("the delays along the line are not commensurate")
        start = np.zeros_like(self.start) if self.offset is not None else self.start
        return AngleCoordinate(start, self.multiples)

    def free_up_to(self, omega: float, *, except_at_zero: bool = False) -> bool:
        """Whether it is proven that no root is on the axis in ``[0, omega]`` (in ``(0, omega]``) on the whole line.

        The characteristic matrix is regular at s = 0 and changes too little up to `omega`.
        """
        if omega == 0.0 or self.matrices.n_states == 0:
            return True
        if except_at_zero:
            return False
        loop = self.matrices
        longest = np.maximum(self.start, self.start + self.direction * self.up_to)
        around = np.abs(np.hstack([loop.C, loop.D]))
        change = np.zeros((loop.n_states + loop.n_channels,) * 2)
        change[: loop.n_states, : loop.n_states] = omega * np.eye(loop.n_states)
        change[loop.n_states :] = omega * longest[:, None] * around
        W = bordered(loop, self.by_delay(), np.zeros(1), np.zeros(1))[0][0]
        try:
            reach = np.abs(np.linalg.inv(W)) @ change
        except np.linalg.LinAlgError:
            return False
        return bool(np.abs(np.linalg.eigvals(reach)).max() < 1.0)

    def delays_of_angle(self, omega: float, theta: float) -> FloatArray:
        """Return every tau in [0, up_to] at which ``omega step (tau + offset) = theta mod 2 pi``."""
        if self.step is None:
            raise ValueError("the delays along the line are not commensurate")
        rate, offset = omega * self.step, self.offset or 0.0
        # Rounding must not push a crossing at tau = 0 or at the end out of the range.
        slack = 1e-11 + 1e-13 * rate * (self.up_to + offset)
        first = np.ceil((rate * offset - theta - slack) / (2.0 * np.pi))
        last = np.floor((rate * (offset + self.up_to) - theta + slack) / (2.0 * np.pi))
        turns = np.arange(first, last + 1.0)
        return np.clip((theta + 2.0 * np.pi * turns) / rate - offset, 0.0, self.up_to)


def bordered(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: FloatArray, y: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return W and its derivatives with respect to omega and y, each of shape (points, n + m, n + m)."""
    n, m = loop.n_states, loop.n_channels
    omega, y = np.atleast_1d(omega), np.atleast_1d(y)
    E = np.exp(-1j * coordinate.phases(omega, y))
    by_omega, by_y = coordinate.slopes(omega, y)
    around = np.hstack([loop.C, loop.D])
    W = np.zeros((omega.size, n + m, n + m), dtype=complex)
    W[:, :n, :n] = 1j * omega[:, None, None] * np.eye(n) - loop.A
    W[:, :n, n:] = -loop.B
    W[:, n:, :] = -E[:, :, None] * around
    W[:, n:, n:] += np.eye(m)
    W_omega, W_y = np.zeros_like(W), np.zeros_like(W)
    W_omega[:, :n, :n] = 1j * np.eye(n)
    W_omega[:, n:, :] = (1j * by_omega * E)[:, :, None] * around
    W_y[:, n:, :] = (1j * by_y * E)[:, :, None] * around
    return W, W_omega, W_y


def axis_matrix(
    loop: CharacteristicMatrix, coordinate: Coordinate, omega: FloatArray, y: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return ``jwI - A - B E (I - D E)^-1 C``, which has the determinant of W, and its derivatives.

    All of it has the unit of a rate, so that no choice of units changes what is small.
    """
    omega, y = np.atleast_1d(omega), np.atleast_1d(y)
    into, passed, out = loop.paths(np.exp(-1j * coordinate.phases(omega, y)))
    by_omega, by_y = (1j * passed * slope[:, None, :] @ out for slope in coordinate.slopes(omega, y))
    identity = 1j * np.eye(loop.n_states)
    return omega[:, None, None] * identity - loop.A - into @ out, identity + by_omega, by_y


def axis_size(loop: CharacteristicMatrix, omega: FloatArray) -> FloatArray:
    """Return the size of the terms that `axis_matrix` is summed from: all of it can vanish at a multiple root."""
    size_A, into, _ = loop.absolute_parts
    return (
        np.abs(omega) + float(np.linalg.norm(size_A)) + float(np.linalg.norm(into) * np.linalg.norm(loop.C))
    )


def roots_always_on_axis(line: DelayLine) -> tuple[float, ...]:
    """Return the frequencies >= 0 of roots on the axis that no delay moves."""
    loop = line.matrices
    if loop.n_states == 0:
        return ()
    found = []
    at_zero = np.block([[loop.A, loop.B], [loop.C, loop.D - np.eye(loop.n_channels)]])
    if distance_to_singular(at_zero) <= _SINGULAR:
        found.append(0.0)
    poles, uncertain = eigenvalues_with_uncertainty(loop.A)
    uncertain = np.maximum(uncertain, 1e-12 * np.abs(poles))
    suspects = np.unique(poles.imag[(np.abs(poles.real) <= uncertain) & (poles.imag > uncertain)])
    for omega in suspects:
        places = line.up_to * np.array([0.217, 0.513, 0.871])
        W = bordered(loop, line.by_delay(), np.full(3, omega), places)[0]
        if np.all(distance_to_singular(W) <= _STAYS):
            found.append(float(omega))
    return tuple(found)


def _commensurate(direction: FloatArray) -> tuple[float | None, FloatArray | None]:
    """Return the common step and the integer multiples of the varying delays, or None."""
    moving = direction != 0.0
    if not np.any(moving) or np.any(direction < 0.0):
        return None, None
    ratios = direction[moving] / direction[moving].min()
    fractions = [Fraction(r).limit_denominator(_LARGEST_MULTIPLE) for r in ratios]
    if any(abs(float(f) - r) > 1e-12 * r for f, r in zip(fractions, ratios, strict=True)):
        return None, None
    denominator = int(np.lcm.reduce([f.denominator for f in fractions]))
    multiples = np.zeros_like(direction)
    multiples[moving] = [float(f * denominator) for f in fractions]
    if multiples.max() > _LARGEST_MULTIPLE:
        return None, None
    return float(direction[moving].min() / denominator), multiples


def _offset(start: FloatArray, direction: FloatArray) -> float | None:
    """Return c with ``start = c direction``, or None."""
    moving = direction != 0.0
    if np.any(start[~moving] != 0.0):
        return None
    c = start[moving] / direction[moving]
    if np.ptp(c) > 1e-14 * float(np.abs(c).max()):
        return None
    return float(c[0])
