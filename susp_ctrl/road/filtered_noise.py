"""A random road as white noise through a first-order filter: the second, independent road generator."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError, TooMuchWorkError
from susp_ctrl.road.iso8608 import REFERENCE_WAVENUMBER, class_and_level
from susp_ctrl.road.road_signals import RoadSignal, SpectralRoad

_MOST_CELLS = 1e8
_SLOWEST = 1e-9  # cycles per metre


@dataclass(frozen=True, kw_only=True)
class FilteredNoiseRoad(SpectralRoad):
    """Random road q' = -2 pi n00 v q + 2 pi n0 sqrt(G_d(n0) v) w(t), w white noise of one-sided PSD 1.

    Its spatial PSD is G_d(n0) n0^2/(n^2 + n00^2): ISO 8608 with waviness 2 above the cut-off n00, flat below.
    The path is drawn from its stationary state by the exact step::

        q+ = a q + sigma sqrt(1 - a^2) xi,    a = exp(-2 pi n00 dx),    sigma^2 = pi n0^2 G_d(n0)/(2 n00)

    every `step` metres and joined by a cubic spline. `RandomRoad` is the method of choice; this one is
    Gaussian at any length and stands beside it as a check.

    Parameters
    ----------
    iso_class : str
        "A" to "H". Ignored where `g_d` is given.
    speed : float
        v (m/s).
    seed : int or numpy.random.Generator
        A generator is used once, on construction.
    length : float
        Road ahead of the front wheel (m).
    lead : float
        Road behind the front wheel at t = 0 (m), which a lagging wheel meets first.
    step : float
        Sampling distance dx (m).
    g_d : float, optional
        G_d(n0) (m3) instead of a class.
    n_cut : float
        n00 (cycle/m).

    Raises
    ------
    InputError
        If an argument is not allowed, or a time off the drawn road is asked for.

    References
    ----------
    .. [1] D. T. Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its integral",
       Physical Review E 54, 1996 (the exact step).
    """

    iso_class: str | None = "C"
    speed: float
    seed: int | np.random.Generator = 0
    length: float
    lead: float = 10.0
    step: float = 0.02
    g_d: float | None = None
    n_cut: float = 0.011
    density_at_n0: float = field(init=False, repr=False, compare=False)
    path: CubicSpline = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._keep_positive("speed", "length", "step", "n_cut")
        self._keep(lead=validation.number("lead", self.lead, at_least=0.0))
        validation.number("step", self.step, at_most=self.length)
        validation.number("n_cut", self.n_cut, at_least=_SLOWEST, at_most=1.0 / _SLOWEST)
        iso_class, level = class_and_level(self.iso_class, self.g_d)
        self._keep(iso_class=iso_class, density_at_n0=level)
        # two samples more at either end keep the spline's end conditions off the road that is used
        cells = (self.lead + self.length) / self.step
        if not cells <= _MOST_CELLS:
            raise TooMuchWorkError(
                f"lead, length and step give {cells:.3g} steps: at most {_MOST_CELLS:g} are allowed"
            )
        behind, ahead = (int(np.ceil(reach / self.step)) + 2 for reach in (self.lead, self.length))
        noise = validation.random_generator(self.seed).standard_normal(behind + ahead + 1)
        memory = np.exp(-2 * np.pi * self.n_cut * self.step)
        sigma = self.rms()
        noise[0] *= sigma  # the first value is drawn from the stationary distribution
        noise[1:] *= sigma * np.sqrt(-np.expm1(2 * np.log(memory)))
        distance = self.step * np.arange(-behind, ahead + 1)
        self._keep(path=CubicSpline(distance, lfilter([1.0], [1.0, -memory], noise)))

    @property
    def band(self) -> tuple[float, float]:
        """Angular frequencies (rad/s) that the sampled path resolves at this speed."""
        return 0.0, np.pi * self.speed / self.step

    def _first_wheel(self) -> RoadSignal:
        # the third derivative of the spline jumps at its knots
        knots = tuple((self.path.x / self.speed).tolist())
        return RoadSignal(self._elevation, breakpoints=knots, bandwidth=self.band[1])

    def _elevation(self, t: FloatArray) -> FloatArray:
        distance = self.speed * t
        slack = self.step  # an integrator may look just past the end
        if distance.size and (
            np.min(distance) < -self.lead - slack or np.max(distance) > self.length + slack
        ):
            raise InputError(
                f"the road is drawn from {-self.lead:g} m to {self.length:g} m: "
                f"{np.min(distance):g} m to {np.max(distance):g} m was asked for; give more length or lead"
            )
        return np.asarray(self.path(distance))

    def spatial_psd(self, n: ArrayLike) -> FloatArray:
        """Return the one-sided displacement PSD of the process (m3) at wavenumbers n (cycle/m)."""
        n = np.asarray(n, dtype=float)
        return np.asarray(self.density_at_n0 * REFERENCE_WAVENUMBER**2 / (n**2 + self.n_cut**2))

    def rms(self) -> float:
        """Return the RMS elevation sigma (m) of the process."""
        return float(np.sqrt(np.pi * REFERENCE_WAVENUMBER**2 * self.density_at_n0 / (2 * self.n_cut)))
