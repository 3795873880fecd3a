"""Numbers, units and signal names as a reader expects to see them. Display only: nothing here feeds a CSV."""

from __future__ import annotations

import math
import re
from typing import Any

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_MINUS, _THIN = "\N{MINUS SIGN}", "\N{THIN SPACE}"
_PLACES = ("front", "rear", "left", "right")
_CAPITALS = {"mtvv": "MTVV", "vdv": "VDV", "rms": "RMS"}
NOTHING = "–"
"""What stands where there is no value."""


def number_text(value: Any, digits: int = 4) -> str:
    """Return a number with `digits` significant digits.

    From 0.001 up to 9 999 999 in plain notation (thousands apart from 10 000), beyond that with a power of ten.

    Examples
    --------
    >>> number_text(0.00097508), number_text(-28.19843, 3), number_text(192000.0)
    ('9.751×10⁻⁴', '−28.2', '192\u2009000')
    """
    number = math.nan if value is None else float(value)
    if math.isnan(number):
        return NOTHING
    if math.isinf(number):
        return "∞" if number > 0 else f"{_MINUS}∞"
    if number == 0.0:
        return "0"
    mantissa, _, power = f"{number:.{digits - 1}e}".partition("e")
    exponent = int(power)
    if -3 <= exponent < 7:
        return grouped(f"{number:.{max(digits - 1 - exponent, 0)}f}")
    return mantissa.replace("-", _MINUS) + _power_of_ten(power)


def exact_text(value: Any, digits: int = 8) -> str:
    """Return a given number (a setting, a printed value) without digits that were never there.

    Examples
    --------
    >>> exact_text(40.5), exact_text(0.5530), exact_text(1e-6)
    ('40.5', '0.553', '1×10⁻⁶')
    """
    if value is None or not math.isfinite(float(value)):
        return number_text(value)
    number = float(value)
    if number != 0.0 and not 1e-4 <= abs(number) < 1e8:
        mantissa, _, power = f"{number:.{digits - 1}e}".partition("e")
        return mantissa.rstrip("0").rstrip(".").replace("-", _MINUS) + _power_of_ten(power)
    text = f"{number:.{digits}g}"
    return grouped(f"{number:.0f}" if "e" in text else text)


def fixed_text(value: Any, decimals: int) -> str:
    """Return a number with a fixed number of decimals."""
    if value is None or not math.isfinite(float(value)):
        return number_text(value)
    text = f"{float(value):.{decimals}f}"
    return grouped(text.lstrip("-") if float(text) == 0.0 else text)


def change_text(percent: Any) -> str:
    """Return a change in percent with its sign and a mark: ▼ less, ▲ more, = the same to one decimal.

    Examples
    --------
    >>> change_text(-28.2), change_text(11.04), change_text(0.01)
    ('−28.2\u2009▼', '+11.0\u2009▲', '0.0\u2009=')
    """
    if percent is None or not math.isfinite(float(percent)):
        return NOTHING
    text = fixed_text(percent, 1)
    if float(f"{float(percent):.1f}") == 0.0:
        return f"{text}{_THIN}="
    return f"+{text}{_THIN}▲" if float(percent) > 0 else f"{text}{_THIN}▼"


def _power_of_ten(exponent: str) -> str:
    return f"×10{str(int(exponent)).translate(_SUPERSCRIPTS)}"


def grouped(text: str) -> str:
    """Return decimal text with a true minus sign and, from 10 000 on, thousands apart."""
    sign, text = (_MINUS, text[1:]) if text.startswith("-") else ("", text)
    whole, point, decimals = text.partition(".")
    if len(whole) >= 5:
        whole = f"{int(whole):,}".replace(",", _THIN)
    return f"{sign}{whole}{point}{decimals}"


def unit_text(unit: str) -> str:
    """Return a unit with raised exponents, ``m/s2`` as ``m/s²``, and nothing for a pure number (``-``)."""
    if unit == "-":
        return ""
    raised = re.sub(r"(?<=s)1\.75\b", "¹·⁷⁵", unit)
    return re.sub(r"(?<=[A-Za-z])([2-9])", lambda match: match.group(1).translate(_SUPERSCRIPTS), raised)


def symbol_text(name: str) -> str:
    """Return text with its numbered symbols as such: ``tau2`` becomes ``τ₂``, ``g1`` ``g₁``, ``rho`` ``ρ``."""

    def with_subscript(match: re.Match[str]) -> str:
        greek = {"tau": "τ"}.get(match.group(1), match.group(1))
        return greek + match.group(2).translate(_SUBSCRIPTS)

    return re.sub(r"\brho\b", "ρ", re.sub(r"\b(tau|[gz])(\d+)\b", with_subscript, name))


def prose(text: str) -> str:
    """Return running text as a reader expects it.

    Signal names become words, numbered symbols get subscripts, units raised exponents, numbers a true minus sign
    and powers of ten.

    Examples
    --------
    >>> prose("tire_deflection_front is -2.5e-6 m, tau2 0.1 s, 3 m/s2")
    'front tire deflection is −2.5×10⁻⁶ m, τ₂ 0.1 s, 3 m/s²'
    """
    words = re.sub(r"\b[a-z]{2,}(_[a-z]{2,})+\b", lambda match: signal_text(match.group()), text.strip())
    words = re.sub(r"(?<=/s)2\b", "²", symbol_text(words))
    words = re.sub(r"(?<=\d)e([+-]?\d+)\b", lambda match: _power_of_ten(match.group(1)), words)
    return re.sub(r"(?<![\w\]).])-(?=[\d.])", _MINUS, words)


def sentence(text: str) -> str:
    """Return `prose` with a capital at the start and a full stop at the end."""
    words = capital(prose(text))
    return words + ("" if not words or words.endswith((".", "!", "?")) else ".")


def capital(text: str) -> str:
    """Return the text with a capital first letter (a Greek symbol stays as it is)."""
    return text[:1].upper() + text[1:] if text[:1].isascii() else text


def signal_text(name: str) -> str:
    """Return the name of a signal, parameter or index as words.

    Examples
    --------
    >>> signal_text("tire_deflection_front"), signal_text("suspension_deflection_rear_peak")
    ('front tire deflection', 'rear suspension deflection peak')
    """
    words = name.split("_")
    where = [word for word in words if word in _PLACES] if len(words) > 1 else []
    return " ".join([*where, *(_CAPITALS.get(word, word) for word in words if word not in where)])


def formula_text(formula: str) -> str:
    """Return a formula of plain letters with true minus signs and dots: ``-Lf*csf/mtf``."""
    return formula.replace("-", _MINUS).replace("*", "·")


def with_unit(name: str, unit: str) -> str:
    """Return ``name (unit)``, or the name alone."""
    return f"{name} ({unit_text(unit)})" if unit else name
