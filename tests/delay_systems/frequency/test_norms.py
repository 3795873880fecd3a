"""Norms against closed forms, published values, Gramians and brute force; refusals."""

from __future__ import annotations

import control as ct
import numpy as np
import oracles
import pytest

import susp_ctrl as sc
from susp_ctrl.delay_systems.frequency import norms
from susp_ctrl.delay_systems.frequency.adaptive_quadrature import integrate
from susp_ctrl.delay_systems.frequency.high_frequency import leading_terms, squared_tail
from susp_ctrl.delay_systems.frequency.response_bounds import local_response, tail_bound

LAG = ct.tf([1], [1, 1])


def hot_shower(h):
    """x' = -x(t - h) + u, y = x."""
    return sc.DelayLTI.from_state_delays([[[0.0]], [[-1.0]]], [h], B=[[1.0]], C=[[1.0]])


def random_loop(seed, states=3, delays=2, size=2):
    """A stable system: small-gain by construction, as the delayed matrices are small beside A0."""
    rng = np.random.default_rng(seed)
    A0 = rng.normal(size=(states, states))
    A0 -= (np.linalg.eigvals(A0).real.max() + 0.4) * np.eye(states)
    omega = np.linspace(0, 30, 3000)
    reach = np.linalg.norm(
        np.linalg.inv(1j * omega[:, None, None] * np.eye(states) - A0), 2, axis=(1, 2)
    ).max()
    delayed = [
        0.8 / (reach * delays) * M / np.linalg.norm(M, 2) for M in rng.normal(size=(delays, states, states))
    ]
    return sc.DelayLTI.from_state_delays(
        [A0, *delayed],
        rng.uniform(0.1, 2.0, delays),
        B=rng.normal(size=(states, size)),
        C=rng.normal(size=(size, states)),
    )


# ------------------------------------------------------------------------------------------------ literature


@pytest.mark.literature
@pytest.mark.parametrize(
    ("h", "value"),
    [(0.1, 0.7434230257686), (0.2, 0.7820002814737), (0.5, 0.9180948799466), (1.0, 1.305416301862)],
)
def test_h2_of_the_hot_shower(h, value):
    """Jarlebring, Vanbiervliet, Michiels 2011, p. 820: sqrt(cos(ah)/(2a(1 - sin(ah)))); 13 digits."""
    found = sc.h2_norm(hot_shower(h))
    assert found == pytest.approx(value, abs=1e-9)
    assert found == pytest.approx(np.sqrt(np.cos(h) / (2 * (1 - np.sin(h)))), rel=1e-9)


@pytest.mark.literature
def test_hinf_of_the_two_state_benchmark():
    """PIETOOLS H-infinity example A.1 at tau = 0.846: published 0.2364; reference 0.2364429339948."""
    system = sc.DelayLTI.from_state_delays(
        [[[-2.0, 0.0], [0.0, -0.9]], [[-1.0, 0.0], [-1.0, -1.0]]], [0.846], B=[[-0.5], [1]], C=[[1, 0]]
    )
    norm, peak = sc.hinf_norm(system)
    assert norm == pytest.approx(0.2364, abs=5e-5)
    assert norm == pytest.approx(0.2364429339948, abs=1e-10)
    assert peak == pytest.approx(2.153954795236, rel=1e-6)


@pytest.mark.literature
def test_hinf_of_the_double_delay_oscillator():
    """x'' - 0.1 x' + x + x(t - 0.5) - x(t - 1) = 0, PIETOOLS example D: gamma = 4.9784."""
    system = sc.DelayLTI.from_state_delays(
        [[[0.0, 1.0], [-1.0, 0.1]], [[0.0, 0.0], [-1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]]],
        [0.5, 1.0],
        B=[[-0.5], [1]],
        C=[[1, 0]],
    )
    norm, peak = sc.hinf_norm(system)
    assert norm == pytest.approx(4.9784, abs=5e-5)
    assert norm == pytest.approx(4.97844832294, rel=1e-10)
    assert peak == pytest.approx(1.22993815693, rel=1e-6)


# ---------------------------------------------------------------------------------------------- closed forms


