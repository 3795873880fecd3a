r"""Crossing points of two parameters of a loop at given frequencies, in closed form.

Two of the gains and delays of two scalar channels are free, everything else is fixed. With
:math:`\zeta_k = g_k e^{-j\omega\tau_k}` the characteristic equation at :math:`s = j\omega` is
:math:`p_0 + p_1\zeta_1 + p_2\zeta_2 + p_{12}\zeta_1\zeta_2 = 0`, and the free pair follows from

* two delays: the torus (see `torus`);
* a gain and the delay of the other channel: ``|p0 + p1 zeta1| = |p2 + p12 zeta1|`` is a circle in the plane of
  zeta1, which the ray of the gain meets twice;
* two gains: ``Im((p0 + p1 zeta1) conj(e2 (p2 + p12 zeta1))) = 0`` is a circle as well;
* gain and delay of one channel: ``zeta1 = -p0/p1``.

Both circles are preimages under a Möbius map, so their radius is proportional to its determinant
:math:`|p_0 p_{12} - p_1 p_2| = |P_{12} P_{21}|`. Formed from this product it keeps all its digits for channels that
are hardly coupled, where the circle is tiny.

The side on which the loop has more unstable roots is known as well: along increasing frequency it lies to the
right where :math:`\mathrm{Im}(\bar f_x f_y) > 0` and to the left where it is negative, f being the
characteristic function [1]_.

References
----------
.. [1] K. Gu, S.-I. Niculescu, J. Chen, "On stability crossing curves for general systems with two delays",
   J. Math. Anal. Appl. 311, 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.crossings import bilinear_coefficients, torus_excess, torus_solutions
from susp_ctrl.delay_systems.model import CharacteristicMatrix


@dataclass(frozen=True)
class Axis:
    """One free parameter: which of the two channels, whether its delay or its gain, and the range."""

    channel: int
    kind: str
    low: float
    high: float

    @property
    def is_delay(self) -> bool:
        """Whether the parameter is a delay."""
        return self.kind == "delay"


def turns_in_range(
    axis: Axis, w0: FloatArray, w1: FloatArray, a: FloatArray, b: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Return the first turn that puts the delay of angles a to b at w0 to w1 into the range, and how many do."""
    first = np.ceil((axis.low * np.minimum(w0, w1) - np.maximum(a, b)) / (2.0 * np.pi))
    last = np.floor((axis.high * np.maximum(w0, w1) - np.minimum(a, b)) / (2.0 * np.pi))
    return first, np.maximum(last - first + 1, 0).astype(int)


class _Circle(NamedTuple):
    """``A g^2 + 2 b g + C = 0`` with discriminant ``reach^2 - off^2``.

    `size` is that of the terms of b and `off`, which may cancel.
    """

    A: FloatArray
    b: FloatArray
    C: FloatArray
    off: FloatArray
    reach: FloatArray
    size: FloatArray

    def roots(self) -> FloatArray:
        """Return both roots, each continuous in the coefficients; nan where there are none."""
        difference = self.reach - np.abs(self.off)
        # The end of an interval is found to rounding.
        difference = np.where(np.abs(difference) <= 1e-15 * self.size, 0.0, difference)
        root = np.sqrt(difference * (self.reach + np.abs(self.off)))
        direct = np.stack([-self.b + root, -self.b - root]) / self.A
        # Far from a double root the smaller one comes from the product, without cancellation.
        stable = self.C / np.stack([-self.b - root, -self.b + root])
        cancels = np.stack([self.b > 0.0, self.b <= 0.0]) & (np.abs(self.A * self.C) < 0.1 * self.b**2)
        return np.where(cancels, stable, direct)


class Points(NamedTuple):
    """Solutions at many frequencies, shape (branches, frequencies); an angle stands for a delay.

    `side` is +1 where, along increasing frequency, more unstable roots lie to the right.
    """

    x: FloatArray
    y: FloatArray
    side: FloatArray


