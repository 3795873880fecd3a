"""Padé against exact delays, for several orders."""

from __future__ import annotations

from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl.report.blocks import Block, Column, Figure, Section, Table, Text
from susp_ctrl.report.formatting import capital, number_text
from susp_ctrl.report.looks import labels
from susp_ctrl.report.sections.pade_orders import (
    cost_blocks,
    indicator_blocks,
    tolerance_blocks,
    verdict_blocks,
)
from susp_ctrl.study.results import PadeCase, StudyRun

_ERRORS = {
    "frequency_error": ("frequency response", "relative"),
    "wheel_hop_frequency_error": ("frequency response at the wheel hop", "relative"),
    "root_error": ("rightmost root", "1/s"),
    "wheel_hop_root_error": ("wheel-hop root", "1/s"),
    "time_error": ("body acceleration in time", "relative to the peak"),
    "rms_error": ("RMS indicators", "relative"),
}


def pade_section(run: StudyRun) -> Section | None:
    """Return the section on Padé approximations, or None if the study has none."""
    if not run.pade:
        return None
    blocks: list[Block] = [
        Text(
            "The same loops with every delay replaced by a Padé approximation. It has the right amplitude everywhere, "
            "but the right phase only up to a frequency that grows with its order: an order of ωτ/2 and a few more is "
            "needed. Roots and responses below that frequency are accurate, those above it are not."
        ),
        Figure(
            key="pade_error",
            caption="Errors of Padé against exact delays over the order. Dotted: the order recommended for the band.",
            draw=partial(_draw, run, run.pade),
        ),
        *tolerance_blocks(run),
        *verdict_blocks(run),
        *(_errors(run, case) for case in run.pade),
        *indicator_blocks(run),
        *cost_blocks(run),
    ]
    return Section("Padé against exact delays", tuple(blocks))


def _errors(run: StudyRun, case: PadeCase) -> Table:
    low, high = (number_text(omega, 3) for omega in case.band)
    needed = ", ".join(map(str, case.recommended_order))
    note = f"Band {low} to {high} rad/s; order recommended for it, one per channel: {needed}."
    frequency = [Column("frequency_error", "frequency response (relative)", "number", 3)]
    roots = [Column("root_error", "rightmost root (1/s)", "number", 3)]
    if case.wheel_hop_band is not None:
        low, high = (number_text(omega, 3) for omega in case.wheel_hop_band)
        note += f" Wheel hop: {low} to {high} rad/s"
        if case.wheel_hop_root is not None:
            real, imaginary = number_text(case.wheel_hop_root.real), number_text(case.wheel_hop_root.imag)
            note += f"; the rightmost exact root there is {real} ± {imaginary}j"
        note += "."
        frequency.append(Column("wheel_hop_frequency_error", "response at wheel hop", "number", 3))
        roots.append(Column("wheel_hop_root_error", "wheel-hop root (1/s)", "number", 3))
    return Table(
        key=f"pade_{case.design}",
        caption=f"{capital(labels(run)[case.design])}: error of Padé against exact delays.",
        frame=case.table,
        columns=(
            Column("order", "order", "integer"),
            *frequency,
            *roots,
            Column("time_error", "time response (of the peak)", "number", 3),
            Column("rms_error", "RMS (relative)", "number", 3),
            Column("stable", "Padé says"),
        ),
        note=note,
    )


def _draw(run: StudyRun, cases: tuple[PadeCase, ...]) -> MatplotlibFigure:
    names = labels(run)

    def draw(case: PadeCase, ax: Axes) -> None:
        errors = {
            f"{label} ({unit})": case.table[name].to_numpy(dtype=float)
            for name, (label, unit) in _ERRORS.items()
            if name in case.table and case.table[name].notna().any()
        }
        plotting.draw_order_error(
            case.table["order"].to_numpy(dtype=float),
            errors,
            ax,
            needed=float(max(case.recommended_order)),
            ylabel="error",
            legend=False,
            title=names[case.design],
        )

    return plotting.panels(cases, draw, columns=2, height=(0.6, 2.4), legend=2, one_ylabel=True)
