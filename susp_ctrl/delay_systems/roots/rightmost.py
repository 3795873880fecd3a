r"""Characteristic roots of a loop with delays: the rightmost ones, or all right of a line.

1. The delayed signals are discretised (`susp_ctrl.delay_systems.approximation.spectral`); the eigenvalues of the
   resulting matrix approximate the roots nearest to the origin and rightmost.
2. Newton on the exact characteristic matrix corrects them; spurious ones are dropped and multiple ones told apart
   (`susp_ctrl.delay_systems.roots.root_refinement`).
3. The number of roots found right of a line is compared with the count of the argument principle there; the
   order is raised until both are equal.

All roots right of a line lie in a known disc [1]_, which gives the first order to try.

References
----------
.. [1] Z. Wu, W. Michiels, "Reliably computing all characteristic roots of delay differential equations in a
   given right half plane using a spectral method", J. Comput. Appl. Math. 236(9), 2012.
"""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.approximation import discretized_matrix
from susp_ctrl.delay_systems.model import CharacteristicMatrix, DelaySystem
from susp_ctrl.delay_systems.roots.argument_principle import ContourError, abscissa_by_counts, count_right_of
from susp_ctrl.delay_systems.roots.modal_count import ModalLoop
from susp_ctrl.delay_systems.roots.root_refinement import RefinedRoots, eigenvalue_uncertainty, refine
from susp_ctrl.errors import InputError

# Largest matrix whose eigenvalues are computed (about a second), and most roots that may be asked for.
_LARGEST_SIZE = 1200
MOST_ROOTS = 1000
_ATTEMPTS = 7
# Points of one count that confirms roots: far to the left, or where signals nearly cancel, it would take millions.
_POINTS_OF_A_CHECK = 100_000
# Angle |s| tau (rad) that the first discretisation resolves at most, where the order is checked afterwards.
FIRST_ANGLE = 150.0


class RootSet(NamedTuple):
    """Roots by descending real part, both of each pair, with what is known about them.

    `residuals` are the last Newton steps, `uncertainties` bound the motion of each root under rounding of the
    data, `complete` tells whether the argument principle confirms that none is missing (None: not asked).
    """

    roots: ComplexArray
    residuals: FloatArray
    uncertainties: FloatArray
    complete: bool | None
    size: int

    @property
    def largest(self) -> bool:
        """Whether the discretisation was as large as is allowed."""
        return self.size > 0.98 * _LARGEST_SIZE

    def first(self, number: int) -> RootSet:
        """Keep the first roots only."""
        return self._replace(
            roots=self.roots[:number],
            residuals=self.residuals[:number],
            uncertainties=self.uncertainties[:number],
        )


def characteristic_roots(
    sys: Any, count: int | None = None, *, right_of: float | None = None
) -> ComplexArray:
    r"""Return the rightmost characteristic roots, or all roots right of a line.

    The roots are the zeros of :math:`\det(sI - A - B_2 E (I - D_{22} E)^{-1} C_2)`, with multiplicity, and
    include those that no delay moves.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The system, with its loops closed.
    count : int, optional
        Number of rightmost roots, at least 1; 8 by default. A complex pair is never split, so one more may be
        returned; fewer if the system has no more roots.
    right_of : float, optional
        Return all roots with real part above this (rad/s) instead.

    Returns
    -------
    ndarray of complex, shape (roots,)
        By descending real part, both roots of each conjugate pair, in rad/s.

    Raises
    ------
    InputError
        Both `count` and `right_of` given; a line so far to the left that more than 1000 roots lie right of it.

    Warns
    -----
    RuntimeWarning
        The argument principle does not confirm that all roots are found.

    Notes
    -----
    Discretisation, Newton on the exact function and a check of completeness, see the module and [1]_.

    References
    ----------
    .. [1] Z. Wu, W. Michiels, J. Comput. Appl. Math. 236(9), 2012.
    """
    K = CharacteristicMatrix.of(DelaySystem.of(sys, "sys").folded)
    if right_of is not None:
        if count is not None:
            raise InputError(f"count = {count} and right_of = {right_of}: only one of them can be given")
        found = roots_right_of(K, validation.number("right_of", right_of))
    else:
        wanted = 8 if count is None else validation.integer("count", count, at_least=1, at_most=MOST_ROOTS)
        found = rightmost_roots(K, wanted)
    if not found.complete:
        warnings.warn(
            f"characteristic roots may be missing: the argument principle does not confirm the "
            f"{found.roots.size} found",
            RuntimeWarning,
            stacklevel=2,
        )
    return found.roots


def spectral_abscissa(sys: Any) -> float:
    """Return the largest real part of the characteristic roots (rad/s); minus infinity without any root.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The system, with its loops closed.

    Returns
    -------
    float
        Where the rightmost root is one of many with the same real part to many digits, the bound that counts by the
        argument principle give.
    """
    K = CharacteristicMatrix.of(DelaySystem.of(sys, "sys").folded)
    found = rightmost_roots(K, 1)
    if K.n_states == 0:
        return -np.inf
    largest = float(found.roots[0].real) if found.roots.size else -np.inf
    if found.complete:
        return largest
    beyond = max(largest, 0.0) + K.root_bound
    below, above = abscissa_by_counts(K, largest if found.roots.size else None, beyond)
    if not above - below <= 1e-4 * max(abs(below), abs(above)):
        warnings.warn(
            f"spectral abscissa {largest:g} is a lower bound: the argument principle does not confirm it",
            RuntimeWarning,
            stacklevel=2,
        )
        return largest
    return above