@dataclass(frozen=True, eq=False)
class CrossingPlane:
    """Two scalar channels of a loop with two free parameters.

    `loop` holds all channels with unit gain on those that are free; `owner` tells for each channel whether it
    is the first (0), the second (1) or another one (-1); `delays` are those of the two channels where they are
    not free; `other_delays` belongs to all channels.
    """

    loop: CharacteristicMatrix
    owner: np.ndarray
    delays: tuple[float, float]
    other_delays: FloatArray
    x: Axis
    y: Axis

    def coefficients(self, omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return ``p0, p1, p2, p12`` with all other channels closed, scaled to size one, and ``|P12 P21|``."""
        P = self.loop.response(omega)
        P = P * np.exp(-1j * omega[:, None, None] * np.where(self.owner < 0, self.other_delays, 0.0))
        others = self.owner < 0
        scale = np.ones(omega.size, dtype=complex)
        if np.any(others):
            inner = np.eye(int(others.sum())) - P[:, others][:, :, others]
            scale = np.linalg.det(inner)
            P = P[:, ~others][:, :, ~others] + P[:, ~others][:, :, others] @ np.linalg.solve(
                inner, P[:, others][:, :, ~others]
            )
        owner = self.owner[~others]
        coupling = np.zeros(omega.size)
        if owner.size == 2:
            order = np.argsort(owner)
            p = bilinear_coefficients(P[:, order][:, :, order])
            coupling = np.abs(P[:, 0, 1] * P[:, 1, 0])
        else:
            p = np.zeros((4, omega.size), dtype=complex)
            p[0] = 1.0
            p[1 + int(owner[0])] = -P[:, 0, 0]
        size2 = np.sum(np.abs(p) ** 2, axis=0)
        return p * (scale / np.abs(scale)) / np.sqrt(size2), coupling / size2

    def _arranged(self, omega: FloatArray) -> tuple[ComplexArray, FloatArray, int]:
        """Return the coefficients with the channel of x (or of the gain) first, and that channel."""
        first = (
            self.x.channel if self.x.is_delay == self.y.is_delay or not self.x.is_delay else self.y.channel
        )
        p, coupling = self.coefficients(omega)
        return (p if first == 0 else p[[0, 2, 1, 3]]), coupling, first

    def excess(self, omega: FloatArray) -> FloatArray:
        """Return a number that is not negative exactly where there are crossing points."""
        if self.x.channel == self.y.channel:
            return np.ones_like(omega)
        p, coupling, first = self._arranged(omega)
        if self.x.is_delay and self.y.is_delay:
            return torus_excess(p, coupling)
        circle = self._circle(p, coupling, omega, first)
        return (circle.reach - np.abs(circle.off)) / (circle.size + circle.reach)

    def points(self, omega: FloatArray) -> Points:
        """Return all crossing points in the base turn of each angle."""
        p, coupling, first = self._arranged(omega)
        with np.errstate(all="ignore"):
            if self.x.channel == self.y.channel:
                return self._one_channel(p, omega, first)
            if self.x.is_delay and self.y.is_delay:
                u, v = torus_solutions(p, coupling)
                return self._sided(p, np.exp(-1j * u), np.exp(-1j * v), u, v, (True, True))
            u = self._circle(p, coupling, omega, first).roots()
            zeta = u * np.exp(-1j * omega * self.delays[first])
            ratio = -(p[0] + p[1] * zeta) / (p[2] + p[3] * zeta)
            if self.x.is_delay or self.y.is_delay:
                return self._sided(p, zeta, ratio, u, -np.angle(ratio), (False, True))
            v = (ratio * np.exp(1j * omega * self.delays[1 - first])).real
            return self._sided(p, zeta, ratio, u, v, (False, False))

    def _circle(self, p: ComplexArray, coupling: FloatArray, omega: FloatArray, first: int) -> _Circle:
        """Return the circle in the plane of zeta1 cut by the ray of the gain."""
        ray = np.exp(-1j * omega * self.delays[first])
        if self.x.is_delay or self.y.is_delay:
            A = np.abs(p[1]) ** 2 - np.abs(p[3]) ** 2
            C = np.abs(p[0]) ** 2 - np.abs(p[2]) ** 2
            centre = (p[0].conj() * p[1] - p[2].conj() * p[3]) * ray
            size = np.abs(p[0] * p[1]) + np.abs(p[2] * p[3])
            return _Circle(A, centre.real, C, centre.imag, coupling, size)
        other = np.exp(1j * omega * self.delays[1 - first])
        low, high = other * p[2].conj(), other * p[3].conj()
        centre = -0.5j * (p[1] * low - (p[0] * high).conj()) * ray
        A, C = (p[1] * high).imag, (p[0] * low).imag
        size = np.abs(p[0] * p[3]) + np.abs(p[1] * p[2])
        return _Circle(A, centre.real, C, centre.imag, 0.5 * coupling, size)

    def _one_channel(self, p: ComplexArray, omega: FloatArray, first: int) -> Points:
        """Gain and delay of the first channel, the second one fixed."""
        other = np.exp(-1j * omega * self.delays[1 - first])
        zeta = -(p[0] + p[2] * other) / (p[1] + p[3] * other)
        gain = np.stack([np.abs(zeta), -np.abs(zeta)])
        angle = -np.angle(zeta / gain)
        # f is linear in zeta: f_g = e p, f_tau = -jw zeta p, with the same p.
        side = np.sign((np.conj(zeta / gain) * (-1j) * zeta).imag)
        if self.x.is_delay:
            return Points(angle, gain, -side)
        return Points(gain, angle, side)

    def _sided(
        self,
        p: ComplexArray,
        zeta1: ComplexArray,
        zeta2: ComplexArray,
        u: FloatArray,
        v: FloatArray,
        delays: tuple[bool, bool],
    ) -> Points:
        """Return (u, v) of the first and second channel as x and y with their side."""
        d1, d2 = p[1] + p[3] * zeta2, p[2] + p[3] * zeta1
        f1 = -1j * zeta1 * d1 if delays[0] else zeta1 / u * d1
        f2 = -1j * zeta2 * d2 if delays[1] else zeta2 / v * d2
        side = np.sign((f1.conj() * f2).imag)
        first_is_x = self.x.is_delay == self.y.is_delay or not self.x.is_delay
        return Points(u, v, side) if first_is_x else Points(v, u, -side)
