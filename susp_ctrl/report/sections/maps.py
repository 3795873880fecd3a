"""Stability maps: regions of two delays, or of a gain and a delay, and where the designs lie in them."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import DelayIndependence
from susp_ctrl.report.blocks import Block, Column, Figure, Section, Table, Text
from susp_ctrl.report.formatting import exact_text, number_text, signal_text, symbol_text, unit_text
from susp_ctrl.report.looks import labels
from susp_ctrl.study.results import MapAxis, StabilityMapCase, StudyRun

_RASTER = 300  # points of the picture along each axis


def maps_section(run: StudyRun) -> Section | None:
    """Return the section on stability maps, or None if the study has none."""
    cases = run.stability_maps
    if not cases:
        return None
    blocks: list[Block] = [
        Text(
            "Two delays, or a gain and a delay, are free at once. On the crossing curves a root lies on the imaginary "
            "axis; between them the number of unstable roots is constant. The numbers follow from the direction in "
            "which each curve is crossed, and independent counts by the argument principle in the regions must agree."
        ),
        _overview(run),
    ]
    drawn = [case for case in cases if case.map.segments.count]
    if drawn:
        blocks.append(_regions(run, drawn))
    for case in drawn:
        blocks.append(
            Figure(
                key=figure_key(case),
                caption=f"Stability of the design “{map_title(run, case)}” over {_plane(case)}: {_in_words(case)}",
                draw=partial(_draw, case),
            )
        )
        if case.gain_limits is not None:
            blocks.append(_limits(run, case))
    return Section("Stability maps", tuple(blocks))


def figure_key(case: StabilityMapCase) -> str:
    """Return the name of the figure of a map."""
    return f"stability_map_{case.name}"


def map_title(run: StudyRun, case: StabilityMapCase) -> str:
    """Return the design of a map with the multiple of its gains."""
    label = labels(run)[case.design]
    return label if case.gain_factor == 1.0 else f"{label}, gains × {exact_text(case.gain_factor)}"


def axis_scale(axis: MapAxis) -> tuple[float, str]:
    """Return the factor to the displayed unit of an axis, and that unit: large gains are shown in kilo."""
    if not axis.is_delay and max(abs(axis.low), abs(axis.high)) >= 1e4:
        return 1e-3, "k" + unit_text(axis.unit)
    return 1.0, unit_text(axis.unit)


def axis_label(axis: MapAxis) -> str:
    """Return the name of an axis: symbol, meaning, unit."""
    kind, _, signal = axis.text.partition(" of ")
    return f"{_symbol(axis)}, {kind} of {signal_text(signal)} ({axis_scale(axis)[1]})"


def picture(case: StabilityMapCase) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Return the unstable roots at evenly spaced points of a map, shape (y, x), after both coordinates."""
    x, y = (np.linspace(*ends, _RASTER) for ends in (case.map.x_range, case.map.y_range))
    return x, y, case.map.unstable_roots(x, y[:, None])


def _symbol(axis: MapAxis) -> str:
    return symbol_text(axis.name.replace("gain", "g"))


def _plane(case: StabilityMapCase) -> str:
    parts = []
    for axis in (case.x, case.y):
        scale, unit = axis_scale(axis)
        parts.append(
            f"{_symbol(axis)} from {exact_text(scale * axis.low)} to {exact_text(scale * axis.high)} {unit}"
        )
    return ", ".join(parts)


def _in_words(case: StabilityMapCase) -> str:
    low, high = case.crossing_band
    text = (
        f"{100 * case.stable_share:.3g} % of the rectangle is stable; roots cross from {number_text(low, 4)} to "
        f"{number_text(high, 4)} rad/s."
    )
    text += _least_limit(case)
    if case.point_roots < 0:
        return text
    where = "stable" if case.point_roots == 0 else f"unstable, with {case.point_roots} roots on the right"
    return f"{text} The design (cross) is {where}."


def _least_limit(case: StabilityMapCase) -> str:
    if case.gain_limits is None or not case.gain_limits["gain_to"].notna().any():
        return ""
    scale, unit = axis_scale(case.y if case.x.is_delay else case.x)
    worst = case.gain_limits.sort_values("gain_to").iloc[0]
    return (
        f" Of {len(case.gain_limits)} delays {exact_text(worst['delay_s'], 4)} s allows the least gain, up to "
        f"{number_text(scale * worst['gain_to'], 6)} {unit} (lost at {number_text(worst['omega_rad_per_s'], 4)} rad/s)."
    )


def _distance(case: StabilityMapCase) -> str:
    if not np.isfinite(case.distance):
        return number_text(case.distance)
    if case.x.is_delay != case.y.is_delay:
        return f"{number_text(100 * case.distance, 3)} % of the ranges"
    return f"{number_text(case.distance, 4)} {unit_text(case.x.unit)}"