def rightmost_roots(K: CharacteristicMatrix, count: int) -> RootSet:
    """Return at least `count` rightmost roots, pairs complete.

    They are compared with the argument principle, and the order is raised until both agree.
    """
    if K.n_channels == 0:
        return _without_delay(K, count)
    # rightmost roots of a loop with long delays are slow ones: try those first
    longest = float(K.delays.max())
    radius = max(min(reach_near_axis(K), FIRST_ANGLE / longest), 1.6 * count / longest)
    margin = 4
    best = _nothing()
    unconfirmed = best.roots
    for _ in range(_ATTEMPTS):
        eigenvalues, size = _eigenvalues(K, radius)
        found = _all_of(refine(K, _rightmost_starts(eigenvalues, count + margin, radius)), size)
        confirmed = _confirmed(K, found, count)
        if confirmed:
            return found.first(pairs_whole(found, count))._replace(complete=True)
        best = max(found, best, key=lambda candidate: min(candidate.roots.size, count))
        if found.largest:
            break
        if confirmed is None:  # a higher order is worth trying only as long as it finds other roots
            if unconfirmed.size and np.allclose(found.roots[:count], unconfirmed, rtol=1e-6):
                break
            unconfirmed = found.roots[:count]
        radius, margin = 1.8 * radius, 2 * margin
    return best.first(pairs_whole(best, count))._replace(complete=False)


def reach_near_axis(K: CharacteristicMatrix) -> float:
    """Modulus within which the roots in the right half plane lie, and those a little left of the axis."""
    margin = 1.0 / float(K.delays.max())
    modal = ModalLoop.of(K, -margin)
    if modal is not None:
        return modal.reach + margin
    return min(K.root_bound, K.shifted(-margin).right_reach + margin)


def roots_near_axis(K: CharacteristicMatrix, count: int, radius: float) -> RootSet:
    """Return the rightmost and all unstable roots that a discretisation up to |s| of about `radius` leads to.

    At least `count` starts are refined, and all that may be unstable. Nothing tells whether a root is missing.
    """
    if K.n_channels == 0:
        return _without_delay(K, K.n_states)
    resolved = max(radius, 1.6 * count / float(K.delays.max()))
    eigenvalues, size = _eigenvalues(K, resolved)
    unstable = int(np.sum(eigenvalues.real > -1e-3 * np.abs(eigenvalues)))
    starts = _rightmost_starts(eigenvalues, max(count, unstable) + 4, resolved)
    return _all_of(refine(K, starts), size)


def probable_roots(K: CharacteristicMatrix, count: int) -> ComplexArray:
    """Return about `count` rightmost roots as hints where peaks may be: exact, but some may be missing."""
    if K.n_channels == 0:
        return _without_delay(K, count).roots
    return roots_near_axis(K, count, min(reach_near_axis(K), FIRST_ANGLE / float(K.delays.max()))).roots


def roots_right_of(K: CharacteristicMatrix, line: float) -> RootSet:
    """Return all roots with real part above `line`."""
    if K.n_channels == 0:
        found = _without_delay(K, K.n_states)
        return found.first(int(np.sum(found.roots.real > line)))
    if line > K.root_bound:
        return _nothing()._replace(complete=True)
    used, wanted = _count_near(K, line)
    if wanted is not None and wanted > MOST_ROOTS:
        raise InputError(
            f"right_of = {line:g} is not allowed: {wanted} roots lie there, at most {MOST_ROOTS} may"
        )
    # a chain of roots is spaced by 2 pi/tau in both half planes
    chain = 3.2 * (wanted or 0) / float(K.delays.max())
    radius = min(K.shifted(used).right_reach + abs(used), 2.0 * K.root_bound + chain)
    found = _nothing()
    for attempt in range(_ATTEMPTS):
        eigenvalues, size = _eigenvalues(K, radius)
        reach = used - 0.1 * (abs(used) + 1.0 / float(K.delays.max()))
        number = max(int(np.sum(eigenvalues.real > reach)), wanted or 0) + 4 * (attempt + 1)
        found = _all_of(refine(K, _rightmost_starts(eigenvalues, number, radius)), size)
        inside = int(np.sum(found.roots.real > used))
        if inside == wanted:
            return found.first(int(np.sum(found.roots.real > line)))._replace(complete=True)
        if found.largest:
            break
        radius *= 1.6
    return found.first(int(np.sum(found.roots.real > line)))._replace(complete=False)


def _nothing() -> RootSet:
    return RootSet(np.zeros(0, dtype=complex), np.zeros(0), np.zeros(0), None, 0)


