"""Checks of arguments, made once at the top of a public function.

Every check returns the clean value or raises `InputError` with one line: name, value, what is allowed.
"""

from __future__ import annotations

import difflib
import math
import os
import stat
from collections.abc import Iterable, Mapping, Sequence, Set
from numbers import Integral, Number, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError, shown

LONGEST_DELAY = 1e15
"""Longest delay that is taken (s): beyond it the phase of ``e^{-s tau}`` has no digits at any frequency of use."""
SHORTEST_DELAY = 1e-30
"""Shortest delay that is taken (s) besides zero: products with it would leave the range of numbers."""
MOST = 1_000_000_000
"""Largest number of anything that is counted, where nothing else is said."""
LARGEST_ENTRY = 1e40
"""Largest entry of a plant's matrices and largest gain: squares of their products would leave the range of numbers."""


def file_content(path: Any, *, most: int) -> bytes:
    """Return the bytes of a regular file of at most `most` bytes.

    A pipe, a device or a folder is refused at once: reading it might wait or never end. Raises `InputError` with the
    reason alone, FileNotFoundError where there is nothing.
    """
    try:
        # without O_NONBLOCK, opening a pipe would wait for its writer
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise
    except (OSError, TypeError, ValueError) as problem:  # ValueError: a name with NUL
        raise InputError(getattr(problem, "strerror", None) or "a path is needed") from None
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise InputError("it is no regular file")
        with os.fdopen(handle, "rb", closefd=False) as file:
            content = file.read(most + 1)
    finally:
        os.close(handle)
    if len(content) > most:
        raise InputError(f"it has more than {most:,} bytes")
    return content


def number(
    name: str,
    value: Any,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
) -> float:
    """Return `value` as a finite float within the given limits."""
    limits = [
        (f"greater than {above:g}", lambda v: v > above) if above is not None else None,
        (f"at least {at_least:g}", lambda v: v >= at_least) if at_least is not None else None,
        (f"less than {below:g}", lambda v: v < below) if below is not None else None,
        (f"at most {at_most:g}", lambda v: v <= at_most) if at_most is not None else None,
    ]
    allowed = [limit for limit in limits if limit is not None]
    wanted = "a finite number" + "".join(f", {text}" for text, _ in allowed)
    scalar = isinstance(value, Real) or (
        isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind in "iuf"
    )
    if isinstance(value, bool) or not scalar:
        raise InputError(f"{name} = {shown(value)} is not allowed: {wanted} is needed")
    try:
        result = float(np.asarray(value, dtype=float).reshape(()))
    except OverflowError:
        result = math.inf if value > 0 else -math.inf
    if not math.isfinite(result) or not all(holds(result) for _, holds in allowed):
        raise InputError(f"{name} = {result:g} is not allowed: {wanted} is needed")
    return result


def is_scalar(value: Any) -> bool:
    """Whether a value is one thing, and not a sequence, ragged ones included."""
    return not isinstance(value, (list, tuple)) and np.ndim(value) == 0


def integer(name: str, value: Any, *, at_least: int | None = None, at_most: int = MOST) -> int:
    """Return `value` as an int within the given limits."""
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    limits = [
        f"at least {at_least}" if at_least is not None else "",
        f"at most {at_most}" if at_most < MOST or (whole and value > MOST) else "",
    ]
    wanted = ", ".join(["an integer", *filter(None, limits)])
    if not whole or (at_least is not None and value < at_least) or value > at_most:
        raise InputError(f"{name} = {shown(value)} is not allowed: {wanted} is needed")
    return int(value)


def delay(name: str, value: Any) -> float:
    """Return `value` as a delay in seconds: zero, or from `SHORTEST_DELAY` to `LONGEST_DELAY`."""
    result = number(name, value, at_least=0.0, at_most=LONGEST_DELAY)
    if 0.0 < result < SHORTEST_DELAY:
        raise InputError(f"{name} = {result:g} is not allowed: zero or at least {SHORTEST_DELAY:g} is needed")
    return result


def delays(name: str, value: ArrayLike, *, size: int | None = None) -> FloatArray:
    """Return `value` as delays in seconds: each zero, or from `SHORTEST_DELAY` to `LONGEST_DELAY`."""
    result = vector(name, value, size=size, at_least=0.0)
    short = np.flatnonzero((result > 0.0) & (result < SHORTEST_DELAY))
    if short.size:
        k = int(short[0])
        raise InputError(
            f"{name}[{k}] = {result[k]:g} is not allowed: zero or at least {SHORTEST_DELAY:g} is needed"
        )
    if result.max(initial=0.0) > LONGEST_DELAY:
        bad = int(np.argmax(result))
        raise InputError(
            f"{name}[{bad}] = {result[bad]:g} is not allowed: at most {LONGEST_DELAY:g} is needed"
        )
    return result


def entries(name: str, *arrays: FloatArray) -> None:
    """Refuse numbers that are not finite or larger than `LARGEST_ENTRY`."""
    for array in arrays:
        if not np.all(np.abs(array) <= LARGEST_ENTRY):
            raise InputError(
                f"{name} with {np.max(np.abs(array)):g} among its numbers is not allowed: "
                f"at most {LARGEST_ENTRY:g} is needed"
            )


