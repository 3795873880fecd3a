"""Checks of arguments: one line with name, value and what is allowed."""

from __future__ import annotations

import numpy as np
import pytest

from susp_ctrl import validation
from susp_ctrl.errors import InputError


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: validation.number("mass", True), "mass = True is not allowed: a finite number is needed"),
        (lambda: validation.number("mass", "1"), "mass = '1' is not allowed"),
        (lambda: validation.number("mass", 0, above=0), "mass = 0 is not allowed: a finite number, greater than 0"),
        (lambda: validation.number("mass", 3, below=3), "mass = 3 is not allowed: a finite number, less than 3"),
        (lambda: validation.number("mass", 4, at_most=3), "mass = 4 is not allowed: a finite number, at most 3"),
        (lambda: validation.number("mass", -np.inf), "mass = -inf is not allowed"),
        (lambda: validation.integer("order", 2.0), "order = 2.0 is not allowed: an integer is needed"),
        (lambda: validation.integer("order", 0, at_least=1), "order = 0 is not allowed: an integer, at least 1"),
        (lambda: validation.vector("delays", [1j]), "delays = [1j] is not allowed: a sequence of numbers"),
        (lambda: validation.vector("delays", [[1.0]]), "delays has shape (1, 1): a one-dimensional sequence"),
        (lambda: validation.vector("delays", [1, 2], size=3), "delays has shape (2,): a one-dimensional"),
        (lambda: validation.matrix("B", [[1.0, 2j]]), "B is not allowed: a real matrix"),
        (lambda: validation.matrix("B", [[1.0]], rows=2), "B has shape (1, 1): a matrix of shape (2, 1)"),
        (lambda: validation.matrix("B", [[np.nan]]), "B is not allowed: finite numbers"),
        (lambda: validation.increasing("omega", []), "omega is empty"),
        (lambda: validation.increasing("omega", [1, 2, 2]), "omega does not increase: omega[2] = 2 follows 2"),
        (lambda: validation.one_of("kind", "rign", ["ring", "global"]), "did you mean 'ring'?"),
        (lambda: validation.random_generator(-1), "seed = -1 is not allowed"),
    ],
)  # fmt: skip
def test_the_message_names_argument_value_and_what_is_allowed(call, message: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_clean_values_pass_unchanged() -> None:
    assert validation.number("x", np.float64(2.5), at_least=0) == 2.5
    assert validation.integer("n", np.int64(3)) == 3
    assert validation.signal_index("signal", "b", ["a", "b"]) == 1
    generator = np.random.default_rng(0)
    assert validation.random_generator(generator) is generator
    np.testing.assert_array_equal(validation.vector("v", 2), [2.0])


@pytest.mark.parametrize("size", [400, 5000])
def test_integers_beyond_every_float_are_refused_like_infinity(size):
    for value in (10**size, -(10**size)):
        with pytest.raises(InputError, match=r"x = -?inf is not allowed: a finite number"):
            validation.number("x", value)
        with pytest.raises(InputError, match="x"):
            validation.vector("x", [1.0, value])


def test_a_message_is_one_short_line_whatever_the_value():
    for value in ("\x1b[2J\n" * 1000, ["\u202e"] * 100_000, np.zeros((100, 100))):
        with pytest.raises(InputError) as caught:
            validation.one_of("word", value, ["a", "b"])
        text = str(caught.value)
        assert text.isprintable()
        assert len(text) <= 300
        assert text.startswith("word = ")
        assert text.endswith("allowed are a, b")
