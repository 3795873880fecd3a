"""`simulate`: against closed forms, phasors, published time responses, and a Runge-Kutta method between kinks."""

from __future__ import annotations

import math
import warnings

import collocation
import control as ct
import delay_cases
import numpy as np
import pytest
from half_car_loops import DELAYS, GAINS, LAG, half_car_loop, relative, road, road_inputs
from scipy.integrate import solve_ivp

import susp_ctrl as sc
from susp_ctrl.delay_systems.approximation.spectral import spectral_approximation


def step(t):
    return np.ones_like(t)


def by_pieces(t, jump=1.0):
    """x' = -x(t - 1), x = 1 before 0: sum over k of (-1)^k (t - k + 1)^k / k!."""
    terms = [
        np.where(t >= k - 1, (-1.0) ** k * (t - k + 1) ** k / math.factorial(k), 0.0) for k in range(1, 14)
    ]
    return jump + np.sum(terms, axis=0)


@pytest.mark.analytical
@pytest.mark.parametrize("simulate", [sc.simulate, collocation.simulate])
def test_scalar_delay_equation_is_its_piecewise_polynomial(simulate):
    sys = sc.DelayLTI.from_state_delays([[[0.0]], [[-1.0]]], [1.0])
    t = np.linspace(0.0, 10.0, 1237)
    response = simulate(sys, t, history=[1.0])
    np.testing.assert_allclose(response.outputs, by_pieces(t), rtol=0, atol=1e-12)


@pytest.mark.analytical
def test_step_of_delayed_integrator_loop():
    """y = 2 (t-1) until 2, then minus 2 (t-2)^2, then plus (2/3) 2 (t-3)^3."""
    sys = sc.feedback(2 * sc.delay(1.0) * ct.tf([1.0], [1.0, 0.0]), 1)
    t = np.linspace(0.0, 4.0, 4001)
    y = 2 * np.clip(t - 1, 0, None) - 2 * np.clip(t - 2, 0, None) ** 2 + 4 / 3 * np.clip(t - 3, 0, None) ** 3
    np.testing.assert_allclose(sc.simulate(sys, t, step).outputs, y, rtol=0, atol=1e-12)


@pytest.mark.analytical
def test_pure_delay_moves_the_input():
    t = np.linspace(0.0, 2.0, 401)
    response = sc.simulate(sc.delay(0.3) * sc.delay(0.25), t, lambda t: np.sin(9.0 * t) + 1.0)
    expected = np.where(t >= 0.55 - 1e-12, np.sin(9.0 * (t - 0.55)) + 1.0, 0.0)
    np.testing.assert_allclose(response.outputs, expected, atol=1e-10)


@pytest.mark.analytical
def test_delayed_history_through_two_delays_in_series():
    """A signal delayed twice asks for the history beyond the largest single delay."""
    G = ct.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    sys = sc.delay(0.4) * sc.delay(0.3) * G
    t = np.linspace(0.0, 2.0, 101)
    response = sc.simulate(sys, t, history=lambda t: np.exp(-t)[None])
    np.testing.assert_allclose(response.outputs, np.exp(-(t - 0.7)), rtol=1e-11)


