r"""Stability for every delay: the small-gain test, and the exact one on the torus.

On the imaginary axis ``E = diag(z_k)`` with ``|z_k| = 1``, and with free delays every such E occurs at every
frequency. A loop that is stable without delays is therefore stable for all delays exactly if

.. math:: \mu(\omega) = \max_{|z_k| = 1} \rho\bigl(P_{22}(j\omega)\,\mathrm{diag}(z_k)\bigr) < 1
    \quad\text{for all } \omega,

because mu tends to zero for a retarded loop and a root crosses where it passes through one. For one delay it is
the spectral radius, for two scalar channels a closed form (`structured_gain`). In general it is bounded from
above by the small-gain value

.. math:: \rho(|P_{22}(j\omega)|) ,

and from below by phases that are found. All are proportional to a common factor of the gains, so delay
independence is lost at the factor ``1 / sup mu``.

References
----------
.. [1] J. Chen, H. A. Latchman, "Frequency sweeping tests for stability independent of delay", IEEE Trans.
   Automatic Control 40(9), 1995.
.. [2] J. C. Doyle, "Analysis of feedback systems with structured uncertainties", IEE Proc. D 129, 1982.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import elementwise

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.crossings.delay_line import DelayLine
from susp_ctrl.delay_systems.crossings.small_gain import frequency_bound, small_gain_bands
from susp_ctrl.delay_systems.crossings.torus import structured_gain
from susp_ctrl.delay_systems.model import (
    CharacteristicMatrix,
    DelaySystem,
    Realization,
    eigenvalues_with_uncertainty,
    perron_bound,
)
from susp_ctrl.delay_systems.roots import count_unstable_roots
from susp_ctrl.errors import UndecidedStabilityWarning

# A supremum this near to one cannot be told from one.
_RESOLUTION = 1e-9


@dataclass(frozen=True, eq=False)
class DelayIndependence:
    """Whether a loop is stable for every combination of its delays.

    Attributes
    ----------
    stable : bool or None
        True: proven. False: some delays destabilise it (or it is unstable without delays). None: the sufficient
        test fails and no destabilising delays were found.
    margin : float
        Factor on all gains at which delay independence is lost; where `exact` is False a lower bound of it.
        Zero if the plant itself is not stable.
    omega : float
        Frequency (rad/s) of the largest value, where the gains reach their limit first; nan without delayed
        signals in the loop.
    small_gain : float
        ``sup_w rho(|P22(jw)| diag|g|)``, the sufficient value.
    small_gain_omega : float
        Its frequency (rad/s).
    exact : bool
        Whether `margin` is the exact limit and not only a bound.
    destabilising_delays : ndarray or None
        Delays (s), one per delay of the system, for which unstable roots were counted.
    message : str
        How it was decided.
    """

    stable: bool | None
    margin: float
    omega: float
    small_gain: float
    small_gain_omega: float
    exact: bool
    destabilising_delays: FloatArray | None
    message: str

    def __bool__(self) -> bool:
        raise TypeError("a verdict is True, False or None: ask .stable")

    def __str__(self) -> str:
        said = {True: "stable for all delays", False: "not stable for all delays", None: "not decided"}[
            self.stable
        ]
        lines = [
            f"Delay-independent stability: {said} ({self.message})",
            f"  lost at {self.margin:.6g} times the gains ({'exact' if self.exact else 'lower bound'}), "
            f"at {self.omega:.6g} rad/s",
            f"  small gain: {self.small_gain:.6g} at {self.small_gain_omega:.6g} rad/s",
        ]
        if self.destabilising_delays is not None:
            lines.append(
                f"  unstable for delays {', '.join(f'{d:.6g}' for d in self.destabilising_delays)} s"
            )
        return "\n".join(lines)

    __repr__ = __str__


def delay_independent_stability(sys: Any) -> DelayIndependence:
    r"""Test whether a loop is stable for every combination of its delays.

    .. math:: \sup_\omega \max_{|z_k|=1} \rho\bigl(P_{22}(j\omega)\,\mathrm{diag}(g_k z_k)\bigr) < 1

    Parameters
    ----------
    sys : DelayLTI
        The system with its loops closed. Its delays are free, those that are zero now too; its gains count.

    Returns
    -------
    DelayIndependence
        ``.stable`` True, False or None, ``.margin`` (gain factor), ``.omega``.

    Raises
    ------
    InputError
        `sys` is no linear continuous-time system.
    NeutralLoopError
        A loop that is neutral once its delays are positive.

    Notes
    -----
    Exact for one delay (on any number of signals) and for two scalar channels; sufficient for others, where a
    failed test is followed by a search for delays that destabilise the loop.
    """
    system = DelaySystem.of(sys, "sys")
    n = system.delays.size
    loop, number = _free_loop(system)
    owner = np.unique(number, return_inverse=True)[1]
    small, small_omega = supremum(loop, _small_gain)
    largest, omega, exact = small, small_omega, np.unique(owner).size == 1 or loop.n_channels <= 2
    exact_value = _spectral_radius if np.unique(owner).size == 1 else structured_gain
    if exact and loop.n_channels:
        largest, omega = supremum(loop, exact_value)
    plant_stable = _stable(*eigenvalues_with_uncertainty(loop.A))
    limit = 1.0 / largest if largest else np.inf

    def verdict(stable: bool | None, delays: FloatArray | None, message: str) -> DelayIndependence:
        factor, sure = (limit, exact) if plant_stable else (0.0, True)
        at, below, below_at = float(omega), float(small), float(small_omega)
        return DelayIndependence(stable, float(factor), at, below, below_at, bool(sure), delays, message)

    if not _stable(*loop.undelayed_eigenvalues()):
        return verdict(False, np.zeros(n), "it is not stable without delays")
    if loop.n_channels == 0:
        return verdict(True, None, "no delay acts in a loop")
    if plant_stable:
        if small < 1.0 - _RESOLUTION:
            return verdict(True, None, "small gain at every frequency")
        if exact and largest < 1.0 - _RESOLUTION:
            return verdict(True, None, "exact test")
        if exact and largest <= 1.0 + _RESOLUTION:
            if omega == 0.0 and largest <= 1.0 + 1e-13 and not _reached_again(loop, exact_value):
                return verdict(True, None, "exact test; its limit one is reached at zero frequency only")
            return verdict(None, None, "on the limit as far as can be told")
    delays = _destabilising_delays(system, loop, owner)
    if delays is not None:
        return verdict(False, delays, "unstable roots counted at the delays given")
    if exact or not plant_stable:
        return verdict(False, None, "exact test")
    return verdict(None, None, "small gain fails, and no destabilising delays were found")


def small_gain_supremum(plant: Realization, gains: ArrayLike) -> tuple[float, float]:
    r"""Return ``sup_w rho(|P22(jw)| diag|g|)`` and its frequency: below one, every pair of delays is harmless.

    Parameters
    ----------
    plant : Realization
        The undelayed plant, as from `loop_plant`; A must be stable.
    gains : array_like, shape (channels,)
        Largest gain of each delayed signal.

    Returns
    -------
    tuple of float
        The supremum, and where it is attained (rad/s).
    """
    g = np.abs(validation.vector("gains", gains, size=plant.n_channels))
    sys = DelaySystem(plant, np.ones(g.size), g)
    loop, _ = _free_loop(sys)
    return supremum(loop, _small_gain)


def small_gain_of_samples(p22: ComplexArray, gains: ArrayLike) -> FloatArray:
    """Return ``max over the samples of rho(|P22| diag|g|)`` for many sets of gains at once.

    Parameters
    ----------
    p22 : ndarray of complex, shape (frequencies, channels, channels)
        Samples as from `sample_plant`; the maximum is only over them.
    gains : array_like, shape (..., channels)

    Returns
    -------
    ndarray, shape (...)
    """
    g = np.abs(np.asarray(gains, dtype=float))
    return perron_bound(np.abs(p22) * g[..., None, None, :]).max(axis=-1)


def supremum(loop: CharacteristicMatrix, value: Callable[[ComplexArray], FloatArray]) -> tuple[float, float]:
    """Return the supremum over ``w >= 0`` of a value of P22(jw) that is at most ``rho(|P22|)``, and where it is.

    The frequencies are those that cannot be excluded by bounds on the change of P, each interval narrow against
    the distance to the nearest pole; the local maxima are then refined on the exact function.
    """
    if loop.n_channels == 0 or loop.n_states == 0:
        return 0.0, float("nan")
    at = _value_at(loop, value)
    omega, values = _samples(loop, at)
    top = float(values.max())
    if not np.isfinite(top) or top > 1e12:
        return float("inf"), float(omega[np.argmax(values)])
    if top == 0.0:
        return 0.0, 0.0
    candidates, sizes = _peaks(at, omega, values)
    best = int(np.argmax(sizes))
    at_zero = float(at(np.zeros(1))[0])
    if at_zero >= sizes[best] * (1.0 - 1e-13):
        return at_zero, 0.0
    return float(sizes[best]), float(candidates[best])


def _value_at(
    loop: CharacteristicMatrix, value: Callable[[ComplexArray], FloatArray]
) -> Callable[[FloatArray], FloatArray]:
    """Return the value of P22(jw) as a function of w; infinite at a pole."""

    def at(omega: FloatArray) -> FloatArray:
        P = loop.response(omega)
        with np.errstate(all="ignore"):
            values = value(np.where(np.isfinite(P), P, 1e150))
        return np.where(np.isfinite(values), values, np.inf)

    return at


def _samples(
    loop: CharacteristicMatrix, at: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return frequencies among which no maximum is missed, and the values there."""
    poles = np.linalg.eigvals(loop.A)
    start = np.unique(np.concatenate([[0.0], np.abs(poles.imag), np.abs(poles)]))
    values = at(start)
    first = float(values.max())
    if not 0.0 < first <= 1e12:
        return start, values
    bands = small_gain_bands(loop, margin=1.0 / (0.999 * first))
    order = np.argsort(bands.centre)
    centre, half = bands.centre[order, None], bands.half[order, None]
    omega = np.unique(np.concatenate([(centre + half * np.linspace(-1.0, 1.0, 9)).ravel(), start]))
    omega = omega[omega >= 0.0]
    return omega, at(omega)


