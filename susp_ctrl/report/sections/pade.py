"""Padé against exact delays, for several orders."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from susp_ctrl.report.blocks import Block, Column, Figure, Section, Table, Text
from susp_ctrl.report.formatting import capital, number_text
from susp_ctrl.report.looks import labels

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from susp_ctrl.study.result import PadeCase, StudyRun

_ERRORS = {
    "frequency_error": ("frequency response", "relative"),
    "root_error": ("rightmost root", "1/s"),
    "time_error": ("body acceleration in time", "relative to the peak"),
    "rms_error": ("RMS indicators", "relative"),
}


def pade_section(run: StudyRun) -> Section | None:
    """Return the section on Padé approximations, or None if the study has none."""
    if not run.pade:
        return None
    names = labels(run)
    blocks: list[Block] = [
        Text(
            "The same loops with every delay replaced by a Padé approximation. It has the right amplitude everywhere, "
            "but the right phase only up to a frequency that grows with its order: an order of ωτ/2 and a few more is "
            "needed. Roots and responses below that frequency are accurate, those above it are not."
        )
    ]
    blocks.append(
        Figure(
            key="pade_error",
            caption="Errors of Padé against exact delays over the order. Dotted: the order recommended for the band.",
            draw=partial(_draw, run, run.pade),
        )
    )
    for case in run.pade:
        low, high = (number_text(omega, 3) for omega in case.band)
        needed = ", ".join(map(str, case.recommended_order))
        blocks.append(
            Table(
                key=f"pade_{case.design}",
                caption=f"{capital(names[case.design])}: error of Padé against exact delays.",
                frame=case.table,
                columns=(
                    Column("order", "order", "integer"),
                    Column("frequency_error", "frequency response (relative)", "number", 3),
                    Column("root_error", "rightmost root (1/s)", "number", 3),
                    Column("time_error", "time response (of the peak)", "number", 3),
                    Column("rms_error", "RMS (relative)", "number", 3),
                    Column("stable", "Padé says"),
                ),
                note=f"Band {low} to {high} rad/s; order recommended for it, one per channel: {needed}.",
            )
        )
    return Section("Padé against exact delays", tuple(blocks))


def _draw(run: StudyRun, cases: tuple[PadeCase, ...]) -> MatplotlibFigure:
    from susp_ctrl.plotting import draw_order_error, new_figure, shared_legend

    columns = min(len(cases), 2)
    rows = -(-len(cases) // columns)
    figure, axes = new_figure(rows, columns, height=0.6 + 2.4 * rows)
    names = labels(run)
    for number, (ax, case) in enumerate(zip(axes.flat, cases, strict=False)):
        errors = {
            f"{label} ({unit})": case.table[name].to_numpy(dtype=float)
            for name, (label, unit) in _ERRORS.items()
            if name in case.table and case.table[name].notna().any()
        }
        draw_order_error(
            case.table["order"].to_numpy(dtype=float),
            errors,
            ax,
            needed=float(max(case.recommended_order)),
            ylabel="" if number % columns else "error",
            legend=False,
            title=names[case.design],
        )
    for ax in axes.flat[len(cases) :]:
        ax.set_visible(False)
    shared_legend(figure, axes, columns=2)
    return figure
