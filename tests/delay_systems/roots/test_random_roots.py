"""Roots of random systems: residuals, the argument principle, another discretisation, and known boundaries."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from delay_oracles import characteristic_matrix, full_state_roots, random_loop, shifted
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems.model.characteristic import CharacteristicMatrix
from susp_ctrl.delay_systems.roots.rightmost import reach_near_axis, roots_near_axis


def check_roots_and_count(seed):
    A, delays = random_loop(seed)
    loop = sc.DelayLTI.from_state_delays(A=A, delays=delays)
    K = CharacteristicMatrix.of(loop.folded)
    found = roots_near_axis(K, 6, reach_near_axis(K))
    right = int(np.sum(found.roots.real > 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.UndecidedStabilityWarning)
        count = sc.count_unstable_roots(loop)
    if count is None:
        assert np.min(np.abs(found.roots.real)) < 1e-8 * np.abs(A).max()
    else:
        assert right == count
    singular = np.linalg.svd(characteristic_matrix(A, delays, found.roots), compute_uv=False)
    size = np.abs(found.roots) + sum(
        np.linalg.norm(a, 2) * np.exp(-found.roots.real * tau)
        for a, tau in zip(A, [0.0, *delays], strict=True)
    )
    assert np.all(singular[:, -1] <= 1e-10 * size)
    if seed % 4 == 0:
        # the oracle resolves the rightmost root where it is not too fast; it must be among the roots found
        rightmost = full_state_roots(A, delays, 24)[0]
        if abs(rightmost) * max(delays) < 12.0:
            near = 1e-4 * (abs(rightmost) + np.abs(A[0]).max() + 1e-3)
            assert np.min(np.abs(found.roots - rightmost)) < near
    if seed % 3 == 0:
        distance = 10.0 ** np.random.default_rng(seed).uniform(-13.0, -2.0) * (abs(found.roots[0]) + 1e-3)
        for side in (-1.0, 1.0):
            shift = float(found.roots[0].real) + side * distance
            moved = sc.DelayLTI.from_state_delays(A=shifted(A, delays, shift), delays=delays)
            expected = int(np.sum(found.roots.real > shift))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sc.UndecidedStabilityWarning)
                assert sc.count_unstable_roots(moved) in (expected, None)


@pytest.mark.property
@settings(max_examples=120)
@given(st.integers(0, 2**31 - 1))
def test_random_roots_equal_the_argument_principle(seed):
    check_roots_and_count(seed)


@pytest.mark.property
@pytest.mark.slow
@settings(max_examples=2000)
@given(st.integers(2**31, 2**32 - 1))
def test_many_random_roots_equal_the_argument_principle(seed):
    check_roots_and_count(seed)


@pytest.mark.parametrize("line", [10.0, 1e6, 1e300])
def test_no_root_lies_right_of_the_bound(line):
    assert (
        sc.characteristic_roots(sc.DelayLTI.from_state_delays([[[0.0]], [[-1.0]]], [1.0]), right_of=line).size
        == 0
    )
