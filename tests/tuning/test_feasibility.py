"""Stability of whole swarms: small gain against closed numbers, the count against independent roots."""

from __future__ import annotations

import control
import numpy as np
import pytest
from oracles import characteristic_function
from tuning.tuning_case import PAIRS, random_designs

import susp_ctrl.tuning.feasibility as feasibility
from susp_ctrl.delay_systems import FeedbackChannel, close_loop, count_unstable_roots, loop_plant
from susp_ctrl.delay_systems.model.lft import Realization
from susp_ctrl.tuning.counting_grid import counting_grid
from susp_ctrl.tuning.feasibility import StabilityTest
from susp_ctrl.vehicle import HalfCar


def half_car():
    return loop_plant(HalfCar().plant(), [FeedbackChannel(*pair, gain=1.0) for pair in PAIRS])


def scalar(a, b=1.0):
    """x' = a x + b w, z = x: closed with w = g z(t - tau)."""
    none = np.zeros((1, 0))
    return Realization(
        A=[[a]], B1=none, B2=[[b]], C1=none.T, C2=[[1.0]], D11=np.zeros((0, 0)), D12=none.T, D21=none,
        D22=[[0.0]],
    )  # fmt: skip


def winding(gains, delays, line=0.0, corner=2000.0):
    """Roots of the oracle's det Z(s) right of a line: winding number round a large half disc.

    The quasi-polynomial is of degree 8 with leading coefficient 1, so on the arc it is s^8 to a few percent.
    """
    omega = np.linspace(0.0, corner, 100001)
    f = characteristic_function(line + 1j * omega, gains, delays)
    along = np.unwrap(np.angle(f))
    steps = np.abs(np.diff(along))
    assert steps.max() < 2.5, "the oracle's grid is too coarse"
    # Upwards along the line the phase grows by along; the arc from +j to -j infinity adds 8 pi.
    return (8 * np.pi - 2 * (along[-1] - along[0])) / (2 * np.pi)


# --------------------------------------------------------------------------------------------- small gain


@pytest.mark.analytical
def test_radius_on_the_counting_grid_against_eigenvalues():
    plant, limits = half_car(), np.array([34000.0, 44000.0])
    grid, radius = counting_grid(plant, limits, 0.5)
    assert grid[0] == 0.0
    for k in range(0, grid.size, 400):
        size = np.abs(
            plant.C2 @ np.linalg.solve(1j * grid[k] * np.eye(plant.n_states) - plant.A, plant.B2) + plant.D22
        )
        expected = np.abs(np.linalg.eigvals(size * limits)).max()
        assert radius[k] == pytest.approx(expected, rel=1e-9)
    assert radius[-1] < 0.5


@pytest.mark.literature
def test_small_gain_of_the_papers_box():
    """Independent recomputation of eq. (1): supremum 0.4441 at 8.82 rad/s; thresholds 103229 and 99402 N/m."""
    box = StabilityTest(half_car(), np.array([34000.0, 44000.0]), np.ones(2))
    assert box.proven
    assert box.corner.supremum == pytest.approx(0.4441, abs=5e-5)
    assert box.corner.omega == pytest.approx(8.82, abs=5e-3)
    for channel, gain, omega in ((0, 103229, 65.64), (1, 99402, 63.12)):
        limits = np.zeros(2)
        limits[channel] = 1.0
        corner = StabilityTest(half_car(), limits, np.ones(2)).corner
        assert 1.0 / corner.supremum == pytest.approx(gain, abs=1.0)
        assert corner.omega == pytest.approx(omega, abs=5e-3)


@pytest.mark.analytical
def test_small_gain_of_a_first_order_lag():
    """|1/(jw + 2)| is largest at w = 0: 1/2, so gains below 2 are proven and 2 is not."""
    assert StabilityTest(scalar(-2.0), np.array([1.99]), np.ones(1)).proven
    barely = StabilityTest(scalar(-2.0), np.array([2.01]), np.ones(1))
    assert not barely.proven
    assert barely.corner.supremum == pytest.approx(2.01 / 2.0, rel=1e-12)
    assert barely.corner.omega == 0.0


