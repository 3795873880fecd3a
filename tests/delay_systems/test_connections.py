"""Algebra: every operation against the closed form of its response, names, and what is refused."""

from __future__ import annotations

import operator

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import susp_ctrl as sc

S = np.concatenate([1j * np.linspace(0.05, 9.0, 19), [0.3 + 2j, -0.2 + 0.7j]])


def close(system, expected, tolerance=1e-14):
    __tracebackhide__ = True
    values = np.asarray(system(S, squeeze=False))
    expected = np.broadcast_to(expected, values.shape)
    assert np.all(np.isfinite(expected))
    assert np.abs(values - expected).max() <= tolerance * max(1.0, np.abs(expected).max())


def lag(s, a=1.0):
    return 1.0 / (s + a)


def two_by_two():
    A = np.array([[-1.0, 0.5], [0.0, -2.0]])
    B, C, D = np.array([[1.0, 0.0], [0.3, 1.0]]), np.eye(2), np.array([[0.0, 0.2], [0.0, 0.0]])
    system = ct.StateSpace(A, B, C, D, inputs=["a", "b"], outputs=["p", "q"])
    return system, np.moveaxis([C @ np.linalg.solve(s * np.eye(2) - A, B) + D for s in S], 0, -1)


# -------------------------------------------------------------------------------------------- closed forms


@pytest.mark.analytical
def test_pure_delay_has_no_states_and_an_exact_response():
    d = sc.delay(0.3)
    assert d.nstates == 0
    assert list(d.delays) == [0.3]
    close(d, np.exp(-0.3 * S))
    close(sc.delay(0.0), np.ones(S.size))
    assert list(sc.delay(0.0).delays) == [0.0]
    assert d(0.0) == 1.0
    close(sc.delay([0.1, 0.4]), np.exp(-np.multiply.outer([[0.1, 0], [0, 0.4]], S)) * np.eye(2)[..., None])


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("build", "closed_form"),
    [
        (lambda d, G: d * G, lambda e, g: e * g),
        (lambda d, G: G * d, lambda e, g: e * g),
        (lambda d, G: G + d * G, lambda e, g: g + e * g),
        (lambda d, G: d * G - G, lambda e, g: e * g - g),
        (lambda d, G: G - d, lambda e, g: g - e),
        (lambda d, G: -d, lambda e, g: -e),
        (lambda d, G: +d, lambda e, g: e),
        (lambda d, G: d * d * d, lambda e, g: e**3),
        (lambda d, G: d + d, lambda e, g: 2 * e),
        (lambda d, G: d - d, lambda e, g: 0 * e),
        (lambda d, G: (1 - d) * (1 + d), lambda e, g: 1 - e**2),
        (lambda d, G: 3 * d / 4, lambda e, g: 0.75 * e),
        (lambda d, G: np.float64(2.5) * d, lambda e, g: 2.5 * e),
        (lambda d, G: np.int64(2) + d * G, lambda e, g: 2 + e * g),
        (lambda d, G: sc.feedback(1, G * d), lambda e, g: 1 / (1 + g * e)),
        (lambda d, G: sc.feedback(G, d), lambda e, g: g / (1 + g * e)),
        (lambda d, G: sc.feedback(G, d, sign=1), lambda e, g: g / (1 - g * e)),
        (lambda d, G: sc.feedback(G * d), lambda e, g: g * e / (1 + g * e)),
        (lambda d, G: ct.feedback(G * d, 0.5), lambda e, g: g * e / (1 + 0.5 * g * e)),
        (lambda d, G: sc.feedback(d * G, d * G), lambda e, g: g * e / (1 + (g * e) ** 2)),
        (lambda d, G: sc.feedback(d, G), lambda e, g: e / (1 + g * e)),
        (lambda d, G: sc.series(G, d, G), lambda e, g: g * e * g),
        (lambda d, G: sc.parallel(G, d, 2), lambda e, g: g + e + 2),
        (lambda d, G: ct.series(G, d), lambda e, g: g * e),
        (lambda d, G: ct.parallel(d, G), lambda e, g: g + e),
        (lambda d, G: sc.feedback(2, G), lambda e, g: 2 / (1 + 2 * g)),
    ],
)
@pytest.mark.parametrize("kind", ["transfer function", "state space", "delay system"])
def test_single_loop_operations(build, closed_form, kind):
    G = {
        "transfer function": ct.tf([1], [1, 1]),
        "state space": ct.ss([[-1]], [[1]], [[1]], [[0]]),
        "delay system": sc.DelayLTI(ct.ss([[-1]], [[1]], [[1]], [[0]])),
    }[kind]
    result = build(sc.delay(0.3), G)
    assert isinstance(result, sc.DelayLTI)
    close(result, closed_form(np.exp(-0.3 * S), lag(S)))


