"""Branch and bound over frequency and delay: what a second try in the singular basis spares, and bounded work."""

from __future__ import annotations

import numpy as np
import pytest

import susp_ctrl as sc
from susp_ctrl.delay_systems.crossings import CrossingSearch, DelayLine, Work, box_exclusion


def search(seed, work=None):
    """Full-rank delayed matrices, incommensurate delays."""
    random = np.random.default_rng(seed)
    A = [random.normal(size=(5, 5)) - np.eye(5), *(0.8 * random.normal(size=(2, 5, 5)))]
    loop = sc.DelayLTI.from_state_delays(A=A, delays=[1.3, 0.7])
    return CrossingSearch(DelayLine.of(loop, loop.delays, np.zeros(2), 1.0), work or Work())


@pytest.mark.property
@pytest.mark.parametrize("seed", [1, 3])
def test_the_singular_basis_spares_boxes_and_moves_no_crossing(monkeypatch, seed):
    with_basis = search(seed)
    found = with_basis.ways()[-1]()
    monkeypatch.setattr(
        box_exclusion,
        "_in_singular_basis",
        lambda x, chosen: box_exclusion._Expansion(*(part[chosen] for part in x)),
    )
    without = search(seed)
    expected = without.ways()[-1]()
    assert found.complete
    assert expected.complete
    assert np.allclose(np.sort(found.tau), np.sort(expected.tau), rtol=0.0, atol=1e-10)
    assert np.allclose(np.sort(found.omega), np.sort(expected.omega), rtol=1e-10)
    assert with_basis.work.left > without.work.left


@pytest.mark.property
def test_a_search_ends_when_its_work_is_spent():
    limited = search(1, Work(200))
    found = limited.ways()[-1]()
    assert not found.complete
    assert limited.work.spent