@pytest.mark.literature
def test_published_time_responses():
    """haag6 (free response from a jump history, step), dead-time PI loop, u' = -u(t-1); tolerances of the file."""
    case = delay_cases.CASES["haag6_two_delay_oscillator"]
    A = delay_cases.matrices(case)
    sys = sc.DelayLTI.from_state_delays(A, case["delays"][1:], B=case["B"])

    def jump(t):
        return np.array([[1.0], [0.0]]) * (t >= 0.0)

    for quantity, inputs, history in (
        ("free_response_x0_1_0", None, jump),
        ("step_response", step, None),
    ):
        row = delay_cases.row(case["id"], quantity)
        value = np.array(row["value"])
        response = sc.simulate(sys, np.append(0.0, value[:, 0]), inputs, history=history)
        np.testing.assert_allclose(response.outputs[:, 1:].T, value[:, 1:], rtol=0, atol=row["tolerance"])
        if quantity != "step_response":
            np.testing.assert_allclose(response.outputs[:, 0], [1.0, 0.0], atol=1e-14)

    case = delay_cases.CASES["matlab_pi_deadtime"]
    sys = sc.DelayLTI.from_state_delays(
        delay_cases.matrices(case),
        case["delays"][1:],
        C=case["C"],
        input_terms=[(case["B"], case["B_delays"][0])],
    )
    row = delay_cases.row(case["id"], "step_response_y")
    value = np.array(row["value"])
    y = sc.simulate(sys, np.append(0.0, value[:, 0]), step).outputs[1:]
    np.testing.assert_allclose(y, value[:, 1], rtol=0, atol=row["tolerance"])

    row = delay_cases.row("ddelib_one_delay", "free_response")
    value = np.array(row["value"])
    sys = delay_cases.system("ddelib_one_delay")
    y = sc.simulate(
        sys, np.append(0.0, value[:, 0]), history=lambda t: (t >= 0.0) * np.ones((1, t.size))
    ).outputs
    np.testing.assert_allclose(y[1:], value[:, 1], rtol=0, atol=row["tolerance"])


@pytest.mark.property
@pytest.mark.parametrize(
    "delays", [DELAYS, (0.3255, 0.5438), (0.1, 0.1), (1e-3, 0.3), (0.0, 0.21), (30.0, 40.0), (2e-4, 3e-4)]
)
def test_half_car_on_harmonic_road_equals_reference(delays):
    """The road reaches the rear wheel with a kink at 0.138 s."""
    sys, t = half_car_loop(delays=delays), np.linspace(0.0, 4.0, 1501)
    inputs = road_inputs()
    exact = sc.simulate(sys, t, inputs)
    reference = collocation.simulate(sys, t, inputs)
    ride = slice(0, 8)
    assert relative(exact.outputs[ride], reference.outputs[ride]) < 1e-9
    peak = np.max(np.abs(exact.outputs), axis=1)
    assert np.all(exact.error_estimate <= 1e-8 * np.maximum(peak, 1e-300))
    assert exact.output_labels == sys.output_labels
    assert exact.input_labels == sys.input_labels
    np.testing.assert_allclose(exact.inputs[1], road(t, LAG), atol=1e-11)


@pytest.mark.property
def test_half_car_equals_runge_kutta_between_kinks():
    """scipy's DOP853 from kink to kink, the delayed signals from its own dense output."""
    plant, t = sc.HalfCar().plant(), np.linspace(0.0, 1.6, 321)
    A, B, C = (np.asarray(m) for m in (plant.A, plant.B, plant.C))
    rows = [plant.output_labels.index(f"unsprung_displacement_{w}") for w in ("front", "rear")]
    columns = [plant.input_labels.index(c) for c in ("road_front", "road_rear", "force_front", "force_rear")]
    pieces = []

    def measured(k, s):
        if s <= 0.0:
            return 0.0
        piece = next(p for p in pieces if s <= p.t_max)
        return float(C[rows[k]] @ piece(s))

    def rate(s, x):
        u = np.array([road(s), road(s, LAG), *(GAINS[k] * measured(k, s - DELAYS[k]) for k in range(2))])
        return A @ x + B[:, columns] @ u

    sources = {0.0, LAG}
    for _ in range(3):
        sources |= {round(s + d, 12) for s in sources for d in DELAYS}
    kinks = sorted(s for s in sources if s < 1.6)
    x, states = np.zeros(plant.nstates), np.zeros((plant.nstates, t.size))
    for a, b in zip(kinks, [*kinks[1:], 1.6], strict=True):
        solution = solve_ivp(rate, (a, b), x, "DOP853", rtol=1e-11, atol=1e-15, dense_output=True)
        pieces.append(solution.sol)
        x = solution.y[:, -1]
        inside = (t >= a) & (t <= b)
        states[:, inside] = solution.sol(t[inside])
    response = sc.simulate(half_car_loop(), t, road_inputs())
    # DOP853's dense output is of order 7, so that the oracle is good for about 1e-8
    assert relative(response.states, states) < 1e-7


