"""Slopes of objectives and limits against Cauchy's integral and extrapolated differences; one solve for all of them."""

from __future__ import annotations

from itertools import pairwise

import control
import numpy as np
import pytest
from tuning.tuning_case import LAGS, PAIRS, PAPER_BOX, WEIGHTS, objective, problem, road

import susp_ctrl.tuning.objectives.joint_evaluation as joint_module
from susp_ctrl.delay_systems import FeedbackChannel, close_loop
from susp_ctrl.delay_systems.model import SampledPlant
from susp_ctrl.tuning import (
    BandMean,
    BandPeak,
    Harmonic,
    Limit,
    RoadRms,
    SpectralAbscissa,
    TuningProblem,
    tune,
)
from susp_ctrl.tuning.neighbourhood import Neighbourhood
from susp_ctrl.tuning.objectives import JointEvaluation, SampledObjective
from susp_ctrl.tuning.objectives.sampled_objective import Peak, RootSquareSum, Spectrum, WeightedSum
from susp_ctrl.tuning.sampling import solve_returns
from susp_ctrl.vehicle import HalfCar

FREQUENCIES, ROWS = 7, 2


def random_plant(rng, m, rows=ROWS):
    def block(*shape):
        return rng.normal(size=(FREQUENCIES, *shape)) + 1j * rng.normal(size=(FREQUENCIES, *shape))

    return SampledPlant(block(rows, 1), block(rows, m), block(m, 1), 0.5 * block(m, m))


def readings(rng):
    return [
        Spectrum(),
        WeightedSum(rng.uniform(0.1, 1.0, FREQUENCIES)),
        Peak(),
        RootSquareSum(rng.uniform(0.1, 1.0, ROWS)),
    ]


def continued_square(plant, omega, gains, delays):
    """|h|^2, shape (f, rows), as an analytic function of complex gains and delays: h times its conjugate continued."""
    result = 1.0
    for blocks, turn in ((plant, -1j), ([block.conj() for block in plant], 1j)):
        p11, p12, p21, p22 = blocks
        E = (gains * np.exp(turn * omega[:, None] * delays))[:, None, :]
        result = result * (p11 + (p12 * E) @ np.linalg.solve(np.eye(gains.size) - p22 * E, p21))[..., 0]
    return result


def continued(reading, square):
    lines = np.sqrt(square).sum(axis=1)
    if isinstance(reading, Spectrum):
        return lines
    if isinstance(reading, WeightedSum):
        return np.array([lines @ reading.shares])
    if isinstance(reading, Peak):
        return lines[[lines.real.argmax()]]
    return np.array([np.sqrt(square.sum(axis=0)) @ reading.weights])


@pytest.mark.analytical
@pytest.mark.parametrize("m", [1, 2, 3, 4, 6])
def test_slopes_against_cauchys_integral(m):
    """dJ/dx from J on a circle of the complex x plane; zero gains and zero delays among the designs."""
    rng = np.random.default_rng(m)
    plant, omega = random_plant(rng, m), rng.uniform(0.1, 30.0, FREQUENCIES)
    gains, delays = rng.normal(size=(5, m)), rng.uniform(0.0, 1.0, (5, m))
    gains[0], delays[1] = 0.0, 0.0
    gains[2, 0] = delays[2, -1] = 0.0
    read = readings(rng)
    joint = JointEvaluation([SampledObjective(omega, plant, reading) for reading in read])
    values, slopes = joint.evaluate(gains, delays), joint.slopes(gains, delays)
    radius, circle = 2e-4, np.exp(2j * np.pi * np.arange(8) / 8)
    for n in range(5):

        def outcomes(dx, n=n):
            square = continued_square(plant, omega, gains[n] + dx[:m], delays[n] + dx[m:])
            return np.concatenate([continued(reading, square) for reading in read])

        np.testing.assert_allclose(values[n], outcomes(np.zeros(2 * m)).real, rtol=1e-11)
        for k, unit in enumerate(np.eye(2 * m)):
            around = np.transpose([outcomes(radius * turn * unit) for turn in circle])
            exact = (around @ circle.conj()).real / (8 * radius)
            np.testing.assert_allclose(slopes[n, :, k], exact, rtol=1e-9, atol=1e-9 * np.abs(slopes[n]).max())


