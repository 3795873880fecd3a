"""Stationary ride indices straight from the exact frequency response and the spectrum of the road."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import integrate
from susp_ctrl.errors import InputError
from susp_ctrl.ride.indicators import VehicleLike, checked_vehicle, signal_unit
from susp_ctrl.ride.indices import Row, comfort_total
from susp_ctrl.ride.spectra import RoadResponse, require_stable

# A response in which the wheels cancel each other to this part of their magnitudes is rounding, such as the
# roll of a car on two equal tracks: its relative error is not pursued.
_CANCELLED = 1e-8
# Panels of the quadrature: at first, evenly spaced in the logarithm of the frequency, and at most.
_PANELS, _MOST_PANELS = 25, 7000


def stationary_rms(
    system: Any,
    road: Any,
    lags: Mapping[str, float] | None = None,
    *,
    vehicle: VehicleLike | None = None,
    seat_position: float | None = None,
    rtol: float = 1e-8,
    known_stable: bool = False,
) -> pd.DataFrame:
    """Return the RMS indices of a stable vehicle on a stationary road, without simulation.

    ::

        sigma_y^2 = integral |sum_i H_yi(j omega) e^{-j omega lag_i}|^2 |W_y(j omega)|^2 G(omega) d omega

    over the road's band, the integral of `response_psd`; G is the one-sided PSD of the road. On a harmonic
    road the integral is |...|^2 amplitude^2/2.

    Parameters
    ----------
    system : control.LTI or DelayLTI
        With named inputs and outputs; the delays of a DelayLTI are exact.
    road : RandomRoad, HarmonicRoad or alike
        Anything with ``psd(omega)`` (m2/(rad/s)) and ``band`` (rad/s), or else with ``lines``: angular
        frequencies (rad/s), amplitudes (m) and phases of a sum of sines. A road with ``coherence(omega)``,
        such as a TwoTrackRoad, has two tracks; the names of its road inputs end in ``_left`` or ``_right``.
    lags : mapping of input name to seconds
        For instance ``{"road_front": 0.0, "road_rear": car.axle_lag(20.0)}``. May be left out only where the
        system has a single road input.
    vehicle : HalfCar or another vehicle, optional
        Adds the tire loads.
    seat_position : float, optional
        Adds ``seat_acceleration`` = x_c'' + position phi'' at this distance (m) behind the centre of mass.
    rtol : float
        Relative error of the RMS values.
    known_stable : bool
        True leaves out the stability test, for systems whose stability has been shown before.

    Returns
    -------
    pandas.DataFrame
        Columns ``indicator``, ``value``, ``unit`` with the names of `ride_indices`: RMS of every
        acceleration, suspension deflection and tire deflection, ``*_weighted``, ``comfort_total``,
        ``tire_load*``, ``load_coefficient*`` and ``actuator_force*``. ``attrs["relative_error"]`` is the
        largest estimated relative error of an RMS value.

    Raises
    ------
    InputError
        If the signals, the road or the lags do not fit.
    UnstableSystemError
        If the system is not shown to be stable: it has no stationary response.

    Warns
    -----
    RuntimeWarning
        If the tolerance was not reached, as for a road spectrum that is not smooth.

    References
    ----------
    .. [1] D. E. Newland, "An Introduction to Random Vibrations, Spectral and Wavelet Analysis", 3rd ed.,
       Longman, 1993, chapter 7 (response of a linear system to several correlated inputs).
    """
    rtol = validation.number("rtol", rtol, above=0.0, below=1.0)
    if vehicle is not None:
        checked_vehicle(vehicle)
    response = RoadResponse.of(system, road, lags, seat_position)
    if not known_stable:
        require_stable(system)
    mean_squares, error = _mean_squares(response, road, rtol)
    rms = dict(zip(response.names, np.sqrt(mean_squares).tolist(), strict=True))
    table = pd.DataFrame(_rows(rms, vehicle), columns=["indicator", "value", "unit"])
    table.attrs["relative_error"] = error
    return table


def _mean_squares(response: RoadResponse, road: Any, rtol: float) -> tuple[FloatArray, float]:
    """Return the mean squares and the largest relative error of their roots."""
    if callable(getattr(road, "psd", None)) and hasattr(road, "band"):
        low, high = road.band
        knots = np.geomspace(low if low > 0 else 1e-5 * high, high, _PANELS)
        uncancelled = integrate(
            lambda omega: response.largest_gain_squared(omega) * road.psd(omega),
            low,
            high,
            0.1,
            knots,
            most=_PANELS,
        )
        integral = integrate(
            lambda omega: response.gain_squared(omega) * road.psd(omega),
            low,
            high,
            2 * rtol,
            knots,
            scale=_CANCELLED**2 * uncancelled.value / rtol,
            most=_MOST_PANELS,
        )
        error = float(np.max(integral.relative_error)) / 2
        if error > rtol:
            warnings.warn(
                f"the stationary RMS values are known to {error:.1e} relative, not to rtol = {rtol:g}",
                RuntimeWarning,
                stacklevel=3,
            )
        return integral.value, error
    if hasattr(road, "lines"):
        omegas, amplitudes, _ = road.lines
        return response.gain_squared(omegas) @ (amplitudes**2 / 2), 0.0
    raise InputError(
        f"road = {road!r} is not allowed: a road with a psd and a band, or with lines, is needed"
    )


def _rows(rms: Mapping[str, float], vehicle: VehicleLike | None) -> Iterator[Row]:
    forces = [name for name in rms if name.startswith("actuator_force")]
    weighted = {
        name.removesuffix("_weighted"): value for name, value in rms.items() if name.endswith("_weighted")
    }
    for name, value in rms.items():
        if name not in forces and not name.endswith("_weighted"):
            yield name, value, signal_unit(name)
    for name, value in weighted.items():
        yield f"{name}_weighted", value, signal_unit(name)
    yield from comfort_total(weighted)
    for tire in vehicle.tires if vehicle is not None else ():
        if tire.deflection in rms:
            wheel = tire.deflection.removeprefix("tire_deflection")
            load = tire.stiffness * rms[tire.deflection]
            yield f"tire_load{wheel}", load, "N"
            yield f"load_coefficient{wheel}", load / tire.static_load, "-"
    for name in forces:
        yield name, rms[name], "N"
