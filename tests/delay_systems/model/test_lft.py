"""The sampled plant and the linear fractional response against direct solves."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems.model.lft import (
    Realization,
    lft_response,
    return_determinant,
    sample_plant,
)


def random_plant(seed: int, n: int, m: int, p: int = 2, q: int = 3) -> Realization:
    rng = np.random.default_rng(seed)
    sizes = {"A": (n, n), "B1": (n, q), "B2": (n, m), "C1": (p, n), "C2": (m, n)}
    sizes |= {"D11": (p, q), "D12": (p, m), "D21": (m, q), "D22": (m, m)}
    return Realization(**{name: rng.normal(size=shape) for name, shape in sizes.items()})


def dense(r: Realization, s: complex) -> np.ndarray:
    B, C = np.hstack([r.B1, r.B2]), np.vstack([r.C1, r.C2])
    return np.block([[r.D11, r.D12], [r.D21, r.D22]]) + C @ np.linalg.solve(s * np.eye(r.n_states) - r.A, B)


@pytest.mark.property
@given(seed=st.integers(0, 10_000), n=st.integers(0, 6), m=st.integers(0, 4))
def test_sampled_plant_equals_a_dense_solve_at_each_point(seed: int, n: int, m: int) -> None:
    plant = random_plant(seed, n, m)
    s = np.array([0.3 + 2.0j, 5.0j, -0.2 + 40j])
    blocks = sample_plant(plant, s)
    for k, point in enumerate(s):
        expected = dense(plant, point)
        sampled = np.block([[blocks.p11[k], blocks.p12[k]], [blocks.p21[k], blocks.p22[k]]])
        np.testing.assert_allclose(
            sampled, expected, rtol=1e-9, atol=1e-10 * np.abs(expected).max(initial=1.0)
        )


@pytest.mark.analytical
def test_a_jordan_block_is_sampled_as_accurately_as_any_other_plant() -> None:
    """1/(s+1)^4 as one Jordan block: A has no basis of eigenvectors, the Schur form does not mind."""
    A = -np.eye(4) + np.diag(np.ones(3), 1)
    empty = np.zeros((4, 0))
    plant = Realization(
        A, np.eye(4)[:, [3]], empty, np.eye(4)[[0]], empty.T, np.zeros((1, 1)),
        np.zeros((1, 0)), np.zeros((0, 1)), np.zeros((0, 0)),
    )  # fmt: skip
    s = 1j * np.logspace(-2, 2, 50)
    np.testing.assert_allclose(sample_plant(plant, s).p11[:, 0, 0], 1.0 / (s + 1.0) ** 4, rtol=1e-13)


@pytest.mark.property
@given(seed=st.integers(0, 10_000), m=st.integers(0, 4))
def test_response_and_determinant_of_a_whole_swarm_equal_the_definition(seed: int, m: int) -> None:
    plant = random_plant(seed, 3, m)
    rng = np.random.default_rng(seed + 1)
    s = 1j * rng.uniform(0.1, 9.0, 5)
    blocks = sample_plant(plant, s)
    E = 0.3 * np.exp(1j * rng.uniform(0, 6, (7, 5, m)))
    response, determinant = lft_response(blocks, E), return_determinant(blocks.p22, E)
    assert response.shape == (7, 5, 2, 3)
    for i in range(7):
        for k in range(5):
            loop = np.eye(m) - blocks.p22[k] @ np.diag(E[i, k])
            expected = blocks.p11[k] + blocks.p12[k] @ np.diag(E[i, k]) @ np.linalg.solve(loop, blocks.p21[k])
            np.testing.assert_allclose(response[i, k], expected, rtol=1e-8, atol=1e-9)
            np.testing.assert_allclose(determinant[i, k], np.linalg.det(loop), rtol=1e-8, atol=1e-10)


@pytest.mark.analytical
def test_a_pole_that_cancels_leaves_the_limit():
    """(1 - e^{-2s})/s is 2 at zero, its square over s^2 is 4; 1/s and e^{-s}/s are infinite there."""
    integrator = control.tf([1.0], [1.0, 0.0])
    average = (1 - sc.delay(2.0)) * integrator
    assert average.dcgain() == pytest.approx(2.0)
    assert (average * average).dcgain() == pytest.approx(4.0)
    assert average(np.array([0.0, 1e-9j]))[0] == pytest.approx(2.0)
    assert sc.feedback(2 * (1 - sc.delay(1.0)) * integrator, 1).dcgain() == pytest.approx(2.0 / 3.0)
    assert sc.feedback(integrator, integrator).dcgain() == pytest.approx(0.0, abs=1e-30)
    assert np.isinf(sc.DelayLTI.of(integrator).dcgain())
    assert np.isinf((sc.delay(1.0) * integrator).dcgain())
    assert np.isinf((1 + 1e-3 * sc.delay(1.0) * integrator).dcgain())
