"""Arithmetic of study files."""

from __future__ import annotations

import pytest

from susp_ctrl.errors import InputError
from susp_ctrl.study.audit.expressions import evaluate

SYMBOLS = {"ksf": 17000.0, "ktf": 192000.0, "mtf": 40.5, "Lf": 1.25, "I": 1200.0}


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", 0.0),
        ("-(ksf + ktf)/mtf", -209000.0 / 40.5),
        ("Lf**2*ksf/I", 1.5625 * 17000.0 / 1200.0),
        (" 1 - 2*3 ", -5.0),
        ("+ksf", 17000.0),
        ("2/4/2", 0.25),
    ],
)
def test_value(text, value):
    assert evaluate(text, SYMBOLS) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "ksf +",
        "ksg",
        "__import__('os')",
        "ksf.real",
        "ksf if 1 else 2",
        "1/0",
        "'a'",
        "True",
        "10**400",
        "f(1)",
        "1,2",
    ],
)
def test_anything_else_is_refused(text):
    with pytest.raises(InputError, match="is not allowed"):
        evaluate(text, SYMBOLS)
