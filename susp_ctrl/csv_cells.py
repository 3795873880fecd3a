r"""Tables as CSV files that a spreadsheet shows and does not execute.

A spreadsheet takes a text that begins with ``=``, ``+``, ``-``, ``@``, a tab or a line break for a formula. Such a text
(a label, a message) is written with an apostrophe before it, which a spreadsheet takes for "this is text"; so is one
that has apostrophes before such a beginning, so that `plain_text` restores every text. Numbers are as they are, and so
is a dash alone, the unit of what has none.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pandas as pd

_FORMULA = re.compile(r"(?!-$)'*[=@+\-\t\r\n\uff1d\uff20\uff0b\uff0d]")  # the last four as wide characters
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf|nan)")


def safe_text(value: Any) -> Any:
    """Return a cell as it is written.

    Examples
    --------
    >>> safe_text("=1+1"), safe_text("-3.5"), safe_text("-csf"), safe_text(-3.5)
    ("'=1+1", '-3.5', "'-csf", -3.5)
    """
    if not isinstance(value, str) or not _FORMULA.match(value) or _NUMBER.fullmatch(value):
        return value
    return f"'{value}"


def plain_text(text: str) -> str:
    """Return the text that `safe_text` made a cell of."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def write_csv(table: pd.DataFrame, path: Path, *, float_format: str | None = None) -> None:
    """Write a table without its index, with headings and texts made safe."""
    safe = table.copy(deep=False)
    for n, kind in enumerate(table.dtypes):
        if kind.kind not in "biufcM":
            safe.isetitem(n, table.iloc[:, n].map(safe_text).array)
    safe.columns = [safe_text(name) for name in table.columns]
    safe.to_csv(path, index=False, lineterminator="\n", encoding="utf-8", float_format=float_format)