@pytest.mark.analytical
def test_h2_of_delayed_inputs_and_outputs():
    """A delay in series changes nothing; 1 + delay adds the autocorrelation exp(-tau) of a lag."""
    assert sc.h2_norm(LAG) == pytest.approx(np.sqrt(0.5), rel=1e-9)
    assert sc.h2_norm(sc.delay(0.4) * LAG) == pytest.approx(np.sqrt(0.5), rel=1e-9)
    assert sc.h2_norm(LAG * sc.delay(0.4)) == pytest.approx(np.sqrt(0.5), rel=1e-9)
    assert sc.h2_norm((1 + sc.delay(0.4)) * LAG) == pytest.approx(np.sqrt(1 + np.exp(-0.4)), rel=1e-9)
    assert sc.h2_norm((1 - sc.delay(0.4)) * LAG) == pytest.approx(np.sqrt(1 - np.exp(-0.4)), rel=1e-9)
    chain = sc.delay(0.3) * (1 + sc.delay(0.4)) * (1 + sc.delay(0.7)) * LAG
    # lags 0, 0.4, 0.7, 1.1: sum of exp(-|difference|)/2 over all pairs
    times = np.array([0.0, 0.4, 0.7, 1.1])
    expected = np.sqrt(0.5 * np.exp(-np.abs(times[:, None] - times)).sum())
    assert sc.h2_norm(chain) == pytest.approx(expected, rel=1e-9)


@pytest.mark.analytical
def test_h2_is_infinite_with_direct_feedthrough():
    assert sc.h2_norm(1 + LAG * sc.delay(0.1)) == np.inf
    assert sc.h2_norm(sc.delay(0.2)) == np.inf
    assert sc.h2_norm(LAG + 1e-6 * sc.delay(0.2)) == np.inf


@pytest.mark.analytical
def test_hinf_closed_forms():
    assert sc.hinf_norm(sc.delay(1.0))[0] == pytest.approx(1.0, rel=1e-12)
    norm, peak = sc.hinf_norm(1 - sc.delay(0.5))
    assert norm == pytest.approx(2.0, rel=1e-9)
    assert np.cos(0.5 * peak) == pytest.approx(-1.0, abs=1e-6)
    assert sc.hinf_norm(LAG * sc.delay(0.3)) == (pytest.approx(1.0, rel=1e-9), 0.0)
    norm, peak = sc.hinf_norm(ct.tf([1], [1, 2e-3, 1]))
    zeta = 1e-3
    assert norm == pytest.approx(1 / (2 * zeta * np.sqrt(1 - zeta**2)), rel=1e-9)
    assert peak == pytest.approx(np.sqrt(1 - 2 * zeta**2), rel=1e-6)
    assert sc.hinf_norm(ct.tf([1, 0], [1, 1])) == (pytest.approx(1.0, rel=1e-7), np.inf)
    # a very sharp peak far above everything else
    sharp = LAG * sc.delay(0.3) + ct.tf([20.0], [1, 1e-3, 1e6])
    s = 1j * np.linspace(999.99, 1000.01, 20001)
    assert sc.hinf_norm(sharp)[0] == pytest.approx(np.abs(sharp(s)).max(), rel=1e-6)
    assert sc.hinf_norm(sharp)[0] > 10


@pytest.mark.analytical
def test_hinf_of_independent_direct_delays_is_on_the_torus():
    """e^{-0.3 s} - e^{-sqrt(2) s} - e^{-s} reaches 3 only in the limit of incommensurate phases."""
    norm, _ = sc.hinf_norm(sc.delay(0.3) - sc.delay(np.sqrt(2.0)) - sc.delay(1.0), tolerance=1e-5)
    assert 3.0 * (1 - 1e-5) <= norm <= 3.0


# ------------------------------------------------------------------------------------ independent methods


