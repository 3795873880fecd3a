r"""Frequency sweeping: every crossing of the imaginary axis along a line in the space of delays.

The crossings are found by `crossing_search`. With one delay tau, or equal ones, the characteristic equation is a
polynomial in :math:`z = e^{-\tau s}`,

.. math:: \sum_k a_k(s) z^k = 0 .

At :math:`s = j\omega` a root :math:`z = e^{-j\theta}` on the unit circle is a crossing at the frequency
:math:`\omega`, for every delay :math:`\tau = (\theta + 2\pi r)/\omega`, r = 0, 1, ...; the root pair moves to the right
or left as the sign of :math:`\mathrm{Re}\,(ds/d\tau)` says, which is that of :math:`d|z|/d\omega` and the same for all
r [2]_.

The tally are closed by counts of unstable roots (argument principle) that know nothing of the crossings
(`sweep_counts`); where they do not close, other ways of finding are tried and missing crossings searched for.

References
----------
.. [1] W. Michiels, S.-I. Niculescu, "Stability, Control, and Computation for Time-Delay Systems", SIAM, 2014.
.. [2] K. L. Cooke, P. van den Driessche, "On zeroes of some transcendental equations", Funkcialaj Ekvacioj 29,
   1986: the tendency at a crossing frequency is the same for all its delays.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.crossings.axis_zeros import Zeros
from susp_ctrl.delay_systems.crossings.branch_and_bound import Work
from susp_ctrl.delay_systems.crossings.crossing_search import Crossings, CrossingSearch
from susp_ctrl.delay_systems.crossings.delay_line import DelayLine, bordered
from susp_ctrl.delay_systems.crossings.delay_sweep import DelaySweep
from susp_ctrl.delay_systems.crossings.sweep_counts import SweepCounts, Tally, crossing_table
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.errors import InputError

_REPAIRED = 6
SHORTEST_SWEEP = 1e-15
"""Least end of a sweep (s)."""


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
    TooMuchWorkError
        More than 50,000 crossings.

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
    s = validation.delays("start", _per_delay("start", 0.0 if start is None else start, n))
    end = validation.number("up_to", up_to, at_least=SHORTEST_SWEEP, at_most=validation.LONGEST_DELAY)
    validation.delays("up_to * direction", np.abs(end * d))
    if n and not np.any(d):
        raise InputError("direction is zero: at least one delay has to grow")
    if np.any(s + end * d < -1e-14 * s):
        k = int(np.argmin(s + end * d))
        raise InputError(f"direction[{k}] = {d[k]:g} makes a delay negative before up_to = {end:g}")
    # Delays positive wherever the line ever leaves zero: here a neutral loop is refused.
    system.with_delays(np.where((s != 0.0) | (d != 0.0), 1.0, 0.0))
    search = CrossingSearch(DelayLine.of(system, d, s, end))
    return _closed(search, SweepCounts(system, d, s, search), d, s)


def _per_delay(name: str, value: ArrayLike, n: int) -> FloatArray:
    return np.full(n, validation.number(name, value)) if validation.is_scalar(value) else (
        validation.vector(name, value, size=n) if n or np.size(value) else np.zeros(0)
    )  # fmt: skip


def _closed(
    search: CrossingSearch, counts: SweepCounts, direction: FloatArray, start: FloatArray
) -> DelaySweep:
    """Try the ways of finding in turn until counts and tendencies agree, then search for what is missing."""
    first, *others = search.ways()
    found = _with_real_roots(search, counts, first())
    tally = counts.close(found)
    for way in others:
        if tally.closed:
            break
        candidate = _with_real_roots(search, counts, way())
        trial = counts.close(candidate)
        if trial.closed:
            found, tally = candidate, trial
    if not tally.closed:
        found = _with_missing(search, found, tally)
        tally = counts.close(found)
    edges, roots = tally.edges, tally.roots if tally.closed else np.full(tally.roots.size, -1)
    intervals = pd.DataFrame(
        {"tau_from": edges[:-1], "tau_to": edges[1:], "unstable_roots": roots.astype(int)}
    )
    given_up = "" if found.complete else "; the search did not prove that no crossing is missing"
    return DelaySweep(
        direction=direction,
        start=start,
        up_to=search.line.up_to,
        crossings=crossing_table(found, edges, intervals["unstable_roots"].to_numpy()),
        intervals=intervals,
        delay_margin=_margin(found, tally, search.axis_roots, counts.rounding(found)),
        decided=tally.closed,
        proven=found.complete,
        axis_roots=search.axis_roots,
        method=found.method,
        message=tally.message + given_up,
        line=search.line,
    )


def _margin(found: Crossings, tally: Tally, axis_roots: tuple[float, ...], rounding: FloatArray) -> float:
    if axis_roots:
        return 0.0
    if not tally.closed:
        return float("nan")
    if tally.roots[0] > 0 or np.any(found.tau <= rounding):
        return 0.0
    if found.tau.size:
        return float(found.tau.min())
    return float("inf") if found.none_ever else float("nan")


def _with_real_roots(search: CrossingSearch, counts: SweepCounts, found: Crossings) -> Crossings:
    """Add real roots that pass through a root which stays at s = 0: there the derivative vanishes too.

    The derivative of the characteristic function at s = 0 is linear in tau. Which way the root goes is
    counted.
    """
    line = search.line
    if 0.0 not in search.axis_roots or not line.varies:
        return found
    loop, ends = line.matrices, np.array([0.0, line.up_to])
    W, W_omega, _ = bordered(loop, line.by_delay(), np.zeros(2), ends)
    left, _, right = np.linalg.svd(W[0])
    slope = (left[:, -1].conj() @ W_omega @ right[-1].conj() / 1j).real
    if slope[0] * slope[1] >= 0.0:
        return found
    tau = line.up_to * slope[0] / (slope[0] - slope[1])
    near = 1e-3 * min(tau, line.up_to - tau)
    before, after = counts.count(tau - near), counts.count(tau + near)
    if before is None or after is None:
        return found
    change = np.array([after - before])
    return found.joined(np.array([tau]), np.zeros(1), np.sign(change), change)


def _with_missing(search: CrossingSearch, found: Crossings, tally: Tally) -> Crossings:
    """Where counts differ and no crossing accounts for it, narrow the place down and search there."""
    order = sorted(tally.missing)
    gaps = [(low, high) for low, high in pairwise(order) if tally.missing[low] != tally.missing[high]]
    if search.work.spent:
        # Too large a task as a whole: worth going on only if little of it is missing.
        if len(gaps) > _REPAIRED:
            return found
        search.work = Work()
    extra = [search.between(low, high) for low, high in gaps]
    if not extra:
        return found
    zeros = Zeros(*(np.concatenate(parts) for parts in zip(*extra, strict=True)))
    known = np.any(
        (np.abs(zeros.y[:, None] - found.tau) < 1e-7 * search.line.up_to)
        & (np.abs(zeros.omega[:, None] - found.omega) < 1e-7 * zeros.omega[:, None]),
        axis=1,
    )
    zeros = Zeros(*(part[~known] for part in zeros))
    found = replace(found, complete=False, none_ever=False)
    return found.joined(zeros.y, zeros.omega, zeros.degree, 2 * zeros.degree)
