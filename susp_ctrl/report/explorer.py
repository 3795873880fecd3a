"""The part of the page in which a click on a stability map shows the rightmost root and the time response.

Everything that a click can show stands in the page, as numbers of few digits; the script only chooses and draws.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.plotting import map_legend, map_picture
from susp_ctrl.report.document import asset
from susp_ctrl.report.formatting import prose, signal_text, symbol_text, unit_text, with_unit
from susp_ctrl.report.sections.maps import axis_label, axis_scale, picture
from susp_ctrl.study.results import MapExplorer

_DIGITS = np.frombuffer(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_", dtype=np.uint8)
_HALF = 2047  # steps from 0 to the peak: far finer than a screen


def explorer_html(explorer: MapExplorer) -> str:
    """Return the map to click on, with all its data, as HTML.

    Parameters
    ----------
    explorer
        What was computed on the grid.
    """
    case = explorer.case
    unstable = picture(case)[2]
    parts = {
        "name": case.name,
        "road": escape(prose(explorer.road_text)),
        "count": f"{explorer.x_values.size} × {explorer.y_values.size}",
        "picture": "data:image/png;base64," + b64encode(map_picture(unstable)).decode(),
        "x_label": escape(axis_label(case.x)),
        "y_label": escape(axis_label(case.y)),
        "response_label": escape(with_unit(signal_text(explorer.output), explorer.unit)),
        "design": _design_mark(explorer),
        "shades": " ".join(
            f'<span><span class="shade" style="background:{shade}"></span> {escape(text)}</span>'
            for text, shade in map_legend(unstable)
        ),
        # No "<" can end the script element that the data stand in.
        "data": json.dumps(explorer_data(explorer), ensure_ascii=False).replace("<", "\\u003c"),
    }
    return filled("explorer.html", parts)


def explorer_script() -> str:
    """Return the script that the maps need."""
    return asset("explorer.js")


def filled(name: str, parts: Mapping[str, str]) -> str:
    """Return an HTML file of the package with its ``{{names}}`` replaced by these parts."""
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match.group(1)], asset(name))


def explorer_data(explorer: MapExplorer) -> dict[str, Any]:
    """Return what the script needs as data that JSON can hold.

    ``points`` has one entry for each point of the grid, row by row from the lowest y: real and imaginary part of the
    rightmost root, unstable roots, peak of the response, and the response as `packed`.
    """
    case = explorer.case
    scales = [axis_scale(axis)[0] for axis in (case.x, case.y)]
    values = (explorer.x_values, explorer.y_values)
    points = [
        _point(explorer, row, column) for row in range(values[1].size) for column in range(values[0].size)
    ]
    start = [int(np.argmin(abs(grid - at))) for grid, at in zip(values, case.map.design, strict=True)]
    peak, curve = packed(explorer.passive)
    return {
        "x": [_short(scales[0] * v) for v in values[0]],
        "y": [_short(scales[1] * v) for v in values[1]],
        "names": [symbol_text(axis.name.replace("gain", "g")) for axis in (case.x, case.y)],
        "units": [axis_scale(axis)[1] for axis in (case.x, case.y)],
        "unit": unit_text(explorer.unit),
        "duration": float(explorer.timepts[-1]),
        "start": start,
        "points": points,
        "passivePeak": peak,
        "passive": curve,
    }


def packed(values: FloatArray) -> tuple[float, str]:
    """Return the peak of a curve, and the curve as two letters for each value; "" where it has no number.

    A value v is the whole number ``round((v/peak + 1) 2047)``, written with two digits of base 64.
    """
    peak = _short(float(np.max(np.abs(values), initial=0.0)))
    if not np.isfinite(peak):
        return 0.0, ""
    share = np.clip(values / peak, -1.0, 1.0) if peak else np.zeros_like(values)
    steps = np.rint((share + 1.0) * _HALF).astype(int)
    return peak, _DIGITS[np.column_stack([steps // 64, steps % 64])].tobytes().decode()


def _point(explorer: MapExplorer, row: int, column: int) -> list[Any]:
    root = explorer.roots[row, column]
    peak, curve = packed(explorer.responses[row, column])
    real, imaginary = _short(float(root.real)), _short(float(root.imag))
    return [real, imaginary, int(explorer.unstable_roots[row, column]), peak, curve]


def _design_mark(explorer: MapExplorer) -> str:
    case = explorer.case
    if case.point_roots < 0:
        return ""
    x = 60 + 360 * (case.map.design[0] - case.x.low) / (case.x.high - case.x.low)
    y = 350 - 340 * (case.map.design[1] - case.y.low) / (case.y.high - case.y.low)
    cross = f'transform="translate({x:.1f} {y:.1f})" d="M-5 -5L5 5M-5 5L5 -5"'
    return f'<path class="design" {cross}><title>design</title></path>'


def _short(value: float) -> float:
    return float(f"{value:.6g}")
