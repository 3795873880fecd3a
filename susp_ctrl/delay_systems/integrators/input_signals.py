"""Inputs of a simulation in one shape, whatever the caller gave.

Arrays, callables and dictionaries of either become one `Inputs` that is evaluated on whole cells at once.
A callable may carry attributes: `breakpoints` (times of kinks and jumps, s), `bandwidth` (rad/s) and `sines`
(omegas, amplitudes, phases: the signal is ``sum a sin(omega t + phi)`` for all t).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError

Lines = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Part:
    """One given signal: `rows` are the inputs it drives; `samples` (rows, times) where it was given so."""

    name: str
    rows: tuple[int, ...]
    function: Callable[[FloatArray], Any]
    lines: Lines | None = None
    samples: FloatArray | None = None


@dataclass(frozen=True)
class Inputs:
    """All inputs of a run.

    Attributes
    ----------
    size : int
        Number of inputs.
    parts : tuple of Part
        The given signals; inputs without one are zero.
    breakpoints : ndarray
        Increasing times of kinks and jumps.
    bandwidth : float or None
        Highest frequency (rad/s), where every part announces one.
    knots : ndarray or None
        Times of the samples, where inputs were given as arrays.
    hold : {"linear", "zero"}
        What the inputs given as arrays do between.
    """

    size: int
    parts: tuple[Part, ...]
    breakpoints: FloatArray
    bandwidth: float | None
    knots: FloatArray | None = None
    hold: str = "linear"

    def without_samples(self) -> tuple[Inputs, Inputs]:
        """Return the inputs given by samples alone, and the others alone."""
        sampled = tuple(part for part in self.parts if part.samples is not None)
        others = tuple(part for part in self.parts if part.samples is None)
        return (
            replace(self, parts=sampled, breakpoints=np.zeros(0), bandwidth=0.0),
            replace(self, parts=others, knots=None),
        )

    def without_sines(self) -> tuple[Inputs, Inputs]:
        """Return the inputs that may have kinks alone, and the sums of sines, which have none, alone."""
        kinked = tuple(part for part in self.parts if part.lines is None)
        smooth = tuple(part for part in self.parts if part.lines is not None)
        band = max((float(np.max(part.lines[0], initial=0.0)) for part in smooth if part.lines), default=0.0)
        return (
            replace(self, parts=kinked),
            replace(self, parts=smooth, breakpoints=np.zeros(0), knots=None, bandwidth=band),
        )

    @property
    def sample_times(self) -> FloatArray:
        """Times of the samples; empty where no input was given as an array."""
        return np.zeros(0) if self.knots is None else self.knots

    def at(self, times: FloatArray) -> FloatArray:
        """Return the inputs at any times t >= 0, shape (inputs, *times.shape)."""
        values = np.zeros((self.size, *times.shape))
        for part in self.parts:
            values[list(part.rows)] = _evaluate(part, times.ravel()).reshape(len(part.rows), *times.shape)
        return values

    def on_cells(self, starts: FloatArray, offsets: FloatArray) -> FloatArray:
        """Return the inputs at ``starts + offsets``, shape (inputs, offsets, starts).

        Sums of sines are turned from cell to cell by one matrix product, which costs a small fraction of as many
        evaluations.
        """
        times = offsets[:, None] + starts
        values = np.zeros((self.size, *times.shape))
        for part in self.parts:
            if part.lines is None:
                values[list(part.rows)] = _evaluate(part, times.ravel()).reshape(len(part.rows), *times.shape)
            else:
                omegas, amplitudes, phases = part.lines
                turned = np.exp(1j * np.outer(offsets, omegas))
                lines = amplitudes[:, None] * np.exp(1j * (np.outer(omegas, starts) + phases[:, None]))
                values[part.rows[0]] = turned.real @ lines.imag + turned.imag @ lines.real
        return values


def as_inputs(
    inputs: Any,
    labels: Sequence[str],
    timepts: FloatArray,
    hold: str = "linear",
    breakpoints: Any = (),
    name: str = "inputs",
) -> Inputs:
    """Return the inputs in one shape.

    Parameters
    ----------
    inputs : None, dict, array_like or callable
        Dictionary name -> array (n_times,) or callable t -> (len(t),); array (n_inputs, n_times), for one input
        also (n_times,); callable t -> (n_inputs, len(t)), for one input also (len(t),). Missing inputs are zero.
    labels : sequence of str
        Names of the system's inputs.
    timepts : ndarray
        Times of the samples of arrays.
    hold : {"linear", "zero"}
        What arrays do between their samples.
    breakpoints : array_like
        Times of kinks and jumps that the callables do not announce.
    name : str
        Argument name for messages.

    Raises
    ------
    InputError
        An unknown name, a wrong shape, a value that is not finite.
    """
    q = len(labels)
    parts: list[Part] = []
    known: list[float] = [*validation.vector("breakpoints", breakpoints)]
    bandwidths: list[float | None] = []
    knots: FloatArray | None = None
    for label, rows, value in _given(inputs, labels, name):
        if callable(value):
            part = Part(label, rows, value, _lines(label, value) if len(rows) == 1 else None)
            _evaluate(part, np.array([timepts[0], timepts[-1]]))
            parts.append(part)
            known.extend(validation.vector(f"{label}.breakpoints", announced_breakpoints(value)))
            band = getattr(value, "bandwidth", None)
            if band is None and part.lines is not None:
                band = float(np.max(part.lines[0], initial=0.0))
            bandwidths.append(band)
            continue
        if np.ndim(value) == 0:
            constant = validation.number(label, value)
            line = (np.zeros(1), np.array([constant]), np.array([0.5 * np.pi])) if len(rows) == 1 else None
            parts.append(Part(label, rows, partial(_constant, constant), line))
            bandwidths.append(0.0)
            continue
        samples = _samples(label, value, len(rows), timepts)
        if not np.any(samples):
            continue
        parts.append(Part(label, rows, _sampled(timepts, samples, hold), None, samples))
        bandwidths.append(0.0)
        knots = timepts
    announced = [b for b in bandwidths if b is not None]
    bandwidth = max(announced, default=0.0) if len(announced) == len(bandwidths) else None
    return Inputs(q, tuple(parts), np.unique(np.array(known, dtype=float)), bandwidth, knots, hold)


def _given(inputs: Any, labels: Sequence[str], name: str) -> list[tuple[str, tuple[int, ...], Any]]:
    if inputs is None:
        return []
    if isinstance(inputs, Mapping):
        found: list[tuple[str, tuple[int, ...], Any]] = []
        for key, value in inputs.items():
            row = validation.signal_index(name, key, labels)
            found.append((f"{name}[{key!r}]", (row,), value))
        rows = [at[0] for _, at, _ in found]
        if len(set(rows)) != len(rows):
            raise InputError(f"{name} gives input {labels[max(rows, key=rows.count)]!r} twice")
        return found
    if len(labels) == 0:
        raise InputError(f"{name} is given, but the system has no inputs")
    return [(name, tuple(range(len(labels))), inputs)]


def announced_breakpoints(value: Any) -> Any:
    """Return the attribute `breakpoints` of a callable; empty without one."""
    breakpoints = getattr(value, "breakpoints", None)
    return () if breakpoints is None else breakpoints


def _constant(value: float, times: FloatArray) -> FloatArray:
    return np.asarray(value)


def _lines(label: str, value: Any) -> Lines | None:
    lines = getattr(value, "sines", None)
    if lines is None:
        return None
    if len(lines) != 3:
        raise InputError(f"{label}.sines has {len(lines)} entries: (omegas, amplitudes, phases) are needed")
    omegas, amplitudes, phases = (validation.vector(f"{label}.sines[{k}]", lines[k]) for k in range(3))
    return tuple(np.array(a) for a in np.broadcast_arrays(omegas, amplitudes, phases))  # type: ignore[return-value]


def _evaluate(part: Part, times: FloatArray) -> NDArray[np.float64]:
    values = np.asarray(part.function(times), dtype=float)
    rows = len(part.rows)
    if values.shape == times.shape and rows == 1:
        values = values[None]
    elif values.ndim == 0:
        values = np.full((rows, times.size), float(values))
    if values.shape != (rows, times.size):
        wanted = f"({times.size},)" if rows == 1 else f"({rows}, {times.size})"
        raise InputError(
            f"{part.name} returns shape {values.shape} for {times.size} times: {wanted} is needed"
        )
    if not np.all(np.isfinite(values)):
        bad = int(np.flatnonzero(~np.isfinite(values).all(axis=0))[0])
        raise InputError(f"{part.name} is not finite at t = {times[bad]:g} s: finite numbers are needed")
    return values


def _samples(label: str, value: Any, rows: int, timepts: FloatArray) -> FloatArray:
    try:
        samples = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{label} is not allowed: an array of numbers or a callable is needed") from None
    if samples.ndim == 1 and rows == 1:
        samples = samples[None]
    if samples.shape != (rows, timepts.size):
        wanted = f"({timepts.size},)" if rows == 1 else f"({rows}, {timepts.size})"
        raise InputError(f"{label} has shape {samples.shape}: {wanted}, one column for each time, is needed")
    if not np.all(np.isfinite(samples)):
        raise InputError(f"{label} is not allowed: it holds numbers that are not finite")
    return samples


def _sampled(timepts: FloatArray, samples: FloatArray, hold: str) -> Callable[[FloatArray], FloatArray]:
    if timepts.size == 1:
        return lambda t: np.repeat(samples, np.size(t), axis=1)
    if hold == "zero":
        return lambda t: samples[:, np.clip(np.searchsorted(timepts, t, side="right") - 1, 0, None)]

    def linear(t: FloatArray) -> FloatArray:
        cell = np.clip(np.searchsorted(timepts, t, side="right") - 1, 0, timepts.size - 2)
        share = (t - timepts[cell]) / (timepts[cell + 1] - timepts[cell])
        return samples[:, cell] * (1.0 - share) + samples[:, cell + 1] * share

    return linear