@pytest.mark.analytical
def test_no_response_has_no_slope():
    """|h| = 0 at one line, in one row, everywhere: finite slopes, those of the other terms alone."""
    rng = np.random.default_rng(0)
    plant, omega = random_plant(rng, 2), rng.uniform(0.1, 30.0, FREQUENCIES)
    zero, delays = np.zeros((1, 2)), np.full((1, 2), 0.3)
    plant.p11[2] = 0.0
    plant.p11[:, 1] = 0.0
    first = plant._replace(p11=plant.p11[:, :1], p12=plant.p12[:, :1])
    for reading, alone in zip(
        readings(np.random.default_rng(1)), readings(np.random.default_rng(1)), strict=True
    ):
        both = JointEvaluation([SampledObjective(omega, plant, reading)]).slopes(zero, delays)
        if isinstance(alone, RootSquareSum):
            alone = RootSquareSum(alone.weights[:1])
        single = JointEvaluation([SampledObjective(omega, first, alone)]).slopes(zero, delays)
        np.testing.assert_allclose(both, single, rtol=1e-13)
        assert isinstance(reading, RootSquareSum | WeightedSum | Peak) or np.all(both[0, 2] == 0.0)
        silent = SampledObjective(omega, plant._replace(p11=0.0 * plant.p11), reading)
        assert np.all(JointEvaluation([silent]).slopes(zero, delays) == 0.0)


def extrapolated(function, u, k):
    """Richardson's central differences of steps h, h/2, h/4, inside the box only; at a wall those of one side."""
    h, unit = 4e-4, np.eye(u.size)[k]
    if h <= u[k] <= 1.0 - h:
        d = [(function(u + s * unit) - function(u - s * unit)) / (2 * s) for s in (h, h / 2, h / 4)]
        d = [(4 * b - a) / 3 for a, b in pairwise(d)]
        return (16 * d[1] - d[0]) / 15
    side = h / 16 * (1.0 if u[k] < 0.5 else -1.0)
    f = [function(u + n * side * unit) for n in range(5)]
    return (-25 * f[0] + 48 * f[1] - 36 * f[2] + 16 * f[3] - 3 * f[4]) / (12 * side)


def tuned_problem(kind):
    """Two cars, the rear one of each fed back already, three channels, one of them with a fixed delay, corners."""
    cars = [HalfCar(body_mass=mass) for mass in (600.0, 780.0)]
    front = FeedbackChannel("suspension_velocity_rear", "force_rear", gain=-800.0, delay=0.03)
    stroke = RoadRms(road(), {"suspension_deflection_front": 1.0}, LAGS)
    return TuningProblem(
        [close_loop(car.plant(), [front]) for car in cars],
        [*PAIRS, ("suspension_velocity_front", "force_front")],
        objective(kind),
        [*PAPER_BOX, (-500.0, 500.0)],
        [(0.0, 0.5), (0.0, 0.5), (0.02, 0.02)],
        limits=[Limit(stroke, 0.02), Limit(BandMean((1.0, 100.0), WEIGHTS, LAGS), 9.0)],
        delay_tolerance=0.15,
        worst_case_delays=True,
    )


@pytest.mark.property
@pytest.mark.parametrize("kind", ["road_rms", "band_peak"])
def test_slopes_of_a_whole_problem_against_extrapolated_differences(kind):
    """Scaled variables, corners, several cars, channels of their own, fixed variables, walls of the box."""
    p = tuned_problem(kind)
    rng = np.random.default_rng(3)
    near = Neighbourhood(p, p.lower + 0.5 * (p.upper - p.lower))
    assert near.size == 5
    walls = rng.uniform(0.1, 0.9, 5)
    walls[[0, 3]], walls[[1, 4]] = 0.0, 1.0
    for u in (rng.uniform(0.1, 0.9, 5), walls):
        slopes = np.concatenate(near.slopes(u))
        assert slopes.shape == (np.concatenate(near.outcomes(u)).size, 5)
        for k in range(5):
            expected = extrapolated(lambda v: np.concatenate(near.outcomes(v)), u, k)
            # relative to the largest slope of the outcome; a difference across |h| = 0 is no reference
            error = np.abs(slopes[:, k] - expected) / np.abs(slopes).max(axis=1)
            assert np.quantile(error, 0.99) < 1e-6
            assert kind == "band_peak" or error.max() < 1e-6


@pytest.mark.property
def test_slopes_of_the_response_itself():
    p = TuningProblem(HalfCar().plant(), PAIRS, Harmonic(7.0, WEIGHTS, LAGS), PAPER_BOX)
    near = Neighbourhood(p, p.lower)
    for u in (np.array([0.3, 0.8, 0.2, 0.6]), np.array([0.5, 0.0, 1.0, 0.0])):
        slopes = near.response(u)[1]
        for k in range(4):
            expected = extrapolated(lambda v: near.response(v)[0], u, k)
            np.testing.assert_allclose(slopes[:, k], expected, atol=1e-8 * np.abs(slopes).max())


