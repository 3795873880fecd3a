"""A single rounded bump."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from susp_ctrl import validation
from susp_ctrl.road.road_signals import Road, RoadSignal

FloatArray = NDArray[np.float64]


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
        object.__setattr__(self, "height", validation.number("height", self.height))
        object.__setattr__(self, "length", validation.number("length", self.length, above=0.0))
        object.__setattr__(self, "speed", validation.number("speed", self.speed, above=0.0))

    @property
    def duration(self) -> float:
        """Time on the bump, length/v (s)."""
        return self.length / self.speed

    def signal(self, lag: float = 0.0) -> RoadSignal:
        """Return the elevation under a wheel that meets the bump `lag` seconds later.

        Raises
        ------
        InputError
            If the lag is negative or not finite.
        """
        lag = validation.number("lag", lag, at_least=0.0)
        return RoadSignal(self._elevation, lag=lag, breakpoints=(lag, lag + self.duration))

    def _elevation(self, t: FloatArray) -> FloatArray:
        # sin^2 form: no cancellation at the foot of the bump
        wave = self.height * np.sin(np.pi * t / self.duration) ** 2
        return np.where((t > 0) & (t < self.duration), wave, 0.0)
