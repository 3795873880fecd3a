"""Stationary ride indices straight from the exact frequency response and the spectrum of the road."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import control
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from susp_ctrl import validation
from susp_ctrl.errors import InputError, UnstableSystemError
from susp_ctrl.ride.indices import Row, comfort_total
from susp_ctrl.ride.quadrature import integrate_spectra
from susp_ctrl.ride.signals import (
    COMFORT_WEIGHTS,
    VehicleLike,
    indicator_signals,
    seat_combination,
    signal_unit,
)
from susp_ctrl.ride.weighting import iso2631_weighting

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# A response in which the wheels cancel each other to this part of their magnitudes is rounding, such as the
# roll of a car on two equal tracks: its relative error is not pursued.
_CANCELLED = 1e-8


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

    over the road's band; G is its one-sided PSD. On a harmonic road the integral is |...|^2 amplitude^2/2. On
    two tracks, with H_l and H_r the sums over the wheels of either side and gamma G the cross spectrum,
    |...|^2 is |H_l|^2 + |H_r|^2 + 2 gamma Re(H_l conj(H_r)).

    Parameters
    ----------
    system : control.LTI or DelayLTI
        With named inputs and outputs; the delays of a DelayLTI are exact.
    road : RandomRoad, HarmonicRoad or alike
        Anything with ``psd(omega)`` (m2/(rad/s)) and ``band`` (rad/s), or else with ``lines``: angular
        frequencies (rad/s), amplitudes (m) and phases of a sum of sines.
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
    labels = list(system.output_labels)
    shift = _checked_lags(system, lags)
    seat = seat_combination(labels, seat_position)
    if not known_stable:
        _require_stable(system)
    if seat is not None:
        labels.append("seat_acceleration")
    outputs = [*indicator_signals(labels), *(name for name in labels if name.startswith("actuator_force"))]
    if not outputs:
        raise InputError(
            f"system has outputs {', '.join(labels)}: "
            "an acceleration or a suspension or tire deflection is needed"
        )
    picked = _output_matrix(labels, outputs, seat)
    weighted = [name for name in labels if name in COMFORT_WEIGHTS]
    magnitude = {name: COMFORT_WEIGHTS[name][0] for name in weighted}
    tracks = _tracks(system, shift, road)

    def weighted_too(omega: FloatArray, power: FloatArray) -> FloatArray:
        weights = {name: np.abs(iso2631_weighting(omega, kind)) ** 2 for name, kind in magnitude.items()}
        return np.vstack([power, *(power[outputs.index(name)] * weights[name] for name in weighted)])

    def responses(omega: FloatArray) -> ComplexArray:
        return np.asarray(picked @ np.moveaxis(np.asarray(system(1j * omega, squeeze=False)), 2, 0))

    def gain_squared(omega: FloatArray) -> FloatArray:
        response = responses(omega)
        at_track = [
            np.einsum("fyi,if->yf", response[..., columns], np.exp(-1j * np.multiply.outer(delays, omega)))
            for columns, delays in tracks
        ]
        if len(at_track) == 1:
            return weighted_too(omega, np.abs(at_track[0]) ** 2)
        # mean and half difference of the tracks are independent, with PSD G (1 + gamma)/2 and G (1 - gamma)/2
        left, right = at_track
        gamma = road.coherence(omega)
        power = (1 + gamma) / 2 * np.abs(left + right) ** 2 + (1 - gamma) / 2 * np.abs(left - right) ** 2
        return weighted_too(omega, power)

    def cancelled(omega: FloatArray) -> FloatArray:
        everything = np.sum(
            np.abs(responses(omega)[..., list(np.concatenate([c for c, _ in tracks]))]), axis=-1
        ).T
        return weighted_too(omega, (_CANCELLED * everything) ** 2)

    mean_squares, error = _mean_squares(gain_squared, cancelled, road, rtol)
    rms = dict(
        zip([*outputs, *(f"{name}_weighted" for name in weighted)], np.sqrt(mean_squares), strict=True)
    )
    table = pd.DataFrame(_rows(rms, vehicle), columns=["indicator", "value", "unit"])
    table.attrs["relative_error"] = error
    return table


def _require_stable(system: Any) -> None:
    if isinstance(system, control.StateSpace | control.TransferFunction):
        stable: bool | None = bool(np.all(system.poles().real < 0))
    else:
        # the verdict on a loop with delays belongs to the room below
        from susp_ctrl.delay_systems import stability

        stable = stability(system).stable
    if not stable:
        verdict = "not stable" if stable is False else "not shown to be stable"
        raise UnstableSystemError(f"the system is {verdict}: it has no stationary response")


def _mean_squares(
    gain_squared: Callable[[FloatArray], FloatArray],
    cancelled: Callable[[FloatArray], FloatArray],
    road: Any,
    rtol: float,
) -> tuple[FloatArray, float]:
    """Return the mean squares and the largest relative error of their roots."""
    if callable(getattr(road, "psd", None)) and hasattr(road, "band"):
        integral = integrate_spectra(
            lambda omega: gain_squared(omega) * road.psd(omega),
            road.band,
            rtol=2 * rtol,
            floor=lambda omega: cancelled(omega) * road.psd(omega),
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
        return gain_squared(omegas) @ (amplitudes**2 / 2), 0.0
    raise InputError(
        f"road = {road!r} is not allowed: a road with a psd and a band, or with lines, is needed"
    )


def _checked_lags(system: Any, lags: Mapping[str, float] | None) -> dict[str, float]:
    inputs = list(system.input_labels)
    if lags is None:
        roads = [name for name in inputs if name.startswith("road")]
        if len(roads) != 1:
            raise InputError(
                f"lags = None is not allowed with the road inputs {', '.join(roads)}: a lag for each is needed"
            )
        return {roads[0]: 0.0}
    if not isinstance(lags, Mapping) or not lags:
        raise InputError(f"lags = {lags!r} is not allowed: a mapping of road input to seconds is needed")
    for name in lags:
        validation.one_of("lags: input", name, inputs)
    return {name: validation.number(f"lags[{name!r}]", lag) for name, lag in lags.items()}


def _tracks(system: Any, shift: Mapping[str, float], road: Any) -> list[tuple[list[int], FloatArray]]:
    """Return for every wheel track its columns of the response and their lags (s)."""
    inputs = list(system.input_labels)
    names: dict[str, list[str]] = {}
    for name in shift:
        track = name.rpartition("_")[2] if hasattr(road, "coherence") else ""
        if hasattr(road, "coherence") and track not in ("left", "right"):
            raise InputError(
                f"lags: input {name!r} is on no track of the road: a name in _left or _right is needed"
            )
        names.setdefault(track, []).append(name)
    return [
        ([inputs.index(name) for name in group], np.array([shift[name] for name in group]))
        for group in names.values()
    ]


def _output_matrix(labels: Sequence[str], wanted: Sequence[str], seat: FloatArray | None) -> FloatArray:
    """Return the rows that pick the wanted outputs, the seat being a combination of two."""
    count = len(labels) - (seat is not None)
    rows = np.eye(len(labels))[:, :count]
    if seat is not None:
        rows[-1] = seat
    return rows[[labels.index(name) for name in wanted]]


def _rows(rms: Mapping[str, float], vehicle: VehicleLike | None) -> Iterator[Row]:
    forces = [name for name in rms if name.startswith("actuator_force")]
    weighted = {
        name.removesuffix("_weighted"): value for name, value in rms.items() if name.endswith("_weighted")
    }
    for name, value in rms.items():
        if name not in forces and not name.endswith("_weighted"):
            yield name, float(value), signal_unit(name)
    for name, value in weighted.items():
        yield f"{name}_weighted", float(value), signal_unit(name)
    yield from comfort_total(weighted)
    for tire in vehicle.tires if vehicle is not None else ():
        if tire.deflection in rms:
            wheel = tire.deflection.removeprefix("tire_deflection")
            load = tire.stiffness * float(rms[tire.deflection])
            yield f"tire_load{wheel}", load, "N"
            yield f"load_coefficient{wheel}", load / tire.static_load, "-"
    for name in forces:
        yield name, float(rms[name]), "N"
