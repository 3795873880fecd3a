"""No answer depends on the units of time and of the states: the same loops in seconds, nanoseconds and megaseconds."""

from __future__ import annotations

import time

import control as ct
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import susp_ctrl as sc
from susp_ctrl.delay_systems.crossings.crossing_search import CrossingSearch
from susp_ctrl.delay_systems.crossings.delay_line import DelayLine

UNITS = [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6]
# gain, poles, delay of every entry of a plant with light resonances
ENTRIES = [
    [(-6.906e-4, [-0.0012 + 0.3656j, -0.0012 - 0.3656j, -0.0105], 2.0), (0.0137, [-0.1299], 0.3)],
    [
        (-33.22, [-1.855 + 1.553j, -1.855 - 1.553j, -3.081], 0.3),
        (-5.892e-4, [-5.4e-5 + 0.1288j, -5.4e-5 - 0.1288j, -0.7325], 0.0),
    ],
]


def resonant_loop(unit):
    """Return the plant of two inputs and outputs, fed back through gains and two more delays."""
    total = sc.DelayLTI(ct.ss([], [], [], np.zeros((2, 2))))
    for i, row in enumerate(ENTRIES):
        for j, (gain, poles, delay) in enumerate(row):
            denominator = np.real(np.poly(poles)) * float(unit) ** np.arange(len(poles), -1, -1)
            entry = sc.delay(delay * unit) * ct.tf([gain], denominator)
            total = total + np.eye(2)[:, [i]] * entry * np.eye(2)[[j]]
    return sc.feedback(total * (0.15 * np.eye(2)) * sc.delay([0.1 * unit] * 2))


def return_difference(omega):
    """Return det(I + L) of the same loop, from its poles, with time in seconds."""
    s = 1j * omega
    L = [
        [
            0.15 * k * np.exp(-s * (tau + 0.1)) / np.prod([s - p for p in poles], axis=0)
            for k, poles, tau in row
        ]
        for row in ENTRIES
    ]
    return (1.0 + L[0][0]) * (1.0 + L[1][1]) - L[0][1] * L[1][0]


@pytest.mark.analytical
def test_a_verdict_is_the_same_in_every_unit_of_time():
    """All three methods answer, in the same time; the count is that of Nyquist on the formula."""
    near = (1.0 + np.multiply.outer([-1, 1], np.geomspace(1e-7, 0.3, 300))).ravel()
    omega = np.unique(np.concatenate([np.geomspace(1e-6, 1e3, 20_001), 0.3656 * near, 0.1288 * near]))
    turns = np.diff(np.unwrap(np.angle(return_difference(omega)))).sum() / np.pi
    assert abs(turns - round(turns)) < 1e-3
    started = time.process_time()
    verdicts = [sc.stability(resonant_loop(unit)) for unit in UNITS]
    assert time.process_time() - started < 6.0
    for unit, verdict in zip(UNITS, verdicts, strict=True):
        assert set(verdict.agreement.values()) == {-round(turns)}
        assert verdict.abscissa * unit == pytest.approx(verdicts[3].abscissa, rel=1e-6)


@pytest.mark.analytical
@pytest.mark.parametrize("unit", [*UNITS, 7e-8, 3e5])
def test_the_work_of_a_search_is_the_same_in_every_unit_of_time(unit):
    """Boxes tested until all crossings are proven; a unit that is no power of two moves them a little."""

    def boxes(unit):
        system = resonant_loop(unit)
        search = CrossingSearch(DelayLine.of(system, system.delays, np.zeros(system.delays.size), 1.0))
        before = search.work.left
        assert search.ways()[-1]().complete
        return before - search.work.left

    assert boxes(unit) < 3 * boxes(1.0)


@pytest.mark.analytical
@pytest.mark.parametrize("unit", UNITS)
def test_crossings_scale_with_time(unit):
    """x' = -x(t - a - b): the two delays follow each other directly, and only their sum counts."""
    direct = sc.delay(0.3 * unit) * sc.delay(0.4 * unit)
    loop = sc.feedback(ct.tf([1.0], [unit, 0.0]) * direct)
    sweep = sc.sweep_delays(loop, direction=[0, 1], start=[0.3 * unit, 0.0], up_to=20.0 * unit)
    expected = np.pi / 2 + 2 * np.pi * np.arange(4) - 0.3
    expected = expected[expected < 20.0]
    assert sweep.crossings["tau"].to_numpy() / unit == pytest.approx(expected, rel=1e-9)
    assert sweep.crossings["omega"].to_numpy() * unit == pytest.approx(1.0, rel=1e-9)
    assert sweep.decided
    assert sweep.proven


