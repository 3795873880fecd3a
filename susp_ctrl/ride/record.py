"""A record of a vehicle's signals, computed between its samples where the response can tell."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.ride.averages import Signals, averages, close_kinks, near_hidden
from susp_ctrl.ride.extremes import extremes

Limits = Mapping[str, tuple[float, float]]

_RATE_STEP = 1.0 / 32.0  # half the difference that stands for a derivative, in sampling steps
_LOOKS = 16  # between two samples or kinks where samples do not show what is there
_ROUNDING = 1e-13  # of the largest signal of a record


class Record:
    """Signals over the times kept of a response.

    Parameters
    ----------
    response : control.TimeResponseData
        With `at` where it can be computed between its samples.
    skip : float
        Time (s) cut off the start.
    seat : callable
        ``labels -> row or None``: the combination of outputs that is the seat's acceleration.

    Attributes
    ----------
    times, signals
        Of the whole response.
    t, kept
        Of what is left after `skip`.
    at : callable or None
        Times to all signals there.
    kinks : ndarray
        Times of kinks that the samples do not show.
    """

    def __init__(self, response: Any, skip: float, seat: Callable[[list[str]], FloatArray | None]) -> None:
        self.times, outputs = checked_response(response)
        self.labels = list(outputs)
        row = seat(self.labels)
        complete = _with_seat(row)
        self.signals = complete(outputs)
        inside = self.times >= self.times[0] + skip * (1 - 1e-12)
        if np.count_nonzero(inside) < 2:
            raise InputError(
                f"skip = {skip:g} is not allowed: less than the record of "
                f"{self.times[-1] - self.times[0]:g} s is needed"
            )
        self.t = self.times[inside]
        self.kept = {name: values[inside] for name, values in self.signals.items()}
        largest = max(float(np.max(np.abs(values))) for values in self.signals.values())
        errors = np.broadcast_to(getattr(response, "error_estimate", 0.0), len(self.labels))
        noise = dict(zip(self.labels, np.abs(errors), strict=True))
        if row is not None:
            noise["seat_acceleration"] = np.abs(row) @ np.abs(errors)
        self.noise = {name: float(error) + _ROUNDING * largest for name, error in noise.items()}
        self.at: Callable[[FloatArray], dict[str, FloatArray]] | None = None
        self.kinks = np.zeros(0)
        if getattr(response, "at", None) is not None:
            self.at = lambda times: complete(checked_response(response.at(times))[1])
            self.kinks = close_kinks(response, self.times)

    @property
    def forces(self) -> list[str]:
        """Names of the actuators' forces."""
        return [name for name in self.kept if name.startswith("actuator_force")]

    def averages(self, names: list[str]) -> dict[str, float]:
        """Return mean squares of signals by name, and the mean power of every actuator; warn of uncertain ones."""
        at = self.at
        powers = [power for power, *_ in self._powers()]

        def integrands(signals: Signals) -> dict[str, FloatArray]:
            squares = {name: signals[name] ** 2 for name in names}
            return squares | {power: signals[f] * signals[v] for power, f, v in self._powers()}

        noise = {name: self.noise[name] ** 2 for name in names}
        noise |= {power: self.noise[f] * self.noise[v] for power, f, v in self._powers()}
        found = averages(
            self.t,
            integrands(self.kept),
            None if at is None else (lambda times: integrands(at(times))),
            self.kinks,
            noise,
        )
        warn_if_coarse([f"mean {name}" if name in powers else f"RMS {name}" for name in found.doubtful])
        return found.means

    def limits(self) -> Limits:
        """Return least and largest value of all signals, powers and force rates; exact where the response can tell."""
        t, at = self.t, self.at
        rates = {name: np.gradient(self.kept[name], t) for name in self.forces}
        if at is None:
            return extremes(t, self._with_actuators(self.kept, rates), None)
        late = _RATE_STEP * float(np.min(np.diff(t)))

        def shown(times: FloatArray) -> Signals:
            before, after = np.maximum(times - late, t[0]), np.minimum(times + late, t[-1])
            every = np.unique(np.concatenate([times, before, after] if rates else [times]))
            found = at(every)
            here, early, later = (np.searchsorted(every, some) for some in (times, before, after))
            slopes = {name: (found[name][later] - found[name][early]) / (after - before) for name in rates}
            return self._with_actuators({name: values[here] for name, values in found.items()}, slopes)

        hidden = near_hidden(t, self.kinks)
        if np.any(hidden):
            share = np.arange(_LOOKS) / _LOOKS
            inside = t[:-1][hidden][:, None] + np.diff(t)[hidden][:, None] * share
            dense = np.unique(np.concatenate([t, inside.ravel(), self._inner_kinks()]))
            return extremes(dense, shown(dense), shown)
        return extremes(t, self._with_actuators(self.kept, rates), shown)

    def _inner_kinks(self) -> FloatArray:
        """Return times at and between the kinks that the samples do not show."""
        gaps = self.kinks[:-1, None] + np.diff(self.kinks)[:, None] * (np.arange(_LOOKS + 1) / _LOOKS)
        times = gaps[np.diff(self.kinks) < 1.0].ravel()
        return times[(times >= self.t[0]) & (times <= self.t[-1])]

    def _powers(self) -> Iterator[tuple[str, str, str]]:
        """Give the name of every actuator's power, and those of its force and velocity."""
        for name in self.forces:
            axle = name.removeprefix("actuator_force")
            if f"suspension_velocity{axle}" in self.kept:
                yield f"actuator_power{axle}", name, f"suspension_velocity{axle}"

    def _with_actuators(self, signals: Signals, rates: Signals) -> Signals:
        """Return the signals, and the power and the rate of every actuator's force."""
        shown = dict(signals) | {f"{name}_rate": rates[name] for name in rates}
        return shown | {power: signals[f] * signals[v] for power, f, v in self._powers()}


def checked_response(response: Any) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the times and every output by name."""
    try:
        t = validation.array("response.time", response.time, finite=False)
        outputs = validation.array("response.y", response.y, finite=False)
        labels = list(response.output_labels)
    except AttributeError:
        raise InputError(f"response = {response!r} is not allowed: a time response is needed") from None
    if outputs.ndim == 3:
        if outputs.shape[1] != 1:
            raise InputError(f"response has {outputs.shape[1]} input traces: one is needed")
        outputs = outputs[:, 0]
    if not (np.all(np.isfinite(outputs)) and np.all(np.isfinite(t))):
        raise InputError("response is not allowed: finite outputs are needed (did the simulation diverge?)")
    return t, dict(zip(labels, outputs, strict=True))


def warn_if_coarse(figures: list[str]) -> None:
    """Warn of figures that are less certain than wanted."""
    if figures:
        warnings.warn(
            f"the record is too coarse for {', '.join(figures)}: a shorter sampling step is needed",
            RuntimeWarning,
            stacklevel=5,
        )


def _with_seat(
    row: FloatArray | None,
) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what adds the acceleration of the seat to outputs."""
    if row is None:
        return dict
    return lambda outputs: {**outputs, "seat_acceleration": row @ np.array(list(outputs.values()))}