@pytest.mark.property
def test_steady_state_is_the_phasor_solution():
    sys, omega = half_car_loop(delays=(0.3255, 0.5438), gains=(29653.0, -4416.0)), 7.0
    t = np.linspace(18.0, 20.0, 500)
    response = sc.simulate(sys, t, road_inputs())
    H = sys(1j * omega, squeeze=False)
    phasor = 0.05 * (H[:, 0] + H[:, 1] * np.exp(-1j * omega * LAG))
    steady = np.imag(phasor[:, None] * np.exp(1j * omega * t))
    assert relative(response.outputs, steady) < 1e-8


@pytest.mark.property
def test_unstable_loop_grows_at_the_rate_of_its_rightmost_root():
    sys = sc.DelayLTI.from_state_delays([[[0.0]], [[-1.0]]], [2.0])
    root = sc.characteristic_roots(sys, 2)[0]
    t = np.linspace(40.0, 60.0, 2001)
    y = sc.simulate(sys, t, history=[1.0]).outputs
    phase = np.exp(root * (t - 40.0))
    basis = np.column_stack([phase.real, phase.imag])
    rest = y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]
    assert np.max(np.abs(rest)) < 1e-8 * np.max(np.abs(y))


def test_overflow_is_an_error():
    sys = sc.DelayLTI.from_state_delays([[[3.0]], [[1.0]]], [1.0])
    with pytest.raises(OverflowError, match="unstable"):
        sc.simulate(sys, [0.0, 1000.0], history=[1.0])


@pytest.mark.property
def test_defective_plant():
    """A Jordan block of length 4 has no eigenvectors to speak of."""
    A = np.diag(np.ones(3), 1) - np.eye(4)
    A1 = np.zeros((4, 4))
    A1[3, 0] = -0.5
    sys = sc.DelayLTI.from_state_delays([A, A1], [0.7], B=np.eye(4)[:, [3]])
    t = np.linspace(0.0, 6.0, 301)
    exact, reference = (way(sys, t, step).outputs for way in (sc.simulate, collocation.simulate))
    assert relative(exact, reference) < 1e-11


@pytest.mark.property
def test_two_incommensurate_delays_with_jump_history_and_delayed_step():
    sys = sc.DelayLTI.from_state_delays(
        [[[-0.3]], [[-1.1]], [[0.4]]], [1.0, math.sqrt(2.0)], B=[[1.0]], input_terms=[([[2.0]], 0.37)]
    )

    def late_step(t):
        return np.where(t >= 0.9, 1.0, 0.0)

    late_step.breakpoints = (0.9,)
    t = np.linspace(0.0, 12.0, 700)
    exact, reference = (
        way(sys, t, late_step, history=[0.8]).outputs for way in (sc.simulate, collocation.simulate)
    )
    assert relative(exact, reference) < 1e-10


@pytest.mark.property
@pytest.mark.filterwarnings("ignore:the estimated error")
def test_kinks_that_nobody_announces_are_found():
    sys, t = half_car_loop(), np.linspace(0.0, 3.0, 700)
    unknown = {"road_front": lambda t: np.abs(np.sin(5.0 * t)) * 0.02}
    known = sc.simulate(sys, t, unknown, breakpoints=np.pi / 5.0 * np.arange(1, 5))
    assert relative(sc.simulate(sys, t, unknown).outputs[:8], known.outputs[:8]) < 1e-8


@pytest.mark.property
def test_stiff_plant_with_fast_actuator():
    """A pole at -20000 rad/s beside a loop at 1 rad/s."""
    plant = ct.ss(ct.tf([1.0], [1.0, 0.4, 1.0]), inputs="force", outputs="position")
    slow = sc.close_loop(plant, [sc.FeedbackChannel("position", "force", -0.6, 0.5, actuator_bandwidth=2e4)])
    t = np.linspace(0.0, 20.0, 400)
    response = sc.simulate(slow, t, step)
    lag = sc.close_loop(plant, [sc.FeedbackChannel("position", "force", -0.6, 0.5 + 1.0 / 2e4)])
    assert relative(response.outputs, sc.simulate(lag, t, step).outputs) < 1e-7


