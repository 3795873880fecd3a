"""How long cells may be: as long as polynomials hold what is asked, and no more of them than is worth the work.

A cell is refused where the highest Legendre coefficients of a signal are too large beside its peak, or where the
polynomial of an input is not what the caller gave at some time inside. Refused cells are shortened; noise and
rounding, which that does not help, and cells as small as they get are taken as they are.
"""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators.cells import GaussRule
from susp_ctrl.delay_systems.integrators.panels import CellGroup, Places
from susp_ctrl.errors import TooMuchWorkError

_EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)  # below it numbers lose digits: _EPS * TINY is the least of all
MOST_CELLS = 64  # cells of a panel in smooth stretches
_LOUDEST_NOISE = 1e-6  # relative size of coefficients that can pass for noise
_MISS = 10.0  # times the coefficients' tolerance that a polynomial may be off between its nodes
_MOST_WORK = (30_000, 30)  # cells solved, refused ones included: at least, and for each cell planned
_SMALLEST = 2.0**-38  # cells are not refined below this fraction of the first length


class TooLong(Exception):  # noqa: N818 - a signal between panel and march, never seen outside
    """The cells of a panel are too long: by what factor, and the relative size of what they do not hold."""

    def __init__(self, factor: float, tail: float) -> None:
        super().__init__()
        self.factor, self.tail = factor, tail


