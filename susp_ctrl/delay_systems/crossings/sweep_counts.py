"""The tally of a sweep: crossings found are held against counts of unstable roots that know nothing of them.

At both ends of the line and between, the count and the sum of tendencies must agree.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import pandas as pd

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.crossings.crossing_search import Crossings, CrossingSearch
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.delay_systems.roots import count_roots_right_of
from susp_ctrl.errors import UndecidedStabilityWarning

_COUNTED_INTERVALS = 5
_COUNTED_WITHOUT_PROOF = 40


@dataclass(frozen=True, eq=False)
class Tally:
    """Intervals between events, the counts made at some tau, what is missing there, and whether all agree."""

    edges: FloatArray
    roots: np.ndarray
    counted: dict[float, int]
    missing: dict[float, int]
    closed: bool
    message: str


class SweepCounts:
    """Counts unstable roots along a line, each place once, and closes the tally of what was found.

    Parameters
    ----------
    system : DelaySystem
        The loop.
    direction, start : ndarray, shape (n_delays,)
        The line, for the delays as given.
    search : CrossingSearch
        Where the crossings come from.
    """

    def __init__(
        self, system: DelaySystem, direction: FloatArray, start: FloatArray, search: CrossingSearch
    ) -> None:
        self._system, self._direction, self._start, self._search = system, direction, start, search
        self._counts: dict[float, int | None] = {}

    def close(self, found: Crossings) -> Tally:
        """Sum up the tendencies and compare with independent counts at both ends and between."""
        end = self._search.line.up_to
        reach = self.rounding(found)
        inside = (found.tau > reach) & (found.tau < end - reach)
        edges = np.concatenate([[0.0], _merged(found.tau[inside], reach[inside]), [end]])
        steps = np.zeros(edges.size - 1, dtype=int)
        np.add.at(steps, _nearest(edges[:-1], found.tau[inside]), found.roots[inside])
        total = np.cumsum(steps)
        counted = {tau: count for tau in self._places(found, edges) if (count := self.count(tau)) is not None}
        start = None if np.any(found.tau <= reach) else self._count_at_start()
        if start is not None:
            counted[0.0] = start
        if not counted:
            return Tally(
                edges, np.full(total.size, -1), {}, {}, False, "no count of unstable roots is possible"
            )
        interval = {tau: int(np.clip(np.searchsorted(edges, tau) - 1, 0, total.size - 1)) for tau in counted}
        base = {tau: counted[tau] - int(total[interval[tau]]) for tau in counted}
        reference = base[min(base)]
        roots = reference + total
        missing = {tau: value - reference for tau, value in base.items()}
        if any(missing.values()) or np.any(roots < 0):
            listed = ", ".join(f"{counted[tau]} at {tau:.6g}" for tau in sorted(counted))
            message = f"tendencies and counts of unstable roots differ: counted {listed}"
            return Tally(edges, roots, counted, missing, False, message)
        message = f"tendencies agree with {len(counted)} counts of unstable roots"
        return Tally(edges, roots, counted, missing, True, message)

    def count(self, tau: float) -> int | None:
        """Count unstable roots at one tau, independently of the crossings."""
        if tau not in self._counts:
            delays = np.maximum(self._start + tau * self._direction, 0.0)
            system = self._system.with_delays(delays)
            line = self._beside_the_axis(delays) if self._search.axis_roots else 0.0
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UndecidedStabilityWarning)
                self._counts[tau] = count_roots_right_of(system, line)
        return self._counts[tau]

    def rounding(self, found: Crossings) -> FloatArray:
        """How far rounding may move the tau of each crossing: some digits of its phase, and of tau itself."""
        fastest = float(np.abs(self._search.line.direction).max(initial=0.0)) or 1.0
        before = float(self._search.line.start.max(initial=0.0)) / fastest
        with np.errstate(divide="ignore"):
            turn = np.minimum(1e-11 / (found.omega * fastest), 1e-9 * self._search.line.up_to)
        return turn + 1e-13 * (found.tau + before)

    def _places(self, found: Crossings, edges: FloatArray) -> list[float]:
        """Choose where to count: both ends if no root is on the axis there, and inside the intervals."""
        number = edges.size - 1
        most = _COUNTED_INTERVALS if found.complete else _COUNTED_WITHOUT_PROOF
        chosen = np.unique(np.linspace(0, number - 1, min(most, number)).round().astype(int))
        places = []
        for k in chosen:
            for share in (0.5, 0.23, 0.81):
                tau = float(edges[k] + share * (edges[k + 1] - edges[k]))
                if self.count(tau) is not None:
                    places.append(tau)
                    break
        reach = self.rounding(found)
        if self._search.line.varies and not np.any(found.tau >= self._search.line.up_to - reach):
            places.append(self._search.line.up_to)
        if self._search.line.varies and self._count_at_start() is None and not np.any(found.tau <= reach):
            # Next to the start: with it a crossing that was missed leaves two counts that differ.
            near = 1e-4 * float(edges[1])
            if self.count(near) is not None:
                places.append(near)
        if not found.complete:
            # Only the counts speak for completeness here: closer ones catch pairs of crossings as well.
            even = np.linspace(0.0, self._search.line.up_to, 4 * _COUNTED_INTERVALS + 1)[1:-1]
            near = np.any(np.abs(even[:, None] - edges) < 1e-6 * self._search.line.up_to, axis=1)
            places.extend(even[~near].tolist())
        return places

    def _beside_the_axis(self, delays: FloatArray) -> float:
        """Return a line that leaves roots on the axis to its left, and as few others as can be."""
        values, uncertain = self._search.line.matrices.undelayed_eigenvalues()
        rates = [*np.abs(values[np.abs(values) > 1e3 * uncertain]), 1.0 / max(float(delays.max()), 1e-300)]
        return 1e-7 * float(min(rates))

    def _count_at_start(self) -> int | None:
        """Count the unstable eigenvalues at tau = 0 if nothing is delayed there and none is on the axis."""
        if np.any(self._search.line.start != 0.0) or self._search.axis_roots:
            return None
        values, uncertain = self._search.line.matrices.undelayed_eigenvalues()
        return int(np.sum(values.real > 0.0)) if np.all(np.abs(values.real) > uncertain) else None


def _merged(values: FloatArray, tolerance: FloatArray) -> FloatArray:
    """Sort and keep one of each group of equal values; each has its own tolerance."""
    order = np.argsort(values, kind="stable")
    ordered, reach = values[order], tolerance[order]
    return ordered[np.append(True, np.diff(ordered) > reach[1:] + reach[:-1])] if ordered.size else ordered


def crossing_table(found: Crossings, edges: FloatArray, roots: np.ndarray) -> pd.DataFrame:
    """One row per crossing root pair, in the order of tau, with the counts around its group."""
    order = np.lexsort((found.omega, found.tau))
    repeats = np.maximum(np.abs(found.degree[order]), 1)
    group = _nearest(edges, found.tau) if found.tau.size else np.zeros(0, dtype=int)
    net = np.zeros(edges.size, dtype=int)
    np.add.at(net, group, found.roots)
    # At the ends of the line one side has no interval: there the change itself says what it would be.
    before = np.append(roots[0] - net[0] if roots[0] >= 0 else -1, roots)
    after = np.append(roots, roots[-1] + net[-1] if roots[-1] >= 0 else -1)
    position = np.repeat(group[order], repeats)
    return pd.DataFrame(
        {
            "tau": np.repeat(found.tau[order], repeats),
            "omega": np.repeat(found.omega[order], repeats),
            "tendency": np.repeat(np.sign(found.degree[order]), repeats).astype(int),
            "unstable_before": before[position],
            "unstable_after": after[position],
        }
    )


def _nearest(edges: FloatArray, values: FloatArray) -> np.ndarray:
    """Return the number of the edge next to each value; edges increase."""
    after = np.clip(np.searchsorted(edges, values), 1, max(edges.size - 1, 1))
    before_is_nearer = values - edges[after - 1] <= edges[np.minimum(after, edges.size - 1)] - values
    return np.where(before_is_nearer | (after >= edges.size), after - 1, after)
