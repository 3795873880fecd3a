r"""Stability of a whole swarm at once: small gain first, else a certified argument-principle count.

On the line Re s = -decay, :math:`f(\omega) = \det(I - P_{22} E)` is a multilinear function of the channels,

.. math:: f = 1 + \sum_S c_S(\omega) \prod_{k \in S} g_k e^{-j\omega\tau_k}, \quad
          c_S = (-1)^{|S|} \det P_{22}[S, S],

over the non-empty sets S of channels, and the number of roots to the right of the line is
:math:`Z = N_P - \Delta\arg f / \pi`, omega from 0 to infinity, with N_P the plant's own poles there.

The phase between two grid points is known only if f does not go round the origin between them. The length of
its path is at most :math:`\sum_S |g_S| (V_S + \tau_S W_S)` with :math:`V_S = \int |c_S'|`,
:math:`W_S = \int |c_S|` over the interval, both tabulated once. A path shorter than
:math:`|f_a| + |f_b|` stays inside an ellipse with foci f_a, f_b that leaves the origin out: then the principal
value of the step is the true one. Intervals without this certificate are refined twice by eight; a design
that is still without it counts as infeasible. Where :math:`\rho(|P_{22}| \mathrm{diag}|\bar g|)` is small, f
stays in the right half plane and no grid is needed at all.

A pole of the plant on the line (an integrator) makes f infinite there. It is moved to the left by a further channel
without delay, :math:`A' = A - \sigma\Pi` with the projector Pi on its modes, whose gain is always one: the
determinant of the larger matrix has the same zeros and no such pole.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import small_gain_supremum
from susp_ctrl.delay_systems.model import Realization, return_determinant, sample_plant
from susp_ctrl.errors import InputError
from susp_ctrl.tuning.counting_grid import counting_grid
from susp_ctrl.tuning.sampling import channel_exponentials, frequencies_contiguous

MAX_CHANNELS = 6  # 2^m - 1 principal minors are tabulated
SPLIT = 8
# Path length of f per base interval relative to its size at the corner of the box: small enough that most
# designs are certified without refinement, large enough to keep the base grid short.
STEP = 0.5
# The chords of the finest grid are shorter than the curve they replace.
CHORD_ALLOWANCE = 1.02
UNDECIDED = 0.5
# Real parts of poles below this share of the fastest pole are looked on as zero.
_ON_THE_LINE = 1e-9


class SmallGain(NamedTuple):
    """Largest ``rho(|P22(jw)| diag(limits))`` and its frequency (rad/s).

    Below one every design within the limits is stable whatever its delays (for a stable plant): the eigenvalues of
    ``P22 E`` stay inside the unit circle (Perron-Frobenius), so no root can reach the axis while the gains grow
    from zero.
    """

    supremum: float
    omega: float


@dataclass(frozen=True, eq=False)
class _Bounds:
    """Per part of the frequency axis and set S of channels: V_S, W_S, max |c_S|, each (sets, K, parts)."""

    variation: FloatArray
    area: FloatArray
    largest: FloatArray
    upper: FloatArray  # (K, parts), upper end of each part (rad/s)

    def merged(self, parts: int) -> _Bounds:
        """Return the bounds of coarser parts, `parts` of them in each of the K intervals."""
        blocks = (*self.upper.shape[:1], parts, -1)

        def blocked(array: FloatArray) -> FloatArray:
            return array.reshape(array.shape[0], *blocks)

        return _Bounds(
            blocked(self.variation).sum(axis=-1),
            blocked(self.area).sum(axis=-1),
            blocked(self.largest).max(axis=-1),
            self.upper.reshape(blocks)[..., -1],
        )


class StabilityTest:
    """Decides stability of many (gains, delays) designs of one plant and box at once.

    Parameters
    ----------
    realization : Realization
        The open plant P.
    gain_limits, delay_limits : ndarray, shape (m,)
        Largest magnitude of each gain and largest delay (s) in the box.
    decay : float
        Required decay rate (1/s): no root to the right of -decay.
    delay_tolerance : float
        Required robustness: stable for all delays within +- this fraction, each on its own. The proof is
        sufficient, not necessary.

    Attributes
    ----------
    corner : SmallGain
        The small-gain test at the corner of the box.
    plant_stable : bool
        The open plant has no pole to the right of the line.
    proven : bool
        Small gain proves every design of the box; no counting is needed.

    Raises
    ------
    InputError
        Too many channels to count; poles on the line itself, as of integrators, count as one channel each.
    """

    def __init__(
        self,
        realization: Realization,
        gain_limits: FloatArray,
        delay_limits: FloatArray,
        decay: float = 0.0,
        delay_tolerance: float = 0.0,
    ) -> None:
        self._decay, self._tolerance = decay, delay_tolerance
        limits = gain_limits * np.exp(decay * delay_limits * (1.0 + delay_tolerance))
        self._plant, self._fixed, where = _off_the_line(_shifted(realization, decay), limits)
        self._plant_poles = int(np.count_nonzero(self._plant.eigenvalues.real > 0))
        self.plant_stable = self._plant_poles == 0 and not self._fixed
        channels = realization.n_channels + self._fixed
        limits = np.append(limits, np.ones(self._fixed))
        delay_limits = np.append(delay_limits, np.zeros(self._fixed))
        # |arg f| <= m asin(radius) stays below a quarter turn up to this level.
        level = 0.98 * np.sin(np.pi / (2 * max(channels, 1)))
        self.corner = SmallGain(np.inf, where)
        if not self._fixed:
            self.corner = SmallGain(*small_gain_supremum(self._plant, limits))
        self.proven = self.plant_stable and self.corner.supremum < 1.0
        if self.proven:
            return
        if channels > MAX_CHANNELS:
            raise InputError(
                f"{channels} channels are too many for a box that small gain does not prove: at most "
                f"{MAX_CHANNELS} are allowed"
            )
        self._sets = [list(s) for size in range(1, channels + 1) for s in combinations(range(channels), size)]
        self._tabulate(limits, delay_limits, level)

    def violations(self, gains: FloatArray, delays: FloatArray) -> FloatArray:
        """Return, shape (n,), 0 for a proven stable design, else its number of roots on the wrong side.

        A design that cannot be certified gets at least 0.5.
        """
        if self.proven:
            return np.zeros(len(gains))
        roots, certain = self.count(gains, delays)
        return np.where(certain, roots, np.maximum(roots, UNDECIDED))

    def count(self, gains: FloatArray, delays: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Count the roots to the right of the line by the argument principle.

        Parameters
        ----------
        gains, delays : ndarray, shape (n, m)

        Returns
        -------
        roots : ndarray, shape (n,)
        certain : ndarray of bool, shape (n,)
            Every phase step is certified (and, with a delay tolerance, no root can cross within it).
        """
        if self.proven:
            return np.zeros(len(gains)), np.ones(len(gains), dtype=bool)
        fixed = np.ones((len(gains), self._fixed))
        scaled = np.hstack([gains * np.exp(self._decay * delays), fixed])
        delays = np.hstack([delays, 0.0 * fixed])
        sizes = np.stack([np.abs(scaled[:, s]).prod(axis=1) for s in self._sets], axis=1)
        totals = np.stack([delays[:, s].sum(axis=1) for s in self._sets], axis=1)

        f = return_determinant(self._p22_base, channel_exponentials(scaled, delays, self._base))
        size = np.abs(f)
        phase = np.angle(f[:, 1:] * f[:, :-1].conj())
        path = self._path(sizes, totals, self._bounds[0], np.s_[:, 0])
        room = size[:, 1:] + size[:, :-1]
        doubtful = ~(self._gap | (path < room))
        certain = np.ones(len(gains), dtype=bool)
        for who, where in _worst_first(doubtful, path / np.maximum(room, 1e-300), certain):
            phase[who, where], failed = self._refined(scaled, delays, sizes, totals, who, where)
            certain[who[failed]] = False
        turns = (phase.sum(axis=1) - np.angle(f[:, -1])) / np.pi
        certain &= np.isfinite(turns)
        roots = self._plant_poles - np.where(certain, turns, 0.0)
        certain &= (np.abs(roots - np.rint(roots)) < 1e-3) & (roots > -0.5)
        return np.maximum(np.rint(roots), 0.0), certain

    def _refined(
        self,
        gains: FloatArray,
        delays: FloatArray,
        sizes: FloatArray,
        totals: FloatArray,
        who: NDArray[np.intp],
        where: NDArray[np.intp],
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the phase over doubtful intervals as the sum over their parts, and which stay doubtful."""
        f = self._determinant(gains[who], delays[who], where, np.s_[::SPLIT])
        phase = np.angle(f[:, 1:] * f[:, :-1].conj())
        path = self._path(sizes[who], totals[who], self._bounds[1], np.s_[where])
        row, part = np.nonzero(path >= np.abs(f[:, 1:]) + np.abs(f[:, :-1]))
        failed = np.zeros(who.size, dtype=bool)
        if row.size:
            design, interval = who[row], where[row]
            columns = part[:, None] * SPLIT + np.arange(SPLIT + 1)
            f = self._determinant(gains[design], delays[design], interval[:, None], columns)
            phase[row, part] = np.angle(f[:, 1:] * f[:, :-1].conj()).sum(axis=1)
            path = self._path(
                sizes[design], totals[design], self._bounds[2], np.s_[interval[:, None], columns[:, :-1]]
            )
            failed[row[np.any(path >= np.abs(f[:, 1:]) + np.abs(f[:, :-1]), axis=1)]] = True
        return phase.sum(axis=1), failed

    def _determinant(self, gains: FloatArray, delays: FloatArray, interval: Any, columns: Any) -> Any:
        """Return f of one design per row at fine grid points of one interval per row."""
        E = channel_exponentials(gains, delays, self._fine[interval, columns])
        return return_determinant(self._p22_fine[interval, columns], E)

    def _path(self, sizes: FloatArray, totals: FloatArray, bounds: _Bounds, at: Any) -> FloatArray:
        """Bound the path length of f, plus twice its change within the delay tolerance.

        `at` selects (K,) parts for every design, or one row of parts per design.
        """
        result: Any = 0.0
        for k in range(sizes.shape[1]):
            size, total = sizes[:, k, None], totals[:, k, None]
            result = result + size * (bounds.variation[k][at] + total * bounds.area[k][at])
            if self._tolerance:
                shift = self._tolerance * total
                grown = np.exp(self._decay * shift)
                turned = 2.0 * np.sin(np.minimum(bounds.upper[at] * shift, np.pi) / 2)
                result = result + 2.0 * size * bounds.largest[k][at] * (grown - 1.0 + grown * turned)
        return result

    def _tabulate(self, limits: FloatArray, delay_limits: FloatArray, level: float) -> None:
        grid, radius = counting_grid(self._plant, limits, level)
        minors = self._minors(sample_plant(self._plant, 1j * grid).p22)
        weight = np.array([limits[s].prod() for s in self._sets])[:, None]
        delay = np.array([delay_limits[s].sum() for s in self._sets])[:, None]
        middle = (np.abs(minors[:, 1:]) + np.abs(minors[:, :-1])) / 2
        path = weight * (np.abs(np.diff(minors)) + delay * middle * np.diff(grid))
        steps = path.sum(axis=0) / (1.0 + (weight * middle).sum(axis=0)) / STEP
        # Grid intervals that touch the region where f may leave the right half plane, 10 % allowance.
        needed = np.maximum(radius[1:], radius[:-1]) > 0.9 * level
        base, gap = _base_grid(grid, steps, needed)

        fraction = np.linspace(0.0, 1.0, SPLIT**2 + 1)
        self._fine = base[:-1, None] + np.diff(base)[:, None] * fraction
        self._base, self._gap = base, gap
        m = limits.size
        p22 = sample_plant(self._plant, 1j * self._fine.ravel()).p22
        self._p22_fine = np.ascontiguousarray(p22).reshape(*self._fine.shape, m, m)
        self._p22_base = frequencies_contiguous(sample_plant(self._plant, 1j * base).p22)
        fine = np.abs(self._minors(self._p22_fine))
        chords = np.abs(np.diff(self._minors(self._p22_fine)))
        largest = np.maximum(fine[..., 1:], fine[..., :-1])
        finest = _Bounds(CHORD_ALLOWANCE * chords, largest * np.diff(self._fine), largest, self._fine[:, 1:])
        self._bounds = (finest.merged(1), finest.merged(SPLIT), finest)

    def _minors(self, p22: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return c_S up to sign, the principal minors, shape (sets, ...)."""
        return np.stack([np.linalg.det(p22[..., s, :][..., s]) for s in self._sets])


def _worst_first(
    doubtful: NDArray[np.bool_], share: FloatArray, certain: NDArray[np.bool_]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield (designs, intervals) that are doubtful, each design's worst first, more of them each time.

    One interval that stays doubtful decides a design: those that are no longer `certain` are left out of what follows.
    """
    order = np.argsort(np.where(doubtful, -share, 0.0), axis=1, kind="stable")
    left = doubtful.sum(axis=1)
    first, last = 0, 1
    while np.any(certain & (left > first)):
        rank = np.arange(first, min(last, order.shape[1]))
        who, column = np.nonzero(certain[:, None] & (rank < left[:, None]))
        yield who, order[who, rank[column]]
        first, last = last, 4 * last


def _base_grid(
    grid: FloatArray, steps: FloatArray, needed: NDArray[np.bool_]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Cut the needed stretches of the axis into intervals of about one step each; join them by gaps."""
    nodes, gap = [np.array([grid[0]])], []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], needed, [False]]).astype(int)))
    for first, last in edges.reshape(-1, 2):
        stretch = grid[first : last + 1]
        travelled = np.append(0.0, np.cumsum(steps[first:last]))
        pieces = max(2, int(np.ceil(travelled[-1])))
        cut = np.interp(np.linspace(0.0, travelled[-1], pieces + 1), travelled, stretch)
        if cut[0] > nodes[-1][-1]:
            nodes.append(cut[:1])
            gap.append(np.array([True]))
        nodes.append(cut[1:])
        gap.append(np.zeros(pieces, dtype=bool))
    return np.concatenate(nodes), np.concatenate(gap)