class CellLength:
    """The length of the cells to come, and what is asked of cells.

    Parameters
    ----------
    rule : GaussRule
        Nodes of the cells.
    nominal : float
        Length (s) that resolves the fastest mode.
    span : float
        Length of the run (s).
    edges : int
        Number of known kinks.
    tolerance, rtol : float
        Relative size allowed to the highest coefficients; error wanted of the run.
    """

    def __init__(
        self, rule: GaussRule, nominal: float, span: float, edges: int, tolerance: float, rtol: float
    ) -> None:
        self.rule, self.nominal, self.length = rule, nominal, nominal
        self.tolerance, self._most_noise = max(tolerance, 4.0 * _EPS), max(0.1 * rtol, 1e-12)
        self._smallest = _SMALLEST * min(nominal, span)
        self.most, self._wait, self._backoff, self._trial = 8, 0, 1, False
        self.accept = ""  # why cells are taken whose coefficients do not decay: "noise" or "small"
        self._tries: list[tuple[float, float]] = []  # lengths refused so far and their tails
        self._work, self._most_work = 0, max(_MOST_WORK[0], _MOST_WORK[1] * (edges + int(span / nominal)))

    def begin(self, cells: int, time: float, end: float) -> None:
        """Count the cells of a panel that is about to be solved.

        Raises
        ------
        TooMuchWorkError
            More cells were solved than the run was allowed beforehand.
        """
        self._work += cells
        if self._work > self._most_work:
            raise TooMuchWorkError(
                f"inputs are too rough for rtol: after {self._work} cells, the last {self.length:.2g} s long, the run "
                f"is at t = {time:.6g} of {end:.6g} s; announce kinks (breakpoints), relax rtol, or give samples"
            )

    def take(self, longest: float, worst: float) -> None:
        """Go on after a panel that was good, with longer cells where its coefficients allow."""
        growth = (1.0 / max(worst, 1e-300)) ** (1.0 / self.rule.size) * 0.85
        self.accept, self._tries = "", []
        self._wait, self._trial = self._wait - 1, False
        if growth >= 1.25 and self.length < self.nominal:
            # after a kink: few cells of each length
            self.length = max(self.length, min(growth, 2.0) * longest)
            return
        self.most = min(2 * self.most, MOST_CELLS)
        if growth >= 1.25:
            self.length = max(self.length, 1.25 * longest)
        elif self.length < self.nominal and self._wait <= 0:
            # what keeps the estimate down may be rounding; a refusal makes the next trial wait longer
            self.length, self._trial = min(self.nominal, 2.0 * self.length), True

    def refuse(self, longest: float, problem: TooLong) -> None:
        """Shorten the cells, or accept them as they are where that does not help."""
        self._tries.append((longest, problem.tail))
        (first, tail_first), (last, tail_last) = self._tries[0], self._tries[-1]
        self._backoff = 2 * self._backoff if self._trial else 1
        self._wait, self._trial = self._backoff, False
        self.most = min(self.most, 8)
        constant = tail_last > tail_first * np.sqrt(last / first)
        if last <= self._smallest:
            self.accept = "small"
        elif len(self._tries) > 8 and constant and tail_last <= _LOUDEST_NOISE:
            # rounding, or noise of the input: it does not fall with the length as the tail of a kink does
            self.accept, self.length = "noise", first
            if tail_last <= self._most_noise:
                self.tolerance = max(self.tolerance, 4.0 * tail_last)
        else:
            self.length = last * problem.factor

    def check(
        self,
        signal: FloatArray,
        peak: FloatArray,
        floor: FloatArray,
        g: CellGroup,
        worst: float,
        brief: bool = False,
    ) -> float:
        """Raise `TooLong` where the two highest coefficients are too large; return their relative size.

        `signal` has shape (signals, N, cells, cases); one is the size allowed. What lies below `floor`, or within
        the rounding of the time itself, is rounding. A drive may be off the more the `brief`er it is: it acts by
        its integral.
        """
        signals, N, cells, cases = signal.shape
        flat = signal.reshape(signals, N, cells * cases)
        tails = np.sum(np.abs(self.rule.to_coefficients[-2:] @ flat), axis=1)
        tails = np.max(tails.reshape(signals, cells, cases), axis=1, initial=0.0)
        rise = np.max(np.ptp(signal, axis=1), axis=1, initial=0.0) if signals else floor
        rounding = floor + self._late(g) * rise
        weight = min(1.0, g.length / self.nominal) if brief else 1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = np.where(tails > rounding, (tails - rounding) / (self.tolerance * peak), 0.0)
            share = np.where(tails > 0.0, tails / (self.tolerance * peak + rounding), 0.0)
        self._judge(float(np.max(excess, initial=0.0)), weight)
        return max(worst, weight * float(np.max(share, initial=0.0)))

    def compare(
        self,
        signal: FloatArray,
        values: FloatArray,
        peak: FloatArray,
        floor: FloatArray,
        g: CellGroup,
        spots: Places,
    ) -> None:
        """Raise `TooLong` where the polynomials of a drive are not the values that were given."""
        if not spots.times.size:
            return
        miss = np.abs(spots.values(signal) - values[:, spots.times])
        allowed = _MISS * max(self.tolerance, _LOUDEST_NOISE if self.accept else 0.0)
        if np.all(np.fmax.reduce(miss, axis=1, initial=0.0) <= allowed * peak):
            return
        rounding = floor[:, None] + self._late(g) * np.ptp(signal, axis=1)[:, spots.cells]
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = np.where(miss > rounding, (miss - rounding) / (allowed * peak[:, None]), 0.0)
        self._judge(
            float(np.max(excess, initial=0.0)), min(1.0, g.length / self.nominal), self.accept == "small"
        )

    def _judge(self, excess: float, weight: float, accepted: bool | None = None) -> None:
        """Raise `TooLong` where an error is so many times larger than is allowed."""
        largest = excess * weight
        if largest > 1.0 and not (bool(self.accept) if accepted is None else accepted):
            factor = (1.0 / largest) ** (1.0 / self.rule.size) * 0.9 if np.isfinite(largest) else 0.3
            raise TooLong(float(np.clip(factor, 0.3, 0.8)), excess * self.tolerance)

    def _late(self, g: CellGroup) -> float:
        """Rounding of the time itself, relative to the length of a cell."""
        return 4.0 * _EPS * abs(float(g.starts[-1])) / g.length
