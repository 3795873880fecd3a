"""Comfort figures of a weighted acceleration: MTVV, VDV, crest factor, and what the numbers mean."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.ride.extremes import top

# Likely reactions to the weighted RMS acceleration (m/s2) in public transport; they overlap on purpose.
_BANDS = (
    ("not uncomfortable", 0.0, 0.315),
    ("a little uncomfortable", 0.315, 0.63),
    ("fairly uncomfortable", 0.5, 1.0),
    ("uncomfortable", 0.8, 1.6),
    ("very uncomfortable", 1.25, 2.5),
    ("extremely uncomfortable", 2.0, np.inf),
)


def comfort_bands(weighted_rms: float) -> list[str]:
    """Return every comfort band of ISO 2631-1 annex C that a weighted RMS acceleration falls into.

    Parameters
    ----------
    weighted_rms : float
        m/s2, not negative.

    Returns
    -------
    list of str
        The bands overlap on purpose, so that there may be two.

    Raises
    ------
    InputError
        If the value is negative or not finite.

    Examples
    --------
    >>> comfort_bands(0.55)
    ['a little uncomfortable', 'fairly uncomfortable']
    """
    value = validation.number("weighted_rms", weighted_rms, at_least=0.0)
    matching = [name for name, low, high in _BANDS if low <= value <= high]
    # 0.315 belongs to the second band: the first is below it
    return matching[1:] if value == _BANDS[0][2] else matching


class Exposure(NamedTuple):
    """Figures of one weighted acceleration over a record; nan where the record is too short or at rest."""

    rms: float
    mtvv: float
    vdv: float
    crest_factor: float
    mtvv_ratio: float
    vdv_ratio: float


def exposure(t: FloatArray, weighted: FloatArray) -> Exposure:
    """Return the comfort figures of a weighted acceleration a_w(t).

    a_w = RMS; MTVV = max over t of the RMS of the last second; VDV = (integral a_w^4 dt)^(1/4), not divided
    by the duration T; crest factor = max|a_w(t)|/a_w; the ratios MTVV/a_w and VDV/(a_w T^(1/4)) tell where
    the basic method is not enough. The largest magnitude is that of a parabola through the samples around it.
    """
    duration = t[-1] - t[0]
    rms = float(np.sqrt(trapezoid(weighted**2, t) / duration))
    vdv = float(trapezoid(weighted**4, t) ** 0.25)
    mtvv = _largest_running_rms(t, weighted, window=1.0)
    scale = rms if rms > 0 else np.nan
    return Exposure(
        rms,
        mtvv,
        vdv,
        max(top(t, weighted), top(t, -weighted)) / scale,
        mtvv / scale,
        vdv / (scale * duration**0.25),
    )


def _largest_running_rms(t: FloatArray, values: FloatArray, window: float) -> float:
    """Return the largest RMS over a window that ends at a sample and lies inside the record."""
    ends = t[t >= t[0] + window * (1 - 1e-9)]
    if ends.size == 0:
        return float("nan")
    energy = cumulative_trapezoid(values**2, t, initial=0)
    gained = energy[t.size - ends.size :] - np.interp(ends - window, t, energy)
    return float(np.sqrt(max(np.max(gained), 0.0) / window))
