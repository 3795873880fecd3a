"""Inputs of a simulation in one shape, whatever the caller gave.

Arrays, callables and dictionaries of either become one `Inputs` that is evaluated on whole cells at once.
A callable may carry attributes: `breakpoints` (times of kinks and jumps, s), `bandwidth` (rad/s) and `sines`
(omegas, amplitudes, phases: the signal is ``sum a sin(omega t + phi)`` for all t).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError

Lines = tuple[FloatArray, FloatArray, FloatArray]

LOOKS = 1000  # by default a feature as long as this part of the run is found
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_FEW_LINES = 8  # sums of more lines are interpolated on cells, which costs less than another evaluation


@dataclass(frozen=True)
class Part:
    """One given signal.

    Attributes
    ----------
    name : str
        For messages.
    rows : tuple of int
        The inputs it drives.
    function : callable
        Its values at any times.
    lines : tuple or None
        Where it is a sum of sines for all times.
    samples : ndarray or None
        Shape (rows, times), where it was given so.
    kinks : ndarray
        Times of its kinks and jumps that are known.
    bandwidth : float or None
        Highest frequency (rad/s), where it announces one.
    """

    name: str
    rows: tuple[int, ...]
    function: Callable[[FloatArray], Any]
    lines: Lines | None = None
    samples: FloatArray | None = None
    kinks: FloatArray = field(default_factory=lambda: np.zeros(0))
    bandwidth: float | None = 0.0


@dataclass(frozen=True)
class Inputs:
    """All inputs of a run.

    Attributes
    ----------
    size : int
        Number of inputs.
    parts : tuple of Part
        The given signals; inputs without one are zero.
    knots : ndarray or None
        Times of the samples, where inputs were given as arrays.
    hold : {"linear", "zero"}
        What the inputs given as arrays do between.
    resolution : float or None
        Longest time (s) between two looks at callables that are not sums of sines.
    """

    size: int
    parts: tuple[Part, ...]
    knots: FloatArray | None = None
    hold: str = "linear"
    resolution: float | None = None

    def without_samples(self) -> tuple[Inputs, Inputs]:
        """Return the inputs given by samples alone, and the others alone."""
        sampled = tuple(part for part in self.parts if part.samples is not None)
        others = tuple(part for part in self.parts if part.samples is None)
        return replace(self, parts=sampled), replace(self, parts=others, knots=None)

    def without_smooth(self) -> tuple[Inputs, Inputs]:
        """Return the inputs that have samples or known kinks alone, and the others, which have none, alone."""
        kinked = tuple(part for part in self.parts if part.samples is not None or part.kinks.size)
        smooth = tuple(part for part in self.parts if part.samples is None and not part.kinks.size)
        return replace(self, parts=kinked), replace(self, parts=smooth, knots=None)

    @cached_property
    def breakpoints(self) -> FloatArray:
        """Increasing times of kinks and jumps."""
        return np.unique(np.concatenate([np.zeros(0), *(part.kinks for part in self.parts)]))

    @property
    def bandwidth(self) -> float | None:
        """Highest frequency (rad/s), where every part announces one."""
        bands = [part.bandwidth for part in self.parts]
        announced = [band for band in bands if band is not None]
        return max(announced, default=0.0) if len(announced) == len(bands) else None

    @property
    def watched_rows(self) -> list[int]:
        """Inputs given by callables whose values only the callable knows."""
        plain = [part for part in self.parts if part.lines is None and part.samples is None]
        return sorted({row for part in plain for row in part.rows})

    def looks(self, timepts: FloatArray, start: float) -> FloatArray:
        """Return the times at which polynomials are held against callables: `timepts` and times between them.

        No two are farther apart than `resolution`, and those between `timepts` lie irregularly, so that no
        period of the input hides it.
        """
        if not self.watched_rows:
            return timepts
        ends = np.unique(np.append(timepts, start))
        span = float(ends[-1] - ends[0])
        step = 0.5 * (span / LOOKS if self.resolution is None else self.resolution)
        return looking_times(ends, step) if span > 0.0 else timepts

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

    def given(self, times: FloatArray) -> FloatArray:
        """Return what the caller gave at `times`, shape (inputs, times).

        Sums of many sines are nan: they are what their lines say, and need no second evaluation.
        """
        values = np.zeros((self.size, times.size))
        for part in self.parts:
            many = part.lines is not None and part.lines[0].size > _FEW_LINES
            values[list(part.rows)] = np.nan if many else _evaluate(part, times)
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
    resolution: float | None = None,
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
    resolution : float, optional
        Longest time (s) between two looks at a callable.

    Raises
    ------
    InputError
        An unknown name, a wrong shape, a value that is not finite, sines that are not the callable.
    """
    q = len(labels)
    parts: list[Part] = []
    unannounced = validation.vector("breakpoints", breakpoints)
    knots: FloatArray | None = None
    for label, rows, value in _given(inputs, labels, name):
        if callable(value):
            lines = _lines(label, value) if len(rows) == 1 else None
            kinks = validation.vector(f"{label}.breakpoints", announced_breakpoints(value))
            kinks = np.append(kinks, unannounced) if lines is None else np.zeros(0)
            band = getattr(value, "bandwidth", None)
            if band is None and lines is not None:
                band = float(np.max(lines[0], initial=0.0))
            parts.append(Part(label, rows, value, lines, None, kinks, band))
            _check_lines(parts[-1], timepts)
            continue
        if validation.is_scalar(value):
            constant = validation.number(label, value)
            line = (np.zeros(1), np.array([constant]), np.array([0.5 * np.pi])) if len(rows) == 1 else None
            parts.append(Part(label, rows, partial(_constant, constant), line))
            continue
        samples = _samples(label, value, len(rows), timepts)
        if not np.any(samples):
            continue
        parts.append(Part(label, rows, _sampled(timepts, samples, hold), None, samples))
        knots = timepts
    return Inputs(q, tuple(parts), knots, hold, resolution)


def looking_times(ends: FloatArray, step: float) -> FloatArray:
    """Return `ends` and, where they are more than two steps apart, one time in every step between, irregularly."""
    gaps = np.diff(ends)
    counts = np.where(gaps > 2.0 * step, np.ceil(gaps / step), 0.0).astype(int)
    gap = np.repeat(np.arange(gaps.size), counts)
    number = np.arange(gap.size)
    inside = number - np.repeat(np.cumsum(counts) - counts, counts)
    share = (inside + (number + 1) * _GOLDEN % 1.0) / counts[gap]
    return np.unique(np.concatenate([ends, ends[gap] + share * gaps[gap]]))


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


def _check_lines(part: Part, timepts: FloatArray) -> None:
    """Refuse a callable that is not the sum of sines that it announces."""
    few = np.append(timepts[:: max(1, timepts.size // 16)], timepts[-1])
    given = _evaluate(part, few)
    if part.lines is None:
        return
    omegas, amplitudes, phases = part.lines
    wave = np.sin(np.multiply.outer(few, omegas) + phases) @ amplitudes
    off = np.abs(given[0] - wave) > 1e-7 * np.sum(np.abs(amplitudes))
    if np.any(off):
        raise InputError(
            f"{part.name}.sines is not the callable: they differ at t = {few[int(np.argmax(off))]:g} s"
        )


def _evaluate(part: Part, times: FloatArray) -> NDArray[np.float64]:
    values = validation.array(f"what {part.name} returns", part.function(times), finite=False)
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
        samples = validation.array(label, value, finite=False)
    except InputError:
        raise InputError(
            f"{label} is not allowed: an array of real numbers or a callable is needed"
        ) from None
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