def _peaks(
    at: Callable[[FloatArray], FloatArray], omega: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the local maxima that are within two percent of the largest, refined, and the values there."""
    peak = np.flatnonzero(
        (values >= np.append(-np.inf, values[:-1])) & (values >= np.append(values[1:], -np.inf))
        & (values > 0.98 * values.max())
    )  # fmt: skip
    low, high = omega[np.maximum(peak - 1, 0)], omega[np.minimum(peak + 1, omega.size - 1)]
    inside = (low < omega[peak]) & (omega[peak] < high)
    bracket = low[inside], omega[peak][inside], high[inside]
    minimum = elementwise.find_minimum(lambda w: -at(w), bracket, tolerances={"xrtol": 1e-9})
    found = minimum.x[minimum.success]
    candidates = np.concatenate([found, omega[peak]])
    return candidates, at(candidates)


def _reached_again(loop: CharacteristicMatrix, value: Callable[[ComplexArray], FloatArray]) -> bool:
    """Tell whether a value that is one at zero frequency comes back to one, as far as can be told, elsewhere."""
    at = _value_at(loop, value)
    omega, values = _samples(loop, at)
    candidates, sizes = _peaks(at, omega, values)
    tied = candidates[sizes > 1.0 - _RESOLUTION]
    # A tie that is no part of the maximum at zero has lower values before it.
    lower = omega[values < 1.0 - 2.0 * _RESOLUTION]
    return bool(lower.size and np.any(tied > lower.min()))


def _small_gain(P: ComplexArray) -> FloatArray:
    """Return ``rho(|P|)`` itself: its bound, in closed form for two channels, is some percent too large for many."""
    return perron_bound(np.abs(P)) if P.shape[-1] <= 2 else _spectral_radius(np.abs(P))


def _spectral_radius(P: ComplexArray | FloatArray) -> FloatArray:
    if P.shape[-1] == 1:
        return np.abs(P[..., 0, 0])
    return np.abs(np.linalg.eigvals(P)).max(axis=-1)


def _free_loop(system: DelaySystem) -> tuple[CharacteristicMatrix, np.ndarray]:
    """Return the channels in loops, all delays being free, and the number of the delay of each channel."""
    n = system.delays.size
    # A direction of its own for each delay keeps them apart, and marks the channels.
    line = DelayLine.of(system.with_delays(np.ones(n)), np.arange(1.0, n + 1.0), np.zeros(n), 1.0)
    return line.matrices, np.rint(line.direction).astype(int) - 1


def _stable(poles: np.ndarray, uncertain: FloatArray) -> bool:
    return bool(np.all(poles.real < -uncertain))


def _destabilising_delays(
    system: DelaySystem, loop: CharacteristicMatrix, owner: np.ndarray
) -> FloatArray | None:
    """Search phases that give a spectral radius above one, and count roots at delays that realise them.

    The phases are turned until the largest eigenvalue is real: then some smaller common gain puts a root on the
    axis, and at the full gain it lies to the right for suitable delays. The smallest delays come first.
    """
    top = frequency_bound(loop)
    poles = np.linalg.eigvals(loop.A)
    frequencies = np.unique(
        np.concatenate([np.geomspace(1e-3 * top, top, 60), np.abs(poles), np.abs(poles.imag)])
    )
    P = loop.response(frequencies)
    usable = (frequencies > 1e-6 * top) & np.all(np.isfinite(P), axis=(1, 2))
    usable &= perron_bound(np.where(usable[:, None, None], np.abs(P), 0.0)) > 1.0
    frequencies, P = frequencies[usable], P[usable]
    if frequencies.size == 0:
        return None
    rng = np.random.default_rng(0)
    phases = rng.uniform(0.0, 2.0 * np.pi, (32, len(P), int(owner.max()) + 1))

    def eigenvalues(angles: FloatArray) -> ComplexArray:
        values = np.linalg.eigvals(P * np.exp(-1j * angles[..., owner])[..., None, :])
        pick = np.argmax(np.abs(values), axis=-1)
        return np.take_along_axis(values, pick[..., None], axis=-1)[..., 0]

    best = np.abs(eigenvalues(phases))
    for width in np.geomspace(1.5, 0.05, 12):
        trial = phases + width * rng.standard_normal(phases.shape)
        value = np.abs(eigenvalues(trial))
        better = value > best
        phases[better], best[better] = trial[better], value[better]
    winner = np.argmax(best, axis=0)
    largest = np.take_along_axis(eigenvalues(phases), winner[None], axis=0)[0]
    angle = np.mod(phases[winner, np.arange(len(P))] + np.angle(largest)[:, None], 2.0 * np.pi)
    delays_of_block = angle / frequencies[:, None]
    above = np.flatnonzero(np.abs(largest) > 1.0)
    block_of_delay = _block_of_delay(system)
    for k in above[np.argsort(delays_of_block[above].max(axis=1))][:24]:
        delays = np.append(delays_of_block[k], 0.0)[block_of_delay]
        for turns in (0.0, 2.0 * np.pi / frequencies[k]):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UndecidedStabilityWarning)
                trial_delays = np.where(block_of_delay >= 0, delays + turns, 0.0)
                if count_unstable_roots(system.with_delays(trial_delays)):
                    return trial_delays
    return None


def _block_of_delay(system: DelaySystem) -> np.ndarray:
    """Return, for each delay, the number of its block of channels in the loop; -1 for a delay in no loop."""
    n = system.delays.size
    used = np.unique(_free_loop(system)[1])
    blocks = np.full(n, -1)
    blocks[used] = np.arange(used.size)
    return blocks