# -------------------------------------------------------------------------------------------------- count


@pytest.mark.analytical
def test_scalar_loop_loses_stability_where_the_closed_form_says():
    """x' = -x - 3 x(t - tau): stable below acos(-1/3)/sqrt(8), then one pair more every 2 pi/sqrt(8)."""
    first, period = np.arccos(-1.0 / 3.0) / np.sqrt(8.0), 2 * np.pi / np.sqrt(8.0)
    test = StabilityTest(scalar(-1.0), np.array([3.0]), np.array([10.0]))
    assert not test.proven
    delays = np.array([0.0, 0.5 * first, 0.999 * first, 1.001 * first, first + 0.99 * period])
    delays = np.append(delays, first + 2.5 * period)[:, None]
    roots, certain = test.count(np.full((6, 1), -3.0), delays)
    assert certain.all()
    assert roots.tolist() == [0, 0, 0, 2, 2, 6]


@pytest.mark.analytical
def test_unstable_plant_is_counted_with_its_own_poles():
    """x' = x - g x(t - tau) is stable for 1 < g and tau below acos(1/g)/sqrt(g^2 - 1)."""
    test = StabilityTest(scalar(1.0), np.array([2.0]), np.array([2.0]))
    limit = np.arccos(0.5) / np.sqrt(3.0)
    roots, certain = test.count(
        np.array([[-2.0], [-2.0], [-0.5], [0.0]]), np.array([[0.99 * limit], [1.01 * limit], [0.1], [1.0]])
    )
    assert certain.all()
    assert roots.tolist() == [0, 2, 1, 1]


@pytest.mark.analytical
def test_count_of_the_wide_box_against_the_winding_of_the_oracle():
    """|g| up to 300 kN/m, where most designs are unstable; det Z(s) of eq. (1) on a fine grid."""
    designs = random_designs(25, seed=3, gain=(3e5, 3e5))
    test = StabilityTest(half_car(), np.array([3e5, 3e5]), np.ones(2))
    roots, certain = test.count(designs[:, :2], designs[:, 2:])
    assert certain.mean() > 0.7
    assert np.count_nonzero(roots[certain] == 0) >= 2
    assert roots.max() > 10
    for x, number in zip(designs[certain], roots[certain], strict=True):
        assert winding(x[:2], x[2:]) == pytest.approx(number, abs=0.1)


@pytest.mark.property
def test_count_does_not_depend_on_company_or_box():
    designs = random_designs(60, seed=4, gain=(1.5e5, 1.5e5))
    narrow = StabilityTest(half_car(), np.array([1.5e5, 1.5e5]), np.ones(2))
    wide = StabilityTest(half_car(), np.array([3e5, 3e5]), np.array([2.0, 2.0]))
    first, sure = narrow.count(designs[:, :2], designs[:, 2:])
    second, sure_too = wide.count(designs[:, :2], designs[:, 2:])
    both = sure & sure_too
    assert both.mean() > 0.8
    np.testing.assert_array_equal(first[both], second[both])
    single = [narrow.count(x[None, :2], x[None, 2:])[0][0] for x in designs]
    np.testing.assert_array_equal(first, single)


@pytest.mark.analytical
def test_three_channels_two_of_them_equal_two():
    """The same signal through two half gains counts as through one whole gain."""
    pairs = [PAIRS[0], PAIRS[0], PAIRS[1]]
    plant = loop_plant(HalfCar().plant(), [FeedbackChannel(*pair, gain=1.0) for pair in pairs])
    designs = random_designs(30, seed=5, gain=(2e5, 2e5))
    three = StabilityTest(plant, np.array([1e5, 1e5, 2e5]), np.ones(3))
    two = StabilityTest(half_car(), np.array([2e5, 2e5]), np.ones(2))
    g, tau = designs[:, :2], designs[:, 2:]
    gains = np.column_stack([g[:, 0] / 2, g[:, 0] / 2, g[:, 1]])
    split, sure = three.count(gains, tau[:, [0, 0, 1]])
    whole, sure_too = two.count(g, tau)
    both = sure & sure_too
    assert both.mean() > 0.5
    np.testing.assert_array_equal(split[both], whole[both])


