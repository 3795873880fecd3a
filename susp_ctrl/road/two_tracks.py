"""Left and right wheel tracks of one random road, coherent at long waves and independent at short ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.road.random_road import RandomRoad, sine_signal
from susp_ctrl.road.road_signals import Lines, Road, RoadSignal, checked_lags, delayed

# Omega_p (rad/m) and p of the coherence by road class, as used in Project Chrono
COHERENCE_OF_CLASS = {"A": (8.5, 3.5), "B": (5.3, 2.2), "C": (3.0, 1.3), "D": (1.6, 0.8), "E": (0.8, 0.5)}


@dataclass(frozen=True, kw_only=True)
class TwoTrackRoad(Road):
    """Two tracks with the PSD G of one random road and the cross spectrum gamma G between them.

    ::

        gamma(Omega) = (1 + (Omega B^a/Omega_p)^w)^-p,      Omega = 2 pi n

    B is the track width and w the waviness. The left track is the given road. The right one has the same
    amplitudes and the phases delta_i + s_i arccos(gamma_i) with random signs s_i: each track has the exact
    power of every bin, the co-spectrum is gamma times that power in every bin, and the quadrature spectrum
    averages to zero.

    Parameters
    ----------
    road : RandomRoad
        The left track.
    track_width : float
        B (m).
    seed : int or numpy.random.Generator
        Of the signs. A generator is used once, on construction.
    omega_p : float, optional
        Omega_p (rad/m); given by the class of the road where it has one, A to E.
    exponent : float, optional
        p; likewise.
    width_exponent : float
        a.

    Attributes
    ----------
    shape : (float, float)
        Omega_p and p, given or of the class.
    right_lines : (omegas, amplitudes, phases)
        Of the right track (rad/s, m, rad).

    Raises
    ------
    InputError
        If a value is not positive, or the road has no class A to E and omega_p or exponent is missing.

    Notes
    -----
    Inputs are told apart by their names: ``road_front_left`` and ``road_rear_left`` meet the left track,
    names that end in ``_right`` the right one.

    References
    ----------
    .. [1] D. Ammon, "Problems in road surface modelling", Vehicle System Dynamics 20 (supplement), 1992.
    .. [2] Project Chrono, `RandomSurfaceTerrain` (the parameters by class).
    """

    road: RandomRoad
    track_width: float
    seed: int | np.random.Generator = 0
    omega_p: float | None = None
    exponent: float | None = None
    width_exponent: float = 1.0
    shape: tuple[float, float] = field(init=False, repr=False, compare=False)
    right_lines: Lines = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.road, RandomRoad):
            raise InputError(f"road = {self.road!r} is not allowed: a RandomRoad is needed")
        usual = dict(
            zip(("omega_p", "exponent"), COHERENCE_OF_CLASS.get(self.road.iso_class or "", ()), strict=False)
        )
        shape = []
        for name in ("omega_p", "exponent"):
            value = getattr(self, name)
            if value is None and name not in usual:
                raise InputError(f"{name} = None is not allowed with a road that has no class A to E")
            shape.append(validation.number(name, usual[name] if value is None else value, above=0.0))
        self._keep_positive("track_width")
        width_exponent = validation.number("width_exponent", self.width_exponent, at_least=0.0)
        self._keep(shape=tuple(shape), width_exponent=width_exponent)
        omegas, amplitudes, phases = self.road.lines
        signs = validation.random_generator(self.seed).choice([-1.0, 1.0], omegas.size)
        phases = phases + signs * np.arccos(self.coherence(omegas))
        self._keep(right_lines=(omegas, amplitudes, phases))

    @property
    def band(self) -> tuple[float, float]:
        """Angular frequencies (rad/s) between which the road has content at its speed."""
        return self.road.band

    def coherence(self, omega: ArrayLike) -> FloatArray:
        """Return gamma, the cross spectrum of the tracks over the PSD of either, at omega (rad/s)."""
        wavenumber = np.asarray(omega, dtype=float) / self.road.speed
        omega_p, exponent = self.shape
        ratio = wavenumber * self.track_width**self.width_exponent / omega_p
        return np.asarray((1 + ratio**self.road.waviness) ** -exponent)

    def psd(self, omega: ArrayLike) -> FloatArray:
        """Return the one-sided displacement PSD of either track (m2/(rad/s)) at omega (rad/s)."""
        return self.road.psd(omega)

    def spatial_psd(self, n: ArrayLike) -> FloatArray:
        """Return the one-sided displacement PSD G_d(n) of either track (m3) at n (cycle/m)."""
        return self.road.spatial_psd(n)

    def signal(self, lag: float = 0.0, track: str = "left") -> RoadSignal:
        """Return the elevation of one track under a wheel that meets it `lag` seconds later.

        Parameters
        ----------
        lag : float
            Seconds, not negative.
        track : {"left", "right"}

        Returns
        -------
        RoadSignal
            Elevation (m) as a function of time (s).

        Raises
        ------
        InputError
            If the lag is negative or not finite, or there is no such track.
        """
        on_left = validation.one_of("track", track, ("left", "right")) == "left"
        first = self._first_wheel() if on_left else sine_signal(self.right_lines)
        return delayed(first, validation.number("lag", lag, at_least=0.0))

    def _first_wheel(self) -> RoadSignal:
        return sine_signal(self.road.lines)

    def inputs(self, lags: Mapping[str, float]) -> dict[str, RoadSignal]:
        """Return one signal per road input, of the track its name ends in.

        Raises
        ------
        InputError
            If a name ends in neither ``_left`` nor ``_right``, or a lag is negative.
        """
        return {name: self.signal(lag, track_of(name)) for name, lag in checked_lags(lags).items()}


def track_of(name: str) -> str:
    """Return "left" or "right", as the name of a road input ends."""
    track = name.rpartition("_")[2]
    if track not in ("left", "right"):
        raise InputError(
            f"road input {name!r} is not allowed on two tracks: a name in _left or _right is needed"
        )
    return track
