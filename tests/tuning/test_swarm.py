"""The swarm alone: its step by hand, feasibility-first comparison, and known minima."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from susp_ctrl.errors import InputError
from susp_ctrl.tuning.swarm import deb_order, latin_hypercube, pso, ring_neighbours, swarm_step

BOX = (np.array([-5.0, -5.0, -5.0, -5.0]), np.array([5.0, 5.0, 5.0, 5.0]))


def sphere(x):
    return ((x - 1.0) ** 2).sum(axis=1)


def rastrigin(x):
    return (x**2 - 10 * np.cos(2 * np.pi * x) + 10).sum(axis=1)


# ---------------------------------------------------------------------------------------------- one step


@pytest.mark.analytical
def test_step_by_hand():
    x = np.array([[1.0]])
    v = np.array([[0.5]])
    random = np.array([[[0.25]], [[0.5]]])
    moved, velocity = swarm_step(
        x, v, np.array([[2.0]]), np.array([[3.0]]), random, 0.8, 2.0, 1.0,
        np.array([9.0]), np.array([-10.0]), np.array([10.0]),
    )  # fmt: skip
    # v = 0.8 * 0.5 + 2 * 0.25 * (2 - 1) + 1 * 0.5 * (3 - 1) = 1.9
    assert velocity[0, 0] == pytest.approx(1.9, abs=1e-15)
    assert moved[0, 0] == pytest.approx(2.9, abs=1e-15)


@pytest.mark.analytical
def test_step_clamps_then_reflects_and_reverses():
    x = np.array([[9.0, -9.0]])
    v = np.array([[50.0, -50.0]])
    zero = np.zeros((2, 1, 2))
    moved, velocity = swarm_step(
        x, v, x, x[0], zero, 1.0, 2.0, 2.0, np.array([3.0, 3.0]), np.array([-10.0] * 2), np.array([10.0] * 2)
    )
    # 9 + 3 = 12 is mirrored at 10 to 8; the same on the other side.
    assert moved.tolist() == [[8.0, -8.0]]
    assert velocity.tolist() == [[-3.0, 3.0]]


def test_step_is_pure():
    rng = np.random.default_rng(3)
    arrays = [rng.random((7, 4)) for _ in range(4)]
    copies = [array.copy() for array in arrays]
    random = rng.random((2, 7, 4))
    args = (0.7, 1.5, 1.5, np.full(4, 0.5), np.zeros(4), np.ones(4))
    first = swarm_step(*arrays, random, *args)
    second = swarm_step(*arrays, random, *args)
    assert all(np.array_equal(a, b) for a, b in zip(arrays, copies, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


@pytest.mark.property
@settings(max_examples=50, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6), clamp=st.floats(0.01, 1.0), width=st.floats(0.0, 1e6))
def test_step_never_leaves_the_box(seed, clamp, width):
    rng = np.random.default_rng(seed)
    low = rng.normal(size=4) * 100
    high = low + width * rng.random(4)
    x, own, social = (low + (high - low) * rng.random((9, 4)) for _ in range(3))
    v = rng.normal(size=(9, 4)) * width
    moved, velocity = swarm_step(
        x, v, own, social, rng.random((2, 9, 4)), 0.9, 2.0, 2.0, clamp * (high - low), low, high
    )
    assert np.all((moved >= low) & (moved <= high))
    assert np.all(np.abs(velocity) <= clamp * (high - low))


def test_neighbours_close_the_ring():
    assert ring_neighbours(5).tolist() == [[4, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 0]]


def test_latin_hypercube_fills_every_slice():
    rng = np.random.default_rng(0)
    points = latin_hypercube(rng.random((20, 3)), rng, np.zeros(3), np.ones(3))
    assert all(sorted((points[:, k] * 20).astype(int)) == list(range(20)) for k in range(3))


def test_deb_order_puts_feasibility_first():
    values = np.array([5.0, 1.0, np.inf, np.inf])
    violations = np.array([0.0, 0.0, 0.1, np.inf])
    assert deb_order(values, violations).tolist() == [1, 0, 2, 3]


# ------------------------------------------------------------------------------------------ whole searches


@pytest.mark.parametrize("options", [{}, {"topology": "global"}, {"preset": "paper"}])
def test_reaches_the_minimum_of_a_sphere(options):
    result = pso(sphere, *BOX, seed=1, **options)
    assert result.success
    assert result.fun < 1e-4
    assert result.fun == sphere(result.x[None])[0]
    assert result.nfev == 60 * 201


def test_ring_finds_a_narrow_deep_basin_beside_a_broad_shallow_one():
    """More often than a global-best swarm, which falls for the first basin it meets."""

    def two_basins(x):
        return np.minimum(0.5 + 0.01 * ((x - 3.0) ** 2).sum(axis=1), ((x + 3.0) ** 2).sum(axis=1) / 6.0)

    hits = {
        topology: sum(
            pso(two_basins, *BOX, seed=s, topology=topology, iterations=150).fun < 0.4 for s in range(30)
        )
        for topology in ("ring", "global")
    }
    assert hits["ring"] > hits["global"]
    assert hits["ring"] >= 10


def test_constrained_minimum_on_the_boundary():
    """Minimise x + y on the unit disc: the minimum is -sqrt(2) at (-1, -1)/sqrt(2)."""

    def disc(p):
        return p.sum(axis=1), (p**2).sum(axis=1) - 1.0

    result = pso(disc, [-3, -3], [3, 3], seed=2)
    assert result.violation == 0
    assert (result.x**2).sum() <= 1.0
    assert result.fun == pytest.approx(-np.sqrt(2), abs=1e-4)


def test_tiny_feasible_region_is_found_through_the_violation():
    def sliver(p):
        return p[:, 0], np.abs(p[:, 1] - 0.321) - 1e-4

    result = pso(sliver, [0, 0], [1, 1], seed=0)
    assert result.success
    assert abs(result.x[1] - 0.321) <= 1e-4
    assert result.history["feasible_share"].iloc[0] < 0.1


def test_no_feasible_point_says_so():
    result = pso(lambda p: (p[:, 0], np.full(len(p), 2.5)), [0], [1], iterations=5)
    assert not result.success
    assert np.isnan(result.fun)
    assert result.violation == 2.5
    assert "no feasible point" in result.message
    assert result.history["best"].isna().all()
    assert (result.history["feasible_share"] == 0).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_infeasible(bad):
    def half(p):
        return np.where(p[:, 0] < 0.5, bad, p[:, 0])

    result = pso(half, [0], [1], seed=0, iterations=60)
    assert result.success
    assert result.fun == pytest.approx(0.5, abs=1e-3)
    assert result.fun >= 0.5


def test_history_counts_and_never_worsens():
    result = pso(rastrigin, *BOX, seed=4, iterations=80)
    history = result.history
    assert list(history.columns) == ["iteration", "evaluations", "best", "mean", "feasible_share"]
    assert history["iteration"].tolist() == list(range(81))
    assert history["evaluations"].iloc[-1] == result.nfev == 60 * 81
    assert np.all(np.diff(history["best"]) <= 0)
    assert history["best"].iloc[-1] == result.fun
    assert np.all(history["mean"] >= history["best"])


def test_candidates_are_sorted_and_their_values_are_true():
    result = pso(rastrigin, *BOX, seed=5, iterations=40)
    assert np.all(np.diff(result.candidate_values) >= 0)
    np.testing.assert_array_equal(rastrigin(result.candidates), result.candidate_values)
    np.testing.assert_array_equal(result.candidates[0], result.x)


def test_restart_keeps_searching_after_the_swarm_has_settled():
    """With restarts the last samples still spread over the box; without they have collapsed."""
    spread = {}
    for stagnation in (5, None):
        last = []
        pso(
            lambda p, last=last: (last.append(p), sphere(p))[1],
            [0, 0], [3, 3], seed=0, iterations=120, stagnation=stagnation, topology="global",
        )  # fmt: skip
        spread[stagnation] = np.ptp(np.concatenate(last[-5:]), axis=0).min()
    assert spread[5] > 2.5
    assert spread[None] < 0.3


def test_seeds():
    first, again, other = (pso(rastrigin, *BOX, seed=s, iterations=20) for s in (7, 7, 8))
    generator = pso(rastrigin, *BOX, seed=np.random.default_rng(7), iterations=20)
    np.testing.assert_array_equal(first.x, again.x)
    np.testing.assert_array_equal(first.x, generator.x)
    assert not np.array_equal(first.x, other.x)


def test_early_stops():
    flat = pso(lambda p: np.ones(len(p)), [0], [1], patience=7)
    assert (flat.status, flat.nit) == (1, 7)
    reached = pso(sphere, *BOX, target=0.5)
    assert reached.status == 2
    assert reached.fun <= 0.5
    seen = []

    def third(state):
        seen.append((state.nit, state.fun, state.feasible_share))
        return state.nit == 3

    stopped = pso(sphere, *BOX, callback=third)
    assert (stopped.status, stopped.nit) == (3, 3)
    assert [nit for nit, _, _ in seen] == [1, 2, 3]
    assert seen[-1][1] == stopped.fun


def test_given_points_are_used_and_fixed_coordinates_stay():
    result = pso(sphere, [0, 1, 1, 1], [5, 1, 1, 1], iterations=0, initial=[[1, 1, 1, 1]])
    assert result.fun == 0.0
    assert result.candidates[:, 1:].tolist() == [[1.0, 1.0, 1.0]] * 60


def test_paper_preset_is_the_papers_rule():
    """With eps1 = eps2 = 2 and everybody's best, equal to the same call spelled out."""
    spelled = pso(
        rastrigin, *BOX, topology="global", cognitive=2, social=2, inertia=(0.9, 0.4), stagnation=None, seed=3
    )
    np.testing.assert_array_equal(pso(rastrigin, *BOX, preset="paper", seed=3).x, spelled.x)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ({"lower": [0.0, 2.0], "upper": [1.0, 1.0]}, r"lower\[1\] = 2 is above upper\[1\] = 1"),
        ({"lower": [0.0], "upper": [1.0, 1.0]}, "upper"),
        ({"lower": [0.0], "upper": [np.inf]}, "upper"),
        ({"particles": 1}, "particles"),
        ({"iterations": -1}, "iterations"),
        ({"topology": "rng"}, "did you mean 'ring'"),
        ({"preset": "papers"}, "did you mean 'paper'"),
        ({"velocity_clamp": 1.5}, "velocity_clamp"),
        ({"stagnation": 0}, "stagnation"),
        ({"initial": [[0.5, 3.0]]}, r"initial\[0, 1\] = 3 is outside"),
        ({"seed": 0.5}, "seed"),
    ],
)
def test_bad_input_is_named(arguments, part):
    with pytest.raises(InputError, match=part):
        pso(**{"objective": sphere, "lower": [0.0, 0.0], "upper": [1.0, 1.0], **arguments})


def test_objective_of_wrong_shape_is_named():
    with pytest.raises(InputError, match="objective returned"):
        pso(lambda p: p, [0, 0], [1, 1])
