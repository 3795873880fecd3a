"""Curves of delays that several signals share: the coarse first look misses no sign of the full grid."""

from __future__ import annotations

import numpy as np
import pytest

import susp_ctrl as sc
from susp_ctrl.delay_systems.maps import shared_delays
from susp_ctrl.delay_systems.model import CharacteristicMatrix


@pytest.mark.property
@pytest.mark.parametrize("states", [2, 3, 4, 5])
def test_the_coarse_look_gives_the_signs_of_the_full_grid(states):
    random = np.random.default_rng(states)
    A = [random.normal(size=(states, states)) - 1.5 * np.eye(states)]
    A += [0.8 * random.normal(size=(states, states)) for _ in range(2)]
    K = CharacteristicMatrix.of(sc.DelayLTI.from_state_delays(A=A, delays=[1.0, 2.0]).folded)
    owner = (K.delays == 2.0).astype(int)
    blocks = shared_delays._Blocks(K, owner, np.zeros(K.n_channels))
    W, T = np.meshgrid(np.linspace(0.02, 5.0, 125), np.linspace(0.0, 2.0 * np.pi, 193), indexing="ij")
    full = blocks.level(W.ravel(), T.ravel()).reshape(W.shape) > 0.0
    assert np.any(full)
    assert not np.all(full)
    assert np.array_equal(shared_delays._signs(blocks, W, T), full)


@pytest.mark.property
def test_points_of_edges_are_on_the_curve():
    random = np.random.default_rng(3)
    A = [random.normal(size=(3, 3)) - 1.5 * np.eye(3), *(0.8 * random.normal(size=(2, 3, 3)))]
    K = CharacteristicMatrix.of(sc.DelayLTI.from_state_delays(A=A, delays=[1.0, 2.0]).folded)
    blocks = shared_delays._Blocks(K, (K.delays == 2.0).astype(int), np.zeros(K.n_channels))
    W, T = np.meshgrid(np.linspace(0.02, 5.0, 40), np.linspace(0.1, 6.0, 40), indexing="ij")
    positive = blocks.level(W.ravel(), T.ravel()).reshape(W.shape) > 0.0
    edges = np.argwhere(positive[1:] != positive[:-1])
    points = shared_delays._edge_points(blocks, W, T, edges, np.array([1, 0]))
    omega, first, second = points.T
    for w, x, y in zip(omega, first, second, strict=True):
        G = 1j * w * np.eye(3) - A[0] - A[1] * np.exp(-1j * x) - A[2] * np.exp(-1j * y)
        values = np.linalg.svd(G, compute_uv=False)
        assert values[-1] < 1e-7 * values[0]
