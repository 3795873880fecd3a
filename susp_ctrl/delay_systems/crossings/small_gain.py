r"""Small loop gain: frequencies at which no root can be on the axis, whatever the delays.

Where ``rho(|P22(jw)|) < 1`` the matrix ``I - P22 E`` is regular for every ``|z_k| = 1``. Between the frequencies at
which P is evaluated its change is bounded, entry by entry, by its Taylor terms and

.. math::

    |r_p| \le \frac{(h \rho)^p}{\rho\,(1 - h \rho)} \|C R\|\,\|R B\|, \qquad
    R = (jcI - A)^{-1}, \; \rho = \|R\|,

so that the intervals left over are proven to contain every frequency at which the gain is not small.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import CharacteristicMatrix, Modes, closed, inverses, perron_bound

_INTERVAL_BUDGET = 200_000
# What the modes may leave out, relative to the distance from a pole.
_SMALL_DEFECT = 1e-7


class Bands(NamedTuple):
    """Frequency intervals, as centre and half width, outside which the loop gain is proven small."""

    centre: FloatArray
    half: FloatArray


class LocalPlant(NamedTuple):
    """P at some frequencies, its derivatives P' and P''/2, and the factors that bound the rest of its change."""

    P: ComplexArray
    slope: ComplexArray
    bend: ComplexArray
    left: FloatArray
    right: FloatArray
    rho: FloatArray

    @classmethod
    def sample(cls, loop: CharacteristicMatrix, omega: FloatArray) -> LocalPlant:
        """Evaluate P and its bounds at many frequencies, in the modes of the loop where it has them."""
        if loop.modes is not None:
            return cls._sample_modes(loop, loop.modes, omega)
        return cls._sample_matrix(loop, omega)

    @classmethod
    def _sample_modes(cls, loop: CharacteristicMatrix, modes: Modes, omega: FloatArray) -> LocalPlant:
        resolvent = 1.0 / (1j * omega[:, None] - modes.poles)
        powers = [(resolvent**k @ modes.residues.reshape(modes.poles.size, -1)) for k in (1, 2, 3)]
        P, slope, bend = (power.reshape(-1, *loop.D.shape) for power in powers)
        left = np.linalg.norm(resolvent[:, None, :] * modes.out, axis=2)
        right = np.linalg.norm(resolvent[:, :, None] * modes.into, axis=1)
        rho = np.abs(resolvent).max(axis=1)
        local = cls(P + loop.D, -1j * slope, -bend, left, right, rho)
        # beside a pole the defect of the modes counts
        vague = np.flatnonzero(~(rho * np.linalg.norm(modes.defect) < _SMALL_DEFECT))
        if vague.size:
            for part, exact in zip(local, cls._sample_matrix(loop, omega[vague]), strict=True):
                part[vague] = exact
        return local

    @classmethod
    def _sample_matrix(cls, loop: CharacteristicMatrix, omega: FloatArray) -> LocalPlant:
        with np.errstate(all="ignore"):
            resolvent = inverses(1j * omega[:, None, None] * np.eye(loop.n_states) - loop.A)
            CR, RB = loop.C @ resolvent, resolvent @ loop.B
            rho = np.linalg.norm(resolvent, axis=(1, 2))
            rho = np.where(np.isfinite(rho), rho, np.inf)
            return cls(
                CR @ loop.B + loop.D, -1j * (CR @ RB), -(CR @ (resolvent @ RB)),
                np.linalg.norm(CR, axis=2), np.linalg.norm(RB, axis=1), rho,
            )  # fmt: skip

    def rest(self, h: FloatArray, order: int) -> FloatArray:
        """Bound the change of P within h from `order` on; infinite where P may have a pole."""
        hr = h * self.rho
        with np.errstate(all="ignore"):
            factor = np.where(hr < 1.0, hr**order / self.rho / (1.0 - hr), np.inf)
            return factor[:, None, None] * self.left[:, :, None] * self.right[:, None, :]

    def at(self, index: np.ndarray) -> LocalPlant:
        """Return the values at some of the frequencies."""
        return LocalPlant(*(part[index] for part in self))


