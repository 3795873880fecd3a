"""Delay-independent stability: closed forms, published thresholds, and delays that destabilise."""

from __future__ import annotations

import numpy as np
import oracles
import pytest
from delay_cases import matrices, row, system
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc
from susp_ctrl.delay_systems import small_gain_of_samples, small_gain_supremum
from susp_ctrl.delay_systems.channels import loop_plant
from susp_ctrl.delay_systems.crossings.torus import structured_gain


def states(*A):
    return sc.DelayLTI.from_state_delays(A=[np.atleast_2d(a) for a in A], delays=[1.0] * (len(A) - 1))


def channels(g1, g2, tau1=0.1, tau2=0.2):
    return [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", gain=g1, delay=tau1),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", gain=g2, delay=tau2),
    ]


def car_loop(g1, g2):
    return sc.close_loop(sc.HalfCar().plant(), channels(g1, g2))


def oracle_loop_gain(omega):
    """P22(jw) of the half car, unit gains, from eq. (1): wheel displacements per actuator force."""
    stiffness = oracles.dynamic_stiffness(1j * np.atleast_1d(omega))
    lf, lr = oracles.TABLE_1["Lf"], oracles.TABLE_1["Lr"]
    force = np.array([[-1.0, 0.0], [0.0, -1.0], [1.0, 1.0], [-lf, lr]])
    return np.linalg.solve(stiffness, np.broadcast_to(force.astype(complex), (stiffness.shape[0], 4, 2)))[
        :, :2
    ]


@pytest.mark.analytical
@pytest.mark.parametrize(("a", "b"), [(2.0, 1.0), (2.0, -1.9), (1.0, 0.2)])
def test_scalar_loop(a, b):
    """x' = -a x + b x(t - tau) with |b| < a: sup |b/(jw + a)| = |b|/a at zero frequency."""
    result = sc.delay_independent_stability(states([[-a]], [[b]]))
    assert result.stable is True
    assert result.margin == pytest.approx(a / abs(b), rel=1e-12)
    assert result.omega == 0.0
    assert result.exact


@pytest.mark.analytical
def test_scalar_loop_beyond_and_at_the_limit():
    beyond = sc.delay_independent_stability(states([[-1.0]], [[-1.5]]))
    assert beyond.stable is False
    assert beyond.margin == pytest.approx(1 / 1.5, rel=1e-12)
    assert sc.count_unstable_roots(states([[-1.0]], [[-1.5]]).with_delays(beyond.destabilising_delays)) > 0
    # x' = -x - x(t - tau) is stable for every finite delay: |mu| = 1 is reached at zero frequency only.
    assert sc.delay_independent_stability(states([[-1.0]], [[-1.0]])).stable is True


@pytest.mark.analytical
def test_resonant_loop():
    """x'' + 2 d x' + x = -k x(t - tau): sup |k/(1 - w^2 + 2 d j w)| = k/(2 d sqrt(1 - d^2)) at sqrt(1 - 2 d^2)."""
    d, k = 0.05, 0.09
    loop = states([[0.0, 1.0], [-1.0, -2 * d]], [[0.0, 0.0], [-k, 0.0]])
    result = sc.delay_independent_stability(loop)
    assert result.margin == pytest.approx(2 * d * np.sqrt(1 - d**2) / k, rel=1e-12)
    assert result.omega == pytest.approx(np.sqrt(1 - 2 * d**2), rel=1e-6)
    assert result.stable is True


@pytest.mark.analytical
def test_unstable_without_delay_and_integrating_plants():
    assert sc.delay_independent_stability(states([[1.0]], [[0.1]])).stable is False
    integrator = sc.delay_independent_stability(states([[0.0]], [[-1.0]]))
    assert integrator.stable is False
    assert integrator.margin == 0.0
    assert sc.delay_independent_stability(sc.HalfCar().plant()).stable is True


@pytest.mark.analytical
def test_touch_at_the_limit_is_not_decided():
    """|mu| touches one at omega = 1 (Haag 2009, example 1): no number of digits tells this from a crossing."""
    assert sc.delay_independent_stability(system("haag1_tangential_touch")).stable is None


