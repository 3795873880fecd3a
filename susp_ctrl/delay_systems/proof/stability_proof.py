"""`prove_stability`: the number of roots right of a line as a theorem about the numbers that were given."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import DelaySystem, SystemMatrix
from susp_ctrl.delay_systems.proof.argument import AxisWalk, walk_along_axis
from susp_ctrl.delay_systems.proof.balls import Ball, flint, require_flint
from susp_ctrl.delay_systems.proof.delay_matrix import DelayMatrix
from susp_ctrl.delay_systems.proof.quasi_polynomial import Expansion, QuasiPolynomial
from susp_ctrl.errors import InputError

# Determinants that may be spent on writing the characteristic function out; beyond, it is taken as a determinant.
_MOST_DETERMINANTS = 3000
_MOST_PRECISION = 1100
_DEEPEST = 200  # divisions of a box within each other


@dataclass(frozen=True, eq=False)
class StabilityProof:
    """Answer of `prove_stability`.

    Attributes
    ----------
    stable : bool or None
        True or False where that is proven, for every point of the box; None where nothing is.
    roots : int or None
        Number of characteristic roots with real part above `right_of`, with none on the line; None if not proven.
    right_of : float
        The line (rad/s).
    reason : str
        What is proven, or why nothing is, in one sentence.
    delays, gains : ndarray, shape (n, 2)
        Least and largest value of each delay (s) and gain.
    intervals : int
        Intervals of the line on which the characteristic function was enclosed.
    boxes : int
        Parts into which the box of delays and gains was divided.
    beyond : float
        Distance from the line's point on the real axis beyond which no root can lie (rad/s).
    precision : int
        Bits of the arithmetic.
    evidence : dict or None
        What `certificate` adds: the matrix and the intervals.
    """

    stable: bool | None
    roots: int | None
    right_of: float
    reason: str
    delays: FloatArray
    gains: FloatArray
    intervals: int
    boxes: int
    beyond: float
    precision: int
    evidence: dict[str, Any] | None

    def certificate(self) -> str:
        """Return the proof as JSON text, which `check_certificate.py` beside this module checks without this package.

        Raises
        ------
        InputError
            Nothing is proven, or the loop has so many delayed signals that its characteristic function was not written
            out.
        """
        if self.roots is None or self.evidence is None:
            reason = "nothing is proven" if self.roots is None else "its determinant was not written out"
            raise InputError(f"this proof has no certificate: {reason}")
        data = {
            "format": "susp_ctrl stability certificate 1",
            "roots": self.roots,
            "right_of": self.right_of.hex(),
            "precision": self.precision,
            "delays": [[v.hex() for v in row] for row in self.delays.tolist()],
            "gains": [[v.hex() for v in row] for row in self.gains.tolist()],
            **self.evidence,
        }
        digest = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
        return json.dumps({**data, "sha256": digest}, sort_keys=True)

    def __bool__(self) -> NoReturn:
        """Refuse: a proof may have failed, which is neither true nor false."""
        raise ValueError("a stability proof has three values: ask for .stable, which is True, False or None")

    def __str__(self) -> str:
        word = {True: "proven stable", False: "proven unstable", None: "not proven"}[self.stable]
        if self.stable is None and self.roots is not None:
            word = "proven"
        return (
            f"{word}: {self.reason}\n"
            f"  {self.intervals} intervals up to {self.beyond:.6g} rad/s in {self.boxes} boxes, "
            f"{self.precision} bits"
        )

    __repr__ = __str__


def prove_stability(
    sys: Any,
    *,
    right_of: float = 0.0,
    delays: Sequence[Any] | None = None,
    gains: Sequence[Any] | None = None,
    precision: int | None = None,
    most_intervals: int = 20_000,
    most_boxes: int = 500,
) -> StabilityProof:
    r"""Count the characteristic roots right of a line, proven, rounding included.

    The characteristic function :math:`f(s) = \det T(s)` of the numbers given (transfer functions and state delays as
    they were written, else the matrices of the plant) is enclosed by ball arithmetic along the line; the argument
    principle counts its zeros. Every number that is a float is taken as the exact number it is.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The system, with its loops closed.
    right_of : float, optional
        Real part of the line (rad/s); a negative one proves a rate of decay.
    delays, gains : sequence, optional
        One entry for each of ``sys.delays`` or ``sys.gains``: None for the value of `sys`, a number, or a pair
        (least, largest). The proof then holds for every point of the box.
    precision : int, optional
        Bits of the arithmetic, at least 24. Without it as many as are needed, up to 1100.
    most_intervals, most_boxes : int, optional
        Bounds on the work: intervals of the line for one box, and parts of the box.

    Returns
    -------
    StabilityProof
        Its truth value is an error: ask for `.stable`.

    Raises
    ------
    InputError
        python-flint is not installed (``pip install 'susp_ctrl[proof]'``), or arguments out of range.

    Notes
    -----
    The mathematics stands in `susp_ctrl.delay_systems.proof`. What was computed before in floating point is not part of
    the proof: a vehicle's matrices from its masses and stiffnesses, and products of matrices of numbers that a system
    was multiplied by.

    Examples
    --------
    ``x' = -k x(t - 1)`` is stable up to k = pi/2, here missed by 1e-12:

    >>> import numpy as np, susp_ctrl as sc
    >>> sc.prove_stability(sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-(np.pi / 2 - 1e-12)]]], delays=[1.0])).stable
    True
    """
    require_flint()
    system = DelaySystem.of(sys, "sys")
    line = validation.number("right_of", right_of)
    box = np.vstack([_ranges("delays", delays, system.delays), _ranges("gains", gains, system.gains)])
    bits = (
        None
        if precision is None
        else validation.integer("precision", precision, at_least=24, at_most=100_000)
    )
    search = _Search(
        system.written or SystemMatrix.of_realization(system.realization, system.widths),
        line,
        bits,
        validation.integer("most_intervals", most_intervals, at_least=1),
    )
    centre = np.repeat(0.5 * (box[:, :1] + box[:, 1:]), 2, axis=1)
    found = search.walk(centre)
    roots, reason = found.zeros, found.reason
    tree: dict[str, Any] = {}
    if roots is not None and np.any(box[:, 0] < box[:, 1]):
        # roots depend continuously on the box: none comes over the line if none is on it anywhere
        reason, tree = search.exclude(box, validation.integer("most_boxes", most_boxes, at_least=1))
        roots = None if reason else roots
    stable = True if roots == 0 and line <= 0.0 else False if roots and line >= 0.0 else None
    split = system.delays.size
    return StabilityProof(
        stable, roots, line, reason or _told(roots, line), box[:split], box[split:], search.intervals,
        max(search.parts, 1), search.beyond, search.precision, search.terms(found.points, tree),
    )  # fmt: skip


class _Search:
    """Proofs for parts of a box: the expansion is made once for each precision."""

    def __init__(self, matrix: SystemMatrix, line: float, precision: int | None, most_intervals: int) -> None:
        self.matrix, self.line, self.most_intervals = matrix, line, most_intervals
        self.intervals, self.beyond, self.parts, self.depth = 0, 0.0, 0, 0
        self._fixed = precision is not None
        self.precision = precision or 96 + 4 * matrix.unknowns
        self._expansions: dict[int, Expansion | None] = {}

    def exclude(self, box: FloatArray, most: int) -> tuple[str, dict[str, Any]]:
        """Prove that no root is on the line anywhere in a box; return why not, and the parts as a tree."""
        found = self.walk(box)
        if found.clear:
            self.parts += 1
            return "", {"points": [point.hex() for point in found.points]}
        if np.all(box[:, 0] == box[:, 1]):
            return found.reason, {}
        if self.parts + 2 > most or self.depth >= _DEEPEST:
            return f"{found.reason}; more than {most} parts of the box are needed", {}
        k, low, high = _halves(box, found.points[-1])
        self.depth += 1
        tree: dict[str, Any] = {"split": k, "at": float(high[k, 0]).hex()}
        for name, half in (("low", low), ("high", high)):
            reason, tree[name] = self.exclude(half, most)
            if reason:
                return reason, {}
        self.depth -= 1
        return "", tree

    def walk(self, box: FloatArray) -> AxisWalk:
        """Walk along the line with balls for the numbers of a box, a point with as many bits as it needs."""
        while True:
            with flint.ctx.workprec(self.precision):
                found = walk_along_axis(self._function(box), self.most_intervals)
            self.intervals += found.steps
            self.beyond = max(self.beyond, found.far)
            point = bool(np.all(box[:, 0] == box[:, 1]))
            if found.zeros is not None or self._fixed or not point or 2 * self.precision > _MOST_PRECISION:
                return found
            self.precision *= 2

    def terms(self, centre: tuple[float, ...], parts: dict[str, Any]) -> dict[str, Any] | None:
        """Return what a certificate holds of the function and the intervals; None where the matrix was enclosed."""
        if self._expansions.get(self.precision) is None:
            return None
        n = self.matrix.unknowns
        terms = [
            [power, k, [[float(v).hex() for v in row] for row in matrix[:n, :n]]]
            for (power, k), matrix in self.matrix.terms.items()
            if np.any(matrix[:n, :n] != 0.0)
        ]
        return {"terms": terms, "centre": [point.hex() for point in centre], "parts": parts}

    def _function(self, box: FloatArray) -> QuasiPolynomial | DelayMatrix:
        numbers = [_ball(*row) for row in box.tolist()]
        tau, g, line = numbers[: len(box) // 2], numbers[len(box) // 2 :], flint.arb(self.line)
        if self.precision not in self._expansions:
            self._expansions[self.precision] = Expansion.of(self.matrix, _MOST_DETERMINANTS)
        expansion = self._expansions[self.precision]
        return DelayMatrix.of(self.matrix, tau, g, line) if expansion is None else expansion.at(tau, g, line)


def _ball(low: float, high: float) -> Ball:
    """Return a ball around an interval."""
    return flint.arb(low) if low == high else flint.arb(low).union(flint.arb(high))


def _ranges(name: str, given: Sequence[Any] | None, own: FloatArray) -> FloatArray:
    """Return least and largest values, shape (n, 2)."""
    result = np.column_stack([own, own])
    if given is None:
        return result
    entries = validation.sequence(name, given)
    if len(entries) != own.size:
        raise InputError(f"{name} has {len(entries)} entries: one for each of {own.size} is needed")
    check = validation.delays if name == "delays" else validation.vector
    for k, entry in enumerate(entries):
        if entry is None:
            continue
        values = check(f"{name}[{k}]", np.ravel(entry) if np.ndim(entry) == 0 else entry)
        if values.size not in (1, 2) or values[0] > values[-1]:
            raise InputError(
                f"{name}[{k}] = {entry!r} is not allowed: None, a number or (least, largest) is needed"
            )
        result[k] = values[0], values[-1]
    return result


def _halves(box: FloatArray, omega: float) -> tuple[int, FloatArray, FloatArray]:
    """Divide a box along the number that moves the characteristic function most at a frequency."""
    n, width = len(box) // 2, box[:, 1] - box[:, 0]
    largest = np.maximum(np.max(np.abs(box), axis=1), 1e-300)
    k = int(np.argmax(np.append(max(abs(omega), 1e-300) * width[:n], width[n:] / largest[n:])))
    first, second = box.copy(), box.copy()
    first[k, 1] = second[k, 0] = 0.5 * (box[k, 0] + box[k, 1])
    return k, first, second


def _told(roots: int | None, line: float) -> str:
    where = "positive real part" if line == 0.0 else f"a real part above {line:g} rad/s"
    number = "no root has" if roots == 0 else "one root has" if roots == 1 else f"{roots} roots have"
    return f"{number} {where}, and none lies on that line"
