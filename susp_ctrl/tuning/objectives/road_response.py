r"""What a design is judged by: four readings of the weighted response, exact in the delays.

With H_i the response of output i to the road displacement at the reference axle (every axle meets it with its
own lag), eq. (6) of the paper is

.. math:: J(\omega) = \sum_i n_i \, |H_i(j\omega)| / \omega,

an amplitude per road *velocity*. `Harmonic` takes it at one frequency, `BandMean` and `BandPeak` over a band;
`RoadRms` takes the standard deviations on a random road instead, :math:`J = \sum_i n_i \sigma_i` with
:math:`\sigma_i^2 = \int |H_i|^2 G \, d\omega`.

Each is a description. Bound to a plant it becomes a `SampledObjective` that evaluates a whole swarm at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import SampledPlant
from susp_ctrl.errors import InputError
from susp_ctrl.ride import iso2631_weighting
from susp_ctrl.tuning.objectives.resonance_rule import resonance_rule
from susp_ctrl.tuning.objectives.sampled_objective import Peak, RootSquareSum, SampledObjective, WeightedSum
from susp_ctrl.tuning.sampling import ControlledPlant

BAND_POINTS = 300


@dataclass(frozen=True, eq=False)
class Harmonic:
    r"""Eq. (6) at one frequency: :math:`J = \sum_i n_i |H_i(j\omega)| / \omega`.

    Parameters
    ----------
    omega : float
        Frequency of the road (rad/s), positive.
    weights : mapping of str to float
        Weight n_i, not negative, of each output.
    lags : mapping of str to float, optional
        Delay (s) after which the road reaches each road input; needed where there is more than one.
    weighting : mapping of str to str, optional
        ISO 2631-1 weighting ("Wk", "Wd", "We") of outputs that are to be filtered by it.

    Raises
    ------
    InputError
        For a frequency, weight or lag out of range; unknown names are found when bound to a plant.
    """

    omega: float
    weights: Mapping[str, float]
    lags: Mapping[str, float] | None = None
    weighting: Mapping[str, str] | None = None
    smooth = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", validation.number("omega", self.omega, above=0))
        _check_weights_and_lags(self)

    def bind(self, plant: ControlledPlant) -> SampledObjective:
        """Return the objective with the plant sampled at the one frequency."""
        omega = np.array([self.omega])
        return SampledObjective(omega, _per_velocity(self, plant, omega), WeightedSum(np.ones(1)))


@dataclass(frozen=True, eq=False)
class _OverBand:
    omega: ArrayLike
    weights: Mapping[str, float]
    lags: Mapping[str, float] | None = None
    weighting: Mapping[str, str] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", _band(self.omega))
        _check_weights_and_lags(self)


@dataclass(frozen=True, eq=False)
class BandMean(_OverBand):
    r"""Mean of eq. (6) over a band: :math:`\int J \, d\omega / (\omega_2 - \omega_1)`.

    Parameters
    ----------
    omega : array_like
        Increasing frequencies (rad/s), positive; the integral is taken by the trapezoidal rule on them. Two
        numbers are the limits of a band, which is then sampled at 300 logarithmically spaced points.
    weights, lags, weighting
        As in `Harmonic`.

    Raises
    ------
    InputError
        For an empty band, or numbers out of range.
    """

    smooth = True

    def bind(self, plant: ControlledPlant) -> SampledObjective:
        """Return the objective with the plant sampled over the band."""
        omega = np.asarray(self.omega)
        step = np.diff(omega)
        shares = (np.append(step, 0.0) + np.append(0.0, step)) / (2.0 * (omega[-1] - omega[0]))
        return SampledObjective(omega, _per_velocity(self, plant, omega), WeightedSum(shares))


@dataclass(frozen=True, eq=False)
class BandPeak(_OverBand):
    r"""Largest value of eq. (6) over a band: :math:`\max_\omega J(\omega)` on a grid.

    Parameters
    ----------
    omega : array_like
        Increasing frequencies (rad/s), positive. Two numbers are the limits of a band, which is then sampled
        at 300 logarithmically spaced points.
    weights, lags, weighting
        As in `Harmonic`.

    Raises
    ------
    InputError
        For an empty band, or numbers out of range.
    """

    smooth = False

    def bind(self, plant: ControlledPlant) -> SampledObjective:
        """Return the objective with the plant sampled over the band."""
        omega = np.asarray(self.omega)
        return SampledObjective(omega, _per_velocity(self, plant, omega), Peak())


@dataclass(frozen=True, eq=False)
class RoadRms:
    r"""Weighted standard deviations on a random road, from the exact response without simulation.

    .. math:: J = \sum_i n_i \sigma_i, \quad \sigma_i^2 = \int |H_i(j\omega)|^2 G(\omega) \, d\omega

    over the road's band, by a fixed quadrature that resolves the resonances of the open plant.

    Parameters
    ----------
    road : RandomRoad or any object with ``psd(omega)`` and ``band``
        One-sided displacement PSD G in m2/(rad/s) and its band (lower, upper) in rad/s.
    weights, lags, weighting
        As in `Harmonic`. Without lags only where the plant has one road input.
    points : int
        Number of nodes.

    Raises
    ------
    InputError
        For a road without spectrum, or numbers out of range.

    Notes
    -----
    With 300 points the largest error over 400 random designs of the paper's box was 1.3e-4 relative.
    """

    road: Any
    weights: Mapping[str, float]
    lags: Mapping[str, float] | None = None
    points: int = BAND_POINTS
    weighting: Mapping[str, str] | None = None
    smooth = True

    def __post_init__(self) -> None:
        if not callable(getattr(self.road, "psd", None)) or not hasattr(self.road, "band"):
            raise InputError(
                f"road = {self.road!r} is not allowed: a road with a spectrum (RandomRoad) is needed"
            )
        validation.integer("points", self.points, at_least=10)
        _check_weights_and_lags(self)

    def with_points(self, points: int) -> RoadRms:
        """Return the same objective with another number of quadrature nodes."""
        return replace(self, points=points)

    def bind(self, plant: ControlledPlant) -> SampledObjective:
        """Return the objective with the plant sampled at the nodes of its integral."""
        # the square roots of weight and PSD go into the rows
        low, high = (float(limit) for limit in self.road.band)
        omega, nodes = resonance_rule((low, high), plant.realization.eigenvalues, self.points)
        density = np.sqrt(nodes * np.asarray(self.road.psd(omega), dtype=float))[:, None] * _filters(
            self, omega
        )
        sampled = plant.sample(omega, list(self.weights), self.lags)
        weights = np.array(list(self.weights.values()))
        return SampledObjective(omega, _scaled(sampled, density), RootSquareSum(weights))


def _per_velocity(objective: Any, plant: ControlledPlant, omega: FloatArray) -> SampledPlant:
    """Sample the plant with the rows multiplied by their weight over the frequency."""
    weights = np.array(list(objective.weights.values()))
    scale = weights * _filters(objective, omega) / omega[:, None]
    return _scaled(plant.sample(omega, list(objective.weights), objective.lags), scale)


def _filters(objective: Any, omega: FloatArray) -> FloatArray:
    """Return |W| of every output at every frequency, shape (f, rows); 1 where none is asked for."""
    filters = np.ones((omega.size, len(objective.weights)))
    for k, output in enumerate(objective.weights):
        if output in (objective.weighting or {}):
            filters[:, k] = np.abs(iso2631_weighting(omega, objective.weighting[output]))
    return filters


def _scaled(plant: SampledPlant, scale: FloatArray) -> SampledPlant:
    """Multiply the output rows by a positive scale of shape (f, rows) or (f, 1)."""
    return plant._replace(p11=plant.p11 * scale[:, :, None], p12=plant.p12 * scale[:, :, None])


def _band(omega: ArrayLike) -> FloatArray:
    grid = validation.increasing("omega", omega, at_least=0)
    if grid[0] <= 0:
        raise InputError(f"omega[0] = {grid[0]:g} is not allowed: |H| per road velocity needs omega > 0")
    if grid.size < 2:
        raise InputError("omega is an empty band: at least two increasing frequencies are needed")
    if grid.size == 2:
        grid = np.geomspace(grid[0], grid[1], BAND_POINTS)
    grid.setflags(write=False)
    return grid


def _check_weights_and_lags(objective: Any) -> None:
    """Check the two mappings of an objective and keep private copies of them."""
    for name, needed in (("weights", True), ("lags", False)):
        given = getattr(objective, name)
        if given is None and not needed:
            continue
        if not isinstance(given, Mapping) or not given:
            raise InputError(
                f"{name} = {given!r} is not allowed: a mapping of signal name to number is needed"
            )
        clean = {
            key: validation.number(f"{name}[{key!r}]", value, at_least=0) for key, value in given.items()
        }
        object.__setattr__(objective, name, clean)
    weighting = objective.weighting
    if weighting is not None:
        if not isinstance(weighting, Mapping):
            raise InputError(
                f"weighting = {weighting!r} is not allowed: a mapping of output to filter is needed"
            )
        for output, name in weighting.items():
            validation.one_of("weighting", output, objective.weights)
            iso2631_weighting(1.0, name)
        object.__setattr__(objective, "weighting", dict(weighting))
    if not any(objective.weights.values()):
        raise InputError("weights are all zero: at least one positive weight is needed")
