"""What a report is made of: sections, each a sequence of text, equations, tables and figures.

Blocks hold content, not layout: the document, the CSV files and a notebook all draw from the same blocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import pandas as pd
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl.report.formatting import (
    NOTHING,
    change_text,
    exact_text,
    fixed_text,
    formula_text,
    number_text,
    prose,
    signal_text,
    unit_text,
)

Words = Literal["text", "long", "prose", "signal", "unit", "formula", "check"]
Numbers = Literal["written", "number", "exact", "fixed", "integer", "change"]
_WORDS: Mapping[str, Callable[[str], str]] = {
    "signal": signal_text,
    "unit": unit_text,
    "prose": prose,
    "long": prose,
    "formula": formula_text,
}


@dataclass(frozen=True)
class Column:
    """How one column of a table is shown.

    Parameters
    ----------
    name : str
        Column of the data.
    heading : str
        Heading, with the unit where the whole column has one.
    kind : str
        ``"text"`` as it is, ``"prose"`` as running text, ``"long"`` the same and it may wrap, ``"signal"`` a signal
        name in words, ``"unit"`` a unit, ``"formula"`` a formula in plain letters, ``"written"`` a number as text,
        ``"number"`` with `digits` significant digits, ``"exact"`` a given number, ``"fixed"`` with `digits` decimals,
        ``"integer"``, ``"change"`` percent with sign and mark, ``"check"`` a truth value.
    digits : int
        Digits of ``"number"`` and ``"fixed"``.
    scale : float
        Factor to the displayed unit (rad/s to Hz, m to mm).
    words : mapping, optional
        Texts to be replaced (design keys by labels).
    """

    name: str
    heading: str
    kind: Words | Numbers = "text"
    digits: int = 4
    scale: float = 1.0
    words: Mapping[str, str] = field(default_factory=dict)

    @property
    def align(self) -> str:
        """Side of the column: numbers stand right."""
        return "right" if self.kind in get_args(Numbers) else "left"

    def text(self, value: Any) -> str:
        """Return one cell as it is shown."""
        if isinstance(value, str):
            return _WORDS.get(self.kind, str)(self.words.get(value, value))
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return NOTHING
        match self.kind:
            case "number":
                return number_text(self.scale * value, self.digits)
            case "exact":
                return exact_text(self.scale * value)
            case "fixed":
                return fixed_text(self.scale * value, self.digits)
            case "integer":
                return fixed_text(self.scale * value, 0)
            case "change":
                return change_text(value)
            case "check":
                return "✓" if value else ""
        return str(value)


@dataclass(frozen=True)
class Table:
    """A table: the data in SI units and full precision, and how it is shown.

    Parameters
    ----------
    key : str
        Name of the table and of its CSV file.
    caption : str
        What it shows.
    frame : DataFrame
        The data, as written to the CSV file.
    columns : tuple of Column
        What the document shows, in order.
    note : str
        Lines below the table.
    group : str
        Column whose value becomes a line of its own above the rows that share it.
    shown : DataFrame or None
        The rows that the document shows, where they are not those of `frame`.
    in_document : bool
        False for a table that is only written as CSV (long histories).
    spans : tuple of (str, int)
        Headings above the headings, each over a number of columns; they may hold line breaks.
    whole : bool
        Keep the table on one page.
    emphasis : str
        Column of truth values: its rows are set bold.
    """

    key: str
    caption: str
    frame: pd.DataFrame
    columns: tuple[Column, ...] = ()
    note: str = ""
    group: str = ""
    shown: pd.DataFrame | None = None
    in_document: bool = True
    whole: bool = False
    emphasis: str = ""
    spans: tuple[tuple[str, int], ...] = ()

    def cells(self) -> list[dict[str, Any]]:
        """Return the rows as shown: ``{"group": text}`` or ``{"cells": [texts], "strong": bool}``."""
        frame = self.frame if self.shown is None else self.shown
        rows: list[dict[str, Any]] = []
        last = None
        for record in frame.to_dict(orient="records"):
            if self.group and record[self.group] != last:
                last = record[self.group]
                rows.append({"group": str(last)})
            strong = bool(self.emphasis and record[self.emphasis])
            rows.append({"cells": [c.text(record[c.name]) for c in self.columns], "strong": strong})
        return rows


@dataclass(frozen=True)
class Figure:
    """A figure that is drawn only when somebody asks for it.

    Parameters
    ----------
    key : str
        Name of the figure and of its files.
    caption : str
        What it shows, and how to read it.
    draw : callable
        Returns the matplotlib figure.
    """

    key: str
    caption: str
    draw: Callable[[], MatplotlibFigure]


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph, or a list of short ones."""

    text: str = ""
    items: tuple[str, ...] = ()
    numbered: bool = False


@dataclass(frozen=True)
class Equations:
    """A group of equations that the document's template holds under this name."""

    name: str


@dataclass(frozen=True)
class Box:
    """A framed statement: what a reader must not miss."""

    title: str
    lines: tuple[str, ...]
    warning: bool = False


Block = Heading | Text | Equations | Table | Figure | Box


@dataclass(frozen=True)
class Section:
    """A chapter of the report."""

    title: str
    blocks: tuple[Block, ...]

    @property
    def tables(self) -> tuple[Table, ...]:
        """The tables, in order."""
        return tuple(block for block in self.blocks if isinstance(block, Table))

    @property
    def figures(self) -> tuple[Figure, ...]:
        """The figures, in order."""
        return tuple(block for block in self.blocks if isinstance(block, Figure))
