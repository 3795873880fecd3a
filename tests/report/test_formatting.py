"""Digits, units and names as a reader sees them."""

from __future__ import annotations

import math

import pytest

from susp_ctrl.report import formatting
from susp_ctrl.report.formatting import (
    change_text,
    exact_text,
    fixed_text,
    number_text,
    prose,
    sentence,
    signal_text,
    unit_text,
)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (3.0647, 4, "3.065"),
        (0.0383, 3, "0.0383"),
        (9.7508e-4, 4, "9.751×10⁻⁴"),
        (-28.19843, 3, "−28.2"),
        (192000.0, 6, "192\u2009000"),
        (9.9999, 3, "10.0"),
        (0.0, 4, "0"),
        (1e-15, 2, "1.0×10⁻¹⁵"),
        (-2.5e8, 2, "−2.5×10⁸"),
        (math.nan, 4, "–"),
        (None, 4, "–"),
        (math.inf, 4, "∞"),
        (-math.inf, 4, "−∞"),
    ],
)
def test_significant_digits(value: float | None, digits: int, text: str) -> None:
    assert number_text(value, digits) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (40.5, "40.5"),
        (0.5530, "0.553"),
        (34000, "34\u2009000"),
        (1e-6, "1×10⁻⁶"),
        (0.001, "0.001"),
        (2.0, "2"),
    ],
)
def test_given_numbers_get_no_digits_that_were_never_there(value: float, text: str) -> None:
    assert exact_text(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(-28.2, "−28.2\u2009▼"), (11.04, "+11.0\u2009▲"), (-0.01, "0.0\u2009="), (math.nan, "–"), (None, "–")],
)
def test_changes_bear_sign_and_mark(value: float | None, text: str) -> None:
    assert change_text(value) == text


def test_fixed_decimals() -> None:
    assert fixed_text(-1.172541, 5) == "−1.17254"
    assert fixed_text(-0.001, 1) == "0.0"
    assert fixed_text(12345.678, 1) == "12\u2009345.7"


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("m/s2", "m/s²"),
        ("rad/s2", "rad/s²"),
        ("kg m2", "kg m²"),
        ("m/s1.75", "m/s¹·⁷⁵"),
        ("-", ""),
        ("N/m", "N/m"),
    ],
)
def test_units(unit: str, text: str) -> None:
    assert unit_text(unit) == text


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("tire_deflection_front", "front tire deflection"),
        ("suspension_deflection_rear_peak", "rear suspension deflection peak"),
        ("body_acceleration_mtvv", "body acceleration MTVV"),
        ("front", "front"),
        ("road_rear_left", "rear left road"),
    ],
)
def test_signal_names(name: str, text: str) -> None:
    assert signal_text(name) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("0.7 body_acceleration at tau2", "0.7 body acceleration at τ₂"),
        ("J = 1.163e-15, change -42.4 %", "J = 1.163×10⁻¹⁵, change −42.4 %"),
        ("3.57 m/s2 and x-axis", "3.57 m/s² and x-axis"),
        ("eq. (1)-(5), Table 2-3", "eq. (1)-(5), Table 2-3"),
        ("g1 = -4416, rho < 1", "g₁ = −4416, ρ < 1"),
        ("path/to/e5 e5", "path/to/e5 e5"),
    ],
)
def test_running_text(text: str, shown: str) -> None:
    assert prose(text) == shown


def test_sentences() -> None:
    assert sentence("all iterations done") == "All iterations done."
    assert sentence("tau2 alone.") == "τ₂ alone."
    assert sentence("") == ""


def test_examples_of_the_docstrings() -> None:
    import doctest

    assert doctest.testmod(formatting).failed == 0
