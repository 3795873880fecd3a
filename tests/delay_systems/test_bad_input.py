"""Arguments that make no sense are refused by name, whatever is wrong with them; what makes sense is accepted."""

import control
import numpy as np
import pytest

import susp_ctrl as sc
from susp_ctrl import validation
from susp_ctrl.errors import InputError, NeutralLoopError

INTEGRATOR = {"A": [[[0.0]], [[-1.0]]], "delays": [1.0]}


def loop(**changes):
    return sc.DelayLTI.from_state_delays(**{**INTEGRATOR, "B": [[1.0]], **changes})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"inputs": ["a", "b"]}, "inputs has 2 names"),
        ({"outputs": ["a", "b", "c"]}, "outputs has 3 names"),
        ({"states": ["a", "b"]}, "states has 2 names"),
        ({"inputs": 3}, "inputs = 3"),
        ({"states": [1]}, r"states\[0\] = 1"),
        ({"name": 3}, "name = 3"),
        ({"colour": "red"}, "colour"),
        ({"A": None}, "A = None"),
        ({"A": 3.0}, "A = 3.0"),
        ({"A": "ab"}, "A = 'ab'"),
        ({"A": [[[1.0, 2.0], [3.0]], [[1.0]]]}, r"A\[0\]"),
        ({"A": [[["0"]], [[-1.0]]]}, r"A\[0\]"),
        ({"A": [[[0.0]], [[True]]]}, r"A\[1\]"),
        ({"delays": ["1"]}, "delays"),
        ({"delays": [True]}, "delays"),
        ({"delays": None}, "delays"),
        ({"B": "b"}, "B"),
        ({"input_terms": [1]}, r"input_terms\[0\] = 1"),
        ({"input_terms": None}, "input_terms = None"),
        ({"input_terms": [([[1.0]],)]}, r"input_terms\[0\] has 1 entries"),
        ({"input_terms": [([[1.0]], "late")]}, r"input_terms\[0\] delay"),
    ],
)
def test_state_delays(changes, words):
    with pytest.raises(InputError, match=words):
        loop(**changes)


@pytest.mark.parametrize("names", [{"outputs": ["a", "b", "c"]}, {"inputs": []}, {"label": "a"}])
def test_new_names(names):
    with pytest.raises(InputError, match=next(iter(names))):
        loop().with_names(**names)


def test_names_that_fit():
    named = loop(inputs="force", outputs=("position",), states=["x"], name="loop")
    assert (named.input_labels, named.output_labels, named.state_labels) == (["force"], ["position"], ["x"])
    assert named.with_names(inputs=["f"]).input_labels == ["f"]


@pytest.mark.parametrize("points", ["a", ["1", "2"], [True, False], None, [1.0, None]])
def test_points_of_evaluation(points):
    with pytest.raises(InputError, match=r"^x = "):
        loop()(points)
    if points is not None:
        with pytest.raises(InputError, match=r"^omega"):
            loop().frequency_response(points)


@pytest.mark.parametrize("sign", [2, 0, 0.5, np.nan, "-", None, True])
def test_sign_of_feedback(sign):
    with pytest.raises(InputError, match="sign"):
        sc.feedback(loop(), 1, sign)
    with pytest.raises(InputError, match="sign"):
        loop().feedback(1, sign=sign)


def test_one_channel_needs_no_list():
    plant = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], inputs=["f"], outputs=["y"])
    channel = sc.FeedbackChannel("y", "f", gain=-1.0, delay=0.5)
    for close in (sc.close_loop, sc.open_loop):
        assert close(plant, channel)(2j) == close(plant, [channel])(2j)
    for bad in (3, None, "y"):
        with pytest.raises(InputError, match="channels"):
            sc.close_loop(plant, bad)


@pytest.mark.parametrize(
    "value", [["1"], [True], [1.0, True], "1", [np.True_], [None], [1j], {"a": 1}, [[1.0], [True]]]
)
def test_vectors_and_matrices_hold_numbers_only(value):
    with pytest.raises(InputError, match="v"):
        validation.vector("v", value)
    with pytest.raises(InputError, match="m"):
        validation.matrix("m", [value])
    with pytest.raises(InputError, match="v"):
        validation.increasing("v", value)


def test_numbers_of_any_kind_are_taken():
    from decimal import Decimal
    from fractions import Fraction

    given = [1, 2.5, np.float32(3.0), np.int8(4), Fraction(1, 2)]
    np.testing.assert_array_equal(validation.vector("v", given), [1.0, 2.5, 3.0, 4.0, 0.5])
    np.testing.assert_array_equal(validation.vector("v", [Decimal("0.25")]), [0.25])
    assert validation.vector("v", []).size == 0


@pytest.mark.analytical
def test_direct_paths_without_a_cycle_are_no_neutral_loop():
    """Strictly triangular in some order: no path comes back, however large its entries; one that does is neutral."""
    random = np.random.default_rng(0)
    D = np.array([[0.0, 0.0, 0.0], [1100.0, 0.0, 0.0], [1900.0, 6500.0, 0.0]])
    cases = [D]
    for _ in range(100):
        m = random.integers(2, 8)
        size = 10.0 ** random.uniform(-6.0, 6.0, (m, m))
        order = random.permutation(m)
        cases.append(np.triu(random.normal(size=(m, m)) * size, 1)[np.ix_(order, order)])
    for D in cases:
        m = len(D)
        system = sc.DelayLTI(
            control.ss([[-1.0]], np.ones((1, m)), np.ones((m, 1)), D), np.arange(1.0, m + 1.0)
        )
        np.testing.assert_allclose(system.realization.D22, D)
        cycle = D.copy()
        i, j = np.argwhere(D)[0]
        cycle[j, i] = 1e-3 / D[i, j]
        with pytest.raises(NeutralLoopError):
            sc.DelayLTI(
                control.ss([[-1.0]], np.ones((1, m)), np.ones((m, 1)), cycle), np.arange(1.0, m + 1.0)
            )


@pytest.mark.analytical
def test_pade_of_a_system_without_inputs():
    """x' = -x - 2 x(t - 1/2): python-control holds no system without inputs; the poles are what matters."""
    system = sc.DelayLTI.from_state_delays(A=[[[-1.0]], [[-2.0]]], delays=[0.5])
    for approximation in (system.pade(6), system.spectral(20)):
        assert approximation.input_labels == ["idle"]
        assert not np.any(approximation.B)
        assert not np.any(approximation.D)
        assert np.max(approximation.poles().real) == pytest.approx(sc.spectral_abscissa(system), rel=1e-6)
    assert sc.DelayLTI.from_state_delays(A=[[[-1.0]]], delays=[]).plant.nstates == 1
    assert sc.DelayLTI.from_state_delays(A=[[[-1.0]]], delays=[]).to_ss().nstates == 1


@pytest.mark.parametrize("bad", ["a", None, [1, "b"], {}, True, 1j, np.array(["x"]), [[1], [2, 3]]])
@pytest.mark.parametrize(
    "call",
    [
        sc.stability,
        sc.characteristic_roots,
        sc.h2_norm,
        lambda x: sc.characteristic_roots(loop(), right_of="none" if x is None else x),
        lambda x: sc.hinf_norm(loop(), x),
        lambda x: loop().pade(x),
        lambda x: loop().spectral(x),
        lambda x: loop().margins("none" if x is None else x),
        lambda x: loop().with_gains(x),
        lambda x: sc.feedback(loop(), x),
        lambda x: sc.FeedbackChannel("y", "u", gain=x),
    ],
)
def test_no_raw_error(call, bad):
    with pytest.raises(InputError):
        call(bad)
