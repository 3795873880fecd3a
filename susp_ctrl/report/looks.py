"""Names and looks of the designs: every design bears the same label and the same line in the whole report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from susp_ctrl.plotting import curve_style
from susp_ctrl.study.results import Design, StudyRun

# Numbers of susp_ctrl.plotting.curve_style by preference: passive black dashed, published broken lines, tuned solid
# lines; a design whose preferred looks are taken gets one that is still free.
_PREFERRED: Mapping[str, tuple[int, ...]] = {
    "passive": (0, 7, 1, 3, 6, 4, 2, 5),
    "published": (1, 3, 6, 7, 4, 2, 5, 0),
    "tuned": (2, 5, 3, 1, 4, 6, 7, 0),
}


def labels(run: StudyRun) -> dict[str, str]:
    """Return design key -> label."""
    return {design.key: design.label for design in run.designs}


def looks(designs: Iterable[Design]) -> dict[str, int]:
    """Return design label -> number of its look."""
    return {label: number for label, (number, _) in _numbered(designs).items()}


def _numbered(designs: Iterable[Design]) -> dict[str, tuple[int, str]]:
    taken: list[int] = []
    result: dict[str, tuple[int, str]] = {}
    for design in designs:
        preferred = _PREFERRED[design.role]
        # With more designs than looks, the one used least often comes again.
        number = min(preferred, key=lambda look: (taken.count(look), preferred.index(look)))
        taken.append(number)
        result[design.label] = (number, design.role)
    return result


def history_looks(designs: Iterable[Design]) -> dict[str, dict[str, Any]]:
    """Return design label -> line properties for time histories, where curves lie over one another.

    The passive car is a broad light line in the background, published designs are broken and tuned ones thin solid
    lines in front, in the colours and with the markers that they have everywhere.
    """
    result = {}
    for label, (number, role) in _numbered(designs).items():
        look = curve_style(number)
        if role == "passive":
            look |= {"color": "#B4B4B4", "linestyle": "-", "linewidth": 1.9}
        elif role == "published":
            look |= {"linestyle": (0, (3.5, 1.0)), "linewidth": 0.9}
        else:
            look |= {"linestyle": "-", "linewidth": 0.75}
        result[label] = look
    return result
