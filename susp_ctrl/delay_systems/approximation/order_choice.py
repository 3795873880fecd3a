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

# A frequency matters to the order where what the delayed signals add has this share of the largest response.
_SHARE = 0.002
_OSCILLATORY = 0.9  # damping ratio from which a mode does not ring
_BAND_POINTS = 48
# Chebyshev points beyond omega tau / 2 that leave an error of a few thousandths.
_SPARE_POINTS = 10


def approximated(
    system: DelaySystem, method: str, order: Any, band: tuple[float, bool]
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
    band : (float, bool)
        Highest frequency of the input (rad/s), and whether it is certain.

    Raises
    ------
    InputError
        An order that the approximation does not take.

    Warns
    -----
    PadeOrderWarning
        The order, given or highest possible, is too low; the message names the one needed. Or the input's band is
        not certain; the message names the band taken.
    """
    omega = relevant_frequency(system, band[0])
    if not band[1] and system.folded.delays.size:
        warnings.warn(
            f"the input has no known bandwidth: the order is chosen for the band up to {omega:g} rad/s",
            PadeOrderWarning,
            stacklevel=4,
        )
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

    These are the natural frequencies of the plant's oscillations, with its delayed paths open and closed without any,
    and the input's band, as far as what the delayed signals add to an output there is not faint (`_SHARE` of its
    largest response to that input).
    """
    plant, delays = system.folded
    if delays.size == 0:
        return 1.0
    closed = np.linalg.eigvals(plant.closed_matrix(np.ones(delays.size, dtype=complex)))
    roots = np.concatenate([plant.eigenvalues, closed])
    roots = roots[(np.abs(roots) > 0.0) & (np.abs(roots.real) <= _OSCILLATORY * np.abs(roots))]
    top = max(bandwidth or 0.0, float(np.max(np.abs(roots), initial=0.0)))
    if top == 0.0:
        return 10.0 / float(np.max(delays))
    candidates = np.unique([*np.abs(roots), *np.geomspace(1e-3 * top, top, _BAND_POINTS)])
    sample = sample_plant(plant, 1j * candidates)
    # without a loop the delayed signals pass once
    added = np.abs(sample.p12) @ np.abs(sample.p21)
    largest = np.max(np.abs(sample.p11) + added, axis=0, initial=0.0, where=np.isfinite(added))
    share = np.max(added / np.where(largest > 0.0, largest, np.inf), axis=(1, 2), initial=0.0)
    matters = candidates[~(share < _SHARE)]
    return float(np.max(matters)) if matters.size else top


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
