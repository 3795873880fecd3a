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

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import SampledPlant, around_resonances
from susp_ctrl.errors import InputError
from susp_ctrl.ride import iso2631_weighting
from susp_ctrl.tuning.objectives.accurate_value import DesignResponse, accurate_integral, accurate_peak
from susp_ctrl.tuning.objectives.box_nodes import integration_nodes, peak_nodes
from susp_ctrl.tuning.objectives.resonance_rule import NODES_PER_PANEL, resonance_edges
from susp_ctrl.tuning.objectives.sampled_objective import (
    Peak,
    RootSquareSum,
    SampledObjective,
    WeightedSum,
    weighted_response,
)
from susp_ctrl.tuning.sampling import ControlledPlant

BAND_POINTS = 300
FIRST_NODES = 100
_TINY = np.finfo(float).tiny


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
        numbers are the limits of a band; the integral over it is sampled as that of `RoadRms`.
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
        if omega.size == 2:
            return self._over_band(plant, (float(omega[0]), float(omega[1])))
        step = np.diff(omega)
        shares = (np.append(step, 0.0) + np.append(0.0, step)) / (2.0 * (omega[-1] - omega[0]))
        return SampledObjective(omega, _per_velocity(self, plant, omega), WeightedSum(shares))

    def _over_band(self, plant: ControlledPlant, band: tuple[float, float]) -> SampledObjective:
        def lines(omega: FloatArray) -> FloatArray:
            return np.stack([_sampled_lines(one, plant, omega) for one in family], axis=-1)

        family = _family(self, plant, lambda other: np.array_equal(other.omega, self.omega))
        edges = resonance_edges(band, plant.realization.eigenvalues, FIRST_NODES // NODES_PER_PANEL)
        omega, nodes = integration_nodes(edges, lines, lambda total: 1.0 / np.maximum(total, _TINY))
        width = band[1] - band[0]

        def judge(gains: FloatArray, delays: FloatArray) -> float:
            response = _design_response(self, plant, gains, delays)
            whole = accurate_integral(response, band, lambda w: np.abs(response.at(w)).sum(axis=-1)[None])
            return float(whole[0]) / width

        return SampledObjective(omega, _per_velocity(self, plant, omega), WeightedSum(nodes / width), judge)


@dataclass(frozen=True, eq=False)
class BandPeak(_OverBand):
    r"""Largest value of eq. (6) over a band: :math:`\max_\omega J(\omega)` on a grid.

    Parameters
    ----------
    omega : array_like
        Increasing frequencies (rad/s), positive. Two numbers are the limits of a band, which is then sampled
        at 300 logarithmically spaced points, and at more where sampled designs of the box peak between them.
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
        if omega.size > 2:
            return SampledObjective(omega, _per_velocity(self, plant, omega), Peak())
        band = float(omega[0]), float(omega[1])
        grid = _grid(band, plant.realization.eigenvalues)
        family = _family(self, plant, lambda other: np.array_equal(other.omega, self.omega))
        omega = peak_nodes(grid, lambda w: np.vstack([_sampled_lines(one, plant, w) for one in family]))

        def judge(gains: FloatArray, delays: FloatArray) -> float:
            return accurate_peak(_design_response(self, plant, gains, delays), band)

        return SampledObjective(omega, _per_velocity(self, plant, omega), Peak(), judge)


@dataclass(frozen=True, eq=False)
class RoadRms:
    r"""Weighted standard deviations on a random road, from the exact response without simulation.

    .. math:: J = \sum_i n_i \sigma_i, \quad \sigma_i^2 = \int |H_i(j\omega)|^2 G(\omega) \, d\omega

    over the road's band, by a quadrature fixed when bound to a plant: as fine as the resonances and delays of a
    sample of the designs ask for.

    Parameters
    ----------
    road : RandomRoad or any object with ``psd(omega)`` and ``band``
        One-sided displacement PSD G in m2/(rad/s) and its band (lower, upper) in rad/s.
    weights, lags, weighting
        As in `Harmonic`. Without lags only where the plant has one road input.
    points : int
        Number of nodes at least; panels of 10 of them are halved where the designs need more.

    Raises
    ------
    InputError
        For a road without spectrum, or numbers out of range.

    Notes
    -----
    In the paper's box that makes about 300 nodes, with errors up to 1e-5 relative for random designs. The designs
    that `tune` compares in the end are judged by an adaptive integral each.
    """

    road: Any
    weights: Mapping[str, float]
    lags: Mapping[str, float] | None = None
    points: int = FIRST_NODES
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
        band = float(self.road.band[0]), float(self.road.band[1])
        weights = np.array(list(self.weights.values()))
        family = _family(
            self, plant, lambda other: tuple(other.road.band) == band and other.points == self.points
        )

        def squares(omega: FloatArray) -> FloatArray:
            return np.concatenate([one._squares(plant, omega) for one in family], axis=-1)

        def sensitivity(total: FloatArray) -> FloatArray:
            cuts = np.cumsum([len(one.weights) for one in family])[:-1]
            parts = np.split(total, cuts, axis=-1)
            return np.hstack([one._sensitivity(part) for one, part in zip(family, parts, strict=True)])

        def judge(gains: FloatArray, delays: FloatArray) -> float:
            response = DesignResponse(
                plant, lambda w: self._sampled(plant, w), _longest(self.lags), gains, delays
            )
            whole = accurate_integral(response, band, lambda w: (weights * np.abs(response.at(w))).T ** 2)
            return float(np.sqrt(whole).sum())

        edges = resonance_edges(band, plant.realization.eigenvalues, -(-self.points // NODES_PER_PANEL))
        omega, nodes = integration_nodes(edges, squares, sensitivity)
        sampled = _scaled(self._sampled(plant, omega), np.sqrt(nodes)[:, None])
        return SampledObjective(omega, sampled, RootSquareSum(weights), judge)

    def _sampled(self, plant: ControlledPlant, omega: FloatArray) -> SampledPlant:
        """Sample the plant with the square root of the PSD in the rows."""
        root = np.sqrt(np.asarray(self.road.psd(omega), dtype=float))[:, None]
        return _scaled(plant.sample(omega, list(self.weights), self.lags), root * _filters(self, omega))

    def _squares(self, plant: ControlledPlant, omega: FloatArray) -> FloatArray:
        h = weighted_response(self._sampled(plant, omega), omega, plant.gains, plant.delays)
        return np.asarray(h.real**2 + h.imag**2)

    def _sensitivity(self, total: FloatArray) -> FloatArray:
        """Return dJ/J by the mean squares, (n, rows) to (n, rows)."""
        sigma, weights = np.sqrt(total), np.array(list(self.weights.values()))
        by_square = np.divide(weights, 2.0 * sigma, out=np.zeros_like(sigma), where=sigma > 0)
        return np.asarray(by_square / np.maximum(sigma @ weights, _TINY)[:, None])


def _family(objective: Any, plant: ControlledPlant, fits: Callable[[Any], bool]) -> list[Any]:
    """Return the objectives bound to the plant that take the same frequencies, in an order common to them."""
    known = [other for other in plant.objectives if type(other) is type(objective)]
    same = [other for other in known if other.lags == objective.lags and fits(other)]
    return same or [objective]


def _sampled_lines(objective: Any, plant: ControlledPlant, omega: FloatArray) -> FloatArray:
    """Return J(omega) of the sampled designs of the box, shape (n, f)."""
    h = weighted_response(_per_velocity(objective, plant, omega), omega, plant.gains, plant.delays)
    return np.asarray(np.abs(h).sum(axis=-1))


def _design_response(
    objective: Any, plant: ControlledPlant, gains: FloatArray, delays: FloatArray
) -> DesignResponse:
    return DesignResponse(
        plant, lambda w: _per_velocity(objective, plant, w), _longest(objective.lags), gains, delays
    )


def _longest(lags: Mapping[str, float] | None) -> float:
    return max(lags.values()) if lags else 0.0


def _grid(band: tuple[float, float], poles: NDArray[np.complex128]) -> FloatArray:
    """Return logarithmically spaced frequencies, and more about resonances that could hide between them."""
    grid = np.geomspace(*band, BAND_POINTS)
    narrow = poles[(poles.imag > 0) & (np.abs(poles.real) < (grid[1] / grid[0] - 1.0) * poles.imag)]
    bells = around_resonances(narrow, np.tan(np.linspace(-1.4, 1.4, 15)))
    return np.unique(np.concatenate([grid, bells[(bells > band[0]) & (bells < band[1])]]))


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