@pytest.mark.property
def test_ordinary_systems_equal_python_control():
    plant, t = sc.HalfCar().plant(), np.linspace(0.0, 2.0, 401)
    u = np.zeros((4, t.size))
    u[0], u[2] = np.sin(3.0 * t), 500.0 * np.cos(t)
    assert relative(sc.simulate(plant, t, u).outputs, ct.forced_response(plant, t, u).outputs) < 1e-9
    tf = ct.tf([1.0, 2.0], [1.0, 0.5, 3.0])
    expected = ct.step_response(tf, t).outputs
    np.testing.assert_allclose(sc.simulate(tf, t, 1.0).outputs, expected, atol=1e-10)


@pytest.mark.property
def test_output_that_is_rounding_alone_raises_no_warning():
    """A symmetric car on one road under both tracks does not roll."""
    plant, t = sc.FullCar().plant(), np.arange(2001) * 1e-3
    wheels = [name for name in plant.input_labels if name.startswith("road")]
    loop = sc.close_loop(
        plant,
        [
            sc.FeedbackChannel(f"unsprung_displacement_{w[5:]}", f"force_{w[5:]}", gain=9e3, delay=0.3)
            for w in wheels
        ],
    )
    road = sc.RandomRoad(iso_class="C", speed=20.0, seed=1, bins=40)
    inputs = road.inputs({w: 0.138 * ("rear" in w) for w in wheels})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for given in (inputs, {name: signal(t) for name, signal in inputs.items()}):
            response = sc.simulate(loop, t, given, rtol=1e-11)
            roll, pitch = (
                np.max(np.abs(response.outputs[response.output_labels.index(f"{motion}_acceleration")]))
                for motion in ("roll", "pitch")
            )
            assert roll < 1e-10 * pitch


@pytest.mark.property
def test_continuation_equals_one_run():
    sys, t = half_car_loop(), np.linspace(0.0, 3.0, 301)
    inputs = road_inputs()
    whole = sc.simulate(sys, t, inputs)
    first = sc.simulate(sys, t[:131], inputs)
    second = sc.simulate(sys, t[130:], inputs, history=first)
    assert relative(second.outputs, whole.outputs[:, 130:]) < 1e-9


@pytest.mark.property
def test_pade_equals_python_control_and_approaches_exact():
    sys, t = half_car_loop(), np.arange(0.0, 1.5, 1e-4)
    inputs = {"road_front": lambda t: 0.05 * np.sin(7.0 * t)}
    u = np.zeros((4, t.size))
    u[0] = inputs["road_front"](t)
    pade = sc.simulate(sys, t, inputs, method="pade", order=30)
    assert relative(pade.outputs, ct.forced_response(sys.pade(30), t, u).outputs) < 1e-5
    exact = sc.simulate(sys, t, inputs)
    chosen = sc.simulate(sys, t, inputs, method="pade")
    assert 20 <= chosen.order <= 40
    assert relative(chosen.outputs[:2], exact.outputs[:2]) < 5e-3
    assert relative(sc.simulate(sys, t, inputs, method="spectral").outputs[:2], exact.outputs[:2]) < 5e-3


@pytest.mark.property
@pytest.mark.parametrize("method", ["pade", "spectral"])
def test_approximations_differ_from_python_control_by_its_sampling_error(method):
    """forced_response joins samples by lines: its error falls with the square of the step, ours is not in it."""
    sys, inputs = half_car_loop(), {"road_front": lambda t: 0.05 * np.sin(7.0 * t) ** 2}
    differences = []
    for step in (4e-3, 2e-3, 1e-3):
        t = np.arange(0.0, 2.0, step)
        ours = sc.simulate(sys, t, inputs, method=method, order=32)
        ordinary = sys.pade(32) if method == "pade" else spectral_approximation(sys, 32)
        u = np.zeros((4, t.size))
        u[0] = inputs["road_front"](t)
        differences.append(relative(ours.outputs, ct.forced_response(ordinary, t, u).outputs))
    assert differences[-1] < 1e-4
    np.testing.assert_allclose(np.array(differences[:-1]) / differences[1:], 4.0, rtol=0.2)


