r"""The stability verdict: three methods, one answer, or none.

* *roots*: the rightmost roots are computed and those with positive real part counted;
* *argument principle*: the phase of the characteristic determinant along the imaginary axis counts them without
  computing any (`susp_ctrl.delay_systems.roots.argument_principle`); where transfer functions or state delays were
  given, that of their own polynomials and matrices, so that a realisation that lost something is found out
  (`susp_ctrl.delay_systems.roots.polynomial_count`);
* *sweep*: starting from the loop without delay, all delays grow in proportion to their full size and every
  crossing of the imaginary axis is followed; the crossings are found without asking the other two
  (`susp_ctrl.delay_systems.crossings.crossing_search`).

A loop is called stable or unstable only if the methods agree, and stable only if the argument principle also
counts, right of a line just left of the rightmost root, as many roots as were found there: no unstable root found is
no evidence by itself. Otherwise the orders are raised, and if the methods still differ, or a root lies on the axis as
far as rounding lets one tell, the verdict is undecided and says why.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Literal, NoReturn

import numpy as np

from susp_ctrl.arrays import ComplexArray
from susp_ctrl.delay_systems.crossings import CrossingSearch, DelayLine, Work
from susp_ctrl.delay_systems.model import CharacteristicMatrix, DelaySystem
from susp_ctrl.delay_systems.roots import (
    FIRST_ANGLE,
    ContourError,
    RootSet,
    abscissa_by_counts,
    count_by_polynomials,
    count_right_of,
    is_complete,
    reach_near_axis,
    rightmost_roots,
    roots_near_axis,
)
from susp_ctrl.errors import InputError, TooMuchWorkError, UndecidedStabilityWarning

VerdictWord = Literal["stable", "unstable", "undecided"]
VERDICT_WORDS: Mapping[bool | None, VerdictWord] = {True: "stable", False: "unstable", None: "undecided"}
"""What the three answers are called wherever they are told."""

ROOTS, ARGUMENT, SWEEP = "roots", "argument principle", "sweep"
# What the discretisation resolves until the methods agree: multiples of a first angle |s| tau, with which it is
# small, and of the modulus within which all unstable roots lie.
_ANGLES, _REACHES = (1.0, 4.0), (1.0, 1.7, 3.0)
# Beyond this number of unstable roots only the rightmost ones are computed.
_MOST_COMPUTED = 300
# What the sweep may spend on one verdict before it abstains, some half microseconds: a box costs the square of the
# order of its matrices and, where the plant is sampled by its matrix, a share of the square of the states.
_SWEEP_WORK = 2_000_000
_RESOLVENT_SHARE = 6
# An abscissa that the roots method leaves open is good enough when counts enclose it this narrowly (relative).
_NARROW = 1e-4


@dataclass(frozen=True, eq=False)
class StabilityVerdict:
    """Answer of `stability`.

    Attributes
    ----------
    stable : bool or None
        None: undecided, see `reason`.
    abscissa : float
        Largest real part of the roots (rad/s): the argument principle counts no root right of it that was not
        found. nan where that cannot be confirmed, which leaves no loop stable.
    unstable_roots : int or None
        Number of roots with positive real part; None if undecided.
    agreement : mapping
        What each method counted; None where it could not tell.
    reason : str
        Why the verdict is what it is, in one sentence.
    roots : ndarray of complex
        The rightmost roots, both of each pair.
    """

    stable: bool | None
    abscissa: float
    unstable_roots: int | None
    agreement: Mapping[str, int | None]
    reason: str
    roots: ComplexArray

    def __bool__(self) -> NoReturn:
        """Refuse: a verdict may be undecided, which is neither true nor false."""
        raise ValueError(
            "a stability verdict has three values: ask for .stable, which is True, False or None"
        )

    def __str__(self) -> str:
        word = VERDICT_WORDS[self.stable]
        counts = ", ".join(f"{name} {'-' if n is None else n}" for name, n in self.agreement.items())
        return (
            f"{word}: {self.reason}\n"
            f"  spectral abscissa: {self.abscissa:.6g} rad/s\n"
            f"  roots with positive real part: {counts}"
        )

    __repr__ = __str__

    def plot(self, ax: Any = None) -> Any:
        """Draw the rightmost roots in the complex plane and return the axes."""
        from susp_ctrl.plotting import draw_roots  # loads matplotlib

        return draw_roots({"rightmost roots": self.roots}, ax)


def stability(sys: Any) -> StabilityVerdict:
    """Tell whether a system with delays is stable, by methods that must agree.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The system, with its loops closed.

    Returns
    -------
    StabilityVerdict
        `stable` is True (all characteristic roots have negative real part), False (at least one has a positive
        real part) or None (undecided). Its truth value is an error: ask for `.stable`.

    Raises
    ------
    InputError
        `sys` is no linear continuous-time system.

    Warns
    -----
    UndecidedStabilityWarning
        The verdict is undecided; the message gives the reason.

    Notes
    -----
    A method that cannot tell (the sweep through a degenerate point, say) is recorded as None; two that answer
    and agree are the least for a verdict.
    """
    verdict = _decide(DelaySystem.of(sys, "sys"))
    if verdict.stable is None:
        warnings.warn(f"stability is undecided: {verdict.reason}", UndecidedStabilityWarning, stacklevel=2)
    return verdict


def _decide(system: DelaySystem) -> StabilityVerdict:
    K = CharacteristicMatrix.of(system.folded)
    agreement: dict[str, int | None] = {ROOTS: 0, ARGUMENT: 0}
    if K.n_states == 0:
        nothing = np.zeros(0, dtype=complex)
        return _verdict(True, 0, agreement, "the system has no state and no roots", nothing)
    agreement[ARGUMENT] = counted = _count(K, 0.0, system)
    if K.n_channels:
        agreement[SWEEP] = _count_by_sweep(system, counted)
    if counted is not None and counted > _MOST_COMPUTED:
        found = rightmost_roots(K, 8)
        agreement[ROOTS] = int(np.sum(found.roots.real > 0.0))
        return _without_agreement(K, agreement, found)
    for radius in _resolved(K):
        found = roots_near_axis(K, 8, radius)
        on_axis = _on_axis(found)
        # a certified count leaves no root on the axis: then only bounds on the roots of a cluster are too wide
        if np.any(on_axis) and counted is None:
            return _with_roots_on_axis(K, found, on_axis, agreement)
        agreement[ROOTS] = int(np.sum(found.roots.real > 0.0))
        answers = {n for n in agreement.values() if n is not None}
        # with all unstable roots found the rightmost is among them; of a stable loop it could have been missed
        if len(answers) == 1 and counted is not None and (counted or is_complete(K, found, 1)):
            return _verdict(counted == 0, counted, agreement, _agreed(counted, agreement), found.roots)
        if found.largest:
            break
    if len(answers) == 1 and counted is not None:
        found = rightmost_roots(K, 1)
        if found.complete and found.roots[0].real < 0.0:
            return _verdict(True, 0, agreement, _agreed(0, agreement), found.roots)
        # many roots of a chain can share their real part to many digits: counts tell where the last of them is
        below, above = abscissa_by_counts(K, float(found.roots[0].real) if found.roots.size else None, 0.0)
        others = {name: n for name, n in agreement.items() if name != ROOTS and n is not None}
        if above - below <= _NARROW * abs(above) and len(others) > 1:
            verdict = _verdict(True, 0, agreement | {ROOTS: None}, _agreed(0, others), found.roots)
            return replace(verdict, abscissa=above)
        reason = (
            "no method finds an unstable root, but the argument principle does not confirm the rightmost root"
        )
        return _verdict(None, None, agreement | {ROOTS: None}, reason, found.roots, known=False)
    return _without_agreement(K, agreement, found)


def _resolved(K: CharacteristicMatrix) -> list[float]:
    """Moduli up to which the delays are resolved, one after the other."""
    if K.n_channels == 0:
        return [0.0]
    reach, angle = reach_near_axis(K), FIRST_ANGLE / float(K.delays.max())
    return [k * angle for k in _ANGLES if k * angle < reach] + [k * reach for k in _REACHES]


def _verdict(
    stable: bool | None,
    number: int | None,
    agreement: Mapping[str, int | None],
    reason: str,
    roots: ComplexArray,
    known: bool = True,
) -> StabilityVerdict:
    abscissa = np.nan if not known else float(roots[0].real) if roots.size else -np.inf
    return StabilityVerdict(stable, abscissa, number, MappingProxyType(dict(agreement)), reason, roots)


def _without_agreement(
    K: CharacteristicMatrix, agreement: Mapping[str, int | None], found: RootSet
) -> StabilityVerdict:
    """Unstable where every method finds unstable roots, so many that not all can be computed; else undecided."""
    known = is_complete(K, found, 1)
    answers = {n for n in agreement.values() if n is not None}
    if all(n > 0 for n in answers) and len(answers) > 1 and agreement[ARGUMENT] is not None:
        counts = [agreement[name] for name in (ARGUMENT, SWEEP) if agreement.get(name) is not None]
        number = counts[0] if len(counts) == 2 and counts[0] == counts[1] else None
        told = ", ".join(f"{name} {n}" for name, n in agreement.items() if n is not None)
        reason = f"all methods find roots with positive real part, though not the same number ({told})"
        return _verdict(False, number, agreement, reason, found.roots, known)
    told = ", ".join(f"{name} {'cannot tell' if n is None else n}" for name, n in agreement.items())
    reason = f"the methods differ on the number of unstable roots ({told})"
    return _verdict(None, None, agreement, reason, found.roots, known)


def _agreed(number: int, agreement: Mapping[str, int | None]) -> str:
    who = ", ".join(name for name, n in agreement.items() if n is not None)
    what = "no root has" if number == 0 else "one root has" if number == 1 else f"{number} roots have"
    silent = [name for name, n in agreement.items() if n is None]
    return f"{what} positive real part; {who} agree" + (
        f", {', '.join(silent)} cannot tell" if silent else ""
    )


def _on_axis(found: RootSet) -> np.ndarray:
    """Roots whose side of the axis rounding of the data could change."""
    return np.asarray(np.abs(found.roots.real) <= 4.0 * np.maximum(found.uncertainties, found.residuals))


def _with_roots_on_axis(
    K: CharacteristicMatrix, found: RootSet, on_axis: np.ndarray, agreement: dict[str, int | None]
) -> StabilityVerdict:
    """Unstable if other roots are, by a line between them and the axis; undecided otherwise."""
    worst = found.roots[on_axis][0]
    where = f"a root lies on the imaginary axis near {abs(worst.imag):.6g} rad/s, as far as rounding lets one tell"
    reach = float(np.max(np.abs(found.roots[on_axis].real)))
    beyond = found.roots[(found.roots.real > 0.0) & ~on_axis]
    if beyond.size and float(beyond.real.min()) > 2.0 * reach:
        number = _count(K, 0.5 * (reach + float(beyond.real.min())))
        if number is not None and number == beyond.size:
            agreement = {ROOTS: number, ARGUMENT: number}
            return _verdict(
                False, number, agreement, f"{_agreed(number, agreement)}; besides, {where}", found.roots
            )
    known = is_complete(K, found, 1)
    return _verdict(None, None, agreement | {ROOTS: None, ARGUMENT: None}, where, found.roots, known)


def _count(K: CharacteristicMatrix, line: float, system: DelaySystem | None = None) -> int | None:
    """Count right of a line; of a system, right of the axis, on what the user wrote, which the roots do not use."""
    try:
        if system is not None and system.written is not None:
            return count_by_polynomials(system.written.closed_by(system.delays, system.gains))
    except ContourError as problem:
        if not np.isnan(problem.omega):
            return None
        # without a place it is the leading coefficients that leave the number open
    try:
        return count_right_of(K, line)
    except (ContourError, InputError):  # on a root, or so far left that e^{-s tau} has no digits
        return None


def _count_by_sweep(system: DelaySystem, expected: int | None) -> int | None:
    """Unstable roots without delay plus all that cross until the delays are full; None if not proven in bounded work.

    The crossings come from a search that asks neither roots nor counts. Where the first way of finding contradicts
    `expected` the others are asked as well; if they contradict each other the sweep cannot tell.
    """
    line = DelayLine.of(system, system.delays, np.zeros(system.delays.size), 1.0)
    n = line.matrices.n_states
    cost = (2 + min(n, line.matrices.n_channels)) ** 2
    cost += 0 if line.matrices.modes else n**2 // _RESOLVENT_SHARE
    search = CrossingSearch(line, Work(_SWEEP_WORK // cost))
    poles, uncertain = line.matrices.undelayed_eigenvalues()
    if search.axis_roots or np.any(np.abs(poles.real) <= np.maximum(uncertain, 1e-9 * np.abs(poles))):
        return None
    unstable = int(np.sum(poles.real > 0.0))
    answer = None
    for way in search.ways():
        try:
            found = way()
        except TooMuchWorkError:  # very long delays: more crossings than can be listed
            return None
        if not found.complete or np.any(np.minimum(found.tau, 1.0 - found.tau) < 1e-9):
            continue
        # roots that cross come in pairs: one on the axis at s = 0 would be there for all delays
        running = unstable + 2 * np.cumsum(np.append(0, found.degree[np.argsort(found.tau)]))
        # no number of roots is negative: tendencies that lead there contradict any count
        number = int(running[-1]) if running.min() >= 0 else int(running.min())
        if answer not in (None, number):
            return None
        answer = number
        if answer == expected:
            break
    return answer
