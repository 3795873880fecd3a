r"""The box test: no root on the axis for ``|delta omega| <= h``, ``|delta y| <= g`` about a centre.

With a matrix G that is singular exactly at the roots on the axis,

.. math::

    \frac{\det G}{\det G_c} = 1 + a\,\delta\omega + b\,\delta y + \text{quadratic} + r ,

the box is free if the parallelogram of the linear part stays farther from zero than the quadratic part and the
remainder r can reach. Linear and quadratic part are exact; r is bounded, entry by entry, from
``|e^{-jx} - 1 + jx - x^2/2 ...|`` and the expansion ``det(I + X) = 1 + e_1 + e_2 + ...`` with
``e_3 + ... <= prod(1 + k_i) - 1 - sum k_i - sum k_i k_j``, k the row sums of |X|. Near a root the inverse of G is
nearly a dyad of large entries; a box that only the remainder keeps gets a second try in the singular basis of G,
where that dyad is one entry.

Two matrices serve. ``T = I - P(jw) (E - K)`` has the size of the number of channels; K is a constant feedback taken
into the plant that keeps its poles off the axis. ``G = jwI - A - sum A_k e^{-j phi_k}`` has the size of the
state and needs no resolvent; it is used where the channels are more than the states.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.crossings.delay_line import Coordinate
from susp_ctrl.delay_systems.crossings.small_gain import LocalPlant, off_axis
from susp_ctrl.delay_systems.model import CharacteristicMatrix, inverses, scaled_row_sums

# Boxes expanded at once: their matrices stay in the cache.
_BATCH = 1024


class _Phases(NamedTuple):
    """Exponentials and their change in a box; axes (box, channel)."""

    E: ComplexArray
    by_omega: FloatArray
    by_y: FloatArray
    mixed: FloatArray
    change: FloatArray
    second: FloatArray
    third: FloatArray
    width_omega: FloatArray
    width_y: FloatArray


class _Expansion(NamedTuple):
    """G at the centre, its exact derivatives, and bounds of its change and of the third order on."""

    G: ComplexArray
    omega: ComplexArray
    y: ComplexArray
    omega_omega: ComplexArray
    omega_y: ComplexArray
    y_y: ComplexArray
    rest: FloatArray


class BoxTest:
    """The test for one loop and one coordinate; call it with arrays of boxes."""

    def __init__(self, loop: CharacteristicMatrix, coordinate: Coordinate) -> None:
        self._coordinate = coordinate
        self._by_state = loop.n_channels > loop.n_states and not np.any(loop.D)
        if self._by_state:
            self._A = loop.A
            # Channels that share all phases act through the product of their columns and rows.
            slopes = np.concatenate(coordinate.slopes(np.ones(1), np.zeros(1))).T
            _, first, group = np.unique(slopes, axis=0, return_index=True, return_inverse=True)
            members = np.eye(first.size)[:, group.ravel()]
            self._coordinate = coordinate.of(first)
            self._parts = np.einsum("im,km,mj->kij", loop.B, members, loop.C)
            self._size = np.abs(self._parts)
            self._rate = float(np.linalg.norm(loop.A, 2) + np.linalg.norm(self._parts, 2, axis=(1, 2)).sum())
        else:
            self._loop, self._K = off_axis(loop)

    def __call__(
        self, c: FloatArray, h: FloatArray, y: FloatArray, g: FloatArray
    ) -> tuple[np.ndarray, FloatArray, np.ndarray]:
        """Return which boxes may hold a root, how wide each is, and which vary more along omega than along y."""
        parts = [self._tested(*(x[i : i + _BATCH] for x in (c, h, y, g))) for i in range(0, c.size, _BATCH)]
        maybe, width, along_omega = (np.concatenate(part) for part in zip(*parts, strict=True))
        return maybe, width, along_omega

    def _tested(
        self, c: FloatArray, h: FloatArray, y: FloatArray, g: FloatArray
    ) -> tuple[np.ndarray, FloatArray, np.ndarray]:
        phases = _phases(self._coordinate, c, h, y, g)
        with np.errstate(all="ignore"):
            if self._by_state:
                expansion, rho = self._state_form(phases, c, h)
            else:
                expansion, rho = self._channel_form(phases, c, h)
            free, along_omega, by_remainder = _free(expansion, h, g)
            again = np.flatnonzero(by_remainder)
            if again.size and expansion.G.shape[-1] > 1:
                basis = _in_singular_basis(expansion, again)
                free[again] = _free(basis, h[again], g[again])[0]
        return ~free, np.maximum(phases.width_omega + h * rho, phases.width_y), along_omega

    def _channel_form(self, p: _Phases, c: FloatArray, h: FloatArray) -> tuple[_Expansion, FloatArray]:
        """Expand ``T = I - P (E - K)``."""
        frequencies, index = np.unique(c, return_inverse=True)
        local = LocalPlant.sample(self._loop, frequencies).at(index)
        E, f, z = p.E[:, None, :], p.by_omega[:, None, :], p.by_y[:, None, :]
        F, PE, slope_E = E - self._K, local.P * E, local.slope * E
        rest_P, size, h3 = local.rest(h, 3), np.abs(local.P), h[:, None, None]
        rest = (
            rest_P * np.abs(F)
            + size * p.third[:, None, :]
            + h3 * np.abs(local.slope) * p.second[:, None, :]
            + (h3**2 * np.abs(local.bend) + rest_P) * p.change[:, None, :]
        )
        expansion = _Expansion(
            np.eye(size.shape[-1]) - local.P * F,
            1j * PE * f - local.slope * F,
            1j * PE * z,
            0.5 * PE * f**2 + 1j * slope_E * f - local.bend * F,
            PE * (f * z + 1j * p.mixed[:, None, :]) + 1j * slope_E * z,
            0.5 * PE * z**2,
            rest,
        )
        return expansion, local.rho

    def _state_form(self, p: _Phases, c: FloatArray, h: FloatArray) -> tuple[_Expansion, FloatArray]:
        """Expand ``G = jwI - A - sum A_k E_k``."""
        E, f, z, mixed, third = p.E, p.by_omega, p.by_y, p.mixed, p.third
        one = np.eye(self._A.shape[0])

        def combined(weights: np.ndarray, parts: FloatArray) -> ComplexArray:
            return np.tensordot(weights, parts, axes=1)

        expansion = _Expansion(
            1j * c[:, None, None] * one - self._A - combined(E, self._parts),
            1j * one + combined(1j * E * f, self._parts),
            combined(1j * E * z, self._parts),
            combined(0.5 * E * f**2, self._parts),
            combined(E * (f * z + 1j * mixed), self._parts),
            combined(0.5 * E * z**2, self._parts),
            combined(third, self._size).real,
        )
        return expansion, np.full_like(h, 1.0 / self._rate)


def _phases(coordinate: Coordinate, c: FloatArray, h: FloatArray, y: FloatArray, g: FloatArray) -> _Phases:
    by_omega, by_y = coordinate.slopes(c, y)
    mixed = np.broadcast_to(coordinate.mixed(), by_omega.shape)
    width_omega, width_y = h[:, None] * np.abs(by_omega), g[:, None] * np.abs(by_y)
    bilinear = (h * g)[:, None] * np.abs(mixed)
    spread = width_omega + width_y + bilinear
    change = np.minimum(spread, 2.0)
    second = 0.5 * spread**2 + bilinear
    third = spread**3 / 6.0 + (width_omega + width_y) * bilinear + 0.5 * bilinear**2
    E = np.exp(-1j * coordinate.phases(c, y))
    return _Phases(
        E, by_omega, by_y, mixed, change, second, third,
        (width_omega + 0.5 * bilinear).max(axis=1, initial=0.0),
        (width_y + 0.5 * bilinear).max(axis=1, initial=0.0),
    )  # fmt: skip


def _in_singular_basis(x: _Expansion, chosen: np.ndarray) -> _Expansion:
    """Multiply by the singular vectors of G from both sides, which moves no root; bounds by their moduli."""
    G = x.G[chosen]
    left, _, right = np.linalg.svd(np.where(np.isfinite(G).all(axis=(1, 2), keepdims=True), G, 0.0))
    left, right = np.conj(np.swapaxes(left, 1, 2)), np.conj(np.swapaxes(right, 1, 2))

    def turned(part: ComplexArray) -> ComplexArray:
        return np.asarray(left @ part[chosen] @ right)

    rest = np.abs(left) @ x.rest[chosen] @ np.abs(right)
    return _Expansion(
        turned(x.G),
        turned(x.omega),
        turned(x.y),
        turned(x.omega_omega),
        turned(x.omega_y),
        turned(x.y_y),
        rest,
    )


def _free(x: _Expansion, h: FloatArray, g: FloatArray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tell which boxes hold no root, which vary more along omega, and which only the remainder keeps."""
    inverse = inverses(x.G)
    size = np.abs(inverse)
    h3, g3 = h[:, None, None], g[:, None, None]
    by_omega, by_y = h3 * (inverse @ x.omega), g3 * (inverse @ x.y)
    a, b = _trace(by_omega), _trace(by_y)
    quadratic = (
        np.abs(h**2 * _trace_of(inverse, x.omega_omega) + 0.5 * (a**2 - _trace_of(by_omega, by_omega)))
        + np.abs(h * g * _trace_of(inverse, x.omega_y) + a * b - _trace_of(by_omega, by_y))
        + np.abs(g**2 * _trace_of(inverse, x.y_y) + 0.5 * (b**2 - _trace_of(by_y, by_y)))
    )
    X1 = np.abs(by_omega) + np.abs(by_y)
    Q = h3**2 * np.abs(x.omega_omega) + h3 * g3 * np.abs(x.omega_y) + g3**2 * np.abs(x.y_y)
    X3 = size @ x.rest
    Y = size @ Q + X3
    trace_Y = _trace(Y)
    # The second-order part of det that is of third order in the box: X1 with Y, and Y with itself.
    mixed = _trace(X1) * trace_Y + _trace_of(X1, Y) + 0.5 * (trace_Y**2 + _trace_of(Y, Y))
    k = scaled_row_sums(X1 + Y)
    total = k.sum(axis=1)
    higher = np.prod(1.0 + k, axis=1) - 1.0 - total - 0.5 * (total**2 - (k**2).sum(axis=1))
    remainder = quadratic + _trace(X3) + mixed + np.maximum(higher, 0.0)
    gap = np.fmax(1.0 - np.abs(a) - np.abs(b), np.fmax(_beyond(a, b), _beyond(b, a)))
    free = (gap > remainder + 1e-13) | (k.max(axis=1, initial=0.0) < 1.0 - 1e-13)
    along_omega = _square(by_omega) > _square(by_y)
    return free, along_omega, ~free & (gap > quadratic + 1e-13)


def _square(matrices: ComplexArray) -> FloatArray:
    """Return the square of the Frobenius norm."""
    flat = matrices.reshape(len(matrices), -1).view(float)
    squares: FloatArray = np.einsum("pi,pi->p", flat, flat)
    return squares


def _trace(matrices: np.ndarray) -> np.ndarray:
    traces: np.ndarray = np.einsum("pii->p", matrices)
    return traces


def _trace_of(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the trace of the product."""
    traces: np.ndarray = np.einsum("pij,pji->p", left, right)
    return traces


def _beyond(a: ComplexArray, b: ComplexArray) -> FloatArray:
    """Return how far zero lies outside the strip ``1 + [-1, 1] a + [-1, 1] b`` seen along the normal of a."""
    normal = 1j * a / np.abs(a)
    return np.abs(normal.real) - np.abs((normal.conj() * b).real)
