"""What a road hands to a simulation: one callable per wheel that knows its own kinks and spectrum."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError

Lines = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class RoadSignal:
    """Road elevation under one wheel as a function of time (s -> m).

    Attributes
    ----------
    elevation : callable
        The road at lag zero: array of times to array of elevations, evaluated as a whole.
    lag : float
        Time (s) after which this wheel meets that road.
    breakpoints : tuple of float
        Times at which the signal or one of its derivatives jumps.
    bandwidth : float or None
        Highest angular frequency (rad/s) of its content; None where it has no such limit.
    sines : (omegas, amplitudes, phases) or None
        Given where the signal equals sum a_i sin(omega_i t + phi_i) for every t (rad/s, m, rad).
    """

    elevation: Callable[[FloatArray], FloatArray]
    lag: float = 0.0
    breakpoints: tuple[float, ...] = ()
    bandwidth: float | None = None
    sines: Lines | None = None

    def __call__(self, t: ArrayLike) -> FloatArray:
        """Return the elevation (m) at the times t (s), of any shape."""
        return self.elevation(np.asarray(t, dtype=float) - self.lag)


class Road(ABC):
    """Base of all roads: profile and signals of all wheels follow from what the first wheel meets."""

    def _keep(self, **values: object) -> None:
        """Set fields of the frozen road while it is made."""
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _keep_positive(self, *names: str) -> None:
        self._keep(**{name: validation.number(name, getattr(self, name), above=0.0) for name in names})

    @abstractmethod
    def _first_wheel(self) -> RoadSignal:
        """Return the elevation under the wheel without lag."""

    def signal(self, lag: float = 0.0) -> RoadSignal:
        """Return the elevation under a wheel that meets the road `lag` seconds later.

        Raises
        ------
        InputError
            If the lag is negative or not finite.
        """
        return delayed(self._first_wheel(), validation.number("lag", lag, at_least=0.0))

    def profile(self, timepts: ArrayLike, lag: float = 0.0) -> FloatArray:
        """Return the road elevation x_g(t - lag).

        Parameters
        ----------
        timepts : array_like
            Times t (s), of any shape.
        lag : float
            Delay of this wheel (s), at least 0.

        Returns
        -------
        ndarray
            Elevation (m), of the shape of `timepts`.

        Raises
        ------
        InputError
            If a time is not finite, or the lag is negative.
        """
        try:
            times = np.asarray(timepts, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"timepts = {timepts!r} is not allowed: numbers are needed") from None
        if not np.all(np.isfinite(times)):
            raise InputError("timepts is not allowed: finite numbers are needed")
        return self.signal(lag)(times)

    def inputs(self, lags: Mapping[str, float]) -> dict[str, RoadSignal]:
        """Return one signal per road input of a plant.

        Parameters
        ----------
        lags : mapping of input name to seconds
            For instance ``{"road_front": 0.0, "road_rear": car.axle_lag(20.0)}``.

        Returns
        -------
        dict of str to RoadSignal
            Callables t -> elevation (m) that carry their breakpoints.

        Raises
        ------
        InputError
            If no input is named, or a lag is negative.
        """
        return {name: self.signal(lag) for name, lag in checked_lags(lags).items()}


class SpectralRoad(Road):
    """Base of the roads that are met at a constant speed and have a power spectral density."""

    speed: float

    @abstractmethod
    def spatial_psd(self, n: ArrayLike) -> FloatArray:
        """Return the one-sided displacement PSD G_d(n) (m3) at wavenumbers n (cycle/m)."""

    def psd(self, omega: ArrayLike) -> FloatArray:
        """Return the one-sided displacement PSD (m2/(rad/s)) at omega (rad/s).

        G(omega) = G_d(n)/(2 pi v) with n = omega/(2 pi v); its integral over omega > 0 is the variance.
        """
        wavenumbers = np.asarray(omega, dtype=float) / self._per_wavenumber
        return self.spatial_psd(wavenumbers) / self._per_wavenumber

    @property
    def _per_wavenumber(self) -> float:
        """Angular frequency of one cycle per metre at this speed, 2 pi v (rad/s per cycle/m)."""
        return 2 * np.pi * self.speed


def delayed(signal: RoadSignal, lag: float) -> RoadSignal:
    """Return the signal of a wheel that meets the road of the first wheel `lag` seconds later."""
    breakpoints = tuple(lag + time for time in signal.breakpoints)
    sines = signal.sines
    if sines is not None:
        omegas, amplitudes, phases = sines
        sines = (omegas, amplitudes, phases - omegas * lag)
    return replace(signal, lag=lag, breakpoints=breakpoints, sines=sines)


def checked_lags(lags: Mapping[str, float]) -> dict[str, float]:
    """Return the lags as floats by input name, at least one of them."""
    if not isinstance(lags, Mapping) or not lags:
        raise InputError(f"lags = {lags!r} is not allowed: a mapping of road input to seconds is needed")
    return {name: validation.number(f"lags[{name!r}]", lag, at_least=0.0) for name, lag in lags.items()}