def _lost_at(independence: DelayIndependence) -> str:
    return f"{'' if independence.exact else '≥ '}{number_text(independence.margin, 5)}"


def _overview(run: StudyRun) -> Table:
    rows: list[dict[str, Any]] = [
        {
            "map": case.key,
            "design": case.design,
            "gain_factor": case.gain_factor,
            "x": case.x.name,
            "x_from": case.x.low,
            "x_to": case.x.high,
            "y": case.y.name,
            "y_from": case.y.low,
            "y_to": case.y.high,
            "regions": len(case.map.regions),
            "stable_share": case.stable_share,
            "unstable_roots_at_design": case.point_roots,
            "distance_of_design": case.distance,
            "delay_independence_lost_at_gain_factor": case.independence.margin,
            "at_omega_rad_per_s": case.independence.omega,
            "confirmed": case.map.decided,
        }
        for case in run.stability_maps
    ]
    frame = pd.DataFrame(rows)
    shown = frame.assign(
        title=[map_title(run, case) for case in run.stability_maps],
        plane=[f"Over {_plane(case)}" for case in run.stability_maps],
        roots=[str(case.point_roots) if case.point_roots >= 0 else "outside" for case in run.stability_maps],
        agreement=["agree" if case.map.decided else "DIFFER" for case in run.stability_maps],
        away=[_distance(case) for case in run.stability_maps],
        factor=[_lost_at(case.independence) for case in run.stability_maps],
    )
    return Table(
        key="stability_maps",
        caption="Designs in their stability maps. Distance: from the design to the nearest crossing curve, ∞ where "
        "there is none in the rectangle.",
        frame=frame,
        shown=shown,
        columns=(
            Column("title", "design"),
            Column("regions", "regions", "integer"),
            Column("stable_share", "stable (%)", "number", 3, scale=100.0),
            Column("roots", "unstable roots", "written"),
            Column("away", "distance", "written"),
            Column("factor", "lost at gains ×", "written"),
            Column("agreement", "counts"),
        ),
        group="plane",
        note="Lost at gains ×: below this multiple of its own gains a design is stable whatever its delays, from "
        "there on some delays destabilise it (≥: a lower bound).",
    )


def _regions(run: StudyRun, cases: list[StabilityMapCase]) -> Table:
    frames = []
    for case in cases:
        frame = case.counts.copy()
        frame.insert(0, "map", case.key)
        frame.insert(1, "design", case.design)
        frames.append(frame.assign(title=f"{map_title(run, case)}, over {_plane(case)}"))
    joined = pd.concat(frames, ignore_index=True)
    return Table(
        key="stability_map_regions",
        caption="Connected regions of the maps by their number of unstable roots, and the share of the rectangle.",
        frame=joined.drop(columns="title"),
        shown=joined,
        columns=(
            Column("unstable_roots", "unstable roots", "integer"),
            Column("regions", "regions", "integer"),
            Column("area", "share (%)", "number", 3, scale=100.0),
        ),
        group="title",
        in_document=len(joined) <= 16,
    )


def _limits(run: StudyRun, case: StabilityMapCase) -> Table:
    limits = case.gain_limits
    assert limits is not None
    axis = case.y if case.x.is_delay else case.x
    return Table(
        key=f"gain_limits_{case.name}",
        caption=f"Stable gains around zero by the delay: {map_title(run, case)}, {axis.text}, "
        f"in {unit_text(axis.unit)}; empty where no limit was met up to the end of the range.",
        frame=limits,
        in_document=False,
    )


def _draw(case: StabilityMapCase) -> MatplotlibFigure:
    scales = np.array([axis_scale(case.x)[0], axis_scale(case.y)[0]])
    limit, limit_label = None, ""
    if case.gain_limits is not None:
        low, high = case.gain_limits["gain_from"].to_numpy(), case.gain_limits["gain_to"].to_numpy()
        delays = case.gain_limits["delay_s"].to_numpy()
        both = (np.concatenate([delays, [np.nan], delays]), np.concatenate([high, [np.nan], low]))
        across, upward = both if case.x.is_delay else both[::-1]
        limit = (scales[0] * across, scales[1] * upward)
        limit_label = "highest stable gain" if np.isnan(low).all() else "limits of the stable gain"
    x, y, unstable = picture(case)
    figure, axes = plotting.new_figure(height=2.6)
    plotting.draw_stability_map(
        scales[0] * x,
        scales[1] * y,
        unstable,
        scales * np.stack([case.map.segments.start, case.map.segments.end], axis=1),
        axes[0, 0],
        xlabel=axis_label(case.x),
        ylabel=axis_label(case.y),
        design=(scales[0] * case.map.design[0], scales[1] * case.map.design[1]),
        limit=limit,
        limit_label=limit_label,
    )
    return figure