def test_low_order_warns_with_the_order_needed():
    sys, t = half_car_loop(), np.linspace(0.0, 1.0, 101)
    for method in ("pade", "spectral"):
        with pytest.warns(sc.PadeOrderWarning, match="is needed"):
            sc.simulate(sys, t, {"road_front": np.sin}, method=method, order=4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sc.simulate(sys, t, {"road_front": np.sin}, method="pade")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"timepts": [0.0, 1.0, 0.5]}, "timepts"),
        ({"timepts": [-1.0, 1.0]}, "timepts"),
        ({"timepts": [0.0, np.nan]}, "timepts"),
        ({"timepts": []}, "timepts"),
        ({"inputs": {"road_frnt": step}}, "road_front"),
        ({"inputs": np.zeros((3, 3))}, "inputs"),
        ({"inputs": {"road_front": np.zeros(4)}}, "road_front"),
        ({"inputs": {"road_front": [0.0, np.nan, 0.0]}}, "road_front"),
        ({"inputs": {"road_front": lambda t: np.zeros((2, t.size))}}, "road_front"),
        ({"inputs": lambda t: np.full((4, t.size), np.nan)}, "inputs"),
        ({"inputs": "road"}, "inputs"),
        ({"method": "euler"}, "method"),
        ({"hold": "cubic"}, "hold"),
        ({"history": [0.0, 1.0]}, "history"),
        ({"history": lambda t: np.zeros((3, t.size))}, "history"),
        ({"history": "yesterday"}, "history"),
        ({"breakpoints": [np.inf]}, "breakpoints"),
        ({"rtol": 0.0}, "rtol"),
        ({"method": "pade", "order": 0}, "order"),
        ({"method": "pade", "order": 2.5}, "order"),
        ({"order": 3}, "order"),
        ({"method": "pade", "history": np.zeros(8)}, "history"),
    ],
)
def test_bad_input_names_the_argument(change, named):
    arguments = {"timepts": [0.0, 0.5, 1.0], "inputs": None} | change
    with pytest.raises(sc.InputError, match=named):
        sc.simulate(half_car_loop(), **arguments)


@pytest.mark.property
def test_many_cases_equal_single_runs():
    one, other, t = half_car_loop(), half_car_loop(delays=(0.2, 0.3)), np.linspace(0.0, 2.0, 201)
    loads = [{"road_front": lambda t, w=w: 0.01 * np.sin(w * t) + 0.002} for w in (3.0, 11.0, 40.0)]
    for k, response in enumerate(sc.simulate_many(one, t, loads, history=np.full(8, 1e-3))):
        single = sc.simulate(one, t, loads[k], history=np.full(8, 1e-3))
        assert relative(response.outputs, single.outputs) < 1e-9
        longer = sc.simulate(one, [2.0, 2.5], loads[k], history=response)
        assert relative(longer.outputs, sc.simulate(one, [2.0, 2.5], loads[k], history=single).outputs) < 1e-9
    for response, sys in zip(sc.simulate_many([one, other], t, loads[0]), (one, other), strict=True):
        assert relative(response.outputs, sc.simulate(sys, t, loads[0]).outputs) < 1e-9
    with pytest.raises(sc.InputError, match="inputs"):
        sc.simulate_many([one, other], t, loads)


@pytest.mark.property
def test_many_steady_starts_keep_their_own_phase():
    sys, t = half_car_loop(), np.linspace(0.0, 1.0, 101)
    roads = [
        sc.RandomRoad(iso_class="C", speed=20.0, seed=k, bins=30).inputs({"road_front": 0.0}) for k in (1, 2)
    ]
    for response, inputs in zip(sc.simulate_many(sys, t, roads, history="steady"), roads, strict=True):
        assert relative(response.outputs, sc.steady_response(sys, t, inputs).outputs) < 1e-8
