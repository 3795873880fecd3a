"""How the spectrum of a road becomes the spectra of the ride: the response of a vehicle to one road, squared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import control
import numpy as np
import pandas as pd
from control.lti import LTI
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems import stability
from susp_ctrl.errors import InputError, UnstableSystemError
from susp_ctrl.ride.indicators import COMFORT_WEIGHTS, indicator_signals, seat_combination
from susp_ctrl.ride.weighting import iso2631_weighting


def response_psd(
    system: Any,
    road: Any,
    omega: ArrayLike,
    lags: Mapping[str, float] | None = None,
    *,
    seat_position: float | None = None,
    known_stable: bool = False,
) -> pd.DataFrame:
    """Return the power spectral densities of the ride on a random road, exact at every frequency.

    ::

        G_y(omega) = |sum_i H_yi(j omega) e^{-j omega lag_i}|^2 |W_y(j omega)|^2 G(omega)

    G is the one-sided PSD of the road. On two tracks, with H_l and H_r the sums over the wheels of either
    side and gamma G the cross spectrum, |...|^2 is |H_l|^2 + |H_r|^2 + 2 gamma Re(H_l conj(H_r)).

    Parameters
    ----------
    system : control.LTI or DelayLTI
        With named inputs and outputs; the delays of a DelayLTI are exact.
    road : RandomRoad or alike
        Anything with ``psd(omega)`` (m2/(rad/s)).
    omega : array_like
        Angular frequencies (rad/s).
    lags : mapping of input name to seconds
        As for `stationary_rms`.
    seat_position : float, optional
        Adds ``seat_acceleration`` = x_c'' + position phi'' at this distance (m) behind the centre of mass.
    known_stable : bool
        True leaves out the stability test, for systems whose stability has been shown before.

    Returns
    -------
    pandas.DataFrame
        ``omega`` (rad/s), then one column per output of `stationary_rms` and its weighted accelerations: the
        one- sided PSD in the unit of the output squared per rad/s. Its integral is the square of the RMS
        there.

    Raises
    ------
    InputError
        If the signals, the road, the lags or the frequencies do not fit.
    UnstableSystemError
        If the system is not shown to be stable: it has no stationary response.
    """
    points = validation.vector("omega", omega)
    response = RoadResponse.of(system, road, lags, seat_position)
    if not callable(getattr(road, "psd", None)):
        raise InputError(f"road = {road!r} is not allowed: a road with a psd is needed")
    if not known_stable:
        require_stable(system)
    densities = response.gain_squared(points) * road.psd(points)
    return pd.DataFrame({"omega": points, **dict(zip(response.names, densities, strict=True))})


@dataclass(frozen=True, eq=False)
class RoadResponse:
    """Squared response of every ride output to the road under all wheels together.

    Attributes
    ----------
    system : control.LTI or DelayLTI
    outputs : tuple of str
        Outputs whose RMS is an indicator, then actuator forces.
    weighted : tuple of str
        Those accelerations that have a comfort weighting.
    picked : ndarray, shape (outputs, system outputs)
        Combination of the system's outputs that each is.
    tracks : list of (columns, lags)
        For every wheel track its inputs of the system and their lags (s).
    coherence : callable or None
        Of the two tracks.
    """

    system: Any
    outputs: tuple[str, ...]
    weighted: tuple[str, ...]
    picked: FloatArray
    tracks: list[tuple[list[int], FloatArray]]
    coherence: Callable[[FloatArray], FloatArray] | None

    @classmethod
    def of(
        cls, system: Any, road: Any, lags: Mapping[str, float] | None, seat_position: float | None
    ) -> Self:
        """Check the arguments of a public function and return the response they mean."""
        if not isinstance(system, LTI):
            raise InputError(f"system is a {type(system).__name__}: a linear system is needed")
        labels = list(system.output_labels)
        rows = np.eye(len(labels))
        seat = seat_combination(labels, seat_position)
        if seat is not None:
            labels.append("seat_acceleration")
            rows = np.vstack([rows, seat])
        forces = [name for name in labels if name.startswith("actuator_force")]
        indicators = indicator_signals(labels)
        if not indicators:
            raise InputError(
                f"system has outputs {', '.join(labels)}: "
                "an acceleration or a suspension or tire deflection is needed"
            )
        outputs = (*indicators, *forces)
        coherence = getattr(road, "coherence", None)
        return cls(
            system=system,
            outputs=outputs,
            weighted=tuple(name for name in labels if name in COMFORT_WEIGHTS),
            picked=rows[[labels.index(name) for name in outputs]],
            tracks=_tracks(list(system.input_labels), _checked_lags(system, lags), coherence is not None),
            coherence=coherence,
        )

    @property
    def names(self) -> list[str]:
        """Names of the rows that the methods return."""
        return [*self.outputs, *(f"{name}_weighted" for name in self.weighted)]

    def gain_squared(self, omega: FloatArray) -> FloatArray:
        """Return PSD over road PSD, shape (names, points)."""
        response = self._per_input(omega)
        at_track = [
            np.einsum("fyi,if->yf", response[..., columns], np.exp(-1j * np.multiply.outer(delays, omega)))
            for columns, delays in self.tracks
        ]
        if len(at_track) == 1 or self.coherence is None:
            return self._with_weighted(omega, np.abs(at_track[0]) ** 2)
        # mean and half difference of the tracks are independent, with PSD G (1 + gamma)/2 and G (1 - gamma)/2
        one, other = at_track
        gamma = self.coherence(omega)
        power = (1 + gamma) / 2 * np.abs(one + other) ** 2 + (1 - gamma) / 2 * np.abs(one - other) ** 2
        return self._with_weighted(omega, power)

    def largest_gain_squared(self, omega: FloatArray) -> FloatArray:
        """Return what `gain_squared` would be if no wheel ever worked against another, shape (names, points)."""
        columns = [column for group, _ in self.tracks for column in group]
        return self._with_weighted(
            omega, np.sum(np.abs(self._per_input(omega)[..., columns]), axis=-1).T ** 2
        )

    def _per_input(self, omega: FloatArray) -> ComplexArray:
        """Return the response of every output to every input, shape (points, outputs, inputs)."""
        values = np.asarray(self.system(1j * omega, squeeze=False))
        return np.asarray(self.picked @ np.moveaxis(values, 2, 0))

    def _with_weighted(self, omega: FloatArray, power: FloatArray) -> FloatArray:
        rows = [
            power[self.outputs.index(name)] * np.abs(iso2631_weighting(omega, COMFORT_WEIGHTS[name][0])) ** 2
            for name in self.weighted
        ]
        return np.vstack([power, *rows])


def require_stable(system: Any) -> None:
    """Raise `UnstableSystemError` unless the system is shown to be stable."""
    if isinstance(system, control.StateSpace | control.TransferFunction):
        stable: bool | None = bool(np.all(system.poles().real < 0))
    else:
        stable = stability(system).stable
    if not stable:
        verdict = "not stable" if stable is False else "not shown to be stable"
        raise UnstableSystemError(f"the system is {verdict}: it has no stationary response")


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
    return {name: validation.number(f"lags[{name!r}]", lag, at_least=0.0) for name, lag in lags.items()}


def _tracks(
    inputs: list[str], lags: Mapping[str, float], two_tracks: bool
) -> list[tuple[list[int], FloatArray]]:
    names: dict[str, list[str]] = {}
    for name in lags:
        track = name.rpartition("_")[2] if two_tracks else ""
        if two_tracks and track not in ("left", "right"):
            raise InputError(
                f"lags: input {name!r} is on no track of the road: a name in _left or _right is needed"
            )
        names.setdefault(track, []).append(name)
    return [
        ([inputs.index(name) for name in group], np.array([lags[name] for name in group]))
        for group in names.values()
    ]
