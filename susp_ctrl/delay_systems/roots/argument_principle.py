r"""Number of characteristic roots right of a line, by the argument principle with certified steps.

The number of zeros of :math:`\det K(s)` in a half plane follows from the phase of the determinant along its edge.
The phase is followed in steps that cannot miss a turn: with midpoint :math:`s_0` of a step and

.. math:: |K(s_0)^{-1} (K(s) - K(s_0))| \le X \quad\text{(entry by entry, for every s of the step)},

no root lies on the step if the spectral radius of X is below one, and the phase then changes by at most
:math:`-\log\det(I - X)`. A step is halved until this is below :math:`\pi`. The bound X contains a relative
uncertainty of some roundings in every entry of K, so a root that rounding could move over the line is reported,
never counted. Beyond the largest possible root the remaining phase is known in closed form. Nothing here uses the
computed roots.

References
----------
.. [1] K. Gu, V. L. Kharitonov, J. Chen, "Stability of Time-Delay Systems", Birkhäuser, 2003, chapter 1.
.. [2] W. Michiels, S.-I. Niculescu, "Stability, Control, and Computation for Time-Delay Systems", SIAM, 2014.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray, numbered
from susp_ctrl.delay_systems.model import CharacteristicMatrix, DelaySystem, Points, perron_bound
from susp_ctrl.delay_systems.roots.modal_count import ModalLoop
from susp_ctrl.errors import InputError, UndecidedStabilityWarning

# Relative uncertainty of every entry of K: some dozens of roundings.
_ENTRY_UNCERTAINTY = 64.0 * np.finfo(float).eps
# A step is accepted below these: spectral radius of X, and largest phase change.
_RADIUS = 0.9
_PHASE = 0.95 * np.pi
# Numbers held at once by the batched matrices, and points after which the search is given up.
_BATCH_NUMBERS = 2_000_000
_MOST_POINTS = 2_000_000
# An abscissa is narrowed down to this relative width, by counts of at most so many points each.
_BRACKET = 1e-9
_POINTS_OF_A_TRIAL = 50_000


class ContourError(ArithmeticError):
    """The phase cannot be followed: a root lies on the line as far as can be told, or too many steps are needed."""

    def __init__(self, omega: float, reason: str) -> None:
        super().__init__(reason)
        self.omega = omega


def count_unstable_roots(sys: Any) -> int | None:
    """Count the characteristic roots with positive real part by the argument principle.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The system, with its loops closed.

    Returns
    -------
    int or None
        Number of roots with positive real part, multiple ones counted as often as they occur; None, with an
        `UndecidedStabilityWarning`, if a root lies on the imaginary axis as far as rounding lets one tell.

    Raises
    ------
    InputError
        `sys` is no linear continuous-time system.

    Notes
    -----
    The phase of ``det K(jw)`` is followed by certified steps [1]_; see the module. The roots themselves are not
    computed.

    References
    ----------
    .. [1] K. Gu, V. L. Kharitonov, J. Chen, "Stability of Time-Delay Systems", Birkhäuser, 2003.
    """
    return count_roots_right_of(sys, 0.0)


def count_roots_right_of(sys: Any, line: float) -> int | None:
    """Count the characteristic roots with real part above `line` (rad/s) by the argument principle.

    As `count_unstable_roots`, with the imaginary axis moved to `line`.
    """
    system = DelaySystem.of(sys, "sys")
    position = validation.number("line", line)
    try:
        return count_right_of(CharacteristicMatrix.of(system.folded), position)
    except ContourError as problem:
        warnings.warn(
            f"roots right of {position:g} not counted: {problem}", UndecidedStabilityWarning, stacklevel=2
        )
        return None


def abscissa_by_counts(K: CharacteristicMatrix, below: float | None, above: float) -> tuple[float, float]:
    """Narrow the largest real part of the roots from both sides by counting.

    Parameters
    ----------
    K : CharacteristicMatrix
        The loop.
    below : float or None
        Real part of a root, so that the abscissa is not smaller; None if no root is known.
    above : float
        A line without roots right of it.

    Returns
    -------
    tuple of float
        The bracket, as narrow as counts of moderate cost make it: roots in a chain can be so close to each other
        that no line passes between them. Its lower end is minus infinity if no root is known and none was met.
    """
    step = 1e-6 * (K.root_bound or 1.0)
    while below is None:
        line = above - step
        try:
            number = count_right_of(K, line, _POINTS_OF_A_TRIAL)
        except (ContourError, InputError):
            return -np.inf, above
        below, above = (line, above) if number else (None, line)
        step *= 1.3
    for _ in range(60):
        if above - below <= _BRACKET * max(abs(below), abs(above)):
            break
        for share in (0.5, 0.4, 0.1, 0.01, 0.001):  # far to the left counts are costly, on a root impossible
            line = above - share * (above - below)
            try:
                number = count_right_of(K, line, _POINTS_OF_A_TRIAL)
            except (ContourError, InputError):
                continue
            below, above = (line, above) if number else (below, line)
            break
        else:
            break
    return below, above


def count_right_of(K: CharacteristicMatrix, line: float = 0.0, most_points: int = _MOST_POINTS) -> int:
    """Count the roots right of a line, or raise `ContourError`."""
    if K.n_states == 0:
        return 0
    moved = K.shifted(line)
    modal = ModalLoop.of(K, line)
    if modal is not None:
        try:
            return _count_in_modes(modal, most_points)
        except ContourError:
            pass  # near a pole, or where modes are no good basis, the matrix itself may still tell
    # any positive number will do where all roots are at zero
    top = moved.root_bound or 1.0
    corner = np.array([1j * top])
    outer_phase = float(
        np.angle(1.0 - np.linalg.eigvals(moved.closed(moved.exponentials(corner)))[0] / corner).sum()
    )
    batch = max(16, _BATCH_NUMBERS // K.n_states**2)
    phase = phase_along_axis(
        lambda lower, upper: _radius(moved, lower, upper, top),
        lambda omega: unit_determinant(moved(1j * omega)),
        top, batch, most_points,
    )  # fmt: skip
    return whole_number(K.n_states / 2.0 + (outer_phase - phase) / np.pi)


def _count_in_modes(loop: ModalLoop, most_points: int) -> int:
    """Poles right of the line plus turns of the return matrix, see `modal_count`."""
    if not loop.certain:
        raise ContourError(0.0, "a pole is too near to the line")
    top = loop.reach
    if top == 0.0:
        return loop.poles_right
    outer_phase = float(np.angle(np.linalg.eigvals(loop.return_matrices(np.array([top])))).sum())
    phase = phase_along_axis(
        lambda lower, upper: _modal_radius(loop, lower, upper, top),
        lambda omega: unit_determinant(loop.return_matrices(omega)),
        top, max(16, _BATCH_NUMBERS // (4 * loop.modes.out.size)), most_points,
    )  # fmt: skip
    return whole_number(loop.poles_right + (outer_phase - phase) / np.pi)


def whole_number(turns: float) -> int:
    """Return the number of roots that the turns of the phase add up to, or raise `ContourError`."""
    count = round(turns)
    if abs(turns - count) > 1e-3 or count < 0:
        raise ContourError(np.nan, f"the phase adds up to {turns:.6g} roots, which is no whole number")
    return count


def phase_along_axis(
    radius_of: Callable[[FloatArray, FloatArray], FloatArray],
    unit_determinant: Callable[[FloatArray], Points],
    top: float,
    batch: int,
    most_points: int,
) -> float:
    """Change of the phase of a determinant from w = 0 to w = `top`; radii bound its change over steps."""
    edges = np.linspace(0.0, top, 17)
    lower, upper = edges[:-1], edges[1:]
    points = [edges]
    evaluated = 0
    while lower.size:
        radius = np.concatenate(
            [radius_of(lower[i : i + batch], upper[i : i + batch]) for i in range(0, lower.size, batch)]
        )
        done = radius <= _RADIUS
        evaluated += lower.size
        points.append(0.5 * (lower + upper)[done])
        parts = np.clip(np.ceil(radius[~done] / (0.7 * _RADIUS)), 2, 8).astype(int)
        if evaluated + parts.sum() > most_points:
            raise ContourError(float(lower[~done][0]), f"more than {most_points} steps would be needed")
        owner, number = numbered(parts)
        width, start = ((upper - lower)[~done] / parts)[owner], lower[~done][owner]
        lower, upper = start + number * width, start + (number + 1) * width
        points.append(lower)
    omega = np.unique(np.concatenate(points))
    phase = np.concatenate([unit_determinant(omega[i : i + batch]) for i in range(0, omega.size, batch)])
    return float(np.angle(phase[1:] / phase[:-1]).sum())


def unit_determinant(matrices: Points) -> Points:
    """Return the phases of determinants, one where they vanish."""
    sign = np.linalg.slogdet(matrices)[0]
    return np.where(sign == 0.0, 1.0, sign)


def _radius(K: CharacteristicMatrix, lower: FloatArray, upper: FloatArray, top: float) -> FloatArray:
    """Bound the spectral radius of X on every step, see `accepted`."""
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    matrices, slopes = K.with_derivative(1j * middle)
    singular = np.linalg.slogdet(matrices)[0] == 0.0
    if np.any(singular):
        # a step may end on a root by chance without the root being its business: move off it
        refuse_narrow(middle[singular], half[singular], 1e-3 * top)
        matrices[singular] += np.eye(K.n_states) * half[singular, None, None] * 1e-3
    inverse = np.linalg.inv(matrices)
    size = np.abs(inverse)
    absolute_A, into, out = K.absolute_parts
    identity = np.eye(K.n_states)
    turn = half[:, None] * K.delays
    uncertain = _ENTRY_UNCERTAINTY * (1.0 + middle[:, None] * K.delays)
    entries = _ENTRY_UNCERTAINTY * (middle[:, None, None] * identity + absolute_A)
    rounding = size @ (entries + (into * uncertain[:, None, :]) @ out)
    # |K(s) - K(s0)| over the step, with |e^{-s tau} - e^{-s0 tau}| <= min(2, tau |s - s0|) on the axis
    all_orders = half[:, None, None] * identity + (into * np.minimum(2.0, turn)[:, None, :]) @ out
    # or the first order itself and the rest, in which nothing cancels
    rest = K.second_order(turn)
    X = np.minimum(size @ all_orders, half[:, None, None] * np.abs(inverse @ slopes) + size @ rest) + rounding
    return accepted(X, rounding, middle, half, 1e-3 * top)


def _modal_radius(loop: ModalLoop, lower: FloatArray, upper: FloatArray, top: float) -> FloatArray:
    """As `_radius`, for the return matrix."""
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    step = loop.step(middle, half)
    usable = step.clear & (np.linalg.slogdet(step.T)[0] != 0.0)
    refuse_narrow(middle[~usable], half[~usable], 1e-3 * top)
    radius = np.full(middle.size, 8.0)
    if np.any(usable):
        T, slope, all_orders, rest, rounding = (part[usable] for part in step[:-1])
        inverse = np.linalg.inv(T)
        size = np.abs(inverse)
        first = half[usable, None, None] * np.abs(inverse @ slope)
        uncertain = size @ rounding
        X = np.minimum(size @ all_orders, first + size @ rest) + uncertain
        radius[usable] = accepted(X, uncertain, middle[usable], half[usable], 1e-3 * top)
    return radius


def accepted(
    X: FloatArray, rounding: FloatArray, middle: FloatArray, half: FloatArray, least: float
) -> FloatArray:
    """Return the spectral radius of every X, or two where the phase could change by half a turn.

    Raises
    ------
    ContourError
        The rounding alone makes the matrix singular as far as can be told.
    """
    limit = perron_bound(rounding)
    if np.any(limit > 0.5 * _RADIUS):
        worst = int(np.argmax(limit))
        raise ContourError(float(middle[worst]), _on_the_line(middle[worst]))
    radius = perron_bound(X)
    refuse_narrow(middle[radius > _RADIUS], half[radius > _RADIUS], least)
    small = np.flatnonzero(radius <= _RADIUS)
    if small.size:
        largest_phase = -np.linalg.slogdet(np.eye(X.shape[-1]) - X[small])[1]
        radius[small[largest_phase > _PHASE]] = 2.0 * _RADIUS
    return radius


def refuse_narrow(middle: FloatArray, half: FloatArray, least: float) -> None:
    """Refuse steps of some roundings of the frequency, or of `least` where that is larger."""
    narrow = half < 4.0 * np.finfo(float).eps * (middle + least)
    if np.any(narrow):
        raise ContourError(float(middle[narrow][0]), _on_the_line(middle[narrow][0]))


def _on_the_line(omega: float) -> str:
    return f"a root lies on the line near {omega:.6g} rad/s, as far as rounding lets one tell"
