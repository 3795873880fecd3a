"""Delayed signals that are one, that cancel, or that only seem to: Smith predictors and their relatives.

With an exact model the delay leaves the characteristic equation: the roots are those of the loop without delay and
those of plant and model.
"""

from __future__ import annotations

import control
import numpy as np
import pytest
from delay_oracles import characteristic_matrix

import susp_ctrl as sc
from susp_ctrl.delay_systems.model import CharacteristicMatrix

FIRST_ORDER = control.tf([1], [1, 1]), control.tf([1.8, 4.0], [1, 0])
SECOND_ORDER = control.tf([1e4], [1, 200, 1e4]), control.tf([0.5, 30.0], [1, 0])
THIRD_ORDER = control.tf([2.0], [1, 3, 3, 1]), control.tf([0.4, 0.1], [1, 0])


def predictor(plant, law, delayed_plant, delayed_model):
    return sc.feedback(delayed_plant * sc.feedback(law, plant - delayed_model), 1)


def out(plant, delay):
    return sc.delay(delay) * plant


def into(plant, delay):
    return plant * sc.delay(delay)


def both(plant, delay):
    return sc.delay(0.4 * delay) * plant * sc.delay(0.6 * delay)


@pytest.mark.analytical
@pytest.mark.parametrize(("plant", "law"), [FIRST_ORDER, SECOND_ORDER, THIRD_ORDER])
@pytest.mark.parametrize("ways", [(out, out), (into, into), (into, out), (both, both), (both, out)])
@pytest.mark.parametrize("delay", [0.3, 40.0, pytest.param(400.0, marks=pytest.mark.slow)])
def test_the_delay_of_an_exact_smith_predictor_moves_no_root(plant, law, ways, delay):
    loop = predictor(plant, law, ways[0](plant, delay), ways[1](plant, delay))
    closed = control.feedback(law * plant, 1)
    expected = np.concatenate([closed.poles(), plant.poles(), plant.poles()])
    # the models share the control signal: not every product keeps a pole of its own
    found = sc.characteristic_roots(loop, 20)
    gap = np.abs(found[:, None] - expected)
    assert (
        np.max(gap.min(axis=1)) < 1e-4
    )  # a pole of the sixth order is known to the sixth root of rounding only
    assert np.max(np.abs(closed.poles()[:, None] - found).min(axis=1)) < 1e-7
    verdict = sc.stability(loop)
    assert verdict.stable is True
    assert verdict.abscissa == pytest.approx(max(expected.real), rel=1e-3)


@pytest.mark.analytical
@pytest.mark.filterwarnings("ignore:characteristic roots may be missing:RuntimeWarning")
@pytest.mark.parametrize("mismatch", [0.2, 1e-3, 1e-6])
@pytest.mark.parametrize("way", [out, into])
def test_a_model_that_is_not_exact_keeps_its_delay(mismatch, way):
    """``(1 + C G) + C g e^{-s tau}`` with the gain of the plant off by g."""
    plant, law = FIRST_ORDER
    loop = predictor(plant, law, (1.0 + mismatch) * way(plant, 4.0), out(plant, 4.0))
    assert CharacteristicMatrix.of(loop.folded).n_channels > 0
    found = sc.characteristic_roots(loop, 4)
    own = found[np.abs(found + 1.0) > 1e-3]
    equation = own * (own + 1.0) + (1.8 * own + 4.0) * (1.0 + mismatch * np.exp(-4.0 * own))
    size = np.abs(own) ** 2 + np.abs(1.8 * own + 4.0) * (1.0 + mismatch * np.abs(np.exp(-4.0 * own)))
    assert own.size >= 2
    assert np.max(np.abs(equation) / size) < 1e-9


@pytest.mark.analytical
def test_delayed_matrices_of_one_delay_are_added():
    """A[1] and A[2] of the same delay cancel in part; the sum has the only root that moves."""
    A = [-np.eye(3), np.outer([1.0, 2.0, 0.0], [1.0, 0.0, 1.0]), -np.outer([1.0, 1.0, 0.0], [1.0, 0.0, 1.0])]
    loop = sc.DelayLTI.from_state_delays(A=A, delays=[2.0, 2.0])
    K = CharacteristicMatrix.of(loop.folded)
    assert K.n_channels == 0  # B = (0, 1, 0), C = (1, 0, 1): no way back
    A[2] = -0.5 * A[2]
    K = CharacteristicMatrix.of(sc.DelayLTI.from_state_delays(A=A, delays=[2.0, 2.0]).folded)
    assert K.n_channels == 1
    s = np.array([0.3 + 2.0j, -0.5 + 0.1j])
    assert np.allclose(
        np.linalg.det(K(s)), np.linalg.det(characteristic_matrix(A, [2.0, 2.0], s)), rtol=1e-12
    )


@pytest.mark.analytical
@pytest.mark.parametrize("gain", [1e-3, 1e-9, 1e-15])
def test_weak_channels_are_kept(gain):
    """A small gain beside large entries is no rounding: nothing cancels."""
    loop = sc.DelayLTI.from_state_delays(A=[np.diag([-1.0, -1e6]), gain * np.eye(2)], delays=[1.0])
    assert CharacteristicMatrix.of(loop.folded).n_channels == 2


@pytest.mark.analytical
def test_a_slow_transfer_is_not_measured_by_a_fast_one():
    """Fast modes cancel exactly; the poles of the slow ones differ by a billionth, which the delay can tell."""
    A = np.diag([-1.0, -1.0 - 1e-9, -1e6, -1e6])
    A1 = np.outer([1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1e6, -1e6])
    loop = sc.DelayLTI.from_state_delays(A=[A, A1], delays=[1.0])
    assert CharacteristicMatrix.of(loop.folded).n_channels == 1