@pytest.mark.literature
def test_corner_of_the_search_box():
    """Small gain at g = (34000, 44000) N/m: 0.4441 at 8.82 rad/s, recomputed from eq. (1) of the paper."""
    result = sc.delay_independent_stability(car_loop(34000.0, 44000.0))
    assert result.stable is True
    assert result.small_gain == pytest.approx(0.4441, abs=5e-5)
    assert result.small_gain_omega == pytest.approx(8.82, abs=5e-3)
    omega = np.linspace(8.0, 9.6, 4001)
    gain = np.abs(oracle_loop_gain(omega)) * np.array([34000.0, 44000.0])
    dense = np.abs(np.linalg.eigvals(gain)).max()
    assert dense <= result.small_gain <= dense * (1 + 1e-7)


@pytest.mark.literature
@pytest.mark.parametrize(
    ("gains", "threshold", "omega"), [((1.0, 0.0), 103229.0, 65.64), ((0.0, 1.0), 99402.0, 63.12)]
)
def test_single_channel_thresholds(gains, threshold, omega):
    """|g1| < 103229 N/m (65.64 rad/s), |g2| < 99402 N/m (63.12 rad/s) from eq. (1) of the paper."""
    result = sc.delay_independent_stability(car_loop(*gains))
    assert result.margin == pytest.approx(threshold, abs=0.6)
    assert result.omega == pytest.approx(omega, abs=6e-3)
    channel = int(np.argmax(gains))
    peak = np.abs(oracle_loop_gain(np.linspace(omega - 0.5, omega + 0.5, 4001))[:, channel, channel]).max()
    assert result.margin == pytest.approx(1 / peak, rel=1e-7)


@pytest.mark.literature
@pytest.mark.parametrize("gains", [(29653, -4416), (19345, 26150), (19287, 23930), (25333, 23371)])
def test_published_designs(gains):
    """All four designs of the paper are stable whatever their delays."""
    assert sc.delay_independent_stability(car_loop(*gains)).stable is True


@pytest.mark.literature
def test_limit_of_a_rank_two_block():
    """delay_independent_beta: sup rho((jw - A0)^-1 A1) = 2 beta, at zero frequency; lost at beta = 0.5."""
    A0, A1 = matrices("delay_independent_beta")
    limit = row("delay_independent_beta", "beta_limit_delay_independent")
    result = sc.delay_independent_stability(states(A0, A1 / 0.35))
    assert result.margin == pytest.approx(limit["value"], abs=limit["tolerance"])
    assert sc.delay_independent_stability(system("delay_independent_beta")).stable is True
    assert sc.delay_independent_stability(states(A0, A1 * (0.51 / 0.35))).stable is False


@pytest.mark.literature
def test_independent_delays_destabilise_what_equal_delays_do_not():
    """Haag 2009, example 6: stable for tau1 = tau2, not for independent delays."""
    loop = system("haag6_two_delay_oscillator")
    result = sc.delay_independent_stability(loop)
    assert result.stable is False
    assert result.exact
    assert sc.count_unstable_roots(loop.with_delays(result.destabilising_delays)) > 0


def random_matrix(rng, n=2):
    return rng.standard_normal((n, n)) + 1j * rng.standard_normal((n, n))


@pytest.mark.property
@settings(max_examples=60)
@given(st.integers(0, 2**31))
def test_structured_gain_is_the_largest_spectral_radius(seed):
    """The closed form against a dense search over the phase between the two channels."""
    P = random_matrix(np.random.default_rng(seed))
    phase = np.linspace(0.0, 2 * np.pi, 20001)
    turned = P * np.stack([np.ones_like(phase), np.exp(1j * phase)], axis=-1)[:, None, :]
    largest = np.abs(np.linalg.eigvals(turned)).max()
    assert structured_gain(P) == pytest.approx(largest, rel=1e-6)
    assert structured_gain(P) <= np.abs(np.linalg.eigvals(np.abs(P))).max() * (1 + 1e-12)


