"""The ISO 8608 road spectrum: classes, band integrals, and the same spectrum seen at a speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError

REFERENCE_WAVENUMBER = 0.1  # n0 (cycle/m)

# G_d(n0) in m3: the geometric means of the classes; the limits of a class are half and twice its mean
ISO_8608_CLASSES = {name: 16e-6 * 4.0**k for k, name in enumerate("ABCDEFGH")}


@dataclass(frozen=True, kw_only=True)
class Iso8608Spectrum:
    """One-sided displacement spectrum of a road between two wavenumbers.

    G_d(n) = g_d (n/n0)^-w for n_min <= n <= n_max and zero outside, n0 = 0.1 cycle/m.

    Parameters
    ----------
    g_d : float
        G_d(n0) (m3).
    waviness : float
        w.
    n_min, n_max : float
        Band (cycle/m).

    References
    ----------
    .. [1] ISO 8608, Mechanical vibration - Road surface profiles - Reporting of measured data.
    """

    g_d: float
    waviness: float = 2.0
    n_min: float = 0.011
    n_max: float = 2.83

    def __post_init__(self) -> None:
        for name in ("g_d", "waviness", "n_min", "n_max"):
            object.__setattr__(self, name, validation.number(name, getattr(self, name), above=0.0))
        if self.n_max <= self.n_min:
            raise InputError(
                f"n_max = {self.n_max:g} is not allowed: more than n_min = {self.n_min:g} is needed"
            )

    def density(self, n: ArrayLike) -> FloatArray:
        """Return G_d (m3) at the wavenumbers n (cycle/m)."""
        n = np.asarray(n, dtype=float)
        inside = within(n, self.n_min, self.n_max)
        ratio = np.where(inside, n, REFERENCE_WAVENUMBER) / REFERENCE_WAVENUMBER
        return np.where(inside, self.g_d * ratio**-self.waviness, 0.0)

    def variance(self, n_low: ArrayLike, n_high: ArrayLike) -> FloatArray:
        """Return the exact integral of G_d (m2) from n_low to n_high (cycle/m), both inside the band."""
        return self._moment(n_low, n_high, 0)

    def slope_variance(self, n_low: ArrayLike, n_high: ArrayLike) -> FloatArray:
        """Return the exact integral of n^2 G_d (cycle2) from n_low to n_high (cycle/m)."""
        return self._moment(n_low, n_high, 2)

    def _moment(self, n_low: ArrayLike, n_high: ArrayLike, order: int) -> FloatArray:
        # integral of n^(p-1), p = order + 1 - w, as n^p (ratio^p - 1)/p, without cancellation for small p
        p = order + 1.0 - self.waviness
        low, high = np.asarray(n_low, dtype=float), np.asarray(n_high, dtype=float)
        log_ratio = np.log(high / low)
        integral = log_ratio if p == 0 else low**p * np.expm1(p * log_ratio) / p
        return np.asarray(self.g_d * REFERENCE_WAVENUMBER**self.waviness * integral)


def within(n: FloatArray, n_min: float, n_max: float) -> NDArray[np.bool_]:
    """Return which wavenumbers lie in a band."""
    # one that was n_max before it was turned into rad/s and back still belongs to the band
    return (n >= n_min * (1 - 1e-12)) & (n <= n_max * (1 + 1e-12))


def class_and_level(iso_class: str | None, g_d: float | None) -> tuple[str | None, float]:
    """Return (class, G_d(n0) in m3): the class with its mean, or no class with the level given.

    Raises
    ------
    InputError
        If no level is given and there is no such class, or the level is not positive.
    """
    if g_d is not None:
        return None, validation.number("g_d", g_d, above=0.0)
    name = validation.one_of("iso_class", iso_class, ISO_8608_CLASSES)
    return name, ISO_8608_CLASSES[name]


def nearest_class(g_d: float) -> str:
    """Return the class A to H between whose limits (half and twice the mean) a G_d(n0) in m3 lies.

    Smoother roads than A count as A, rougher ones than H as H.
    """
    g_d = validation.number("g_d", g_d, above=0.0)
    return min(ISO_8608_CLASSES, key=lambda name: abs(np.log(g_d / ISO_8608_CLASSES[name])))
