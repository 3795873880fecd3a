"""Zeros in the right half plane of a function that is enclosed along the imaginary axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from susp_ctrl.delay_systems.proof.balls import Ball, flint
from susp_ctrl.delay_systems.proof.delay_matrix import DelayMatrix
from susp_ctrl.delay_systems.proof.quasi_polynomial import QuasiPolynomial

Enclosed = QuasiPolynomial | DelayMatrix


@dataclass(frozen=True, eq=False)
class AxisWalk:
    """What a walk along the axis has shown.

    Attributes
    ----------
    clear : bool
        Whether f is proven to vanish nowhere on the axis.
    zeros : int or None
        Number of zeros with positive real part; None where it is not proven.
    steps : int
        Number of intervals.
    far : float
        Beyond this nothing vanishes (rad/s).
    points : tuple of float
        Ends of the intervals (rad/s), from 0 as far as the walk came.
    reason : str
        Why nothing is proven, empty otherwise.
    """

    clear: bool
    zeros: int | None
    steps: int
    far: float
    points: tuple[float, ...]
    reason: str


def walk_along_axis(f: Enclosed, most_steps: int) -> AxisWalk:
    """Exclude zeros of `f` on the axis, interval after interval, and count those right of it by the phase."""
    far = f.far()
    if far is None:
        return AxisWalk(False, None, 0, np.inf, (0.0,), "the leading coefficient cannot be told from zero")
    phase, last, points = flint.arb(0), None, [0.0]
    for step in range(most_steps):
        here = flint.arb(points[-1])
        value = f.value(here)
        if last is not None:
            # both lie in one disc that leaves out zero
            phase += (value / last).arg()
        last = value
        if here == far:
            zeros = _zeros(f, here, value, phase)
            reason = "" if zeros is not None else "the phase is not narrow enough to be a number of roots"
            return AxisWalk(True, zeros, step, float(far), tuple(points), reason)
        length = f.free_length(here, far)
        # the next point is a float, so that a certificate can name it
        end = points[-1] if length is None else min(math.nextafter(points[-1] + length, 0.0), float(far))
        if end <= points[-1]:
            reason = f"a root lies on the line near {points[-1]:.6g} rad/s, as far as these numbers tell"
            return AxisWalk(False, None, step, float(far), tuple(points), reason)
        points.append(end)
    reason = f"more than {most_steps} intervals of the line are needed"
    return AxisWalk(False, None, most_steps, float(far), tuple(points), reason)


def _zeros(f: Enclosed, end: Ball, value: Ball, phase: Ball) -> int | None:
    """Close the contour beyond `end`, where f is ``c s^N`` times a number of a disc around one."""
    leading = f.leading * flint.acb(0, end) ** f.degree
    zeros = flint.arb(f.degree) / 2 + ((value / leading).arg() - phase) / flint.arb.pi()
    number = zeros.unique_fmpz()
    return None if number is None else int(number)
