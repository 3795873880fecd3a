"""Band of the inputs of a run, computed from what they are during it."""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators import Inputs

_ENERGY = 0.999
_FEWEST, _MOST = 4096, 2**17  # samples
_RESOLVED = 0.5  # of the highest frequency of the samples: energy beyond it may be aliased
_IN_A_GAP = 16  # samples between two announced kinks


def input_band(inputs: Inputs, start: float, end: float) -> tuple[float, bool]:
    """Return the frequency (rad/s) below which 99.9 % of the energy of every input lies, and whether that is certain.

    The chord from first to last value is taken off, so that the periodic continuation of the run does not jump. An
    announced bandwidth is not exceeded; sums of sines announce theirs.
    """
    span = end - start
    if span <= 0.0 or not inputs.parts:
        return 0.0, True
    kinks = np.unique(np.clip(inputs.breakpoints, start, end))
    shortest = float(np.min(np.diff(kinks), initial=span))
    count = int(np.clip(_IN_A_GAP * span / max(shortest, span / _MOST), _FEWEST, _MOST))
    times = np.linspace(start, end, count + 1)
    announced = inputs.bandwidth or np.inf
    band = _energy_band(inputs.at(times), span)
    certain = band <= _RESOLVED * np.pi * count / span or band > announced
    return min(band, announced), bool(certain)


def _energy_band(values: FloatArray, span: float) -> float:
    ends = values[:, -1:] - values[:, :1]
    rest = values - values[:, :1] - ends * np.linspace(0.0, 1.0, values.shape[1])
    energy = np.cumsum(np.abs(np.fft.rfft(rest[:, :-1], axis=1)) ** 2, axis=1)
    moved = energy[:, -1] > 0.0
    if not np.any(moved):
        return 0.0
    last = np.argmax(energy[moved] >= _ENERGY * energy[moved, -1:], axis=1)
    return float(2.0 * np.pi * np.max(last) / span)
