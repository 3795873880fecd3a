"""Bounds of spectral radii."""

from __future__ import annotations

import numpy as np
import pytest

from susp_ctrl.delay_systems.model.perron import certified_radius


@pytest.mark.property
@pytest.mark.parametrize("size", [1e-280, 1e-8, 1.0, 1e8, 1e150])
def test_a_certified_radius_is_close_above(size):
    random = np.random.default_rng(3)
    for n in (1, 2, 5, 9):
        M = random.uniform(size=(n, n)) * size
        radius = np.max(np.abs(np.linalg.eigvals(M)))
        assert radius <= certified_radius(M) <= 1.02 * radius


@pytest.mark.parametrize("entry", [1e308, np.inf, np.nan])
def test_beyond_the_range_of_numbers_the_radius_is_infinite(entry):
    assert certified_radius(np.full((3, 3), entry)) == np.inf