@pytest.mark.analytical
def test_decay_rate_moves_the_line():
    """x' = -a x - g x(t - tau) right of -1: with s = p - 1 a loop of the same form, a - 1 and g e^tau."""
    test = StabilityTest(scalar(-2.0), np.array([4.0]), np.array([2.0]), decay=1.0)
    gain, tau = 1.5, 0.9
    inner = gain * np.exp(tau)
    limit = np.arccos(-1.0 / inner) / np.sqrt(inner**2 - 1.0)
    roots, certain = test.count(np.array([[-gain]]), np.array([[tau]]))
    assert certain.all()
    assert roots[0] == (2 if tau > limit else 0)
    assert tau > limit, "the example must have roots between the axis and the line"
    plain = StabilityTest(scalar(-2.0), np.array([4.0]), np.array([2.0]))
    assert plain.violations(np.array([[-gain]]), np.array([[tau]]))[0] == 0


@pytest.mark.analytical
def test_delay_tolerance_keeps_off_the_limit():
    """x' = -x - 3 x(t - tau), limit tau* known: with +-10 % nothing above tau*/1.1 may pass."""
    limit = np.arccos(-1.0 / 3.0) / np.sqrt(8.0)
    test = StabilityTest(scalar(-1.0), np.array([3.0]), np.array([2.0]), delay_tolerance=0.1)
    delays = np.linspace(0.2 * limit, 1.2 * limit, 101)[:, None]
    passed = test.violations(np.full_like(delays, -3.0), delays) == 0
    assert not passed[delays[:, 0] > limit / 1.1].any()
    assert passed[delays[:, 0] < 0.8 * limit].all()


@pytest.mark.analytical
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e6])
def test_a_delayed_integrator_in_any_unit_of_time(speed):
    """x' = -k x(t - tau): stable for 0 < k tau < pi/2, then two roots more every 2 pi; k < 0 has one root."""
    test = StabilityTest(scalar(0.0), np.array([10.0 * speed]), np.array([2.0 / speed]))
    assert not test.plant_stable
    product = np.array([0.01, 0.99 * np.pi / 2, 1.01 * np.pi / 2, 2.49 * np.pi, 2.51 * np.pi, 5.0 * np.pi])
    gains, delays = -product[:, None] * speed, np.ones((6, 1)) / speed
    roots, certain = test.count(gains, delays)
    assert certain.all()
    assert roots.tolist() == [0, 0, 2, 2, 4, 6]
    assert test.count(np.array([[0.5 * speed]]), np.array([[1.0 / speed]]))[0].tolist() == [1]
    # without gain the root stays on the axis: neither side can be certain
    assert test.violations(np.zeros((1, 1)), np.ones((1, 1))).tolist() == [0.5]


@pytest.mark.property
@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize(
    "A",
    [
        [[0.0, 0.0], [0.0, -1.3]],
        [[0.0, 1.5], [-1.5, 0.0]],
        [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -2.0]],
        [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.3]],
        [[0.0, 1.0, 0.0, 0.0], [-4.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0]],
    ],
)
def test_plants_with_poles_on_the_axis_against_the_count_of_one_loop(A, channels):
    """Integrators, double ones, undamped oscillators, with an unstable pole beside: counted on det K(s)."""
    A = np.array(A)
    rng = np.random.default_rng(channels)
    plant = control.ss(A, rng.normal(size=(len(A), channels)), rng.normal(size=(channels, len(A))), 0)
    paths = [FeedbackChannel(k, k, 1.0, 0.1) for k in range(channels)]
    test = StabilityTest(loop_plant(plant, paths), np.full(channels, 2.0), np.ones(channels))
    gains, delays = rng.uniform(-2, 2, (30, channels)), rng.uniform(0, 1, (30, channels))
    roots, certain = test.count(gains, delays)
    assert certain.mean() > 0.6
    for k in np.flatnonzero(certain):
        designs = [p.replace(gain=g, delay=d) for p, g, d in zip(paths, gains[k], delays[k], strict=True)]
        assert count_unstable_roots(close_loop(plant, designs)) == roots[k]


