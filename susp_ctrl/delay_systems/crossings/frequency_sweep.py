r"""Frequency sweeping: every crossing of the imaginary axis along a line in the space of delays.

A root on the axis at :math:`j\omega` for the delays ``start + tau direction`` is a zero of
:math:`\det W(\omega, \tau)` (see `delay_line`). Three ways find all of them, each with its own proof:

* all delays multiples of one: an eigenvalue problem (`crossings`), exact;
* the varying delays multiples of one, others fixed: branch and bound over frequency and the angle of one turn
  (`exclusion`);
* any other line: branch and bound over frequency and tau.

With one delay tau, or equal ones, the characteristic equation is a polynomial in :math:`z = e^{-\tau s}`,

.. math:: \sum_k a_k(s) z^k = 0 .

At :math:`s = j\omega` a root :math:`z = e^{-j\theta}` on the unit circle is a crossing at the frequency
:math:`\omega`, for every delay :math:`\tau = (\theta + 2\pi r)/\omega`, r = 0, 1, ...; the root pair moves to the right
or left as the sign of :math:`\mathrm{Re}\,(ds/d\tau)` says, which is that of :math:`d|z|/d\omega` and the same for all
r [2]_.

The books are closed by counts of unstable roots (argument principle) that know nothing of the crossings: at both
ends and between, count and sum of tendencies must agree.

References
----------
.. [1] W. Michiels, S.-I. Niculescu, "Stability, Control, and Computation for Time-Delay Systems", SIAM, 2014.
.. [2] K. L. Cooke, P. van den Driessche, "On zeroes of some transcendental equations", Funkcialaj Ekvacioj 29,
   1986: the tendency at a crossing frequency is the same for all its delays.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.delay_systems.crossings.axis_zeros import Zeros, chain_zeros, unit_chain
from susp_ctrl.delay_systems.crossings.branch_and_bound import Work, search_zeros
from susp_ctrl.delay_systems.crossings.delay_line import bordered, delay_line, roots_always_on_axis
from susp_ctrl.delay_systems.crossings.delay_sweep import DelaySweep
from susp_ctrl.delay_systems.crossings.small_gain import small_gain_bands
from susp_ctrl.delay_systems.crossings.sweep_books import (
    Books,
    Crossings,
    crossing_table,
    merged,
    nothing_found,
)
from susp_ctrl.delay_systems.model.lft import FloatArray
from susp_ctrl.delay_systems.model.system import DelaySystem
from susp_ctrl.delay_systems.roots.argument_principle import count_roots_right_of
from susp_ctrl.errors import InputError, UndecidedStabilityWarning

# Largest eigenvalue problem of the exact way; above it branch and bound is faster.
_LARGEST_PENCIL = 200
_COUNTED_INTERVALS = 5
_COUNTED_WITHOUT_PROOF = 40
_REPAIRED = 6


def sweep_delays(
    sys: Any, direction: ArrayLike | None = None, start: ArrayLike | None = None, up_to: float = 2.0
) -> DelaySweep:
    r"""Find every crossing of the imaginary axis along a line of delays.

    .. math:: \tau_k(\tau) = \mathrm{start}_k + \tau\,\mathrm{direction}_k, \qquad 0 \le \tau \le \mathrm{up\_to}

    Parameters
    ----------
    sys : DelayLTI
        The system with its loops closed; its own delays do not matter, except that they say how many there are.
    direction : float or array_like, shape (n_delays,), optional
        Growth of each delay; all ones by default. A number stands for all.
    start : float or array_like, shape (n_delays,), optional
        Delays at tau = 0 in seconds; zeros by default.
    up_to : float, optional
        End of the line in seconds (of tau).

    Returns
    -------
    DelaySweep
        ``.crossings``, ``.intervals``, ``.stable_intervals``, ``.delay_margin``, ``.figure_data``, ``.plot()``.

    Raises
    ------
    InputError
        Wrong sizes, a direction of zeros, a delay that becomes negative on the line.
    NeutralLoopError
        A loop that is neutral once its delays are positive.

    Examples
    --------
    >>> import susp_ctrl as sc
    >>> integrator = sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-1.0]]], delays=[1.0])
    >>> round(sc.sweep_delays(integrator, up_to=9.0).delay_margin, 9)
    1.570796327
    """
    system = DelaySystem.of(sys, "sys")
    n = system.delays.size
    d = _per_delay("direction", 1.0 if direction is None else direction, n)
    s = validation.vector("start", _per_delay("start", 0.0 if start is None else start, n), at_least=0.0)
    end = validation.number("up_to", up_to, above=0.0)
    if n and not np.any(d):
        raise InputError("direction is zero: at least one delay has to grow")
    if np.any(s + end * d < -1e-15):
        k = int(np.argmin(s + end * d))
        raise InputError(f"direction[{k}] = {d[k]:g} makes a delay negative before up_to = {end:g}")
    # Delays positive wherever the line ever leaves zero: here a neutral loop is refused.
    system.with_delays(np.where((s != 0.0) | (d != 0.0), 1.0, 0.0))
    return _Sweep(system, d, s, end).run()


def _per_delay(name: str, value: ArrayLike, n: int) -> FloatArray:
    return np.full(n, validation.number(name, value)) if np.ndim(value) == 0 else (
        validation.vector(name, value, size=n) if n or np.size(value) else np.zeros(0)
    )  # fmt: skip


class _Sweep:
    """One sweep: find, close the books, repair where they do not close."""

    def __init__(self, system: DelaySystem, direction: FloatArray, start: FloatArray, up_to: float) -> None:
        self.system, self.direction, self.start, self.up_to = system, direction, start, up_to
        self.line = delay_line(system, direction, start, up_to)
        self.axis_roots = roots_always_on_axis(self.line)
        self._counts: dict[float, int | None] = {}
        self._work = Work()

    def run(self) -> DelaySweep:
        """Try the ways of finding in turn until counts and tendencies agree."""
        first, *others = self._ways()
        found = self._with_real_roots(first())
        books = self._close(found)
        for way in others:
            if books.closed:
                break
            candidate = self._with_real_roots(way())
            trial = self._close(candidate)
            if trial.closed:
                found, books = candidate, trial
        if not books.closed:
            found = self._with_missing(found, books)
            books = self._close(found)
        return self._result(found, books)

    def _ways(self) -> list[Any]:
        line = self.line
        if not line.varies or line.matrices.n_states == 0:
            return [lambda: nothing_found("no delay in a loop varies", True)]
        self._bands = small_gain_bands(line.matrices)
        if self._bands.centre.size == 0:
            return [lambda: nothing_found("small gain at every frequency: no crossing for any delays", True)]
        ways = []
        if line.multiples is not None:
            size = 2 * line.matrices.n_states * int(line.multiples.sum())
            if line.offset is not None and size <= _LARGEST_PENCIL:
                ways.append(self._by_pencil)
            ways.append(self._by_angle)
        ways.append(self._by_delay)
        return ways

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
        latest = (self.up_to + (line.offset or 0.0)) * (line.step or 0.0)
        options: dict[str, Any] = {"turn": 2.0 * np.pi, "lowest": self._lowest(), "work": self._work}
        turn = (0.0, 2.0 * np.pi)
        search = search_zeros(
            line.matrices, line.by_angle(), self._bands, turn, latest=latest * (1 + 1e-9), **options
        )
        none_ever = False
        if search.complete and search.zeros.omega.size == 0:
            beyond = search_zeros(line.matrices, line.by_angle(), self._bands, turn, **options)
            none_ever = beyond.complete and beyond.zeros.omega.size == 0
        return self._unrolled(search.zeros, search.complete, none_ever, "branch and bound over one turn")

    def _by_delay(self) -> Crossings:
        """Search frequency and tau directly."""
        search = search_zeros(
            self.line.matrices, self.line.by_delay(), self._bands, (0.0, self.up_to),
            lowest=self._lowest(), work=self._work,
        )  # fmt: skip
        zeros = search.zeros
        tau = np.clip(zeros.y, 0.0, self.up_to)
        found = self._genuine(Zeros(zeros.omega, tau, zeros.degree))
        return Crossings(
            found.y, found.omega, found.degree, 2 * found.degree, search.complete, False, "branch and bound"
        )

    def _with_real_roots(self, found: Crossings) -> Crossings:
        """Add real roots that pass through a root which stays at s = 0: there the derivative vanishes too.

        The derivative of the characteristic function at s = 0 is linear in tau. Which way the root goes is
        counted.
        """
        if 0.0 not in self.axis_roots or not self.line.varies:
            return found
        loop, ends = self.line.matrices, np.array([0.0, self.up_to])
        W, W_omega, _ = bordered(loop, self.line.by_delay(), np.zeros(2), ends)
        left, _, right = np.linalg.svd(W[0])
        slope = (left[:, -1].conj() @ W_omega @ right[-1].conj() / 1j).real
        if slope[0] * slope[1] >= 0.0:
            return found
        tau = self.up_to * slope[0] / (slope[0] - slope[1])
        near = 1e-3 * min(tau, self.up_to - tau)
        before, after = self._count(tau - near), self._count(tau + near)
        if before is None or after is None:
            return found
        change = np.array([after - before])
        return found.joined(np.array([tau]), np.zeros(1), np.sign(change), change)

    def _lowest(self) -> float:
        """With a root at s = 0 for every tau the search cannot come arbitrarily near zero frequency."""
        return 1e-6 * float((self._bands.centre + self._bands.half).max()) if self.axis_roots else 0.0

    def _unrolled(self, zeros: Zeros, complete: bool, exact: bool, method: str) -> Crossings:
        """Turn angles into every delay up to the end."""
        zeros = self._genuine(zeros, angle=True)
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

    def _genuine(self, zeros: Zeros, angle: bool = False) -> Zeros:
        """Drop roots that stay on the axis for every tau: they do not cross."""
        if not self.axis_roots or zeros.omega.size == 0:
            return zeros
        fixed = np.array(self.axis_roots)
        crossing = np.all(np.abs(zeros.omega[:, None] - fixed) > 1e-7 * (1.0 + fixed), axis=1)
        return Zeros(*(part[crossing] for part in zeros))

    def _count(self, tau: float) -> int | None:
        """Count unstable roots at one tau, independently of the crossings."""
        if tau not in self._counts:
            delays = np.maximum(self.start + tau * self.direction, 0.0)
            system = self.system.with_delays(delays)
            line = self._beside_the_axis(delays) if self.axis_roots else 0.0
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UndecidedStabilityWarning)
                self._counts[tau] = count_roots_right_of(system, line)
        return self._counts[tau]

    def _beside_the_axis(self, delays: FloatArray) -> float:
        """Return a line that leaves roots on the axis to its left, and as few others as can be."""
        values, uncertain = self.line.matrices.undelayed_eigenvalues()
        rates = [*np.abs(values[np.abs(values) > 1e3 * uncertain]), 1.0 / max(float(delays.max()), 1e-300)]
        return 1e-7 * float(min(rates))

    def _count_at_start(self) -> int | None:
        """Count the unstable eigenvalues at tau = 0 if nothing is delayed there and none is on the axis."""
        if np.any(self.line.start != 0.0) or self.axis_roots:
            return None
        values, uncertain = self.line.matrices.undelayed_eigenvalues()
        return int(np.sum(values.real > 0.0)) if np.all(np.abs(values.real) > uncertain) else None

    def _rounding(self, found: Crossings) -> FloatArray:
        """How far rounding may move the tau of each crossing: some digits of its phase, and of tau itself."""
        fastest = float(np.abs(self.line.direction).max(initial=0.0)) or 1.0
        before = float(self.line.start.max(initial=0.0)) / fastest
        with np.errstate(divide="ignore"):
            turn = np.minimum(1e-11 / (found.omega * fastest), 1e-9 * self.up_to)
        return turn + 1e-13 * (found.tau + before)

    def _close(self, found: Crossings) -> Books:
        """Sum up the tendencies and compare with independent counts at both ends and between."""
        end = self.up_to
        reach = self._rounding(found)
        inside = (found.tau > reach) & (found.tau < end - reach)
        edges = np.concatenate([[0.0], merged(found.tau[inside], reach[inside]), [end]])
        steps = np.zeros(edges.size - 1, dtype=int)
        np.add.at(
            steps, np.argmin(np.abs(found.tau[inside][:, None] - edges[:-1]), axis=1), found.roots[inside]
        )
        total = np.cumsum(steps)
        counted = {
            tau: count for tau in self._places(found, edges) if (count := self._count(tau)) is not None
        }
        start = None if np.any(found.tau <= reach) else self._count_at_start()
        if start is not None:
            counted[0.0] = start
        if not counted:
            return Books(
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
            return Books(edges, roots, counted, missing, False, message)
        message = f"tendencies agree with {len(counted)} counts of unstable roots"
        return Books(edges, roots, counted, missing, True, message)

    def _places(self, found: Crossings, edges: FloatArray) -> list[float]:
        """Choose where to count: both ends if no root is on the axis there, and inside the intervals."""
        number = edges.size - 1
        most = _COUNTED_INTERVALS if found.complete else _COUNTED_WITHOUT_PROOF
        chosen = np.unique(np.linspace(0, number - 1, min(most, number)).round().astype(int))
        places = []
        for k in chosen:
            for share in (0.5, 0.23, 0.81):
                tau = float(edges[k] + share * (edges[k + 1] - edges[k]))
                if self._count(tau) is not None:
                    places.append(tau)
                    break
        reach = self._rounding(found)
        if self.line.varies and not np.any(found.tau >= self.up_to - reach):
            places.append(self.up_to)
        if self.line.varies and self._count_at_start() is None and not np.any(found.tau <= reach):
            # Next to the start: with it a crossing that was missed leaves two counts that differ.
            near = 1e-4 * float(edges[1])
            if self._count(near) is not None:
                places.append(near)
        if not found.complete:
            # Only the counts speak for completeness here: closer ones catch pairs of crossings as well.
            even = np.linspace(0.0, self.up_to, 4 * _COUNTED_INTERVALS + 1)[1:-1]
            near = np.any(np.abs(even[:, None] - edges) < 1e-6 * self.up_to, axis=1)
            places.extend(even[~near].tolist())
        return places

    def _with_missing(self, found: Crossings, books: Books) -> Crossings:
        """Where counts differ and no crossing accounts for it, narrow the place down and search there."""
        order = sorted(books.missing)
        extra: list[Zeros] = []
        gaps = [(low, high) for low, high in pairwise(order) if books.missing[low] != books.missing[high]]
        if self._work.spent:
            # Too large a task as a whole: worth going on only if little of it is missing.
            if len(gaps) > _REPAIRED:
                return found
            self._work = Work()
        for low, high in gaps:
            search = search_zeros(
                self.line.matrices, self.line.by_delay(), self._bands, (low, high),
                lowest=self._lowest(), work=self._work,
            )  # fmt: skip
            extra.append(self._genuine(search.zeros))
        if not extra:
            return found
        zeros = Zeros(*(np.concatenate(parts) for parts in zip(*extra, strict=True)))
        known = np.any(
            (np.abs(zeros.y[:, None] - found.tau) < 1e-7 * self.up_to)
            & (np.abs(zeros.omega[:, None] - found.omega) < 1e-7 * zeros.omega[:, None]),
            axis=1,
        )
        zeros = Zeros(*(part[~known] for part in zeros))
        found = replace(found, complete=False, none_ever=False)
        return found.joined(zeros.y, zeros.omega, zeros.degree, 2 * zeros.degree)

    def _result(self, found: Crossings, books: Books) -> DelaySweep:
        edges, roots = books.edges, books.roots if books.closed else np.full(books.roots.size, -1)
        intervals = pd.DataFrame(
            {"tau_from": edges[:-1], "tau_to": edges[1:], "unstable_roots": roots.astype(int)}
        )
        return DelaySweep(
            direction=self.direction,
            start=self.start,
            up_to=self.up_to,
            crossings=crossing_table(found, edges, intervals["unstable_roots"].to_numpy()),
            intervals=intervals,
            delay_margin=self._margin(found, books),
            decided=books.closed,
            proven=found.complete,
            axis_roots=self.axis_roots,
            method=found.method,
            message=books.message + self._given_up(found),
            line=self.line,
        )

    def _given_up(self, found: Crossings) -> str:
        return "" if found.complete else "; the search did not prove that no crossing is missing"

    def _margin(self, found: Crossings, books: Books) -> float:
        if self.axis_roots:
            return 0.0
        if not books.closed:
            return float("nan")
        if books.roots[0] > 0 or np.any(found.tau <= self._rounding(found)):
            return 0.0
        if found.tau.size:
            return float(found.tau.min())
        return float("inf") if found.none_ever else float("nan")
