"""A tuning problem: which signals are fed back where, within which bounds, judged by what."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import spectral_abscissa
from susp_ctrl.delay_systems.channels import FeedbackChannel, close_loop, loop_plant
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.errors import InputError
from susp_ctrl.tuning.box_sample import box_sample
from susp_ctrl.tuning.case import Case
from susp_ctrl.tuning.feasibility import SmallGain, StabilityTest
from susp_ctrl.tuning.objectives import Objective
from susp_ctrl.tuning.sampling import ControlledPlant

# The best delay is often none at all, and a control loop always has some: one millisecond by default.
DEFAULT_DELAY_BOUNDS = (0.001, 1.0)


@dataclass(frozen=True, eq=False)
class Limit:
    """An upper limit on any objective: stroke, tire load, actuator force, ...

    Parameters
    ----------
    objective : Harmonic, BandMean, BandPeak or RoadRms
        ``RoadRms(road, {"suspension_deflection_front": 1.0}, lags)`` is the RMS stroke of the front axle.
    at_most : float
        The limit, positive, in the objective's unit.

    Raises
    ------
    InputError
        For a limit that is not positive.
    """

    objective: Objective
    at_most: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "at_most", validation.number("at_most", self.at_most, above=0))


class TuningProblem:
    r"""Find gains and delays of feedback channels: minimise J(x) over a box, subject to stability.

    The design vector is x = [g_1, ..., g_m, tau_1, ..., tau_m]. A design is feasible when the closed loop is
    stable (with the decay rate and for the delays asked for) and every limit is kept. Stability is decided
    inside the search by `susp_ctrl.tuning.feasibility.StabilityTest`: small gain at the corner of the box, or
    else a certified count of roots for every design.

    Parameters
    ----------
    plant : control.StateSpace, DelayLTI, or a sequence of them
        With several (a list of vehicles) J and every limit is the worst of them, and all must be stable.
    pairs : sequence of (str, str)
        (measured output, actuator input) of each channel; any number, signals may repeat.
    objective : Harmonic, BandMean, BandPeak, RoadRms, SpectralAbscissa
        What is minimised.
    gain_bounds : sequence of (float, float)
        Lower and upper gain of each channel, in units of the actuator per unit of the measured signal; one
        pair serves all channels.
    delay_bounds : sequence of (float, float), optional
        Lower and upper delay (s) of each channel, or one pair for all; (0.001, 1) by default. Equal limits
        fix a delay.
    actuator_bandwidth : float or sequence of float or None, optional
        Bandwidth (rad/s) of the first-order actuators of the channels; needed for acceleration feedback.
    limits : sequence of Limit, optional
        Upper limits on other objectives.
    decay_rate : float, optional
        Required decay rate (1/s): every root satisfies Re s < -decay_rate.
    delay_tolerance : float, optional
        Required robustness: stable while each delay moves by +- this fraction on its own.
    worst_case_delays : bool, optional
        Take J and the limits at their worst over the nominal delays and all corners of the box that
        `delay_tolerance` spans.

    Attributes
    ----------
    lower, upper : ndarray, shape (2 m,)
        The box of the design vector.
    passive_value : float
        J with all channels idle; nan where the plant without them is unstable.

    Raises
    ------
    InputError
        Unknown signals (the nearest known one is named), crossed or negative bounds, missing road lags.
    NeutralLoopError
        A channel around a direct feed-through without `actuator_bandwidth`.
    """

    def __init__(
        self,
        plant: Any,
        pairs: Sequence[tuple[str, str]],
        objective: Objective,
        gain_bounds: Sequence[ArrayLike] | ArrayLike,
        delay_bounds: Sequence[ArrayLike] | ArrayLike = DEFAULT_DELAY_BOUNDS,
        *,
        actuator_bandwidth: float | Sequence[float | None] | None = None,
        limits: Sequence[Limit] = (),
        decay_rate: float = 0.0,
        delay_tolerance: float = 0.0,
        worst_case_delays: bool = False,
    ) -> None:
        self._arguments = {
            "plant": plant,
            "pairs": pairs,
            "objective": objective,
            "gain_bounds": gain_bounds,
            "delay_bounds": delay_bounds,
            "actuator_bandwidth": actuator_bandwidth,
            "limits": limits,
            "decay_rate": decay_rate,
            "delay_tolerance": delay_tolerance,
            "worst_case_delays": worst_case_delays,
        }
        self.pairs = _checked_pairs(pairs)
        m = len(self.pairs)
        gains = _bounds("gain_bounds", gain_bounds, m, validation.vector)
        delays = _bounds("delay_bounds", delay_bounds, m, validation.delays)
        self.lower = np.concatenate([gains[:, 0], delays[:, 0]])
        self.upper = np.concatenate([gains[:, 1], delays[:, 1]])
        self.decay_rate = validation.number("decay_rate", decay_rate, at_least=0)
        self.delay_tolerance = validation.number("delay_tolerance", delay_tolerance, at_least=0, below=1)
        corners = np.array(list(product((1.0 - self.delay_tolerance, 1.0 + self.delay_tolerance), repeat=m)))
        self._factors = np.vstack([np.ones((1, m)), corners]) if worst_case_delays else np.ones((1, m))
        widths = actuator_bandwidth if isinstance(actuator_bandwidth, Sequence) else [actuator_bandwidth] * m
        if len(widths) != m:
            raise InputError(
                f"actuator_bandwidth has {len(widths)} entries: one for each of {m} pairs is needed"
            )
        self._bandwidths = tuple(widths)
        if not callable(getattr(objective, "bind", None)):
            raise InputError(f"objective = {objective!r} is not allowed: Harmonic, RoadRms, ... is needed")
        self.objective = objective
        self.limits = tuple(limits)
        for k, limit in enumerate(self.limits):
            if not isinstance(limit, Limit):
                raise InputError(f"limits[{k}] is a {type(limit).__name__}: a Limit is needed")
        self.plants = tuple(plant) if isinstance(plant, (list, tuple)) else (plant,)
        if not self.plants:
            raise InputError("plant is an empty list: at least one plant is needed")
        self._cases = tuple(self._case(each) for each in self.plants)
        idle = np.concatenate([np.zeros(m), self.lower[m:]])
        passive_stable = all(spectral_abscissa(each) < 0 for each in self.plants)
        self.passive_value = self.accurate(idle)[0] if passive_stable else np.nan

    def replace(self, **changes: Any) -> TuningProblem:
        """Return a copy with some arguments changed."""
        return TuningProblem(**(self._arguments | changes))

    @property
    def dimension(self) -> int:
        """Length 2 m of the design vector."""
        return self.lower.size

    @property
    def proven(self) -> bool:
        """Whether small gain proves every design of the box stable, so that nothing is counted."""
        return all(case.stability.proven for case in self._cases)

    @property
    def corners(self) -> list[SmallGain]:
        """The small-gain test at the corner of the box, one per plant."""
        return [case.stability.corner for case in self._cases]

    @property
    def cases(self) -> tuple[Case, ...]:
        """The sampled plants with their bound objectives."""
        return self._cases

    def channels(self, x: ArrayLike) -> list[FeedbackChannel]:
        """Return the feedback channels of a design ``x = [gains..., delays...]``.

        Raises
        ------
        InputError
            If `x` has the wrong size or holds a number that is not finite.
        """
        design = validation.vector("x", x, size=self.dimension)
        m = len(self.pairs)
        return [
            FeedbackChannel(*pair, gain=float(g), delay=float(tau), actuator_bandwidth=width)
            for pair, g, tau, width in zip(self.pairs, design[:m], design[m:], self._bandwidths, strict=True)
        ]

    def loops(self, x: ArrayLike) -> list[DelayLTI]:
        """Return the closed loop of a design, one per plant."""
        return [close_loop(plant, self.channels(x)) for plant in self.plants]

    def values(self, points: FloatArray) -> FloatArray:
        """Return J of many designs as the search sees it, points (n, 2 m) to (n,), feasible or not."""
        return np.max([case.values(points) for case in self._cases], axis=0)

    def accurate(self, x: ArrayLike) -> tuple[float, float]:
        """Return J of one design and its largest relative overshoot of a limit, not at the search's frequencies.

        Parameters
        ----------
        x : array_like, shape (2 m,)
            Gains and delays (s) of the design.

        Returns
        -------
        J : float
            By adaptive integrals and refined peaks for this design; of several plants and corners the largest.
        overshoot : float
            0 where all limits are kept.

        Raises
        ------
        InputError
            Another number of entries, or one that is not finite.
        """
        design = validation.vector("x", x, size=self.dimension)
        worst = np.max([case.accurate(design) for case in self._cases], axis=0)
        most = np.array([limit.at_most for limit in self.limits])
        return float(worst[0]), float(np.max(worst[1:] / most - 1.0, initial=0.0))

    def violations(self, points: FloatArray) -> FloatArray:
        """Return how far designs are from feasible, points (n, 2 m) to (n,): 0 if feasible.

        Overshoot of limits, relative and summed, is mapped to (0, 1/2); a design whose stability is in
        doubt has 1/2, an unstable one its number of roots on the wrong side. Thus stability always comes
        first, and limits are compared among stable designs.
        """
        return self.evaluate(points)[1]

    def evaluate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (values, violations) of many designs: what the swarm asks for."""
        most = np.array([limit.at_most for limit in self.limits])
        values, violations = np.full(len(points), -np.inf), np.zeros(len(points))
        for case in self._cases:
            worst = case.outcomes(points).max(axis=1)
            values = np.maximum(values, worst[:, 0])
            over = np.maximum(worst[:, 1:] / most - 1.0, 0.0).sum(axis=1)
            unstable = case.stability.violations(*case.spread(points))
            violations = np.maximum(violations, np.where(unstable > 0, unstable, 0.5 * over / (1.0 + over)))
        return values, violations

    def _case(self, plant: Any) -> Case:
        m = len(self.pairs)
        base = DelayLTI.of(plant, "plant")
        # The corner of the box: it validates every signal and bandwidth, and refuses neutral loops.
        corner = np.concatenate([np.maximum(np.abs(self.lower[:m]), np.abs(self.upper[:m])), self.upper[m:]])
        channels = self.channels(corner)
        close_loop(base, channels)
        realization = loop_plant(base, channels)
        fixed_gains, fixed_delays = base.channel_gains, base.channel_delays
        test = StabilityTest(
            realization,
            np.append(np.abs(fixed_gains), corner[:m]),
            np.append(fixed_delays, corner[m:]),
            self.decay_rate,
            self.delay_tolerance,
        )
        sample = box_sample(self.lower, self.upper, self._factors, (fixed_gains, fixed_delays), test)
        controlled = ControlledPlant(
            realization,
            tuple(base.input_labels),
            tuple(base.output_labels),
            tuple(str(actuator) for _, actuator in self.pairs),
            *sample,
            (self.objective, *(limit.objective for limit in self.limits)),
        )
        limits = tuple(limit.objective.bind(controlled) for limit in self.limits)
        return Case(self.objective.bind(controlled), limits, test, fixed_gains, fixed_delays, self._factors)


def _checked_pairs(pairs: Any) -> tuple[tuple[str, str], ...]:
    try:
        clean = tuple((measured, actuator) for measured, actuator in validation.sequence("pairs", pairs))
    except (TypeError, ValueError):
        raise InputError(
            f"pairs = {pairs!r} is not allowed: a list of (measured output, actuator input) is needed"
        ) from None
    if not clean:
        raise InputError("pairs is empty: at least one (measured output, actuator input) is needed")
    return clean


def _bounds(name: str, bounds: Any, count: int, checked: Callable[..., FloatArray]) -> FloatArray:
    """Return bounds as (count, 2); one (lower, upper) serves all."""
    try:
        array = np.asarray(bounds, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape == (2,):
        array = np.tile(array, (count, 1))
    if array.shape != (count, 2):
        raise InputError(
            f"{name} = {bounds!r} is not allowed: one (lower, upper) for each of {count} pairs is needed"
        )
    for k, row in enumerate(array):
        low, high = checked(f"{name}[{k}]", row)
        if low > high:
            raise InputError(f"{name}[{k}] = ({low:g}, {high:g}) is not allowed: lower is above upper")
    return array