def _off_the_line(plant: Realization, limits: FloatArray) -> tuple[Realization, int, float]:
    """Move poles on the imaginary axis to the left by channels of gain one; return their number and the place of one.

    Poles that rounding might put on either side are moved as well: what is counted stays exact.
    """
    poles = plant.eigenvalues
    size = np.abs(poles)
    reach = _ON_THE_LINE * size.max(initial=0.0)
    narrow = np.abs(poles.real) <= reach
    if not np.any(narrow):
        return plant, 0, np.nan
    # the modes to be moved come first; the projector on them splits off the others

    def moves(real: float, _imaginary: float) -> bool:
        return abs(real) <= reach

    T, Q, count = scipy.linalg.schur(plant.A, output="real", sort=moves)
    Y = scipy.linalg.solve_sylvester(T[:count, :count], -T[count:, count:], -T[:count, count:])
    into, out = Q[:, :count], (Q[:, :count] - Q[:, count:] @ Y.T).T
    # as far as the nearest of the other poles is away, or as the loop is fast
    others = size[~narrow & (size > 0.0)]
    speed = np.abs(plant.B2) @ (np.abs(limits)[:, None] * np.abs(plant.C2))
    shift = float(others.min()) if others.size else float(np.abs(np.linalg.eigvals(speed)).max()) or 1.0
    whole = plant.matrix
    grown = np.zeros((whole.shape[0] + count, whole.shape[1] + count))
    grown[: whole.shape[0], : whole.shape[1]] = whole
    n = plant.n_states
    grown[:n, :n] -= shift * into @ out
    grown[:n, whole.shape[1] :] = shift * into
    grown[whole.shape[0] :, :n] = out
    moved = Realization.from_matrix(grown, n, plant.n_outputs, plant.n_inputs)
    return moved, count, float(np.abs(poles[narrow].imag).min())


def _shifted(r: Realization, decay: float) -> Realization:
    """Return P(s - decay): the line Re s = -decay becomes the imaginary axis."""
    return replace(r, A=r.A + decay * np.eye(r.n_states)) if decay else r