@pytest.mark.property
def test_a_limit_of_which_only_values_are_known_takes_differences():
    """The abscissa as a limit: its column from differences, that of the objective exact."""
    p = problem("road_rms", limits=[Limit(_Shifted(SpectralAbscissa()), 4.0)])
    near = Neighbourhood(p, p.lower)
    u = np.array([0.6, 0.3, 0.2, 0.1])
    slopes = near.slopes(u)[1]
    assert slopes.shape == (1, 4)
    for k in range(4):
        expected = extrapolated(lambda v: near.outcomes(v)[1], u, k)
        np.testing.assert_allclose(slopes[:, k], expected, rtol=1e-4, atol=1e-4)
    best = tune(p, particles=10, iterations=10, polish_starts=1)
    assert best.success
    assert best.stability.abscissa <= 4.0 - 5.0


class _Shifted:
    """Five more than another objective, which makes a positive quantity of an abscissa."""

    smooth = False

    def __init__(self, inner):
        self.inner = inner

    def bind(self, plant):
        return _Shifted(self.inner.bind(plant))

    def evaluate(self, gains, delays):
        return 5.0 + self.inner.evaluate(gains, delays)


# ---------------------------------------------------------------------------------------------- one solve


@pytest.mark.property
def test_one_solve_serves_all_that_read_the_same_frequencies(monkeypatch):
    """An objective and three limits on one road: one solve per corner; another band or another lag is its own."""
    strokes = [f"suspension_deflection_{end}" for end in ("front", "rear")]
    on_road = [RoadRms(road(), {name: 1.0}, LAGS) for name in (*strokes, "tire_deflection_front")]
    late = {"road_front": 0.0, "road_rear": 0.2}
    for extra, solves in (
        ([], 1),
        ([BandPeak((1.0, 9.0), WEIGHTS, LAGS)], 2),
        ([RoadRms(road(), WEIGHTS, late)], 2),
    ):
        limited = [*on_road, *extra]
        p = problem("road_rms", limits=[Limit(each, 1.0) for each in limited])
        asked = []
        real = joint_module.weighted_response

        def counted(plant, omega, gains, delays, asked=asked, real=real):
            asked.append(len(gains))
            return real(plant, omega, gains, delays)

        x = p.lower + np.random.default_rng(0).random((4, 4)) * (p.upper - p.lower)
        with monkeypatch.context() as patched:
            patched.setattr(joint_module, "weighted_response", counted)
            together = p.cases[0].outcomes(x)[:, 0]
        assert asked == [4] * solves
        case = p.cases[0]
        alone = [each.evaluate(*np.split(x, 2, axis=1)) for each in (case.objective, *case.limits)]
        np.testing.assert_allclose(together, np.transpose(alone), rtol=1e-13)


@pytest.mark.analytical
@pytest.mark.parametrize("m", [1, 2, 3, 4, 6])
def test_elimination_in_step_equals_one_by_one(m):
    """Against LAPACK at every point, pivots of zero and of rounding size among them."""
    rng = np.random.default_rng(m)
    m22 = rng.normal(size=(4, 9, m, m)) + 1j * rng.normal(size=(4, 9, m, m))
    right = rng.normal(size=(9, m, 3)) + 1j * rng.normal(size=(9, m, 3))
    if m > 1:
        m22[1, 2, 0, 0], m22[2, 3, 0, 0], m22[0, 0, 0, 0] = 1.0, 1.0 - 1e-14, 1.0 + 1e-5j
    found = solve_returns(m22, right)
    expected = np.linalg.solve(np.eye(m) - m22, np.broadcast_to(right, (4, 9, m, 3)))
    error = np.abs(found - expected).max(axis=(2, 3)) / np.abs(expected).max(axis=(2, 3))
    assert np.all(error < 1e-13 * np.linalg.cond(np.eye(m) - m22))


# ------------------------------------------------------------------------------------------------ progress


def test_progress_covers_swarm_polish_and_verdict():
    seen, steps = [], []
    p = problem("road_rms")
    tune(
        p, particles=10, iterations=5, polish_starts=2, progress=lambda stage, share: seen.append((stage, share)),
        callback=lambda state: steps.append(state.nit),
    )  # fmt: skip
    stages, shares = zip(*seen, strict=True)
    assert sorted(set(stages), key=stages.index) == ["swarm", "polish", "stability verdict"]
    assert [stages.count("swarm"), stages.count("polish")] == [5, 2]
    assert np.all(np.diff(shares) >= 0)
    assert shares[-1] == 1.0
    assert steps == [1, 2, 3, 4, 5]


def test_callback_still_stops_the_swarm():
    plant = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["road", "u"], outputs=["y"])
    p = TuningProblem(plant, [("y", "u")], BandPeak((0.1, 10.0), {"y": 1.0}), (-0.5, 0.5))
    assert tune(p, particles=5, iterations=50, callback=lambda state: state.nit == 3).nit == 3