@pytest.mark.literature
def test_two_delay_loop_of_control_systems_jl():
    """S = 1/(1 + P1 (e^-2s + e^-3s)), P1 = 1/(s + 1), omega = 0..8.

    Source: JuliaControl/ControlSystems.jl, test_delayed_systems.jl (rtol 1e-14 there; 13 digits here).
    """
    P1 = ct.tf([1], [1, 1])
    sensitivity = sc.feedback(1, P1 * (sc.delay(2) + sc.delay(3)))
    published = [
        0.3333333333333,
        -2.725857280496 - 2.123825982006j,
        0.6753808750833 - 0.03873136823269j,
        1.035299106052 + 0.03001788774034j,
        1.027159170097 + 0.2098772916293j,
        0.9820122270604 - 0.3244944105445j,
        0.778544893201 + 0.1303055155645j,
        1.357658609626 - 0.03872771310087j,
        0.8734522286165 - 0.06444973734069j,
    ]
    s = 1j * np.arange(9.0)
    # the published digits end at the 13th
    assert sensitivity(s) == pytest.approx(published, rel=1e-12)
    assert sensitivity(s) == pytest.approx(1 / (1 + (np.exp(-2 * s) + np.exp(-3 * s)) / (s + 1)), rel=1e-14)


@pytest.mark.analytical
def test_matrices_and_promotion_of_single_signals():
    G, g = two_by_two()
    d, e = sc.delay(0.3), np.exp(-0.3 * S)
    M = np.array([[1.0, 2.0], [0.5, -1.0]])

    def times(left, right):
        return np.einsum("ij...,jk...->ik...", left, right)

    m = np.repeat(M[..., None], S.size, axis=-1)
    close(d * G, e * g)
    close(G * d, e * g)
    close(G + d, g + e)
    close(d - G, e - g)
    close(M * d, e * m)
    close(d * M, e * m)
    close(M + d, m + e)
    close(M * (d * G), times(m, g) * e)
    close((d * G) * M, times(g, m) * e)
    close((d * G) * G, times(g, g) * e)
    close((d * G) / 2, g * e / 2)
    close(2 * (d * G), 2 * g * e)
    close(M - d * G, m - g * e)
    close([[1.0, 2.0]] * (d * G), times(m[:1], g) * e)
    close((d * G) * [[1.0], [2.0]], times(g, np.array([[1.0], [2.0]])[..., None]) * e)
    identity = np.eye(2)[..., None]
    inverse = np.moveaxis(np.linalg.inv(np.moveaxis(identity + g * e, -1, 0)), 0, -1)
    close(sc.feedback(G, d), times(g, inverse))
    close(sc.feedback(d * G), times(g * e, inverse))
    close(sc.feedback(np.eye(2), d * G), inverse)


@pytest.mark.analytical
def test_transfer_function_matrix_needs_no_slycot():
    G = ct.tf([[[1], [0]], [[2, 1], [3]]], [[[1, 1], [1]], [[1, 2], [1]]])
    e = np.exp(-0.3 * S)
    one = np.ones(S.size)
    close(sc.delay(0.3) * G, e * np.array([[lag(S), 0 * one], [(2 * S + 1) * lag(S, 2), 3 * one]]))
    with pytest.raises(sc.InputError, match="improper from input 0 to output 1"):
        sc.delay(1) * ct.tf([[[1]], [[1, 0, 0]]], [[[1, 1]], [[1, 1]]])


