"""One vehicle of a tuning problem, sampled: its objective and limits at every corner of the delays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.tuning.feasibility import StabilityTest
from susp_ctrl.tuning.objectives import BoundObjective, JointEvaluation, SampledObjective, response_and_slopes


@dataclass(frozen=True, eq=False)
class Case:
    """One vehicle of a problem; the delays it has of its own come first among the channels.

    Attributes
    ----------
    objective, limits : BoundObjective, tuple of BoundObjective
    stability : StabilityTest
    fixed_gains, fixed_delays : ndarray
        The vehicle's own delayed signals.
    delay_factors : ndarray, shape (corners, m)
        What the tuned delays are multiplied by.
    """

    objective: BoundObjective
    limits: tuple[BoundObjective, ...]
    stability: StabilityTest
    fixed_gains: FloatArray
    fixed_delays: FloatArray
    delay_factors: FloatArray

    @cached_property
    def _alone(self) -> JointEvaluation:
        return JointEvaluation([self.objective])

    @cached_property
    def _together(self) -> JointEvaluation:
        return JointEvaluation([self.objective, *self.limits])

    @cached_property
    def _line_by_line(self) -> JointEvaluation:
        kinked = self.objective
        lines = kinked.line_by_line() if isinstance(kinked, SampledObjective) else kinked
        return JointEvaluation([lines, *self.limits])

    def values(self, points: FloatArray) -> FloatArray:
        """Return the largest value of the objective over the corners, points (n, 2 m) to (n,)."""
        spread = self._alone.evaluate(*self.spread(points, self.delay_factors))
        return np.asarray(spread.reshape(len(points), -1).max(axis=1))

    def outcomes(self, points: FloatArray, lines: bool = False) -> FloatArray:
        """Return the objective (or the lines of its spectrum) and the limits, shape (n, corners, outcomes)."""
        joint = self._line_by_line if lines else self._together
        values = joint.evaluate(*self.spread(points, self.delay_factors))
        return values.reshape(len(points), len(self.delay_factors), -1)

    def accurate(self, x: FloatArray) -> FloatArray:
        """Return the objective and the limits of one design, the worst of the corners, each by its own evaluation."""
        gains, delays = self.spread(x[None], self.delay_factors)
        objectives = [self.objective, *self.limits]
        return np.max(
            [[_accurate(o, g, t) for o in objectives] for g, t in zip(gains, delays, strict=True)], axis=0
        )

    def slopes(self, points: FloatArray, lines: bool = False) -> FloatArray:
        """Return the derivatives of `outcomes` by the design, (n, corners, outcomes, 2 m); nan where unknown."""
        joint = self._line_by_line if lines else self._together
        slopes = joint.slopes(*self.spread(points, self.delay_factors))
        shaped = slopes.reshape(len(points), len(self.delay_factors), joint.size, -1)
        by_gain, by_delay = self._tuned(shaped)
        return np.concatenate([by_gain, by_delay * self.delay_factors[:, None, :]], axis=-1)

    def response(self, point: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the weighted response of one design, flat, and its derivatives by the design (entries, 2 m)."""
        sampled = cast(SampledObjective, self.objective)
        gains, delays = self.spread(point[None])
        h, by_gain = response_and_slopes(sampled.plant, sampled.omega, gains, delays)
        by_delay = -1j * sampled.omega[:, None, None] * gains[:, None, None, :] * by_gain
        slopes = np.concatenate(self._tuned(np.concatenate([by_gain, by_delay], axis=-1)), axis=-1)
        return h.ravel(), slopes.reshape(h.size, -1)

    def _tuned(self, slopes: NDArray[Any]) -> list[NDArray[Any]]:
        """Return the derivatives by the tuned gains and by the tuned delays: all but the vehicle's own."""
        return [part[..., self.fixed_gains.size :] for part in np.split(slopes, 2, axis=-1)]

    def spread(
        self, points: FloatArray, delay_factors: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return gains and delays, shape (n, channels), of design vectors (n, 2 m); (n corners, ...) with factors."""
        gains, delays = np.split(points, 2, axis=1)
        if delay_factors is not None:
            gains = np.repeat(gains, len(delay_factors), axis=0)
            delays = (delays[:, None, :] * delay_factors).reshape(gains.shape)
        own = [
            np.broadcast_to(fixed, (len(gains), fixed.size))
            for fixed in (self.fixed_gains, self.fixed_delays)
        ]
        return np.hstack([own[0], gains]), np.hstack([own[1], delays])


def _accurate(objective: BoundObjective, gains: FloatArray, delays: FloatArray) -> float:
    own = getattr(objective, "accurate", None)
    return float(own(gains, delays) if own else objective.evaluate(gains[None], delays[None])[0])