@pytest.mark.analytical
@pytest.mark.parametrize("unit", UNITS)
def test_crossings_beside_a_root_at_zero_scale_with_time(unit):
    """x' = -x + x(t - 1), y' = -k y(t - tau): the root at zero stays, that of the other equation crosses at pi/2k."""
    k = 1e-3
    loop = sc.DelayLTI.from_state_delays(
        [np.diag([-1.0, 0.0]) / unit, np.diag([1.0, 0.0]) / unit, np.diag([0.0, -k]) / unit],
        [1.0 * unit, 1.0 * unit],
    )
    sweep = sc.sweep_delays(loop, direction=[0, 1], start=[1.0 * unit, 0.0], up_to=4.0 / k * unit)
    assert sweep.axis_roots == (0.0,)
    assert sweep.crossings["tau"].to_numpy() / unit == pytest.approx([np.pi / 2 / k], rel=1e-9)


A0 = np.array([[0.0, 1.0, 0.0], [-4.0, -0.1, 1.0], [0.0, 0.0, -2.0]])
A1 = np.array([[0.0, 0.0, 0.0], [-0.03, 0.0, 0.0], [0.0, 0.2, 0.0]])
B, C = np.array([[0.0], [0.0], [1.0]]), np.array([[1.0, 0.0, 0.0]])


def scaled_system(scales, unit, gain=1.0):
    """Return the system A0, A1 in other units of states and time."""
    scale = np.array(scales)[:, None]
    A = [scale * M / scale.T / unit for M in (A0, A1)]
    return sc.DelayLTI.from_state_delays(A, [0.7 * unit], B=gain * scale * B / unit, C=C / scale.T)


def response(omega):
    s = 1j * omega
    return (C @ np.linalg.solve(s * np.eye(3) - A0 - A1 * np.exp(-0.7 * s), B))[0, 0]


@pytest.mark.analytical
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    "scales", [(1, 1, 1), (1, 1e-6, 1e6), (1, 1e9, 1e-9), (1e-8, 1e8, 1), (1e12, 1, 1e-12)]
)
def test_peak_of_a_gain_in_any_units(scales, unit):
    peak = minimize_scalar(lambda w: -abs(response(w)), bounds=(1.8, 2.1), options={"xatol": 1e-12})
    norm, omega = sc.hinf_norm(scaled_system(scales, unit))
    assert norm == pytest.approx(-peak.fun, rel=1e-9)
    assert omega * unit == pytest.approx(peak.x, rel=1e-6)
    if unit == 1.0 or scales == (1, 1e-6, 1e6):
        # (S - T)/2 of a tenth of it
        sensitivity = minimize_scalar(
            lambda w: -abs(1.0 / (1.0 + 0.1 * response(w)) - 0.5), bounds=(1.5, 2.5), options={"xatol": 1e-12}
        )
        margin = sc.disk_margin(scaled_system(scales, unit, gain=0.1))
        assert margin.margin == pytest.approx(-1.0 / sensitivity.fun, rel=1e-8)


@pytest.mark.analytical
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1.0, 1e6])
def test_peak_of_transfer_functions_side_by_side_in_any_unit_of_time(unit):
    """Realisations of high order have entries of all sizes, and the delay behind them is in no loop."""
    poles, damped = np.array([-0.3 + 2j, -0.3 - 2j, -0.05 + 9j, -0.05 - 9j, -20.0]), np.array([-4.0])
    systems, gains = [], []
    for k, these in ((5e4, poles), (3.0, damped)):
        powers = float(unit) ** np.arange(these.size, -1, -1)
        systems.append(sc.delay(0.4 * unit) * ct.tf([k], np.real(np.poly(these)) * powers))
        gains.append(lambda w, k=k, these=these: k / np.prod(np.abs(1j * w - these)))
    norm, omega = sc.hinf_norm(sc.append(*systems))
    peak = max(
        (minimize_scalar(lambda w: -gains[0](w), bounds=bounds) for bounds in ((1.5, 2.5), (8.5, 9.5))),
        key=lambda found: -found.fun,
    )
    assert norm == pytest.approx(max(-peak.fun, gains[1](0.0)), rel=1e-8)
    assert omega * unit == pytest.approx(peak.x, rel=1e-4)