@pytest.mark.property
@pytest.mark.parametrize("seed", range(6))
def test_norms_of_random_systems_against_gramian_and_dense_samples(seed):
    system = random_loop(seed)
    approximation = system.pade(14)
    gramian = ct.lyap(approximation.A, approximation.B @ approximation.B.T)
    h2 = np.sqrt(np.trace(approximation.C @ gramian @ approximation.C.T))
    # the approximation is an all-pass: its error sits at frequencies that hardly count
    assert sc.h2_norm(system) == pytest.approx(h2, rel=1e-4)
    omega = np.linspace(0, 40, 40001)
    dense = np.linalg.norm(np.moveaxis(system(1j * omega), -1, 0), 2, axis=(1, 2))
    norm, peak = sc.hinf_norm(system)
    assert dense.max() <= norm * (1 + 1e-8)
    assert norm == pytest.approx(dense.max(), rel=1e-6)
    assert abs(peak - omega[dense.argmax()]) < 2e-3
    assert np.linalg.norm(system(1j * peak), 2) == pytest.approx(norm, rel=1e-12)


@pytest.mark.analytical
def test_half_car_norms_against_the_oracle():
    delays, gains = (0.553, 0.5186), (19345.0, 26150.0)
    loop = sc.close_loop(
        sc.HalfCar().plant(),
        [
            sc.FeedbackChannel("unsprung_displacement_front", "force_front", gains[0], delays[0]),
            sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", gains[1], delays[1]),
        ],
    )
    omega = np.linspace(0.0, 3000.0, 600_001)
    exact = oracles.ride_response(1j * omega, gains, delays)
    norm, peak = sc.hinf_norm(loop["body_acceleration", "road_front"])
    assert norm == pytest.approx(np.abs(exact[:, 0, 0]).max(), rel=1e-6)
    assert peak == pytest.approx(omega[np.abs(exact[:, 0, 0]).argmax()], abs=0.01)
    front = np.abs(exact[:, 2, 0]) ** 2
    # suspension deflection falls with the third power: the tail beyond 3000 rad/s does not count
    h2 = np.sqrt(np.trapezoid(front, omega) / np.pi)
    assert sc.h2_norm(loop["suspension_deflection_front", "road_front"]) == pytest.approx(h2, rel=1e-5)
    road = 1e-4
    rms = sc.output_rms(
        loop[["body_acceleration", "pitch_acceleration"], "road_front"],
        lambda w: road / w**2,
        (0.5, 400.0),
    )
    band = (omega >= 0.5) & (omega <= 400.0)
    density = np.abs(exact[band, :2, 0]) ** 2 * (road / omega[band] ** 2)[:, None]
    assert rms == pytest.approx(np.sqrt(np.trapezoid(density, omega[band], axis=0)), rel=1e-5)


@pytest.mark.analytical
def test_output_rms_closed_form_and_independent_inputs():
    """White noise through a lag in a band: arctangent; independent inputs add in power."""
    value = sc.output_rms(LAG * sc.delay(0.7), lambda w: 3.0, (0.5, 20.0))
    assert value == pytest.approx([np.sqrt(3 * (np.arctan(20) - np.arctan(0.5)))], rel=1e-8)
    both = sc.append(LAG, 2 * LAG * sc.delay(0.1))
    both = np.ones((1, 2)) * both
    value = sc.output_rms(both, {"u[0]": lambda w: 3.0, "u[1]": np.ones_like}, (0.0, 20.0))
    assert value == pytest.approx([np.sqrt((3 + 4) * np.arctan(20))], rel=1e-8)
    alone = sc.output_rms(both, {"u[1]": np.ones_like}, (0.0, 20.0))
    assert alone == pytest.approx([np.sqrt(4 * np.arctan(20))], rel=1e-8)


@pytest.mark.literature
def test_rear_wheel_over_the_same_road_is_a_delay():
    """Passive car of Table 1 on an ISO 8608 class C road at 20 m/s, 0.011 to 2.83 cycle/m (project notes).

    The values there are given to four digits: 0.9291 m/s2, 0.7078 rad/s2, 0.0116, 0.0112, 0.0040, 0.0042 m.
    """
    speed, car = 20.0, oracles.TABLE_1
    outputs = list(oracles.RIDE_OUTPUTS[:6])
    roads = sc.append(1.0, sc.delay((car["Lf"] + car["Lr"]) / speed)) * np.ones((2, 1))
    system = sc.DelayLTI(sc.HalfCar().plant())[outputs, ["road_front", "road_rear"]] * roads
    band = tuple(2 * np.pi * speed * np.array([0.011, 2.83]))
    rms = sc.output_rms(system, lambda w: 2 * np.pi * 256e-6 * 0.1**2 * speed / w**2, band)
    assert rms == pytest.approx([0.9291, 0.7078, 0.0116, 0.0112, 0.0040, 0.0042], abs=5.1e-5)


