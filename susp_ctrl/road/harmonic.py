"""A sinusoidal road."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.road.road_signals import Lines, Road, RoadSignal


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
        self._keep(amplitude=validation.number("amplitude", self.amplitude, at_least=0.0))
        self._keep_positive("omega")
        if not isinstance(self.steady, bool):
            raise InputError(f"steady = {self.steady!r} is not allowed: True or False is needed")

    @property
    def lines(self) -> Lines:
        """The spectrum: (omegas, amplitudes, phases), one line."""
        return np.array([self.omega]), np.array([self.amplitude]), np.zeros(1)

    def _first_wheel(self) -> RoadSignal:
        if self.steady:
            return RoadSignal(self._elevation, bandwidth=self.omega, sines=self.lines)
        return RoadSignal(self._elevation, breakpoints=(0.0,), bandwidth=self.omega)

    def _elevation(self, t: FloatArray) -> FloatArray:
        wave = self.amplitude * np.sin(self.omega * t)
        return wave if self.steady else np.where(t > 0, wave, 0.0)
