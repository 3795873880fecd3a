"""Simulations: roads, time histories with exact delays and with Padé, RMS tables, ride indices."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl.report.blocks import Block, Column, Figure, Section, Table, Text
from susp_ctrl.report.formatting import capital, exact_text, signal_text, unit_text
from susp_ctrl.report.looks import history_looks, labels
from susp_ctrl.study.results import StudyRun, TimeCase

METHODS = {"exact": "exact", "pade": "Padé", "stationary": "no simulation", "printed": "printed"}
_DISPLAY = {"m": ("mm", 1000.0)}  # displayed unit and factor, by SI unit


def time_sections(run: StudyRun) -> list[Section]:
    """Return one section per road that was simulated."""
    return [Section(f"Time histories: {case.label}", tuple(_case(run, case))) for case in run.time]


def _case(run: StudyRun, case: TimeCase) -> list[Block]:
    names = labels(run)
    orders = "; ".join(
        f"{names[key]}: {', '.join(map(str, order))}" for key, order in case.pade_orders.items() if order
    )
    road = case.road_text.rstrip(".")
    pade = f" Padé orders, one per channel: {orders}." if orders else ""
    return [
        Text(
            f"{capital(road)}. The record lasts {case.timepts[-1]:g} s.{pade} RMS values are taken on the finer step "
            f"of the simulation; the files hold the histories every {case.timepts[1] - case.timepts[0]:g} s."
        ),
        Figure(
            key=f"road_{case.key}",
            caption=f"Road elevation under the wheels, {case.label}.",
            draw=partial(_draw_road, case),
        ),
        rms_table(run, case),
        Figure(
            key=f"changes_{case.key}",
            caption=f"Change of the RMS indicators against the passive car, {case.label}, exact delays: "
            "left of zero is less than passive, and better.",
            draw=partial(_draw_changes, run, case),
        ),
        Figure(
            key=f"histories_{case.key}",
            caption=f"Time histories, {case.label}. Lines: exact delays; open markers: Padé, which lies on its line "
            "where it is right.",
            draw=partial(_draw_histories, run, case),
        ),
        _difference_table(run, case),
        _indices_table(run, case),
        *history_tables(case),
    ]


def rms_table(run: StudyRun, case: TimeCase) -> Table:
    """Return the RMS table: one row per indicator and method, one pair of columns per design."""
    names = labels(run)
    rows: list[dict[str, Any]] = []
    for indicator in dict.fromkeys(case.rms["indicator"]):
        part = case.rms[case.rms["indicator"] == indicator]
        unit = part["unit"].iloc[0]
        for method in METHODS:
            row: dict[str, Any] = {"indicator": indicator, "unit": unit, "method": method}
            source = part[part["method"] == method]
            if method == "printed" and case.printed is not None:
                source = case.printed[case.printed["indicator"] == indicator].assign(change_percent=np.nan)
            if source.empty:
                continue
            for record in source.to_dict(orient="records"):
                row[record["design"]] = record["value"]
                row[f"{record['design']}_change_percent"] = record["change_percent"]
            rows.append(row)
    frame = pd.DataFrame(rows)
    designs = [key for key in case.designs if key in frame]
    changes = [
        key
        for key in designs
        if f"{key}_change_percent" in frame and frame[f"{key}_change_percent"].notna().any()
    ]
    columns = [Column("method", "method", words=METHODS)]
    for key in designs:
        columns.append(Column(key, names[key], "number", 5))
        if key in changes:
            columns.append(Column(f"{key}_change_percent", "change (%)", "change"))
    frame = frame[["indicator", "unit", *(column.name for column in columns)]]
    group = [
        f"{signal_text(name)} ({unit_text(unit)})"
        for name, unit in zip(frame["indicator"], frame["unit"], strict=True)
    ]
    return Table(
        key=f"rms_{case.key}",
        caption=f"RMS of the six indicators, {case.label}: passive car against published and tuned design.",
        frame=frame,
        shown=_as_printed(frame, designs).assign(group=group),
        columns=tuple(columns),
        group="group",
        whole=True,
        note="Change against the passive car by the same method: ▼ less (better), ▲ more (worse). “No simulation”: "
        "from the exact frequency response, without transient and without sampling error. “Printed”: the source's "
        "own numbers.",
    )


def _as_printed(frame: pd.DataFrame, designs: list[str]) -> pd.DataFrame:
    # A printed number is shown with the digits that it was printed with, not with ours.
    shown = frame.astype(dict.fromkeys(designs, object))
    printed = shown["method"] == "printed"
    for key in designs:
        shown.loc[printed, key] = [exact_text(value) for value in frame.loc[printed, key]]
    return shown


def history_tables(case: TimeCase) -> list[Table]:
    """Return the histories of a case as tables, one per method: time, road (once), ``design.output`` columns."""
    result: list[Table] = []
    for method in dict.fromkeys(method for _, method in case.histories):
        columns: dict[str, Any] = {"time_s": case.timepts}
        if not result:  # the road is the same for all methods
            columns |= {f"{name}_m": profile for name, profile in case.road_profiles.items()}
        for (design, by), values in case.histories.items():
            if by == method:
                columns |= {
                    f"{design}.{output}": row for output, row in zip(case.outputs, values, strict=True)
                }
        result.append(
            Table(
                key=f"history_{case.key}_{method}",
                caption=f"Time histories, {case.label}, {METHODS.get(method, method)}.",
                frame=pd.DataFrame(columns),
                in_document=False,
            )
        )
    return result


def _difference_table(run: StudyRun, case: TimeCase) -> Table:
    frame = case.pade_difference
    names = labels(run)
    return Table(
        key=f"pade_difference_{case.key}",
        caption=f"Padé against exact over the whole record, {case.label}.",
        frame=frame,
        shown=frame.assign(label=frame["design"].map(names)) if len(frame) else frame,
        columns=(
            Column("output", "output", "signal"),
            Column("max_difference", "largest difference", "number", 3),
            Column("unit", "unit", "unit"),
            Column("relative_to_peak", "relative to the peak", "number", 3),
        ),
        group="label",
        in_document=len(frame) > 0,
    )


def _indices_table(run: StudyRun, case: TimeCase) -> Table:
    names = labels(run)
    wide = case.indices.pivot_table(
        index=["indicator", "unit"], columns="design", values="value", sort=False, dropna=False
    )
    wide = wide[[key for key in case.designs if key in wide]].dropna(how="all").reset_index()
    wide.columns.name = None
    columns = [Column("indicator", "indicator", "signal"), Column("unit", "unit", "unit")]
    columns += [Column(key, names[key], "number", 4) for key in case.designs if key in wide]
    return Table(
        key=f"ride_indices_{case.key}",
        caption=f"Ride indices from the exact histories, {case.label}.",
        frame=wide,
        columns=tuple(columns),
    )


def _draw_road(case: TimeCase) -> MatplotlibFigure:
    figure, axes = plotting.new_figure(height=1.9)
    profiles = {signal_text(name): rows for name, rows in case.road_profiles.items()}
    plotting.draw_road(case.timepts, profiles, axes[0, 0], legend=False)
    plotting.shared_legend(figure, axes)
    return figure


def _draw_histories(run: StudyRun, case: TimeCase) -> MatplotlibFigure:
    names = labels(run)

    def curves(output: str, method: str) -> dict[str, Any]:
        row = case.outputs.index(output)
        held = [key for key in case.designs if (key, method) in case.histories]
        return {names[key]: case.histories[key, method][row] for key in held}

    def draw(output: str, ax: Axes) -> None:
        unit = run.signal_units.get(output, "")
        unit, scale = _DISPLAY.get(unit, (unit, 1.0))
        plotting.draw_history(
            case.timepts,
            curves(output, "exact"),
            ax,
            overlay=curves(output, "pade"),
            ylabel=unit_text(unit),
            scale=scale,
            styles=history_looks(run.designs),
            legend=False,
            title=signal_text(output),
        )

    figure = plotting.panels(case.outputs, draw, columns=1, height=(0.55, 1.33), legend=3, sharex=True)
    figure.align_ylabels()
    return figure


def _draw_changes(run: StudyRun, case: TimeCase) -> MatplotlibFigure:
    names = labels(run)
    exact = case.rms[case.rms["method"] == "exact"]
    indicators = list(dict.fromkeys(exact["indicator"]))
    changes = {
        names[key]: exact[exact["design"] == key]
        .set_index("indicator")["change_percent"]
        .reindex(indicators)
        .to_numpy()
        for key in case.designs
        if key != "passive"
    }
    figure, axes = plotting.new_figure(height=0.7 + 0.2 * len(indicators) * max(len(changes), 1))
    plotting.draw_changes([signal_text(name) for name in indicators], changes, axes[0, 0], legend=False)
    plotting.shared_legend(figure, axes)
    return figure
