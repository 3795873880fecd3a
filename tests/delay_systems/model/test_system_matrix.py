"""What the user wrote is carried through all arithmetic: same response and same count as the realisation."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems import verdict as verdict_module
from susp_ctrl.delay_systems.model import DelaySystem, SystemMatrix


def transfer_function(rng):
    n = rng.integers(0, 4)
    den = np.poly(-rng.uniform(0.2, 3.0, n)) if n else [1.0]
    return ct.tf(rng.normal(size=max(n - rng.integers(0, 2), 0) + 1), den)


def state_delays(rng):
    delayed = 0.5 * rng.normal(size=(2, 2))
    return sc.DelayLTI.from_state_delays(
        [-2.0 * np.eye(2), delayed],
        [rng.uniform(0, 1)],
        B=rng.normal(size=(2, 1)),
        C=rng.normal(size=(1, 2)),
        input_terms=[(rng.normal(size=(2, 1)), 0.3)],
    )


def random_system(seed):
    """Some operations on a transfer function, a state space, state delays and a delay."""
    rng = np.random.default_rng(seed)
    state_space = ct.ss(
        -np.eye(2) + 0.3 * rng.normal(size=(2, 2)), [[1.0], [0.5]], rng.normal(size=(1, 2)), 0
    )
    given_parts = transfer_function(rng), state_space, state_delays(rng), sc.delay(rng.uniform(0, 1))
    parts = [sc.DelayLTI.of(part) for part in given_parts]
    bandwidth = None if rng.random() < 0.5 else 5.0
    channel = sc.FeedbackChannel(0, 0, 0.2, 0.1, actuator_bandwidth=bandwidth)
    operations = [
        lambda S, P: S + P,
        lambda S, P: S * P,
        lambda S, P: S - 2.0 * P,
        lambda S, P: sc.feedback(0.3 * S, P),
        lambda S, P: sc.append(S, P)[0, 0] + sc.append(S, P)[1, 1],
        lambda S, P: sc.close_loop(S, [channel, channel.replace(gain=0.1, delay=0.0)]),
        lambda S, P: sc.open_loop(S, channel) * P,
    ]
    system = parts[rng.integers(4)]
    for _ in range(rng.integers(1, 4)):
        system = operations[rng.integers(len(operations))](system, parts[rng.integers(4)])
    weights = rng.uniform(0.5, 1.5, (2, system.delays.size))
    return system.with_gains(system.gains * weights[0]).with_delays(system.delays * weights[1])


@pytest.mark.property
@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_response_and_count_are_those_of_the_realisation(seed):
    try:
        system = random_system(seed)
    except sc.NeutralLoopError:
        return
    if system.written is None:
        return
    s = 0.1 + 1j * np.array([0.1, 1.0, 7.0])
    expected = np.moveaxis(system.written.response(s, system.delays, system.gains), 0, -1)
    np.testing.assert_allclose(system(s, squeeze=False), expected, rtol=1e-9, atol=1e-12)
    assert sc.stability(system).agreement["argument principle"] == sc.count_unstable_roots(system)


@pytest.mark.parametrize("write", ["transfer function", "state delays"])
def test_a_realisation_that_lost_something_is_found_out(monkeypatch, write):
    """The roots and the sweep use the wrong realisation, the argument principle what was written: no verdict."""
    if write == "transfer function":
        loop = sc.feedback(sc.delay(1.0) * ct.tf([8.0], [1.0, 3.0, 3.0, 1.0]), 1)
        right = sc.feedback(sc.delay(1.0) * ct.tf([0.8], [1.0, 3.0, 3.0, 1.0]), 1)
    else:
        loop = sc.DelayLTI.from_state_delays([[[-1.0]], [[-2.0]]], [3.0])
        right = sc.DelayLTI.from_state_delays([[[-1.0]], [[-0.2]]], [3.0])
    assert sc.stability(loop).stable is False
    assert sc.stability(right).stable is True
    wrong = DelaySystem.of(right).with_written(loop.written)
    with pytest.warns(sc.UndecidedStabilityWarning, match="differ"):
        verdict = verdict_module.stability(wrong)
    assert verdict.stable is None


def test_what_is_given_as_state_space_has_nothing_else():
    assert sc.DelayLTI.of(ct.ss(-1.0, 1.0, 1.0, 0.0)).written is None
    assert (sc.delay(1.0) * ct.ss(-1.0, 1.0, 1.0, 0.0)).written is None
    system = sc.delay(1.0) * ct.tf([1.0], [1.0, 1.0])
    assert system.with_delays([2.0]).with_names(name="P").written is system.written


@pytest.mark.analytical
@pytest.mark.parametrize("factor", [1e-150, 1e-30, 1.0, 1e30, 1e60, 1e155, 1e200])
def test_a_common_factor_of_a_transfer_function_is_no_matter(factor):
    """e^-s/(s + 1), open and in a loop, as any multiple of both polynomials."""
    lag = sc.delay(1.0) * ct.tf([factor], [factor, factor])
    assert sc.stability(lag).stable is True
    verdict = sc.stability(sc.feedback(lag, 0.5))
    assert verdict.stable is True
    assert None not in verdict.agreement.values()


@pytest.mark.analytical
def test_a_common_factor_takes_no_coefficient_away():
    """1e-150/(1e200 (s + 1)): bringing the denominator near one would make the numerator zero."""
    written = SystemMatrix.of_transfer_function(ct.tf([1e-150], [1e200, 1e200]))
    assert any(1e-150 in matrix for matrix in written.terms.values())