def _eigenvalues(K: CharacteristicMatrix, radius: float) -> tuple[ComplexArray, int]:
    """Eigenvalues of the discretisation that resolves e^{-s tau} for |s| up to `radius`, and its size."""
    M = discretized_matrix(K, radius, _LARGEST_SIZE)
    return np.linalg.eigvals(M).astype(complex), M.shape[0]


def _rightmost_starts(eigenvalues: ComplexArray, count: int, resolved: float = np.inf) -> ComplexArray:
    """The eigenvalues in the closed upper half plane that stand for the `count` rightmost ones.

    Those beyond the modulus that is resolved may be spurious; as many rightmost ones within it are taken besides.
    """
    upper = eigenvalues[eigenvalues.imag >= 0.0]
    upper = upper[np.argsort(-upper.real)]
    within = np.abs(upper) <= resolved
    stands_for = np.where(upper.imag > 0.0, 2, 1)
    taken = np.cumsum(stands_for) - stands_for < count
    taken |= within & (np.cumsum(stands_for * within) - stands_for * within < count)
    return upper[taken]


def _all_of(refined: RefinedRoots, size: int) -> RootSet:
    """Add the conjugates and sort by descending real part."""
    upper = refined.roots.imag > 0.0
    roots = np.concatenate([refined.roots, refined.roots[upper].conj()])
    residuals = np.concatenate([refined.residuals, refined.residuals[upper]])
    uncertainties = np.concatenate([refined.uncertainties, refined.uncertainties[upper]])
    order = np.lexsort((-roots.imag, np.abs(roots.imag), -roots.real))
    return RootSet(roots[order], residuals[order], uncertainties[order], None, size)


def pairs_whole(found: RootSet, count: int) -> int:
    """Where the first `count` roots end without splitting a pair."""
    if found.roots.size < count:
        return found.roots.size
    return count + int(found.roots[count - 1].imag > 0.0)


def is_complete(K: CharacteristicMatrix, found: RootSet, count: int) -> bool:
    """Tell whether the argument principle confirms the first `count` roots, by a line in a gap after them.

    The first gap is tried and the widest of the next few: between the members of a cluster nothing can be counted.
    """
    return _confirmed(K, found, count) is True


def _confirmed(K: CharacteristicMatrix, found: RootSet, count: int) -> bool | None:
    """As `is_complete`; None where no line can be counted at."""
    if found.roots.size < count:
        return False
    answers = []
    for number, line in _gaps(K, found, count):
        try:
            answers.append(count_right_of(K, line, _POINTS_OF_A_CHECK) == number)
        except (ContourError, InputError):  # on a root, or so far left that e^{-s tau} has no digits
            continue
        if answers[-1]:
            return True
    return False if answers else None


def _gaps(K: CharacteristicMatrix, found: RootSet, count: int) -> list[tuple[int, float]]:
    """Numbers of roots and lines right of which just these were found."""
    roots, error = found.roots, np.maximum(found.uncertainties, found.residuals)
    end = pairs_whole(found, count)
    # further left e^{-s tau} grows, and the count becomes costly without being any safer
    furthest = 1.0 / float(K.delays.max()) if K.n_channels else np.inf
    if end == roots.size:
        size = np.abs(roots[-1]) or min(furthest, K.root_bound or 1.0)
        return [(end, float(roots[-1].real - min(0.05 * size, furthest) - 10.0 * error[-1]))]
    gap = roots.real[end - 1 : -1] - roots.real[end:]
    certain = 10.0 * (error[end - 1 : -1] + error[end:]) + 1e-9 * np.abs(roots.real[end:])
    open_ = np.flatnonzero(gap > certain)
    if open_.size == 0:
        return []
    near = open_[open_ < open_[0] + 12]
    chosen = dict.fromkeys([int(open_[0]), int(near[np.argmax(gap[near])])])
    return [
        (end + k, float(roots[end + k - 1].real - min(0.5 * gap[k], furthest + 10.0 * error[end + k - 1])))
        for k in chosen
    ]


def _count_near(K: CharacteristicMatrix, line: float) -> tuple[float, int | None]:
    """Count right of `line`, moved a little to the left where a root lies on it."""
    size = abs(line) + min(1e-3 * K.root_bound, 1.0 / float(K.delays.max()))
    for shift in (0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-3):
        moved = line - shift * size
        try:
            return moved, count_right_of(K, moved)
        except ContourError:
            continue
    return line, None


def _without_delay(K: CharacteristicMatrix, count: int) -> RootSet:
    """The rightmost eigenvalues of A: no delay moves any root."""
    if K.n_states == 0:
        return _nothing()._replace(complete=True)
    bare = CharacteristicMatrix(K.A, K.B[:, :0], K.C[:0], K.D[:0, :0], K.delays[:0])
    eigenvalues = np.linalg.eigvals(K.A).astype(complex)
    upper = eigenvalues[eigenvalues.imag >= 0.0]
    found = _all_of(refine(bare, upper), K.n_states)
    if found.roots.size != K.n_states:
        error = eigenvalue_uncertainty(bare, upper)
        found = _all_of(RefinedRoots(upper, np.zeros(upper.size), error), K.n_states)
    return found.first(pairs_whole(found, count))._replace(complete=True)
