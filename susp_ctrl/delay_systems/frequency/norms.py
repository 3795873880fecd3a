r"""Norms of stable systems with exact delays: H2, H-infinity, and the RMS of outputs under noise.

Nothing is approximated but integrals and maxima, and those to a stated tolerance: the H-infinity norm comes from a
branch-and-bound search over frequency in which an interval is dropped only when a bound proves that the peak is
not in it; the H2 norm from adaptive quadrature with the high-frequency part in closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.frequency.adaptive_quadrature import integrate
from susp_ctrl.delay_systems.frequency.high_frequency import leading_terms, squared_tail
from susp_ctrl.delay_systems.frequency.response_bounds import in_even_units, local_response, tail_bound
from susp_ctrl.delay_systems.model import CharacteristicMatrix, DelaySystem, FoldedLoop, around_resonances
from susp_ctrl.delay_systems.roots import probable_roots
from susp_ctrl.delay_systems.verdict import stability
from susp_ctrl.errors import InputError, TooMuchWorkError, UnstableSystemError

_MOST_INTERVALS = 1_000_000
_BATCH = 1024


def hinf_norm(sys: Any, tolerance: float = 1e-8) -> tuple[float, float]:
    r"""Return the H-infinity norm and the frequency where it is reached.

    .. math:: \|H\|_\infty = \sup_\omega \sigma_{max}(H(j\omega))

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        A stable system.
    tolerance : float, optional
        No frequency has a gain larger than the norm returned by more than this fraction.

    Returns
    -------
    norm : float
        The norm.
    peak_omega : float
        Frequency of the peak (rad/s); infinite if it is only approached at high frequency.

    Raises
    ------
    UnstableSystemError
        The system is not proven stable.
    InputError
        The search does not end: a peak at high frequency made by several delays that pass directly, or a
        response that is flat to `tolerance` over a long band.

    Notes
    -----
    On an interval the response is its linear expansion about the centre plus a remainder with a bound entry by
    entry. The largest singular value of the expansion is convex, so its ends bound it. Beyond the last interval
    the response is bounded by its direct part and ``1/omega``.
    """
    relative = validation.number("tolerance", tolerance, at_least=1e-12, below=1.0)
    system = _proven_stable(sys, "H-infinity norm")
    if system.ninputs == 0 or system.noutputs == 0:
        return 0.0, 0.0
    loop = in_even_units(system.folded)
    tail = tail_bound(loop)
    scale = _frequency_scale(loop)
    best, peak = (tail.undelayed, np.inf) if tail.undelayed == tail.direct else (0.0, 0.0)
    for omega in (0.0, *np.geomspace(1e-3 * scale, 10.0 * scale, 60)):
        value = _gain(system, omega)
        if value > best:
            best, peak = value, float(omega)
    low, high = 0.0, 0.0
    while tail.at(high) > best * (1.0 + relative):
        low, high = high, max(3.0 * high, 2.0 * scale)
        if high > 1e12 * scale:
            raise InputError(
                f"sys has a peak at high frequency that is not found (between {best:.10g} and {tail.direct:.10g}): "
                "several delays pass directly from input to output"
            )
        best, peak = _search(system, loop, low, high, best, peak, relative)
    return best, peak


def _search(
    system: DelaySystem, loop: FoldedLoop, low: float, high: float, best: float, peak: float, relative: float
) -> tuple[float, float]:
    """Raise `best` to the maximum on [low, high] by branch and bound."""
    edges = np.linspace(low, high, 65)
    waiting = np.array([0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)])
    examined = 0
    while waiting.size:
        (centre, half), waiting = waiting[:, -_BATCH:], waiting[:, :-_BATCH]
        examined += centre.size
        if examined > _MOST_INTERVALS:
            raise InputError(
                "sys has a response too flat or too fast for a proof of its peak to this tolerance"
            )
        local = local_response(loop, centre, half)
        values = np.linalg.norm(local.value, 2, axis=(1, 2))
        top = int(np.argmax(values))
        if values[top] > best:
            best, peak = _climb(system, float(centre[top]), float(half[top]), float(values[top]))
        remaining = local.upper_bound(half) > best * (1.0 + relative)
        centre, half = centre[remaining], 0.5 * half[remaining]
        halves = np.array([np.concatenate([centre - half, centre + half]), np.concatenate([half, half])])
        waiting = np.concatenate([waiting, halves], axis=1)
    return best, peak


def _climb(system: DelaySystem, centre: float, half: float, value: float) -> tuple[float, float]:
    """Go up from a sample: a better lower bound drops more intervals."""
    found = minimize_scalar(
        lambda w: -_gain(system, abs(w)),
        bounds=(max(centre - half, 0.0), centre + half),
        method="bounded",
        options={"xatol": 1e-9 * (centre + half)},
    )
    return (float(-found.fun), float(found.x)) if -found.fun > value else (value, centre)


def h2_norm(sys: Any, tolerance: float = 1e-9) -> float:
    r"""Return the H2 norm.

    .. math:: \|H\|_2^2 = \frac{1}{\pi} \int_0^\infty \|H(j\omega)\|_F^2 \, d\omega

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        A stable system.
    tolerance : float, optional
        Relative accuracy.

    Returns
    -------
    float
        Infinite if an input passes directly to an output, delayed or not.

    Raises
    ------
    UnstableSystemError
        The system is not proven stable.
    TooMuchWorkError
        The tolerance is not reached in bounded work: long delays and fast poles together.

    Notes
    -----
    At high frequency H is a series in ``1/(j omega)`` whose coefficients are sums of delayed constants; the tail of
    its square is a sum of sine and cosine integrals. The rest is integrated adaptively; the band is widened until the
    norm no longer changes.

    References
    ----------
    .. [1] E. Jarlebring, J. Vanbiervliet, W. Michiels, "Characterizing and computing the H2 norm of time-delay
       systems by solving the delay Lyapunov equation", IEEE Trans. Automatic Control 56(4), 2011.
    """
    relative = validation.number("tolerance", tolerance, at_least=1e-12, below=1.0)
    system = _proven_stable(sys, "H2 norm")
    loop = system.folded
    direct, terms = leading_terms(loop)
    if any(np.any(matrix != 0.0) for matrix in direct.values()):
        return np.inf

    def power(omega: FloatArray) -> FloatArray:
        return np.asarray((np.abs(system(1j * omega, squeeze=False)) ** 2).sum(axis=(0, 1)))

    edge, knots = 30.0 * _frequency_scale(loop), _knots(system)
    # of the square, and a third of what is asked: the tail and the band share the rest
    part = relative / 3.0
    body = float(_integral(power, 0.0, edge, part, knots))
    previous, change = np.inf, np.inf
    for _ in range(12):
        # what the closed form leaves out falls with the fifth power of the edge, by 32 at every doubling
        total = body + squared_tail(terms, edge)
        before, change = change, abs(total - previous)
        # what is left out oscillates with the delays: one change alone can be small by chance
        if change <= relative * total and before <= 10.0 * relative * total:
            break
        previous = total
        body += float(_integral(power, edge, 2.0 * edge, part, knots, scale=body))
        edge *= 2.0
    return float(np.sqrt(total / np.pi))


def output_rms(
    sys: Any,
    psd: Callable[[FloatArray], Any] | Mapping[str, Callable[[FloatArray], Any]],
    omega_range: tuple[float, float],
    tolerance: float = 1e-8,
) -> FloatArray:
    r"""Return the stationary RMS of every output under noise inputs of given power spectral density.

    .. math:: \sigma_i^2 = \int_{\omega_1}^{\omega_2} \sum_j |H_{ij}(j\omega)|^2 S_j(\omega) \, d\omega

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        A stable system.
    psd : callable or mapping name -> callable
        One-sided density of the input over angular frequency (unit squared per rad/s), ``omega -> (n,)``. One
        callable is for a system with one input; in a mapping inputs that are missing are at rest, and those
        given are independent of each other.
    omega_range : (float, float)
        Band (rad/s).
    tolerance : float, optional
        Relative accuracy of each mean square.

    Returns
    -------
    ndarray, shape (n_outputs,)
        Unit of each output.

    Raises
    ------
    UnstableSystemError
        The system is not proven stable.
    InputError
        An unknown input, an empty band, a density that is negative or not finite.

    Notes
    -----
    Inputs that repeat one another later are one input and a delay: for two wheels over one road multiply the
    system by ``append(1, delay(lag)) * [[1], [1]]``.
    """
    relative = validation.number("tolerance", tolerance, at_least=1e-12, below=1.0)
    limits = validation.increasing("omega_range", omega_range, at_least=0.0)
    if limits.size != 2:
        raise InputError(f"omega_range = {omega_range!r} is not allowed: two frequencies are needed")
    system = _proven_stable(sys, "RMS")
    if callable(psd):
        if system.ninputs != 1:
            raise InputError(
                f"psd is one function for {system.ninputs} inputs: a mapping by input name is needed"
            )
        densities = {0: psd}
    else:
        densities = {
            validation.signal_index("psd", name, system.input_labels): f
            for name, f in validation.mapping("psd", psd).items()
        }

    def power(omega: FloatArray) -> FloatArray:
        gains = np.abs(system(1j * omega, squeeze=False)) ** 2
        total = np.zeros((gains.shape[0], omega.size))
        for j, density in densities.items():
            S = np.broadcast_to(
                validation.array("what psd returns", density(omega), finite=False), omega.shape
            )
            if not np.all(np.isfinite(S)) or np.any(S < 0.0):
                raise InputError(f"psd of {system.input_labels[j]} is negative or not finite in omega_range")
            total += gains[:, j] * S
        return total

    low, high = float(limits[0]), float(limits[1])
    knots = np.concatenate([_knots(system), np.geomspace(low, high, 20)[1:-1] if low > 0.0 else []])
    return np.sqrt(_integral(power, low, high, relative, knots))


def _integral(
    function: Callable[[FloatArray], FloatArray],
    low: float,
    high: float,
    relative: float,
    knots: FloatArray,
    scale: float = 0.0,
) -> FloatArray:
    found = integrate(function, low, high, relative, knots, scale)
    if np.any(found.relative_error > relative):
        raise TooMuchWorkError(
            f"tolerance = {relative:.3g} of the integral over {low:.3g} to {high:.3g} rad/s is not reached in bounded "
            f"work (estimate {float(np.max(found.relative_error)):.3g}): a larger tolerance is needed"
        )
    return found.value


def _proven_stable(sys: Any, what: str) -> DelaySystem:
    system = DelaySystem.of(sys, "sys")
    verdict = stability(system)
    if verdict.stable is not True:
        known = "is unstable" if verdict.stable is False else "is not proven stable"
        raise UnstableSystemError(
            f"sys {known}: the {what} exists only for stable systems ({verdict.reason})"
        )
    return system


def _knots(system: DelaySystem) -> FloatArray:
    """Where the integrand has its peaks: quadrature must not step over them."""
    roots = probable_roots(CharacteristicMatrix.of(system.folded), 12)
    upper = roots[roots.imag >= 0.0]
    # beyond, by decades: a slow pole's flank reaches up to the fast ones
    offsets = np.append([1.0, 3.0], 10.0 ** np.arange(1.0, 17.0))
    offsets = np.concatenate([-offsets[:5], [0.0], offsets])
    points = around_resonances(upper, offsets)
    return np.unique(points[(points > 0.0) & (points < 30.0 * _frequency_scale(system.folded))])


def _frequency_scale(loop: FoldedLoop) -> float:
    """Size of the frequencies at which something happens (rad/s)."""
    sizes = np.abs(loop.plant.eigenvalues)
    slowest_turn = 1.0 / loop.delays.max() if loop.delays.size else 0.0
    return float(max(np.max(sizes, initial=0.0), slowest_turn)) or 1.0


def _gain(system: DelaySystem, omega: float) -> float:
    return float(np.linalg.norm(system(np.array([1j * omega]), squeeze=False)[:, :, 0], 2))
