"""Objectives of one plant evaluated together: one solve serves all that read the same frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import SampledPlant
from susp_ctrl.tuning.objectives.sampled_objective import (
    BoundObjective,
    Reading,
    SampledObjective,
    response_and_slopes,
    slopes_of,
    weighted_response,
)

# Designs per solve: with 300 frequencies and a few channels its arrays stay in the processor's cache.
AT_ONCE = 20


class _Member(NamedTuple):
    """A reading of some rows of a shared response, and where its outcomes belong."""

    reading: Reading
    rows: slice
    columns: slice


class _Shared(NamedTuple):
    """Frequencies and stacked rows that are solved together."""

    omega: FloatArray
    plant: SampledPlant
    members: list[_Member]


class JointEvaluation:
    """Outcomes of several objectives side by side, in their order.

    Parameters
    ----------
    objectives : sequence of BoundObjective
        Those that are a `SampledObjective` share solves and have slopes; of others only values are known.

    Attributes
    ----------
    size : int
        Number of outcomes in all.
    """

    def __init__(self, objectives: Sequence[BoundObjective]) -> None:
        self._shared: list[_Shared] = []
        self._others: list[tuple[BoundObjective, int]] = []
        self.size = 0
        for objective in objectives:
            if isinstance(objective, SampledObjective):
                self.size += self._add(objective)
            else:
                self._others.append((objective, self.size))
                self.size += 1

    def evaluate(self, gains: FloatArray, delays: FloatArray) -> FloatArray:
        """Return the outcomes of many designs, gains and delays (n, m) to (n, size)."""
        result = np.empty((len(gains), self.size))
        for some in _blocks(len(gains)):
            for omega, plant, members in self._shared:
                h = weighted_response(plant, omega, gains[some], delays[some])
                for reading, rows, columns in members:
                    result[some, columns] = reading.outcomes(h[..., rows])
            for objective, column in self._others:
                result[some, column] = objective.evaluate(gains[some], delays[some])
        return result

    def slopes(self, gains: FloatArray, delays: FloatArray) -> FloatArray:
        """Return the derivatives of the outcomes by gains and then delays, shape (n, size, 2 m); nan if unknown."""
        result = np.full((len(gains), self.size, 2 * gains.shape[1]), np.nan)
        for some in _blocks(len(gains)):
            for omega, plant, members in self._shared:
                h, by_gain = response_and_slopes(plant, omega, gains[some], delays[some])
                for reading, rows, columns in members:
                    factor = reading.factor(h[..., rows])
                    along = slopes_of(factor, by_gain[..., rows, :], omega, gains[some])
                    pooled = along if reading.keeps_frequencies else along.sum(axis=1, keepdims=True)
                    result[some, columns] = pooled
        return result

    def _add(self, objective: SampledObjective) -> int:
        """Stack the rows of an objective on those with the same frequencies and inputs; return its outcomes."""
        omega, plant = objective.omega, objective.plant
        size = omega.size if objective.reading.keeps_frequencies else 1
        columns = slice(self.size, self.size + size)
        for k, (known, stacked, members) in enumerate(self._shared):
            same = zip((known, stacked.p21, stacked.p22), (omega, plant.p21, plant.p22), strict=True)
            if all(np.array_equal(a, b) for a, b in same):
                first = stacked.p11.shape[1]
                members.append(_Member(objective.reading, slice(first, first + plant.p11.shape[1]), columns))
                both = stacked._replace(
                    p11=np.concatenate([stacked.p11, plant.p11], axis=1),
                    p12=np.concatenate([stacked.p12, plant.p12], axis=1),
                )
                self._shared[k] = _Shared(omega, both, members)
                return size
        member = _Member(objective.reading, slice(0, plant.p11.shape[1]), columns)
        self._shared.append(_Shared(omega, plant, [member]))
        return size


def _blocks(count: int) -> Iterator[slice]:
    return (slice(k, min(k + AT_ONCE, count)) for k in range(0, count, AT_ONCE))
