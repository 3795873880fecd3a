"""The published numbers a study holds its own against: data of the study file, as the source prints them.

Printed numbers are texts, so that the number of printed digits is kept: it says how closely a computed value can be
expected to agree.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from susp_ctrl.study.settings.fields import SettingError, Settings, TextForm, setting


class Printed(NamedTuple):
    """A printed number: its value, half a unit of its last digit, and the text."""

    value: float
    half_digit: float
    text: str


def printed_number(text: str) -> Printed:
    """Read a printed number such as ``"9.7508e-4"``; ValueError if it is none.

    Examples
    --------
    >>> printed_number("0.5026")
    Printed(value=0.5026, half_digit=5e-05, text='0.5026')
    """
    mantissa, _, exponent = text.strip().lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return Printed(float(text), 0.5 * 10.0 ** (int(exponent or 0) - decimals), text)


_PRINTED = re.compile(r"\s*[+-]?(\d{1,12}(\.\d{0,40})?|\.\d{1,40})([eE][+-]?\d{1,2})?\s*", re.ASCII)


_MOST_PHASE = 1e4  # rad, of a crossing at the end of a printed interval
PRINTED = TextForm(_PRINTED.fullmatch, 'a number as printed, in quotes, such as "0.5026", is needed')


@dataclass(frozen=True)
class PrintedRow(Settings):
    """One row of a printed RMS table."""

    indicator: str = setting(not_empty=True)
    passive: str = setting(form=PRINTED)
    active: str = setting(form=PRINTED)
    change_percent: str | None = setting(None, form=PRINTED)
    misprint: str = setting("", lines=True)


@dataclass(frozen=True)
class PrintedTable(Settings):
    """A printed RMS table: passive against one published design on the road of a time case."""

    item: str = setting(not_empty=True)
    time: str = setting(not_empty=True)
    active: str = setting(not_empty=True)
    road_printed: bool = setting(True)
    rows: tuple[PrintedRow, ...] = setting(not_empty=True)


@dataclass(frozen=True)
class PrintedRoot(Settings):
    """One printed characteristic root; its conjugate is understood."""

    name: str = setting(not_empty=True)
    real: str = setting(form=PRINTED)
    imaginary: str = setting(form=PRINTED)


@dataclass(frozen=True)
class Substitution(Settings):
    """One entry of a matrix of x' = A x + B x(t - tau): what eq. (1) gives and what was used instead.

    Both are expressions in the symbols of Table 1; in B the gains are g1 and g2. Rows and columns count from 1.
    """

    matrix: str = setting(choices=("A", "B"))
    row: int = setting(at_least=1, at_most=8)
    column: int = setting(at_least=1, at_most=8)
    correct: str = setting(not_empty=True)
    used: str = setting(not_empty=True)
    note: str = setting("", lines=True)


@dataclass(frozen=True)
class PrintedRoots(Settings):
    """Printed roots of a design without delay, and the misprinted matrices that may explain them."""

    item: str = setting(not_empty=True)
    design: str = setting(not_empty=True)
    roots: tuple[PrintedRoot, ...] = setting(not_empty=True)
    substitutions: tuple[Substitution, ...] = setting(())


@dataclass(frozen=True)
class PrintedInterval(Settings):
    """A printed stability interval of the delay, with the crossing frequencies printed for it."""

    item: str = setting(not_empty=True)
    design: str = setting(not_empty=True)
    upper: str = setting(unit="s", form=PRINTED)
    crossings: tuple[str, ...] = setting((), unit="rad_per_s", form=PRINTED)

    def check(self) -> None:
        """Refuse frequencies that no crossing has, and more periods up to the delay than anybody prints."""
        for n, text in enumerate(self.crossings, 1):
            value, upper = printed_number(text).value, printed_number(self.upper).value
            if not 0.0 < value * max(upper, 1e-9) < _MOST_PHASE:
                allowed = f"a frequency greater than 0 is needed, at most {_MOST_PHASE:g} / upper_s"
                raise SettingError(f"crossings_rad_per_s[{n}]", text, allowed)


@dataclass(frozen=True)
class PrintedPeak(Settings):
    """A printed peak frequency of |H|."""

    item: str = setting(not_empty=True)
    design: str = setting("passive")
    output: str = setting(not_empty=True)
    frequency: str = setting(unit="Hz", form=PRINTED)


@dataclass(frozen=True)
class PrintedOptimum(Settings):
    """A published design that the source calls optimal, against the optimum found here."""

    item: str = setting(not_empty=True)
    published: str = setting(not_empty=True)
    tuned: str = setting(not_empty=True)


@dataclass(frozen=True)
class AuditSettings(Settings):
    """All printed numbers; `tolerance` is the relative difference up to which a number counts as reproduced."""

    tolerance: float = setting(0.005, at_least=0.0, at_most=0.1)
    tables: tuple[PrintedTable, ...] = setting(())
    roots: tuple[PrintedRoots, ...] = setting(())
    intervals: tuple[PrintedInterval, ...] = setting(())
    peaks: tuple[PrintedPeak, ...] = setting(())
    optima: tuple[PrintedOptimum, ...] = setting(())