def small_gain_bands(loop: CharacteristicMatrix, margin: float = 1.0) -> Bands:
    """Return the frequency intervals that remain after excluding ``rho(|P22(jw)|) < 1 / margin``.

    An empty result proves that no root is ever on the axis at ``w >= 0``, for whatever delays and any gains
    grown up to `margin` times.
    """
    if loop.n_channels == 0 or loop.n_states == 0:
        return Bands(np.zeros(0), np.zeros(0))
    shifted, _ = off_axis(loop)
    top = frequency_bound(loop, margin)
    centre: FloatArray = np.asarray((np.arange(16) + 0.5) * (top / 16), dtype=float)
    half: FloatArray = np.full(16, top / 32)
    done: list[tuple[FloatArray, FloatArray]] = []
    moved = shifted is not loop
    for _ in range(60):
        if centre.size == 0:
            break
        local = LocalPlant.sample(loop, centre)
        gain = np.abs(local.P) + half[:, None, None] * np.abs(local.slope) + local.rest(half, 2)
        large = ~(perron_bound(gain) * margin < 1.0)
        centre, half = centre[large], half[large]
        rho = (LocalPlant.sample(shifted, centre) if moved else local.at(large)).rho
        fine = half * rho <= 0.2
        done.append((centre[fine], half[fine]))
        centre, half = centre[~fine], half[~fine]
        if centre.size > _INTERVAL_BUDGET:
            break
        half = np.repeat(half / 2.0, 2)
        centre = np.repeat(centre, 2) + half * np.tile([-1.0, 1.0], centre.size)
    done.append((centre, half))
    return Bands(np.concatenate([c for c, _ in done]), np.concatenate([h for _, h in done]))


def frequency_bound(loop: CharacteristicMatrix, margin: float = 1.0) -> float:
    """Return a frequency above which ``rho(|P22(jw)|) < 1 / margin``: no root on the axis is above it.

    For ``w > ||A||`` it holds that ``|P22(jw)| <= |D| + |C| |B| / (w - ||A||)`` with the norms of rows and
    columns, and the cycles of D have no weight.
    """
    norm = float(np.linalg.norm(loop.A, 2)) if loop.n_states else 0.0
    outer = np.outer(np.linalg.norm(loop.C, axis=1), np.linalg.norm(loop.B, axis=0))
    gap = 1e-6 * (norm + float(outer.max(initial=0.0))) or 1.0
    for _ in range(400):
        if perron_bound(margin * (np.abs(loop.D) + outer / gap)[None])[0] < 1.0:
            break
        gap *= 1.5
    return norm + gap


def off_axis(loop: CharacteristicMatrix) -> tuple[CharacteristicMatrix, float]:
    """Return the loop with K times every channel closed, its poles off the axis, and K."""
    if loop.n_states == 0:
        return loop, 0.0

    def clearance(matrix: FloatArray) -> float:
        values = np.linalg.eigvals(matrix)
        return float(np.min(np.abs(values.real) / (np.abs(values) + 1e-3 * np.abs(values).max() + 1e-300)))

    best, best_clearance, best_K = loop, clearance(loop.A), 0.0
    if best_clearance > 1e-2:
        return loop, 0.0
    for K in (0.5, -0.5, 0.9, -0.9, 0.2, -0.2):
        n, whole = loop.n_states, loop.plant.matrix
        M = closed(whole, K * whole[:, n:], whole[n:], K * loop.D)
        moved = CharacteristicMatrix(M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:], loop.delays)
        room = clearance(moved.A)
        if room > best_clearance:
            best, best_clearance, best_K = moved, room, K
        if room > 3e-2:
            break
    return best, best_K