def test_channels_without_gain_are_stable_with_a_stable_plant():
    test = StabilityTest(half_car(), np.array([3e5, 3e5]), np.ones(2))
    assert not test.proven
    assert test.violations(np.zeros((3, 2)), np.full((3, 2), 0.3)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.property
@pytest.mark.parametrize(("tolerance", "decay"), [(0.0, 0.0), (0.2, 0.0), (0.2, 0.5)])
def test_undecided_designs_are_not_refined_to_the_end(monkeypatch, tolerance, decay):
    """What is certain is the same as with every doubtful interval refined; of the others few are looked at."""
    designs = random_designs(60, seed=4, gain=(2e5, 2e5))
    gains, delays = designs[:, :2], designs[:, 2:]
    test = StabilityTest(half_car(), np.array([2e5, 2e5]), np.ones(2), decay, tolerance)
    refined = []
    real = StabilityTest._refined

    def counted(self, *arguments):
        refined.append(arguments[-2])
        return real(self, *arguments)

    monkeypatch.setattr(StabilityTest, "_refined", counted)
    roots, certain = test.count(gains, delays)
    some = np.bincount(np.concatenate(refined), minlength=60)
    refined.clear()
    monkeypatch.setattr(feasibility, "_worst_first", lambda doubtful, share, certain: [np.nonzero(doubtful)])
    all_roots, all_certain = test.count(gains, delays)
    every = np.bincount(np.concatenate(refined), minlength=60)
    np.testing.assert_array_equal(certain, all_certain)
    np.testing.assert_array_equal(roots, all_roots)
    np.testing.assert_array_equal(some[certain], every[certain])
    assert certain.any()
    if tolerance:
        assert some[~certain].sum() < every[~certain].sum() / 10


@pytest.mark.slow
@pytest.mark.analytical
def test_wide_box_against_eigenvalues_of_a_discretised_loop():
    """400 designs against the spectrum of a Chebyshev discretisation of both delays (60 nodes each)."""
    nodes = np.cos(np.pi * np.arange(61) / 60)
    edge = np.r_[2.0, np.ones(59), 2.0] * (-1.0) ** np.arange(61)
    distance = nodes[:, None] - nodes
    D = np.outer(edge, 1 / edge) / (distance + np.eye(61))
    D -= np.diag(D.sum(axis=1))
    plant: control.StateSpace = HalfCar().plant()
    force = [plant.input_labels.index(name) for _, name in PAIRS]
    wheel = [plant.output_labels.index(name) for name, _ in PAIRS]

    def unstable(gains, delays):
        M = np.zeros((8 + 120, 8 + 120))
        M[:8, :8] = plant.A
        for k in range(2):
            rows = slice(8 + 60 * k, 68 + 60 * k)
            M[rows, rows] = 2 / delays[k] * D[1:, 1:]
            M[rows, :8] = 2 / delays[k] * np.outer(D[1:, 0], plant.C[wheel[k]])
            M[:8, 67 + 60 * k] = gains[k] * plant.B[:, force[k]]
        return np.count_nonzero(np.linalg.eigvals(M).real > 0)

    designs = random_designs(400, seed=11, gain=(3e5, 3e5))
    test = StabilityTest(half_car(), np.array([3e5, 3e5]), np.ones(2))
    roots, certain = test.count(designs[:, :2], designs[:, 2:])
    assert certain.mean() > 0.85
    for x, number in zip(designs[certain], roots[certain], strict=True):
        assert unstable(x[:2], x[2:]) == number
