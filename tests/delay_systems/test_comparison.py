"""Padé against exact, order by order: errors recomputed from closed forms, wrong verdicts shown as such."""

from __future__ import annotations

import control as ct
import numpy as np
import oracles
import pytest
from scipy.special import lambertw

import susp_ctrl as sc
from susp_ctrl.delay_systems.approximation.spectral import spectral_approximation
from susp_ctrl.delay_systems.comparison import relative_error

A, K, TAU = 0.5, 1.2, 0.8


def scalar_loop():
    """x' = -0.5 x - 1.2 x(t - 0.8) + u, y = x."""
    return sc.DelayLTI.from_state_delays([[[-A]], [[-K]]], [TAU], B=[[1.0]], C=[[1.0]])


def half_car_loop(gains, delays):
    loop = sc.close_loop(
        half_car_plant(),
        [
            sc.FeedbackChannel("wheel_front", "force_front", gains[0], delays[0]),
            sc.FeedbackChannel("wheel_rear", "force_rear", gains[1], delays[1]),
        ],
    )
    omega = np.array([1.0, 9.0, 60.0])
    exact = oracles.ride_response(1j * omega, gains, delays)
    assert loop(1j * omega)[:, :2] == pytest.approx(np.moveaxis(exact[:, [0, 6, 7], :], 0, -1), rel=1e-9)
    return loop


def half_car_plant():
    car = oracles.TABLE_1
    front, rear = np.array([-1.0, 0, 1, -car["Lf"]]), np.array([0, -1.0, 1, car["Lr"]])
    inverse = np.diag([1 / car["mtf"], 1 / car["mtr"], 1 / car["m"], 1 / car["I"]])
    damping = car["csf"] * np.outer(front, front) + car["csr"] * np.outer(rear, rear)
    stiffness = car["ksf"] * np.outer(front, front) + car["ksr"] * np.outer(rear, rear)
    stiffness += np.diag([car["ktf"], car["ktr"], 0, 0])
    road = np.eye(4)[:, :2] * [car["ktf"], car["ktr"]]
    dynamics = np.block([[np.zeros((4, 4)), np.eye(4)], [-inverse @ stiffness, -inverse @ damping]])
    B = np.vstack([np.zeros((4, 4)), inverse @ np.column_stack([road, front, rear])])
    return ct.StateSpace(
        dynamics,
        B,
        np.vstack([dynamics[6], np.eye(8)[:2]]),
        np.vstack([B[6], np.zeros((2, 4))]),
        inputs=["road_front", "road_rear", "force_front", "force_rear"],
        outputs=["body_acceleration", "wheel_front", "wheel_rear"],
    )


def unstable_roots(gains, delays):
    """Phase of the oracle's characteristic function along the imaginary axis (8 roots without delay)."""
    omega = np.concatenate([np.linspace(0.0, 200.0, 40001), np.geomspace(200.0, 1e6, 4000)[1:]])
    phase = np.unwrap(np.angle(oracles.characteristic_function(1j * omega, gains, delays)))
    return round(4.0 - (phase[-1] - phase[0]) / np.pi)


@pytest.mark.analytical
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_errors_of_the_scalar_loop_against_polynomials(order):
    omega = np.linspace(0.0, 6.0, 101)
    row = sc.compare_pade(scalar_loop(), [order], omega).iloc[0]
    num, den = ct.pade(TAU, order)
    s = 1j * omega
    exact = 1 / (s + A + K * np.exp(-TAU * s))
    approximate = 1 / (s + A + K * np.polyval(num, s) / np.polyval(den, s))
    expected = np.abs(approximate - exact).max() / np.abs(exact).max()
    assert row["frequency_error"] == pytest.approx(expected, rel=1e-9)
    root = -A + lambertw(-K * TAU * np.exp(A * TAU)) / TAU
    roots = np.roots(np.polyadd(np.polymul([1, A], den), K * np.array(num)))
    rightmost = max(roots[roots.imag >= 0], key=lambda r: r.real)
    assert row["rightmost_root_error"] == pytest.approx(
        min(abs(rightmost - root), abs(rightmost - root.conj())), rel=1e-7
    )
    assert row["stable"] == (rightmost.real < 0)
    assert row["exact_stable"] == (root.real < 0)


@pytest.mark.analytical
def test_columns_and_convergence_of_both_approximations():
    omega = np.linspace(0.1, 8.0, 60)
    table = sc.compare_pade(scalar_loop(), [2, 4, 8, 16, 30], omega)
    assert list(table.columns) == [
        "order",
        "frequency_error",
        "rightmost_root_error",
        "stable",
        "exact_stable",
        "spectral_frequency_error",
        "spectral_rightmost_root_error",
        "spectral_stable",
    ]
    assert list(table["order"]) == [2, 4, 8, 16, 30]
    for column in table.columns:
        if column.endswith("error"):
            assert table[column].iloc[0] > 1e-3
            assert table[column].iloc[-1] < 1e-12
            assert table[column].iloc[1] < table[column].iloc[0]


