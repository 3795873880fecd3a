"""A measured road: elevation over distance, from arrays or a CSV file."""

from __future__ import annotations

import difflib
import os
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from typing import Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.integrate import trapezoid
from scipy.interpolate import CubicSpline
from scipy.signal import welch

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.road.iso8608 import REFERENCE_WAVENUMBER, Iso8608Spectrum, within
from susp_ctrl.road.road_signals import RoadSignal, SpectralRoad

_INTERPOLATIONS = ("cubic", "linear")
_SEGMENTS = 8  # of the Welch estimate, before overlap
_LARGEST_FILE = 100_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredRoad(SpectralRoad):
    """Measured profile z(x) met at constant speed: x_g(t) = z(v t) - z(0).

    The record starts under the wheel at t = lag. Its first elevation is the datum, so that the road begins
    without a step; before the record the road is flat, after it the last elevation is kept.

    Parameters
    ----------
    distance : array_like
        Increasing distances (m), at least 4; the first is where the wheel starts.
    elevation : array_like
        Elevations (m).
    speed : float
        v (m/s).
    interpolation : {"cubic", "linear"}
        Between the samples: a cubic spline, or straight lines with a kink at every sample.

    Raises
    ------
    InputError
        If the arrays do not fit, are not finite, or the distance does not increase.
    """

    distance: ArrayLike
    elevation: ArrayLike
    speed: float
    interpolation: str = "cubic"
    samples: tuple[FloatArray, FloatArray] = field(init=False, repr=False)
    _spline: CubicSpline | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._keep_positive("speed")
        self._keep(interpolation=validation.one_of("interpolation", self.interpolation, _INTERPOLATIONS))
        distance = validation.increasing("distance", self.distance)
        elevation = validation.vector("elevation", self.elevation, size=distance.size)
        if distance.size < 4:
            raise InputError(f"distance has {distance.size} values: at least 4 are needed")
        samples = (distance - distance[0], elevation - elevation[0])
        spline = CubicSpline(*samples) if self.interpolation == "cubic" else None
        self._keep(samples=samples, _spline=spline)

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        *,
        speed: float,
        distance: str = "distance",
        elevation: str = "elevation",
        interpolation: str = "cubic",
    ) -> Self:
        """Read a profile from a CSV file with a header line; lines that start with # are skipped.

        Parameters
        ----------
        path : path
        speed : float
            v (m/s).
        distance, elevation : str
            Names of the two columns (m).
        interpolation : {"cubic", "linear"}

        Returns
        -------
        MeasuredRoad

        Raises
        ------
        InputError
            If the file cannot be read, a column is missing or holds anything but numbers, or as the class
            itself.
        """
        try:
            content = validation.file_content(path, most=_LARGEST_FILE)
            # as texts: pandas would take truth values for numbers
            table = pd.read_csv(BytesIO(content), comment="#", skipinitialspace=True, dtype=str)
        except FileNotFoundError:
            raise InputError(f"road file {path} cannot be read: there is no such file") from None
        except InputError as error:
            raise InputError(f"road file {path} cannot be read: {error}") from None
        except (UnicodeDecodeError, pd.errors.ParserError, pd.errors.EmptyDataError):
            raise InputError(
                f"road file {path} cannot be read: it is no table of comma-separated values"
            ) from None
        columns = [_numbers(table, name, path) for name in (distance, elevation)]
        try:
            return cls(distance=columns[0], elevation=columns[1], speed=speed, interpolation=interpolation)
        except InputError as error:
            raise InputError(f"road file {path}: {error}") from None

    @property
    def length(self) -> float:
        """Length of the record (m)."""
        return float(self.samples[0][-1])

    @property
    def band(self) -> tuple[float, float]:
        """Angular frequencies (rad/s) that the PSD estimate resolves at this speed."""
        n, _ = self._welch
        return self._per_wavenumber * float(n[0]), self._per_wavenumber * float(n[-1])

    def _first_wheel(self) -> RoadSignal:
        x = self.samples[0]
        return RoadSignal(
            self._elevation,
            # every sample: a cubic spline too is smooth only between them, its third derivative jumps
            breakpoints=tuple((x / self.speed).tolist()),
            bandwidth=float(np.pi * self.speed / np.min(np.diff(x))),
        )

    def _elevation(self, t: FloatArray) -> FloatArray:
        x, z = self.samples
        place = np.clip(self.speed * t, 0.0, x[-1])
        return np.interp(place, x, z) if self._spline is None else np.asarray(self._spline(place))

    @cached_property
    def _welch(self) -> tuple[FloatArray, FloatArray]:
        """Return wavenumbers (cycle/m, without 0) and the one-sided PSD (m3) of the evenly resampled record."""
        x, z = self.samples
        count = x.size
        even = np.linspace(0.0, x[-1], count)
        n, density = welch(
            np.interp(even, x, z),
            fs=1.0 / even[1],
            window="hann",
            nperseg=max(4, 2 * count // (_SEGMENTS + 1)),
            detrend="constant",
        )
        return n[1:], density[1:]

    def spatial_psd(self, n: ArrayLike) -> FloatArray:
        """Return Welch's estimate of the one-sided displacement PSD (m3) at n (cycle/m), zero off its band."""
        known, density = self._welch
        n = np.asarray(n, dtype=float)
        inside = within(n, known[0], known[-1])
        # the slope spectrum n^2 G_d is nearly flat on a road, so straight lines between its estimates keep
        # the power
        place = np.where(inside, n, known[0])
        return np.where(inside, np.interp(place, known, known**2 * density) / place**2, 0.0)

    def rms(self) -> float:
        """Return the RMS elevation (m) about the mean of the record, by distance."""
        x, z = self.samples
        mean = trapezoid(z, x) / x[-1]
        return float(np.sqrt(trapezoid((z - mean) ** 2, x) / x[-1]))

    def fit_iso8608(self, n_min: float = 0.011, n_max: float = 2.83) -> Iso8608Spectrum:
        """Return the straight line G_d(n0) (n/n0)^-w that fits the estimated PSD in log-log (least squares).

        The estimate is first averaged in third-octave bands, so that every octave of the band weighs alike.

        Parameters
        ----------
        n_min, n_max : float
            Band of the fit (cycle/m).

        Returns
        -------
        Iso8608Spectrum

        Raises
        ------
        InputError
            If fewer than three bands hold an estimate.
        """
        wanted = Iso8608Spectrum(g_d=1.0, n_min=n_min, n_max=n_max)
        n, density = self._welch
        inside = (n >= wanted.n_min) & (n <= wanted.n_max) & (density > 0)
        n, density = n[inside], density[inside]
        band = np.floor(3 * np.log2(n / wanted.n_min)).astype(int)
        held = np.unique(band)
        if held.size < 3:
            raise InputError(
                f"n_min = {wanted.n_min:g}, n_max = {wanted.n_max:g} is not allowed: "
                "the record has too few estimates there"
            )
        logs = np.array(
            [
                [np.log(n[band == k] / REFERENCE_WAVENUMBER).mean(), np.log(density[band == k].mean())]
                for k in held
            ]
        )
        slope, level = np.polyfit(logs[:, 0], logs[:, 1], 1)
        return Iso8608Spectrum(
            g_d=float(np.exp(level)), waviness=float(-slope), n_min=wanted.n_min, n_max=wanted.n_max
        )


def _numbers(table: pd.DataFrame, name: str, path: str | os.PathLike[str]) -> FloatArray:
    """Return a column of texts as numbers."""
    if name not in table:
        # of what may be any file only a name like the wanted one is told
        close = difflib.get_close_matches(str(name), [str(column)[:100] for column in table], n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise InputError(f"road file {path}: column {name!r} is not among its {len(table.columns)}{hint}")
    numbers = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=float)
    if np.isnan(numbers).any():
        row = int(np.flatnonzero(np.isnan(numbers))[0])
        raise InputError(
            f"road file {path}: {name} = {str(table[name].iloc[row])[:60]!r} in data row {row + 1} "
            "is not allowed: a number is needed"
        )
    return numbers