def random_loop(seed, scalar):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 6), rng.integers(1, 3)
    A = [rng.standard_normal((n, n)) - rng.uniform(0.5, 3) * np.eye(n)]
    for _ in range(m):
        r = 1 if scalar else rng.integers(1, n + 1)
        A.append(
            rng.uniform(0.05, 1.0) * rng.standard_normal((n, r)) @ rng.standard_normal((r, n)) / np.sqrt(n)
        )
    return sc.DelayLTI.from_state_delays(A=A, delays=np.ones(m)), rng


def check_verdict(seed, scalar):
    """True: no random delays are unstable. False: the delays given are, or a gain just above the margin is."""
    loop, rng = random_loop(seed, scalar)
    result = sc.delay_independent_stability(loop)
    if result.stable:
        for delays in rng.uniform(0.0, 1.0, (6, loop.delays.size)) * 10.0 ** rng.uniform(-2, 1.5, (6, 1)):
            assert sc.count_unstable_roots(loop.with_delays(delays)) in (0, None)
    elif result.stable is False and result.destabilising_delays is not None:
        assert sc.count_unstable_roots(loop.with_delays(result.destabilising_delays)) != 0
    if result.exact and 0.0 < result.margin < np.inf:
        # The plant is stable here, so a little less than the margin is safe and a little more is not.
        assert (
            sc.delay_independent_stability(loop.with_gains(loop.gains * result.margin * 0.999)).stable is True
        )
        more = sc.delay_independent_stability(loop.with_gains(loop.gains * result.margin * 1.01))
        assert more.stable is False


@pytest.mark.property
@settings(max_examples=25)
@given(st.integers(0, 2**31), st.booleans())
def test_verdicts_hold_for_random_loops(seed, scalar):
    check_verdict(seed, scalar)


@pytest.mark.property
@pytest.mark.slow
@settings(max_examples=300)
@given(st.integers(0, 2**31), st.booleans())
def test_verdicts_hold_for_many_random_loops(seed, scalar):
    check_verdict(seed, scalar)


@pytest.mark.property
def test_small_gain_for_many_gains_at_once():
    plant = loop_plant(sc.HalfCar().plant(), channels(1.0, 1.0))
    omega = np.linspace(1.0, 100.0, 400)
    p22 = oracle_loop_gain(omega)
    gains = np.random.default_rng(0).uniform(-3e5, 3e5, (5, 3, 2))
    many = small_gain_of_samples(p22, gains)
    assert many.shape == (5, 3)
    for index in np.ndindex(5, 3):
        one = np.abs(np.linalg.eigvals(np.abs(p22) * np.abs(gains[index]))).max()
        assert many[index] == pytest.approx(one, rel=1e-12)
        supremum, where = small_gain_supremum(plant, gains[index])
        assert supremum >= one * (1 - 1e-12)
        at_peak = np.abs(np.linalg.eigvals(np.abs(oracle_loop_gain(where)) * np.abs(gains[index]))).max()
        assert supremum == pytest.approx(at_peak, rel=1e-9)


@pytest.mark.analytical
def test_text_and_truth_value():
    result = sc.delay_independent_stability(car_loop(34000.0, 44000.0))
    assert "stable for all delays" in str(result)
    with pytest.raises(TypeError):
        bool(result)


@pytest.mark.analytical
def test_small_gain_of_many_channels_is_the_radius_itself():
    """A chain of nearly uncoupled channels, where cheap bounds of the radius are some percent too large."""
    rng = np.random.default_rng(4)
    A = [rng.normal(size=(4, 4)) - 4.0 * np.eye(4), *(rng.normal(size=(4, 4)) for _ in range(2))]
    loop = sc.DelayLTI.from_state_delays(A, [0.5, 1.1])
    found = sc.delay_independent_stability(loop)
    B, C = np.hstack([np.eye(4)] * 2), np.vstack(A[1:])
    P = C @ np.linalg.solve(1j * found.small_gain_omega * np.eye(4) - A[0], B)
    assert found.small_gain == pytest.approx(np.abs(np.linalg.eigvals(np.abs(P))).max(), rel=1e-8)