@pytest.mark.analytical
def test_frequency_errors_are_those_of_the_realised_systems():
    """The errors come from each delay's own approximation; the whole state-space systems give the same."""
    loop = half_car_loop((60e3, 80e3), (0.37, 0.28))
    omega = np.linspace(0.5, 60.0, 80)
    exact = loop(1j * omega)
    for order in (3, 9, 14):
        row = sc.compare_pade(loop, [order], omega).iloc[0]
        pade = relative_error(loop.pade(order)(1j * omega), exact)
        spectral = relative_error(spectral_approximation(loop, order)(1j * omega), exact)
        assert row["frequency_error"] == pytest.approx(pade, rel=1e-6)
        assert row["spectral_frequency_error"] == pytest.approx(spectral, rel=1e-6)


@pytest.mark.analytical
def test_low_orders_give_wrong_verdicts_in_both_directions():
    omega = np.linspace(0.5, 80.0, 50)
    gains, delays = (60e3, 110e3), (0.37, 0.28)
    assert unstable_roots(gains, delays) == 0
    table = sc.compare_pade(half_car_loop(gains, delays), [3, 30], omega)
    assert list(table["stable"]) == [False, True]
    assert list(table["exact_stable"]) == [True, True]
    gains, delays = (-120e3, 20e3), (0.47, 0.93)
    assert unstable_roots(gains, delays) == 2
    table = sc.compare_pade(half_car_loop(gains, delays), [5, 40], omega)
    assert list(table["stable"]) == [True, False]
    assert list(table["exact_stable"]) == [False, False]


@pytest.mark.analytical
def test_pure_delay_has_no_roots_and_a_double_integrator_no_finite_peak_at_zero():
    table = sc.compare_pade(sc.delay(0.5), [3, 20], np.linspace(0, 20, 30))
    assert table["rightmost_root_error"].isna().all()
    assert table["frequency_error"].iloc[1] < 1e-10
    integrator = ct.tf([1], [1, 0]) * sc.delay(0.1)
    with pytest.warns(sc.UndecidedStabilityWarning):
        table = sc.compare_pade(integrator, [4], [0.0, 1.0, 2.0])
    assert table["frequency_error"].iloc[0] < 1e-9
    assert not table["stable"].iloc[0]


@pytest.mark.analytical
def test_relative_error_by_hand():
    exact = np.array([[1.0, -4.0, np.inf], [0.0, 0.0, 0.0], [2.0, 1.0, 1.0]])
    values = np.array([[1.0, -3.0, 7.0], [5.0, 0.0, 0.0], [2.0, 1.0, 1.2]])
    assert relative_error(values, exact) == pytest.approx(0.25)
    values[2, 0] = np.nan
    assert relative_error(values, exact) == np.inf
    assert np.isnan(relative_error(values[1:2], exact[1:2]))


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (([], [1.0, 2.0]), "orders"),
        (([0], [1.0, 2.0]), "orders"),
        (([61], [1.0, 2.0]), "orders"),
        (([2.5], [1.0, 2.0]), "orders"),
        (([4], []), "omega"),
        (([4], [2.0, 1.0]), "omega"),
        (([4], [-1.0, 1.0]), "omega"),
        (([4], [1.0], None, {"u[0]": 1}), "timepts"),
    ],
)
def test_wrong_arguments_are_named(arguments, name):
    with pytest.raises(sc.InputError, match=name):
        sc.compare_pade(scalar_loop(), *arguments)


@pytest.mark.analytical
def test_time_error_of_a_smooth_pulse_in_closed_form():
    """A pure delay of a Gaussian pulse: the exact output is known, Padé through python-control beside it."""
    tau, width = 0.55, 0.2
    t = np.linspace(0.0, 3.0, 3001)

    def pulse(time):
        return np.exp(-((time - 1.2) ** 2) / (2 * width**2))

    table = sc.compare_pade(sc.delay(tau), [2, 4, 16], [1.0, 5.0], timepts=t, inputs={"u[0]": pulse})
    exact = pulse(t - tau)
    for order, error in zip(table["order"], table["time_error"], strict=True):
        through_control = ct.forced_response(sc.delay(tau).pade(order), t, pulse(t)).outputs
        expected = np.abs(through_control - exact).max() / exact.max()
        # sampled input of python-control, and the pulse's start at 1e-8
        assert error == pytest.approx(expected, rel=1e-3, abs=1e-5)
    assert table["time_error"].iloc[0] > 1e-2
    assert table["time_error"].iloc[-1] < 1e-5
    assert table["spectral_time_error"].iloc[-1] < table["spectral_time_error"].iloc[0]


@pytest.mark.analytical
def test_time_error_of_the_half_car_falls_with_the_order():
    loop = half_car_loop((19345.0, 26150.0), (0.553, 0.5186))
    t = np.linspace(0.0, 4.0, 401)
    inputs = {"road_front": lambda time: 0.05 * np.sin(7 * time) ** 4}
    table = sc.compare_pade(loop, [3, 8, 20], [1.0, 5.0], timepts=t, inputs=inputs)
    assert np.all(np.diff(table["time_error"]) < 0)
    assert table["time_error"].iloc[0] > 0.05
    assert table["time_error"].iloc[-1] < 0.02