@pytest.mark.analytical
def test_append_is_block_diagonal():
    G, g = two_by_two()
    both = sc.append(G, sc.delay(0.3), 2.0)
    expected = np.zeros((4, 4, S.size), dtype=complex)
    expected[:2, :2], expected[2, 2], expected[3, 3] = g, np.exp(-0.3 * S), 2.0
    close(both, expected)
    zero = np.zeros(S.size)
    close(
        ct.append(sc.delay(0.3), ct.tf([1], [1, 1])),
        np.array([[np.exp(-0.3 * S), zero], [zero, lag(S)]]),
    )


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
@pytest.mark.property
def test_random_expressions_equal_their_values(seed):
    """Both sides of a random expression, in systems and in numbers at each frequency."""
    rng = np.random.default_rng(seed)
    s = 1j * rng.uniform(0.1, 5.0, 4)

    def leaf():
        kind = rng.integers(3)
        if kind == 0:
            tau = rng.uniform(0, 2)
            return sc.delay(tau), np.exp(-tau * s)
        if kind == 1:
            a, b = rng.uniform(0.2, 3, 2)
            return ct.tf([b], [1, a]), b / (s + a)
        k = float(rng.normal())
        return k, np.full(4, k, dtype=complex)

    system, value = sc.delay(0.5), np.exp(-0.5 * s)
    for _ in range(5):
        other, number = leaf()
        which = rng.integers(5)
        if which < 3:
            function = (operator.add, operator.sub, operator.mul)[which]
            if rng.integers(2):
                system, value = function(system, other), function(value, number)
            else:
                system, value = function(other, system), function(number, value)
        else:
            # a lag keeps the loop retarded
            back, gain = ct.tf([0.2], [1, 1]), 0.2 / (s + 1)
            system, value = sc.feedback(system, back), value / (1 + value * gain)
    assert system(s) == pytest.approx(value, rel=1e-12, abs=1e-12)


# --------------------------------------------------------------------------------- names, delays, selection


def test_delays_and_gains_stay_as_given_in_order():
    inner = sc.DelayLTI.from_state_delays([[[-1.0]], [[0.5]]], [0.0], B=[[1.0]], C=[[1.0]]).with_gains([2.0])
    result = sc.feedback(inner * sc.delay(0.7), sc.delay(0.7))
    assert list(result.delays) == [0.0, 0.7, 0.7]
    assert list(result.gains) == [2.0, 1.0, 1.0]
    g = np.exp(-0.2 * S) / (S + 1 - np.exp(-0.1 * S))
    close(result.with_delays([0.1, 0.2, 0.3]), g / (1 + g * np.exp(-0.3 * S)))


def test_names_carry_through():
    G, _ = two_by_two()
    d = sc.delay(0.3)
    for system in (d * G, G * d, 2 * (d * G), -(d * G), G + d * G, d * G / 3, sc.feedback(G, d), scaled(G)):
        assert system.input_labels == ["a", "b"]
        assert system.output_labels == ["p", "q"]
        assert set(system.state_labels) >= {"x[0]", "x[1]"}
    H = ct.StateSpace(-np.eye(2), np.eye(2), np.eye(2), 0, inputs=["p", "q"], outputs=["r", "s"])
    chain = H * (d * G)
    assert chain.input_labels == ["a", "b"]
    assert chain.output_labels == ["r", "s"]
    assert sc.append(d * G, G).input_labels == ["a", "b", "a_2", "b_2"]
    named = sc.delay(1.0, inputs="command", outputs="force", name="line")
    assert named.input_labels == ["command"]
    assert named.output_labels == ["force"]
    assert named.name == "line"
    assert sc.series(named, 2, outputs=["double"]).output_labels == ["double"]
    mixed = np.array([[1.0, 1.0], [0.0, 1.0]]) * (d * G)
    assert mixed.output_labels == ["y[0]", "y[1]"]


