"""A random road of ISO 8608 as a sum of sines, analytic in time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.road.iso8608 import Iso8608Spectrum, class_and_level
from susp_ctrl.road.road_signals import Lines, RoadSignal, SpectralRoad
from susp_ctrl.road.sine_sum import sine_sum


def sine_signal(lines: Lines) -> RoadSignal:
    """Return sum a_i sin(omega_i t + phi_i) as the signal of the first wheel."""
    return RoadSignal(partial(_at_times, lines), bandwidth=float(lines[0][-1]), sines=lines)


def _at_times(lines: Lines, t: FloatArray) -> FloatArray:
    return sine_sum(t, *lines)


@dataclass(frozen=True, kw_only=True)
class RandomRoad(SpectralRoad):
    """Random road of ISO 8608 met at constant speed, as a sum of sines that exists for all t (also t < 0).

    ::

        x_g(t) = sum_i A_i sin(omega_i t + delta_i),    omega_i = 2 pi n_i v,    delta_i uniform on (0, 2 pi)

    The band [n_min, n_max] is cut into logarithmic bins. A_i^2/2 is the exact integral of G_d over bin i (for
    w = 2 A_i = sqrt(2 G_d(n0) n0^2 (1/n_lo - 1/n_hi))), and n_i the wavenumber at which the line has the
    exact slope variance of its bin as well (for w = 2 the geometric mean of its limits). So the displacement
    and the velocity of the road have the RMS of the spectrum, not of a sampled one. The lines are
    incommensurate: the road does not repeat. The rear wheel is the same function at t - lag.

    Parameters
    ----------
    iso_class : str
        "A" to "H": G_d(n0) = 16e-6 m3 for A, four times more for each class. Ignored where `g_d` is given.
    speed : float
        v (m/s).
    seed : int or numpy.random.Generator
        Of the phases. A generator is used once, on construction.
    g_d : float, optional
        G_d(n0) (m3) instead of a class.
    waviness : float
        w.
    n_min, n_max : float
        Band (cycle/m).
    bins : int
        Number of sines.

    Attributes
    ----------
    spectrum : Iso8608Spectrum
    edges : ndarray, shape (bins + 1,)
        Limits of the bins (cycle/m).
    lines : (omegas, amplitudes, phases)
        rad/s, m, rad.

    Raises
    ------
    InputError
        If the class is unknown, a value is not positive, the band is empty, or the seed is none.

    Notes
    -----
    ISO 8608 gives a class as its geometric mean, used here; the limits are half and twice that.

    References
    ----------
    .. [1] ISO 8608, Mechanical vibration - Road surface profiles - Reporting of measured data.
    .. [2] K. Wu, C. Ren, "Control and Stability Analysis of Double Time-Delay Active Suspension Based on
       Particle Swarm Optimization", Shock and Vibration, 2020, eq. (16) (the sum, without amplitudes).

    Examples
    --------
    >>> road = RandomRoad(iso_class="C", speed=20.0, seed=1)
    >>> round(1e3 * road.rms(), 2)
    15.23
    """

    iso_class: str | None = "C"
    speed: float
    seed: int | np.random.Generator = 0
    g_d: float | None = None
    waviness: float = 2.0
    n_min: float = 0.011
    n_max: float = 2.83
    bins: int = 300
    spectrum: Iso8608Spectrum = field(init=False, repr=False, compare=False)
    edges: FloatArray = field(init=False, repr=False, compare=False)
    lines: Lines = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._keep_positive("speed")
        self._keep(bins=validation.integer("bins", self.bins, at_least=1, at_most=1_000_000))
        iso_class, level = class_and_level(self.iso_class, self.g_d)
        spectrum = Iso8608Spectrum(g_d=level, waviness=self.waviness, n_min=self.n_min, n_max=self.n_max)
        edges = np.geomspace(spectrum.n_min, spectrum.n_max, self.bins + 1)
        variance = spectrum.variance(edges[:-1], edges[1:])
        wavenumbers = np.sqrt(spectrum.slope_variance(edges[:-1], edges[1:]) / variance)
        phases = validation.random_generator(self.seed).uniform(0.0, 2 * np.pi, self.bins)
        lines = (self._per_wavenumber * wavenumbers, np.sqrt(2 * variance), phases)
        self._keep(iso_class=iso_class, spectrum=spectrum, edges=edges, lines=lines)

    @property
    def band(self) -> tuple[float, float]:
        """Angular frequencies (rad/s) between which the road has content at this speed."""
        return self._per_wavenumber * self.spectrum.n_min, self._per_wavenumber * self.spectrum.n_max

    def _first_wheel(self) -> RoadSignal:
        return sine_signal(self.lines)

    def spatial_psd(self, n: ArrayLike) -> FloatArray:
        """Return the one-sided displacement PSD G_d(n) (m3) at wavenumbers n (cycle/m), zero off the band."""
        return self.spectrum.density(n)

    def rms(self) -> float:
        """Return the RMS elevation (m), from the closed form of the band integral."""
        return float(np.sqrt(self.spectrum.variance(self.spectrum.n_min, self.spectrum.n_max)))
