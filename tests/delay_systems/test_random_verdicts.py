"""Verdicts on families of random systems, against the winding number of the determinant of the matrices given."""

from __future__ import annotations

import warnings

import pytest
from random_systems import FAMILIES, random_system
from winding_oracle import unstable_roots

import susp_ctrl as sc


def differences(family, seeds):
    """Return the seeds whose verdict is wrong, or undecided where the oracle knows the number."""
    wrong = []
    for seed in seeds:
        A, delays = random_system(family, seed)
        try:
            expected = unstable_roots(A, delays)
        except ArithmeticError:  # a root on the axis
            expected = None
        with warnings.catch_warnings(action="ignore", category=sc.UndecidedStabilityWarning):
            verdict = sc.stability(sc.DelayLTI.from_state_delays(A, delays))
        if expected is None:
            agrees = verdict.stable is not True
        else:
            agrees = verdict.stable is (expected == 0) and verdict.unstable_roots in (expected, None)
        if not agrees:
            wrong.append((seed, expected, str(verdict)))
    return wrong


@pytest.mark.property
@pytest.mark.parametrize("family", FAMILIES)
def test_verdicts_of_random_systems(family):
    assert differences(family, range(2)) == []


@pytest.mark.slow
@pytest.mark.property
@pytest.mark.parametrize("family", FAMILIES)
def test_verdicts_of_many_random_systems(family):
    """Together 3,000."""
    assert differences(family, range(2, 252)) == []
