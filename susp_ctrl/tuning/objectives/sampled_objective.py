r"""Objectives bound to a plant: a reading J(h) of the weighted responses h, with its slope.

A reading maps responses h of shape (n, f, rows) to outcomes (n, k): one value (k = 1), or every line of a spectrum
(k = f). Its slope is a factor c of the shape of h, so that

.. math:: dJ = \mathrm{Re} \sum c \, dh

over rows, and over frequencies as well unless the reading keeps them apart. |h| has no slope at h = 0: zero, which
lies between those of all directions, stands there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import SampledPlant
from susp_ctrl.tuning.sampling import ControlledPlant, channel_exponentials, solve_returns


class BoundObjective(Protocol):
    """An objective that has sampled its plant."""

    def evaluate(self, gains: FloatArray, delays: FloatArray) -> FloatArray:
        """Return one value per design, (n, m) gains and delays (s) to (n,)."""


class Objective(Protocol):
    """Anything that can be bound to a plant and then judges many designs at once."""

    #: False where the minimum typically sits on a kink; decides the local polish.
    smooth: bool

    def bind(self, plant: ControlledPlant) -> BoundObjective:
        """Return the objective with the plant sampled once for all evaluations to come."""


class Reading(Protocol):
    """What is read from the weighted responses."""

    #: One outcome per frequency rather than one in all.
    keeps_frequencies: bool

    def outcomes(self, h: ComplexArray) -> FloatArray:
        """Return the outcomes of responses (n, f, rows), shape (n, k)."""

    def factor(self, h: ComplexArray) -> ComplexArray:
        """Return c of the slope, shape (n, f, rows)."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    r"""Every line :math:`\sum_i |h_i|`."""

    keeps_frequencies = True

    def outcomes(self, h: ComplexArray) -> FloatArray:
        """Return the lines, shape (n, f)."""
        return np.asarray(np.abs(h).sum(axis=-1))

    def factor(self, h: ComplexArray) -> ComplexArray:
        """Return ``conj(h)/|h|``."""
        return _against(h)


@dataclass(frozen=True, eq=False)
class WeightedSum:
    r""":math:`\sum_\omega s(\omega) \sum_i |h_i|` with the shares s of the frequencies, shape (f,)."""

    shares: FloatArray
    keeps_frequencies = False

    def outcomes(self, h: ComplexArray) -> FloatArray:
        """Return the sum, shape (n, 1)."""
        return (np.abs(h).sum(axis=-1) @ self.shares)[:, None]

    def factor(self, h: ComplexArray) -> ComplexArray:
        """Return ``s conj(h)/|h|``."""
        return _against(h) * self.shares[:, None]


@dataclass(frozen=True, eq=False)
class Peak:
    r""":math:`\max_\omega \sum_i |h_i|`; of equal peaks the first gives the slope."""

    keeps_frequencies = False

    def outcomes(self, h: ComplexArray) -> FloatArray:
        """Return the largest line, shape (n, 1)."""
        return np.asarray(np.abs(h).sum(axis=-1).max(axis=-1, keepdims=True))

    def factor(self, h: ComplexArray) -> ComplexArray:
        """Return ``conj(h)/|h|`` at the peak and zero elsewhere."""
        highest = np.abs(h).sum(axis=-1).argmax(axis=-1)
        at_peak = np.arange(h.shape[1]) == highest[:, None]
        return np.where(at_peak[..., None], _against(h), 0.0)


@dataclass(frozen=True, eq=False)
class RootSquareSum:
    r""":math:`\sum_i n_i \sigma_i` with :math:`\sigma_i^2 = \sum_\omega |h_i|^2`; the weights n, shape (rows,)."""

    weights: FloatArray
    keeps_frequencies = False

    def outcomes(self, h: ComplexArray) -> FloatArray:
        """Return the sum, shape (n, 1)."""
        return (_deviations(h) @ self.weights)[:, None]

    def factor(self, h: ComplexArray) -> ComplexArray:
        """Return ``n conj(h)/sigma``."""
        sigma = _deviations(h)
        scale = np.divide(self.weights, sigma, out=np.zeros_like(sigma), where=sigma > 0)
        return np.asarray(h.conj() * scale[:, None, :])


def _deviations(h: ComplexArray) -> FloatArray:
    # The sum over frequencies as a product: several times faster than a strided sum.
    return np.asarray(np.sqrt(np.ones(h.shape[1]) @ (h.real**2 + h.imag**2)))


def _against(h: ComplexArray) -> ComplexArray:
    size = np.abs(h)
    return np.divide(h.conj(), size, out=np.zeros_like(h), where=size > 0)


@dataclass(frozen=True, eq=False)
class SampledObjective:
    """An objective bound to a plant.

    Attributes
    ----------
    omega : ndarray, shape (f,)
        Frequencies (rad/s).
    plant : SampledPlant
        One input; the scale of each row and frequency is already in it.
    reading : Reading
        What is read from the responses.
    judge : callable, optional
        The value of one design, gains and delays (m,) to a number, where the frequencies only approximate it.
    """

    omega: FloatArray
    plant: SampledPlant
    reading: Reading
    judge: Callable[[FloatArray, FloatArray], float] | None = None

    def evaluate(self, gains: FloatArray, delays: FloatArray) -> FloatArray:
        """Return one value per design, (n, m) gains and delays (s) to (n,)."""
        h = weighted_response(self.plant, self.omega, gains, delays)
        return self.reading.outcomes(h)[:, 0]

    def accurate(self, gains: FloatArray, delays: FloatArray) -> float:
        """Return the value of one design, (m,) gains and delays (s), by an evaluation of its own."""
        if self.judge is None:
            return float(self.evaluate(gains[None], delays[None])[0])
        return self.judge(gains, delays)

    def line_by_line(self) -> SampledObjective:
        """Return the objective whose outcomes are the lines of the spectrum."""
        return replace(self, reading=Spectrum())


def weighted_response(
    plant: SampledPlant, omega: FloatArray, gains: FloatArray, delays: FloatArray
) -> ComplexArray:
    """Return ``P11 + P12 E (I - P22 E)^-1 P21`` of many designs, gains and delays (n, m) to (n, f, rows)."""
    e = channel_exponentials(gains, delays, omega)[..., None, :]
    return np.asarray(plant.p11 + (plant.p12 * e) @ solve_returns(plant.p22 * e, plant.p21))[..., 0]


def response_and_slopes(
    plant: SampledPlant, omega: FloatArray, gains: FloatArray, delays: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    r"""Return the responses with their derivatives by the gains.

    .. math:: \frac{\partial h}{\partial E_k} = [P_{12} (I - E P_{22})^{-1}]_k [(I - P_{22} E)^{-1} P_{21}]_k,
              \quad \frac{\partial E_k}{\partial g_k} = e^{-j \omega \tau_k}

    Returns
    -------
    h : ndarray, shape (n, f, rows)
    by_gain : ndarray, shape (n, f, rows, m)
        The derivative by a delay is ``-j omega g_k`` times it.
    """
    turned = channel_exponentials(np.ones_like(gains), delays, omega)
    e = (gains[:, None, :] * turned)[..., None, :]
    # one factorisation for the measured signals and for (I - E P22)^-1 = I + E (I - P22 E)^-1 P22
    solved = solve_returns(plant.p22 * e, np.concatenate([plant.p21, plant.p22], axis=-1))
    driven = plant.p12 * e
    h = plant.p11 + driven @ solved[..., :1]
    left = plant.p12 + driven @ solved[..., 1:]
    return h[..., 0], left * (solved[..., 0] * turned)[..., None, :]


def slopes_of(
    factor: ComplexArray, by_gain: ComplexArray, omega: FloatArray, gains: FloatArray
) -> FloatArray:
    """Return ``Re sum c dh`` over rows at every frequency, by gains and then delays, shape (n, f, 2 m)."""
    along = (factor[..., None, :] @ by_gain)[..., 0, :]
    by_delay = along.imag * omega[:, None] * gains[:, None, :]
    return np.concatenate([along.real, by_delay], axis=-1)
