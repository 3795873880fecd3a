"""Proofs against closed forms, literature, the verdict, and each other."""

from __future__ import annotations

import warnings

import control as ct
import flint
import numpy as np
import pytest
from delay_cases import rows, system
from delay_oracles import random_loop, shifted
from random_systems import FAMILIES, random_system

import susp_ctrl as sc
from susp_ctrl.delay_systems.model import SystemMatrix
from susp_ctrl.delay_systems.proof import balls
from susp_ctrl.delay_systems.proof.argument import walk_along_axis
from susp_ctrl.delay_systems.proof.delay_matrix import DelayMatrix
from susp_ctrl.delay_systems.proof.quasi_polynomial import Expansion


def system_of(A, delays):
    return sc.DelayLTI.from_state_delays(A=A, delays=delays)


def delayed_integrator(gain):
    """x' = -gain x(t - 1): stable up to pi/2."""
    return system_of([[[0.0]], [[-gain]]], [1.0])


def half_car(front=19345.0, rear=26150.0, delays=(0.5530, 0.5186)):
    car = sc.HalfCar()
    channels = [
        sc.FeedbackChannel(f"unsprung_displacement_{axle}", f"force_{axle}", gain, delay)
        for axle, gain, delay in (("front", front, delays[0]), ("rear", rear, delays[1]))
    ]
    return sc.close_loop(car.plant(), channels)


@pytest.mark.analytical
@pytest.mark.parametrize("distance", [1e-3, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize("side", [-1, 1])
def test_near_the_limit_of_a_delayed_integrator(distance, side):
    proof = sc.prove_stability(delayed_integrator(np.pi / 2 + side * distance))
    assert proof.stable is (side < 0)
    assert proof.roots == (0 if side < 0 else 2)


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("unstable_root_count"))
def test_literature_counts(case, row):
    """Counts of tests/data/delay_cases.json, source in each case."""
    proof = sc.prove_stability(system(case, row.get("at_delays")))
    assert proof.roots == row["value"]
    assert proof.stable is (row["value"] == 0)


@pytest.mark.literature
@pytest.mark.parametrize(("case", "row"), rows("unstable_root_count_intervals"))
def test_literature_counts_in_the_middle_between_crossings(case, row):
    """Every interval of the common delay, source in each case."""
    several = len(case["delays"]) - 1
    for low, high, number in row["value"]:
        assert sc.prove_stability(system(case, [0.5 * (low + high)] * several)).roots == number


@pytest.mark.analytical
def test_numbers_that_conversions_lose():
    """Slow poles whose numerator was once trimmed, and states in units 1e17 apart: both unstable."""
    s = ct.tf("s")
    lag = sc.delay(100.0) * (2 * (1 - 500 * s) / (1000 * s + 1) ** 6)
    assert sc.prove_stability(sc.feedback(lag, 1)).stable is False
    A = [-np.eye(2), np.array([[0.0, 1e10], [-1e-7, 0.0]])]
    assert sc.prove_stability(system_of(A, [1.0])).stable is False


@pytest.mark.analytical
@pytest.mark.parametrize("plant", [ct.tf([1], [1, 0]), ct.tf([1], [1, 0, 4]), ct.tf([1], [1, 0, 0])])
def test_roots_on_the_axis_prove_nothing(plant):
    proof = sc.prove_stability(plant)
    assert proof.stable is None
    assert proof.roots is None
    assert "root lies on the line" in proof.reason
    with pytest.raises(ValueError, match="three values"):
        bool(proof)


@pytest.mark.property
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 6, 8, 9])
def test_a_line_on_either_side_of_the_rightmost_root(seed):
    A, delays = random_loop(seed)
    loop = system_of(A, delays)
    rightmost = sc.spectral_abscissa(loop)
    size = 1e-6 * (1.0 + abs(rightmost))
    assert sc.prove_stability(loop, right_of=rightmost + size).roots == 0
    assert sc.prove_stability(loop, right_of=rightmost - size).roots >= 1


@pytest.mark.property
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_determinants_written_out_and_enclosed_count_the_same(seed):
    A, delays = random_loop(seed)
    matrix = SystemMatrix.of_state_delays(
        A, np.zeros((len(A[0]), 0)), np.zeros((0, len(A[0]))), np.zeros((0, 0)), []
    )
    with flint.ctx.workprec(200):
        tau, gains = [flint.arb(float(d)) for d in delays], [flint.arb(1)] * len(delays)
        line = flint.arb(-0.01)
        counts = [
            walk_along_axis(f, 20_000).zeros
            for f in (
                Expansion.of(matrix, 10_000).at(tau, gains, line),
                DelayMatrix.of(matrix, tau, gains, line),
            )
        ]
    assert counts[0] is not None
    assert counts[0] == counts[1]