@pytest.mark.property
@pytest.mark.parametrize("seed", range(5))
def test_bounds_hold(seed):
    """No frequency within reach exceeds the local bound; none beyond exceeds the tail bound."""
    rng = np.random.default_rng(seed)
    system = random_loop(seed + 50) * sc.delay([0.3, 0.8])
    loop = system.folded
    centre = rng.uniform(0, 10, 12)
    for width in (1e-3, 0.02, 0.1):
        half = np.full(12, width)
        bound = local_response(loop, centre, half).upper_bound(half)
        for offset in np.linspace(-width, width, 11):
            gain = np.linalg.norm(np.moveaxis(system(1j * (centre + offset)), -1, 0), 2, axis=(1, 2))
            assert np.all(gain <= bound * (1 + 1e-12))
        if width == 1e-3:
            assert np.all(bound < 1.01 * gain + 1e-3)
    tail = tail_bound(loop)
    omega = np.geomspace(1.01 * tail.start, 1e4 * tail.start, 300)
    gain = np.linalg.norm(np.moveaxis(system(1j * omega), -1, 0), 2, axis=(1, 2))
    assert np.all(gain <= [tail.at(w) * (1 + 1e-12) for w in omega])


@pytest.mark.analytical
def test_quadrature_meets_its_tolerance():
    assert integrate(np.sin, 0.0, 1000.0, 1e-10, scale=1.0).value == pytest.approx(
        1 - np.cos(1000.0), abs=1e-9
    )
    narrow = integrate(lambda x: 1e-6 / ((x - 0.3217) ** 2 + 1e-12), 0.0, 1.0, 1e-10).value
    assert narrow == pytest.approx(np.arctan(0.6783e6) + np.arctan(0.3217e6), rel=1e-9)


# ------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    "norm", [sc.h2_norm, sc.hinf_norm, lambda s: sc.output_rms(s, np.ones_like, (0.1, 1.0))]
)
def test_unstable_and_undecided_systems_are_refused(norm):
    with pytest.raises(sc.UnstableSystemError, match="unstable"):
        norm(hot_shower(1.6))
    with pytest.raises(sc.UnstableSystemError, match="unstable"):
        norm(ct.tf([1], [1, -1]) * sc.delay(0.1))
    with (
        pytest.warns(sc.UndecidedStabilityWarning),
        pytest.raises(sc.UnstableSystemError, match="not proven"),
    ):
        norm(ct.tf([1], [1, 0]) * sc.delay(0.1))


def test_wrong_arguments_are_named():
    two = sc.append(LAG, LAG)
    for wrong, name in [
        (lambda: sc.output_rms(two, np.ones_like, (0.1, 1.0)), "psd"),
        (lambda: sc.output_rms(two, {"w": np.ones_like}, (0.1, 1.0)), "psd"),
        (lambda: sc.output_rms(LAG, lambda w: -w, (0.1, 1.0)), "psd"),
        (lambda: sc.output_rms(LAG, np.ones_like, (1.0, 0.1)), "omega_range"),
        (lambda: sc.output_rms(LAG, np.ones_like, (0.1, 1.0, 2.0)), "omega_range"),
        (lambda: sc.hinf_norm(LAG, tolerance=0.0), "tolerance"),
        (lambda: sc.h2_norm("G"), "sys"),
    ]:
        with pytest.raises(sc.InputError, match=name):
            wrong()


