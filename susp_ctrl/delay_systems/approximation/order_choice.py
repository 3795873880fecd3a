r"""Simulation methods that replace the delays: Padé and the spectral line, as ordinary `control.StateSpace`.

The approximating system is integrated by the same method as the exact one, without delays, so that the whole
difference to the exact response is the approximation's.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import control
import numpy as np

from susp_ctrl import validation
from susp_ctrl.delay_systems.approximation.pade import HIGHEST_ORDER, pade_approximation, pade_order
from susp_ctrl.delay_systems.approximation.spectral import HIGHEST_ORDER as MOST_POINTS
from susp_ctrl.delay_systems.approximation.spectral import spectral_approximation
from susp_ctrl.delay_systems.model import DelaySystem, sample_plant
from susp_ctrl.errors import InputError, PadeOrderWarning

# A frequency matters to the order where the way around the loop has this share of its largest gain.
_SHARE = 0.05
# Chebyshev points beyond omega tau / 2 that leave an error of a few thousandths.
_SPARE_POINTS = 10


def approximated(
    system: DelaySystem, method: str, order: Any, bandwidth: float | None
) -> tuple[control.StateSpace, int | tuple[int, ...]]:
    """Return the approximating system and its order.

    Parameters
    ----------
    system : DelayLTI
        System with exact delays.
    method : {"pade", "spectral"}
        Kind of approximation.
    order : int, sequence of int or None
        Order for all delays or one for each; None chooses it for `relevant_frequency`.
    bandwidth : float or None
        Highest frequency of the input (rad/s), where known.

    Raises
    ------
    InputError
        An order that the approximation does not take.

    Warns
    -----
    PadeOrderWarning
        The order, given or highest possible, is too low; the message names the one needed.
    """
    omega = relevant_frequency(system, bandwidth)
    if order is None:
        chosen: Any = _pade_choice(system, omega) if method == "pade" else _points_needed(system, omega)
    elif isinstance(order, Sequence | np.ndarray):
        chosen = tuple(validation.integer("order", n, at_least=1) for n in order)
    else:
        chosen = validation.integer("order", order, at_least=1)
    if method == "pade":
        return pade_approximation(system, chosen, omega if order is not None else None), chosen
    needed = _points_needed(system, omega)
    lowest = chosen if isinstance(chosen, int) else min(chosen, default=needed)
    if isinstance(chosen, int) and lowest < needed:
        warnings.warn(
            f"spectral order {lowest} is too low up to {omega:g} rad/s: {needed} is needed",
            PadeOrderWarning,
            stacklevel=4,
        )
    return spectral_approximation(system, chosen), chosen


def relevant_frequency(system: DelaySystem, bandwidth: float | None) -> float:
    """Return the highest frequency (rad/s) at which the delays' phase decides the response.

    These are the natural frequencies of the plant, with its delayed paths open and closed without delay, and the
    input's band, as far as the way around the loop is not faint there (`_SHARE` of its largest gain).
    """
    plant, delays = system.folded
    if delays.size == 0:
        return 1.0
    closed = np.linalg.eigvals(plant.closed_matrix(np.ones(delays.size, dtype=complex)))
    natural = np.abs(np.concatenate([plant.eigenvalues, closed]))
    candidates = np.array([*natural[natural > 0.0], *([bandwidth] if bandwidth else [])])
    if candidates.size == 0:
        return 10.0 / float(np.max(delays))
    gain = np.max(np.abs(sample_plant(plant, 1j * candidates).p22), axis=(1, 2))
    gain = np.where(np.isfinite(gain), gain, 0.0)
    largest = float(np.max(gain))
    if largest == 0.0:
        # no loop: the delayed signals pass once, all of the input's band counts
        return float(bandwidth if bandwidth else np.max(candidates))
    return float(np.max(candidates[gain >= _SHARE * largest]))


def _pade_choice(system: DelaySystem, omega: float) -> int:
    try:
        return pade_order(system, omega)
    except InputError as above_highest:
        warnings.warn(
            f"Padé order {HIGHEST_ORDER}, the highest, is too low up to {omega:g} rad/s: {above_highest}",
            PadeOrderWarning,
            stacklevel=5,
        )
        return HIGHEST_ORDER


def _points_needed(system: DelaySystem, omega: float) -> int:
    longest = float(np.max(system.folded.delays, initial=0.0))
    return min(MOST_POINTS, math.ceil(0.5 * omega * longest) + _SPARE_POINTS)
