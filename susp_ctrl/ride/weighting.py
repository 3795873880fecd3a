r"""Frequency weighting of vibration by ISO 2631-1, as a transfer function and applied to a history.

W = H_h H_l H_t H_s
H_h = 1/(1 + w1/(Q1 s) + (w1/s)^2)                    band limitation below, f1 = 0.4 Hz, Q1 = 1/sqrt 2
H_l = 1/(1 + s/(Q2 w2) + (s/w2)^2)                    and above, f2 = 100 Hz, Q2 = 1/sqrt 2
H_t = (1 + s/w3)/(1 + s/(Q4 w4) + (s/w4)^2)           acceleration-velocity transition
H_s = (1 + s/(Q5 w5) + (s/w5)^2)/(1 + s/(Q6 w6) + (s/w6)^2) (w5/w6)^2      upward step
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.errors import InputError

_LOW_HZ, _HIGH_HZ, _BAND_Q = 0.4, 100.0, np.sqrt(0.5)


@dataclass(frozen=True)
class _Shape:
    """Frequencies (Hz) and quality factors of H_t and, where there is one, H_s."""

    f3: float
    f4: float
    q4: float
    step: tuple[float, float, float, float] | None = None  # f5, Q5, f6, Q6


_WEIGHTINGS = {
    "Wk": _Shape(12.5, 12.5, 0.63, (2.37, 0.91, 3.35, 0.91)),
    "Wd": _Shape(2.0, 2.0, 0.63),
    "We": _Shape(1.0, 1.0, 0.63),
}


def iso2631_weighting(omega: ArrayLike, weighting: str = "Wk") -> ComplexArray:
    """Return the weighting W(j omega) of ISO 2631-1.

    Parameters
    ----------
    omega : array_like
        Angular frequencies (rad/s), of any shape; 0 gives 0.
    weighting : {"Wk", "Wd", "We"}
        Vertical on the seat, horizontal, or rotation (pitch and roll).

    Returns
    -------
    ndarray of complex
        Of the shape of `omega`; the RMS of a weighted signal needs the magnitude only.

    Raises
    ------
    InputError
        If there is no such weighting, or a frequency is not finite.

    References
    ----------
    .. [1] ISO 2631-1:1997, Mechanical vibration and shock - Evaluation of human exposure to whole-body
       vibration, annex A; ISO 8041-1:2017 (the transfer functions).

    Examples
    --------
    >>> import numpy as np
    >>> print(np.abs(iso2631_weighting(2 * np.pi * np.array([1.0, 8.0]), "Wk")).round(3))
    [0.482 1.036]
    """
    shape = _WEIGHTINGS[validation.one_of("weighting", weighting, _WEIGHTINGS)]
    s = validation.array("omega", omega).astype(complex) * 1j
    high_pass = s**2 / _quadratic(s, _LOW_HZ, _BAND_Q) / (2 * np.pi * _LOW_HZ) ** 2
    transition = (1 + s / (2 * np.pi * shape.f3)) / _quadratic(s, shape.f4, shape.q4)
    result = high_pass * transition / _quadratic(s, _HIGH_HZ, _BAND_Q)
    if shape.step is not None:
        f5, q5, f6, q6 = shape.step
        result = result * (f5 / f6) ** 2 * _quadratic(s, f5, q5) / _quadratic(s, f6, q6)
    return np.asarray(result)


def _quadratic(s: ComplexArray, frequency: float, quality: float) -> ComplexArray:
    """Return 1 + s/(Q w) + (s/w)^2, w = 2 pi times the frequency in Hz."""
    ratio = s / (2 * np.pi * frequency)
    return 1 + ratio / quality + ratio**2


# The slowest mode of the filter, 0.4 Hz with damping 0.707, falls as exp(-1.78 t): below 1e-12 after 16 s.
# The padding of the Fourier transform keeps that tail from wrapping round to the start of the record.
_TAIL = 16.0
_MOST_SAMPLES = 1e8


def weighted_history(values: ArrayLike, step: float, weighting: str = "Wk") -> FloatArray:
    """Return a signal filtered by W, from rest, at the same times.

    The filter is applied in the frequency domain, exactly for a band-limited signal: no bilinear distortion
    near 80 Hz, whatever the sampling rate.

    Parameters
    ----------
    values : array_like, shape (..., times)
        The signal, evenly sampled; it is taken as zero before its first sample.
    step : float
        Sampling interval (s).
    weighting : {"Wk", "Wd", "We"}

    Returns
    -------
    ndarray, shape (..., times)
        In the unit of the signal.

    Raises
    ------
    InputError
        If the step is not positive, a value is not finite, or there is no such weighting.
    """
    step = validation.number("step", step, above=0.0)
    validation.one_of("weighting", weighting, _WEIGHTINGS)
    signal = validation.array("values", values)
    if signal.ndim == 0 or signal.shape[-1] == 0:
        raise InputError(f"values has shape {signal.shape}: samples along the last axis are needed")
    count = signal.shape[-1]
    if not _TAIL / step < _MOST_SAMPLES:
        raise InputError(f"step = {step:g} is not allowed: at least {_TAIL / _MOST_SAMPLES:g} is needed")
    padded = scipy.fft.next_fast_len(count + int(np.ceil(_TAIL / step)), real=True)
    omega = 2 * np.pi * scipy.fft.rfftfreq(padded, step)
    spectrum = scipy.fft.rfft(signal, padded) * iso2631_weighting(omega, weighting)
    return np.asarray(scipy.fft.irfft(spectrum, padded)[..., :count])