@pytest.mark.property
def test_the_h2_norm_asks_once_where_the_peaks_are(monkeypatch):
    """However often the band is widened; the roots are hints, no proof is asked."""
    asked = []
    probable = norms.probable_roots
    monkeypatch.setattr(norms, "probable_roots", lambda K, count: asked.append(count) or probable(K, count))
    A = [np.array([[-1.0, 3.0], [-3.0, -1.0]]), 0.3 * np.eye(2)]
    loop = sc.DelayLTI.from_state_delays(A=A, delays=[0.5], B=[[1.0], [0.0]])
    assert sc.h2_norm(loop) > 0.0
    assert len(asked) == 1


@pytest.mark.analytical
def test_the_h2_norm_keeps_its_tolerance_beside_narrow_peaks_and_oscillating_tails():
    """Closed forms: sqrt(1/4 zeta), and the inner products of e^{-at} and a delayed e^{-t}."""
    for zeta in (1e-2, 1e-4, 1e-5, 1e-6):
        resonance = ct.tf([1.0], [1.0, 2.0 * zeta, 1.0])
        assert sc.h2_norm(sc.delay(0.1) * resonance) == pytest.approx(np.sqrt(0.25 / zeta), rel=1e-9)
    for a in (1e-3, 0.1, 2.0):
        both = ct.tf([1.0], [1.0, a]) + sc.delay(1.0) * ct.tf([1.0], [1.0, 1.0])
        expected = np.sqrt(0.5 / a + 0.5 + 2.0 * np.exp(-a) / (1.0 + a))
        assert sc.h2_norm(both) == pytest.approx(expected, rel=1e-9)


def test_a_norm_that_would_take_too_long_says_so():
    slow_and_fast = ct.tf([1.0], [1e-6, 1.0]) + sc.delay(1.0) * ct.tf([1.0], [1.0, 1.0])
    with pytest.raises(sc.TooMuchWorkError, match="a larger tolerance is needed"):
        sc.h2_norm(slow_and_fast)


@pytest.mark.analytical
@pytest.mark.parametrize("slow", [1e-15, 1e-13, 1e-9, 1e-4, 1.0])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_h2_norm_with_a_pole_far_slower_than_the_others(slow, unit):
    """(s + 1)/(s^2 + 2 s + a0): the square is (a0 + 1)/(4 a0); a delay changes nothing."""
    plant = ct.tf([1.0 / unit, 1.0 / unit**2], [1.0, 2.0 / unit, slow / unit**2])
    exact = np.sqrt((slow + 1.0) / (4.0 * slow) / unit)
    assert sc.h2_norm(sc.delay(unit) * plant) == pytest.approx(exact, rel=2e-9)


@pytest.mark.analytical
@pytest.mark.parametrize("fast", [1e2, 1e3, 1e4])
def test_h2_norm_of_a_fast_path_beside_a_slow_one(fast):
    """e^-s/(s + 1) + e^-0.5s b/(s + b): 1/2 + b/2 + 2 times the integral of both responses from t = 1 on."""
    both = sc.parallel(sc.delay(1.0) * ct.tf([1.0], [1.0, 1.0]), sc.delay(0.5) * ct.tf([fast], [1.0, fast]))
    exact = np.sqrt(0.5 + 0.5 * fast + 2.0 * fast * np.exp(-0.5 * fast) / (1.0 + fast))
    assert sc.h2_norm(both) == pytest.approx(exact, rel=2e-9)


@pytest.mark.analytical
def test_tail_of_a_delayed_sum_against_quadrature():
    """Of e^-s/(s + 2) - 3 e^-0.3s/(s + 5), by scipy from 2000 to 8000."""
    both = sc.parallel(sc.delay(1.0) * ct.tf([1.0], [1.0, 2.0]), -sc.delay(0.3) * ct.tf([3.0], [1.0, 5.0]))
    _, terms = leading_terms(both.folded)
    edges = np.linspace(2000.0, 8000.0, 4001)
    x, w = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(edges)
    omega = (0.5 * (edges[1:] + edges[:-1]))[:, None] + half[:, None] * x
    power = np.abs(both(1j * omega.ravel())) ** 2
    body = float(np.sum((power.reshape(omega.shape) @ w) * half))
    assert squared_tail(terms, 2000.0) - squared_tail(terms, 8000.0) == pytest.approx(body, rel=1e-10)