def scaled(G):
    return np.diag([2.0, 3.0]) * (sc.delay(0.1) * G)


def test_indexing_by_name_number_list_and_slice():
    G, g = two_by_two()
    system, e = sc.delay(0.3) * G, np.exp(-0.3 * S)
    for key, rows, columns in [
        (("q", "a"), [1], [0]),
        ((1, 0), [1], [0]),
        ((-1, -2), [1], [0]),
        ((slice(None), "b"), [0, 1], [1]),
        ((["q", "p"], slice(0, 2)), [1, 0], [0, 1]),
        ((["q", 0], [1]), [1, 0], [1]),
        ((np.int64(1), slice(None, None, -1)), [1], [1, 0]),
    ]:
        part = system[key]
        assert isinstance(part, sc.DelayLTI)
        assert part.output_labels == [["p", "q"][k] for k in rows]
        assert part.input_labels == [["a", "b"][k] for k in columns]
        close(part, (g * e)[np.ix_(rows, columns)])
    for key in [("x", "a"), (2, 0), (0, -3), 0, (0,), (0, 0, 0), ("p", 1.0), (True, 0), (slice("p", "q"), 0)]:
        with pytest.raises(sc.InputError):
            system[key]


# ------------------------------------------------------------------------------------------------- refusals


def test_ill_posed_and_neutral_loops_are_refused():
    with pytest.raises(sc.InputError, match="ill-posed"):
        sc.feedback(-1.0, 1.0)
    with pytest.raises(sc.InputError, match="algebraic loop"):
        sc.feedback(sc.delay(0.0), -1.0)
    for loop in (
        lambda: sc.feedback(sc.delay(1.0), 0.5),
        lambda: sc.feedback(ct.tf([1, 0], [1, 1]), sc.delay(0.1)),
        lambda: sc.feedback(sc.delay(0.5), sc.delay(0.5) * 1e-3),
    ):
        with pytest.raises(sc.NeutralLoopError, match="actuator_bandwidth"):
            loop()


@pytest.mark.parametrize("other", [1j, np.complex128(1j), "G", None, True, object()])
@pytest.mark.parametrize("op", [operator.add, operator.sub, operator.mul])
def test_strange_operands_are_type_errors_on_both_sides(other, op):
    with pytest.raises(TypeError):
        op(sc.delay(0.1), other)
    with pytest.raises(TypeError):
        op(other, sc.delay(0.1))


def test_wrong_operands_are_clear_errors():
    d, G = sc.delay(0.3), two_by_two()[0]
    for wrong in (
        lambda: d / 0,
        lambda: sc.delay(-1.0),
        lambda: sc.delay(np.inf),
        lambda: (d * G) * np.ones((3, 3)),
        lambda: (d * G) + np.ones((3, 3)),
        lambda: sc.feedback(d * G, np.ones((2, 3))),
        lambda: d * ct.tf([1], [1, 1], 0.1),
        lambda: sc.feedback(d, np.array([[1j]])),
        lambda: d * np.array([[1j]]),
        lambda: sc.series(d, 2, colour="red"),
        lambda: d * ct.tf([1, 0], [1]),
    ):
        with pytest.raises(sc.InputError):
            wrong()
    with pytest.raises(TypeError):
        1 / d
    with pytest.raises(TypeError):
        d / G


def test_frequency_data_on_the_left_stays_frequency_data_with_the_delay_exact():
    omega = np.array([0.5, 1.0, 3.0])
    G = ct.frd(ct.tf([1], [1, 1]), omega)
    product = G * sc.delay(0.3)
    assert isinstance(product, ct.FrequencyResponseData)
    assert product.frdata[0, 0] == pytest.approx(np.exp(-0.3j * omega) / (1j * omega + 1), rel=1e-14)
