"""A single rounded bump."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.road.road_signals import Road, RoadSignal


@dataclass(frozen=True)
class BumpRoad(Road):
    """Cosine bump x_g(t) = height/2 (1 - cos(2 pi v t/length)) for 0 <= t <= length/v, flat elsewhere.

    Parameters
    ----------
    height : float
        m; a negative height is a hollow.
    length : float
        m.
    speed : float
        v (m/s).

    Raises
    ------
    InputError
        If a value is not finite, or the length or the speed is not positive.

    Examples
    --------
    >>> bump = BumpRoad(height=0.1, length=2.0, speed=10.0)
    >>> [round(float(x), 3) for x in bump.profile([0.05, 0.1, 0.25])]
    [0.05, 0.1, 0.0]
    """

    height: float
    length: float
    speed: float

    def __post_init__(self) -> None:
        self._keep(height=validation.number("height", self.height))
        self._keep_positive("length", "speed")

    @property
    def duration(self) -> float:
        """Time on the bump, length/v (s)."""
        return self.length / self.speed

    def _first_wheel(self) -> RoadSignal:
        return RoadSignal(self._elevation, breakpoints=(0.0, self.duration))

    def _elevation(self, t: FloatArray) -> FloatArray:
        # sin^2 form: no cancellation at the foot of the bump
        wave = self.height * np.sin(np.pi * t / self.duration) ** 2
        return np.where((t > 0) & (t < self.duration), wave, 0.0)