def contradictions(family, seeds, **work):
    """Return seeds whose verdict a proof contradicts, and how many were proven."""
    wrong, proven = [], 0
    for seed in seeds:
        A, delays = random_system(family, seed)
        loop = system_of(A, delays)
        proof = sc.prove_stability(loop, **work)
        proven += proof.stable is not None
        with warnings.catch_warnings(action="ignore", category=sc.UndecidedStabilityWarning):
            verdict = sc.stability(loop)
        if None not in (proof.stable, verdict.stable) and proof.stable is not verdict.stable:
            wrong.append((seed, proof, verdict))
        if None not in (proof.roots, verdict.unstable_roots) and proof.roots != verdict.unstable_roots:
            wrong.append((seed, proof, verdict))
    return wrong, proven


@pytest.mark.property
@pytest.mark.parametrize("family", [family for family in FAMILIES if family != "large"])
def test_verdicts_are_what_is_proven(family):
    wrong, _ = contradictions(family, range(2), most_intervals=60)
    assert wrong == []


@pytest.mark.slow
@pytest.mark.property
@pytest.mark.parametrize("family", FAMILIES)
def test_many_verdicts_are_what_is_proven(family):
    """Together some 450; of the large ones only those that 100 intervals decide."""
    few = family == "large"
    wrong, proven = contradictions(family, range(10 if few else 40), most_intervals=100 if few else 2000)
    assert wrong == []
    assert proven >= (0 if family in ("large", "integrator") else 32)


def near_critical(seed):
    """A system whose rightmost root lies at a known tiny distance from the axis."""
    A, delays = random_loop(seed)
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):
        rightmost = sc.spectral_abscissa(system_of(A, delays))
    random = np.random.default_rng([seed, 5])
    distance = random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-9.0, -2.0)
    return system_of(shifted(A, delays, rightmost - distance), delays)


def false_proofs(seeds):
    """Return the seeds of which few bits prove something else than many bits do, and how many few bits prove."""
    wrong, proven = [], 0
    for seed in seeds:
        loop = near_critical(seed)
        rough = sc.prove_stability(loop, precision=24, most_intervals=200)
        if rough.roots is not None:
            proven += 1
            if rough.roots != sc.prove_stability(loop).roots:
                wrong.append(seed)
    return wrong, proven


@pytest.mark.property
def test_few_bits_prove_nothing_false():
    wrong, proven = false_proofs(range(15))
    assert wrong == []
    assert proven > 0


@pytest.mark.slow
@pytest.mark.property
def test_few_bits_prove_nothing_false_of_many_systems():
    assert false_proofs(range(15, 315))[0] == []


@pytest.mark.property
def test_a_box_of_all_designs_around_one():
    loop = half_car()
    box = {
        name: [sorted((0.95 * v, 1.05 * v)) for v in values]
        for name, values in (("delays", loop.delays), ("gains", loop.gains))
    }
    proof = sc.prove_stability(loop, **box)
    assert proof.stable is True
    assert proof.delays.shape == proof.gains.shape == (2, 2)
    random = np.random.default_rng(2)
    for _ in range(10):
        inside = loop.with_delays(random.uniform(*proof.delays.T)).with_gains(random.uniform(*proof.gains.T))
        assert sc.stability(inside).stable is True


@pytest.mark.analytical
@pytest.mark.parametrize(("largest", "stable"), [(1.5, True), (1.57, True), (1.58, None)])
def test_a_box_up_to_the_limit_and_beyond(largest, stable):
    proof = sc.prove_stability(delayed_integrator(1.0), gains=[(0.1, largest)], most_boxes=60)
    assert proof.stable is stable


@pytest.mark.analytical
def test_a_delay_of_zero_may_be_the_end_of_a_box():
    assert sc.prove_stability(delayed_integrator(1.0), delays=[(0.0, 1.5)], most_boxes=200).stable is True
    assert sc.prove_stability(delayed_integrator(1.0), delays=[0.0]).stable is True


def test_what_is_no_range_is_named():
    loop = delayed_integrator(1.0)
    for delays in ([(2.0, 1.0)], [(1.0, 2.0, 3.0)], [-1.0], ["x"], [1.0, 2.0], 3.0):
        with pytest.raises(sc.InputError, match="delays"):
            sc.prove_stability(loop, delays=delays)
    with pytest.raises(sc.InputError, match="precision"):
        sc.prove_stability(loop, precision=8)


def test_without_the_library_the_line_that_installs_it_is_told(monkeypatch):
    monkeypatch.setattr(balls, "flint", None)
    with pytest.raises(sc.InputError, match="pip install"):
        sc.prove_stability(delayed_integrator(1.0))


def test_work_has_an_end():
    proof = sc.prove_stability(half_car(), most_intervals=3)
    assert proof.stable is None
    assert "3 intervals" in proof.reason
    assert "not proven" in str(proof)
