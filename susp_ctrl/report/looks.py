"""Names and looks of the designs: every design bears the same label and the same line in the whole report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from susp_ctrl.study.result import Design, StudyRun

# Numbers of susp_ctrl.plotting.curve_style: passive black dashed, published broken lines, tuned solid lines.
_NUMBERS: Mapping[str, tuple[int, ...]] = {"passive": (0,), "published": (1, 3, 6, 7, 4), "tuned": (2, 5)}


def labels(run: StudyRun) -> dict[str, str]:
    """Return design key -> label."""
    return {design.key: design.label for design in run.designs}


def looks(designs: Iterable[Design]) -> dict[str, int]:
    """Return design label -> number of its look."""
    counts: dict[str, int] = {}
    result = {}
    for design in designs:
        numbers = _NUMBERS[design.role]
        result[design.label] = numbers[counts.get(design.role, 0) % len(numbers)]
        counts[design.role] = counts.get(design.role, 0) + 1
    return result


def of_role(run: StudyRun, *roles: str) -> list[Design]:
    """Return the designs of these roles, in the study's order."""
    return [design for design in run.designs if design.role in roles]


def subscript(number: int) -> str:
    """Return a positive whole number as subscript digits."""
    return str(number).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))
