"""A sinusoidal road."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from susp_ctrl import validation
from susp_ctrl.errors import InputError
from susp_ctrl.road.road_signals import Lines, Road, RoadSignal

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class HarmonicRoad(Road):
    """Sinusoidal road x_g(t) = amplitude sin(omega t), which a wheel meets at t = lag.

    Before a wheel has arrived its road is flat, so that the signal has a kink at t = lag.

    Parameters
    ----------
    amplitude : float
        m.
    omega : float
        rad/s.
    steady : bool
        True: the road has been there for all time, x_g(t - lag) holds before t = lag too.

    Raises
    ------
    InputError
        If the amplitude is negative, omega is not positive, or steady is not a bool.

    Examples
    --------
    >>> road = HarmonicRoad(0.05, 7.0)
    >>> float(road.profile(0.1, lag=0.138)), round(float(road.profile(0.3)), 4)
    (0.0, 0.0432)
    """

    amplitude: float
    omega: float
    steady: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "amplitude", validation.number("amplitude", self.amplitude, at_least=0.0))
        object.__setattr__(self, "omega", validation.number("omega", self.omega, above=0.0))
        if not isinstance(self.steady, bool):
            raise InputError(f"steady = {self.steady!r} is not allowed: True or False is needed")

    @property
    def lines(self) -> Lines:
        """The spectrum: (omegas, amplitudes, phases), one line."""
        return np.array([self.omega]), np.array([self.amplitude]), np.zeros(1)

    def signal(self, lag: float = 0.0) -> RoadSignal:
        """Return the elevation under a wheel that meets the road `lag` seconds later.

        Raises
        ------
        InputError
            If the lag is negative or not finite.
        """
        lag = validation.number("lag", lag, at_least=0.0)
        omegas, amplitudes, phases = self.lines
        return RoadSignal(
            self._elevation,
            lag=lag,
            breakpoints=() if self.steady else (lag,),
            bandwidth=self.omega,
            sines=(omegas, amplitudes, phases - omegas * lag) if self.steady else None,
        )

    def _elevation(self, t: FloatArray) -> FloatArray:
        wave = self.amplitude * np.sin(self.omega * t)
        return wave if self.steady else np.where(t > 0, wave, 0.0)