def vector(
    name: str, value: ArrayLike, *, size: int | None = None, at_least: float | None = None
) -> FloatArray:
    """Return `value` as a finite one-dimensional float array."""
    try:
        result = np.atleast_1d(_real(value))
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} = {shown(value)} is not allowed: a sequence of numbers is needed") from None
    if result.ndim != 1 or (size is not None and result.size != size):
        length = "" if size is None else f" of {size} numbers"
        raise InputError(f"{name} has shape {result.shape}: a one-dimensional sequence{length} is needed")
    if not np.all(np.isfinite(result)):
        bad = int(np.flatnonzero(~np.isfinite(result))[0])
        raise InputError(f"{name}[{bad}] = {result[bad]} is not allowed: finite numbers are needed")
    if at_least is not None and np.any(result < at_least):
        bad = int(np.flatnonzero(result < at_least)[0])
        raise InputError(f"{name}[{bad}] = {result[bad]:g} is not allowed: at least {at_least:g} is needed")
    return result


def matrix(name: str, value: ArrayLike, *, rows: int | None = None, columns: int | None = None) -> FloatArray:
    """Return `value` as a finite two-dimensional float array of the given shape."""
    try:
        result = np.atleast_2d(_real(value))
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} is not allowed: a real matrix is needed") from None
    wanted = (
        result.shape[0] if rows is None else rows,
        result.shape[1] if columns is None else columns,
    )
    if result.ndim != 2 or result.shape != wanted:
        raise InputError(f"{name} has shape {result.shape}: a matrix of shape {wanted} is needed")
    if not np.all(np.isfinite(result)):
        raise InputError(f"{name} is not allowed: finite numbers are needed")
    return result


def sequence(name: str, value: Any) -> Sequence[Any]:
    """Return `value` as a list if it is a list, a tuple, an array or another finite collection in order."""
    if isinstance(value, np.ndarray) and value.ndim:
        return list(value)
    if isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping, Set, np.ndarray)):
        return list(value)
    raise InputError(f"{name} = {shown(value)} is not allowed: a sequence is needed")


def mapping(name: str, value: Any) -> Mapping[Any, Any]:
    """Return `value` if it is a mapping with at least one entry."""
    if not isinstance(value, Mapping) or not value:
        raise InputError(
            f"{name} = {shown(value)} is not allowed: a mapping with at least one entry is needed"
        )
    return value


def function(name: str, value: Any) -> Any:
    """Return `value` if it can be called."""
    if not callable(value):
        raise InputError(f"{name} = {shown(value)} is not allowed: a function is needed")
    return value


def array(name: str, value: ArrayLike, *, finite: bool = True) -> FloatArray:
    """Return `value` as a float array of any shape."""
    try:
        result = _real(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} is not allowed: real numbers are needed") from None
    if finite and not np.all(np.isfinite(result)):
        raise InputError(f"{name} is not allowed: finite numbers are needed")
    return result


def complex_array(name: str, value: ArrayLike) -> NDArray[np.complex128]:
    """Return `value` as an array of complex numbers of any shape; nan and infinity pass."""
    try:
        return np.asarray(_numbers(value), dtype=complex)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} = {shown(value)} is not allowed: numbers are needed") from None


def increasing(name: str, value: ArrayLike, *, at_least: float | None = None) -> FloatArray:
    """Return `value` as a finite, strictly increasing, non-empty float array."""
    result = vector(name, value, at_least=at_least)
    if result.size == 0:
        raise InputError(f"{name} is empty: at least one value is needed")
    steps = np.diff(result)
    if np.any(steps <= 0):
        bad = int(np.flatnonzero(steps <= 0)[0])
        raise InputError(
            f"{name} does not increase: {name}[{bad + 1}] = {result[bad + 1]:g} follows {result[bad]:g}"
        )
    return result


def one_of(name: str, value: Any, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of the allowed words; name the nearest one if it is not."""
    words = list(allowed)
    if isinstance(value, str) and value in words:
        return value
    raise InputError(f"{name} = {shown(value)} is not allowed: {_nearest(value, words)}")


def signal_index(name: str, value: Any, labels: Sequence[str]) -> int:
    """Return the position of a signal given by its name or number."""
    if isinstance(value, Integral) and not isinstance(value, bool) and 0 <= int(value) < len(labels):
        return int(value)
    return list(labels).index(one_of(name, value, labels))


def random_generator(seed: Any, name: str = "seed") -> np.random.Generator:
    """Return a generator from an int or pass a `numpy.random.Generator` through."""
    if isinstance(seed, np.random.Generator):
        return seed
    return np.random.default_rng(integer(name, seed, at_least=0))


def _real(value: ArrayLike) -> FloatArray:
    """Return a float array; numpy would drop imaginary parts with a warning only."""
    array = _numbers(value)
    if np.iscomplexobj(array):
        raise TypeError("complex numbers")
    return array.astype(float)


def _numbers(value: ArrayLike) -> NDArray[Any]:
    """Return an array of numbers; numpy would read strings and take truth values for numbers."""
    array = np.asarray(value)
    if array.dtype.kind == "O":
        if not all(
            isinstance(entry, Number) and not isinstance(entry, (bool, np.bool_)) for entry in array.flat
        ):
            raise TypeError("no numbers")
        kind = complex if any(isinstance(entry, complex) for entry in array.flat) else float
        try:
            array = array.astype(kind)
        except OverflowError:  # an int of hundreds of digits
            raise TypeError("numbers beyond the range") from None
    elif array.dtype.kind not in "iufc":
        raise TypeError("no numbers")
    elif isinstance(value, (list, tuple)) and _has_truth_values(value):
        raise TypeError("truth values")
    return array


def _has_truth_values(value: Sequence[Any]) -> bool:
    """Among other numbers numpy turns them into 0 and 1."""
    return any(
        _has_truth_values(entry) if isinstance(entry, (list, tuple)) else isinstance(entry, (bool, np.bool_))
        for entry in value
    )


def _nearest(value: Any, words: Sequence[str]) -> str:
    close = difflib.get_close_matches(str(value), words, n=1, cutoff=0.6)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}allowed are {', '.join(words)}"
