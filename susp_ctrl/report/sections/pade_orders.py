"""Which order is needed, what a lower one says wrongly, and what each costs: further blocks on Padé."""

from __future__ import annotations

from functools import partial
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl.report.blocks import Block, Column, Figure, Heading, Table, Text
from susp_ctrl.report.formatting import capital, number_text, signal_text
from susp_ctrl.report.looks import labels
from susp_ctrl.study.results import StudyRun

_ERROR_WORDS = {
    "frequency_error": "frequency response, whole band",
    "wheel_hop_frequency_error": "frequency response, wheel hop",
    "root_error": "rightmost root",
    "wheel_hop_root_error": "wheel-hop root",
    "time_error": "body acceleration in time",
    "rms_error": "RMS, worst indicator",
}
_COSTS = {
    "simulation_ratio": "simulation",
    "roots_ratio": "roots",
    "frequency_ratio": "frequency response",
}


def tolerance_blocks(run: StudyRun) -> list[Block]:
    """Return the table of the orders that keep a tolerance."""
    cases = [case for case in run.pade if case.met is not None]
    if not cases:
        return []
    parts, columns, spans = [], [Column("error", "error of")], [("", 1)]
    for case in cases:
        assert case.met is not None
        wide = case.met.pivot_table(
            index="error", columns="tolerance", values="order", sort=False, dropna=False
        )
        for tolerance in sorted(wide.columns, reverse=True):
            name = f"{case.design}.{tolerance:g}"
            parts.append(wide[tolerance].rename(name))
            columns.append(Column(name, f"{100 * tolerance:g} %", "integer"))
        spans.append((labels(run)[case.design], wide.shape[1]))
    frame = pd.concat(parts, axis=1).rename_axis("error").reset_index()
    words = {name: _ERROR_WORDS.get(name, f"RMS of {signal_text(name)}") for name in frame["error"]}
    columns[0] = Column("error", "error of", words=words)
    orders = cases[0].table["order"]
    return [
        Table(
            key="pade_order_for_tolerance",
            caption="The order of Padé from which on an error stays within a tolerance.",
            frame=frame,
            columns=tuple(columns),
            spans=tuple(spans),
            note=f"Orders {orders.min()} to {orders.max()} were tried; – : none of them. Responses relative to their "
            "peak, roots to their size, RMS values to themselves.",
            whole=True,
        )
    ]


def verdict_blocks(run: StudyRun) -> list[Block]:
    """Return what Padé says about stability beside the truth."""
    table = run.pade_verdicts
    if table is None:
        return []
    names, rows = labels(run), []
    for key, group in table.groupby("design", sort=False):
        wrong = group[~group["right"]]
        rows.append(
            {
                "design": names[str(key)],
                "exact": group["exact"].iloc[0],
                "abscissa": group["exact_abscissa"].iloc[0],
                "wrong": ", ".join(map(str, wrong["order"])) or "none",
                "says": "" if wrong.empty else wrong["pade_says"].iloc[0],
                "range": wrong["pade_abscissa"].iloc[-1] if not wrong.empty else None,
            }
        )
    return [
        Heading("Verdicts on stability"),
        Text(
            "An order that is too low is wrong in both directions: it calls stable loops unstable and unstable loops "
            "stable. The next higher order need not be better."
        ),
        Table(
            key="pade_verdicts",
            caption="Stability with exact delays, and the orders at which Padé says the opposite.",
            frame=table,
            shown=pd.DataFrame(rows),
            columns=(
                Column("design", "design"),
                Column("exact", "exact delays"),
                Column("abscissa", "its abscissa (1/s)", "number"),
                Column("wrong", "Padé is wrong at order"),
                Column("says", "and says"),
                Column("range", "abscissa (1/s)", "number"),
            ),
            note="Abscissa: real part of the rightmost root; of Padé, at the last of the wrong orders. "
            "The exact verdict is that of roots, argument principle and frequency sweep together.",
            whole=True,
        ),
        Figure(
            key="pade_verdicts",
            caption="Real part of the rightmost root that Padé finds, over its order. Dashed: the exact one. Points "
            "on the wrong side of zero are filled: a wrong verdict.",
            draw=partial(_draw_verdicts, run),
        ),
    ]


def indicator_blocks(run: StudyRun) -> list[Block]:
    """Return the error of each RMS indicator over the order."""
    return [
        Table(
            key=f"pade_rms_{case.design}",
            caption=f"{capital(labels(run)[case.design])}: relative error of each RMS indicator with Padé.",
            frame=case.indicators,
            columns=(
                Column("order", "order", "integer"),
                *(Column(name, signal_text(name), "number", 2) for name in case.indicators.columns[1:]),
            ),
        )
        for case in run.pade
        if case.indicators is not None
    ]


def cost_blocks(run: StudyRun) -> list[Block]:
    """Return the measured cost of each order; a figure and text only, since no two runs measure the same."""
    items = []
    for label, cost in _measured(run):
        exact, last = cost.iloc[0], cost.iloc[-1]
        items.append(
            f"{label}: with exact delays {number_text(1e3 * exact['simulation_s'], 3)} ms for the "
            f"simulation, {number_text(1e3 * exact['roots_s'], 3)} ms for the rightmost roots, "
            f"{number_text(1e3 * exact['frequency_s'], 3)} ms for the frequency response; Padé of order "
            f"{last['order']:.0f} has {last['states']:.0f} states instead of {exact['states']:.0f} and takes "
            f"{number_text(last['simulation_ratio'], 2)}, {number_text(last['roots_ratio'], 2)} and "
            f"{number_text(last['frequency_ratio'], 2)} times as long."
        )
    if not items:
        return []
    return [
        Heading("Cost"),
        Text(
            "Times were measured on this run, each the best of several; the time to evaluate the road is a part of a "
            "simulation, and building the approximation is a part of everything done with it. They differ from run "
            "to run and therefore stand here only and in no table file: equal runs give identical tables."
        ),
        Text(items=tuple(items)),
        Figure(
            key="pade_cost",
            caption="Time with Padé as a multiple of the time with exact delays, over the order.",
            draw=partial(_draw_cost, run),
        ),
    ]


def _draw_verdicts(run: StudyRun) -> MatplotlibFigure:
    assert run.pade_verdicts is not None
    names = labels(run)

    def draw(verdicts: tuple[Any, pd.DataFrame], ax: Axes) -> None:
        key, group = verdicts
        plotting.draw_abscissa_over_order(
            group["order"].to_numpy(dtype=float),
            group["pade_abscissa"].to_numpy(dtype=float),
            float(group["exact_abscissa"].iloc[0]),
            ax,
            ylabel="abscissa (1/s)",
            legend=False,
            title=f"{names[str(key)]}: {group['exact'].iloc[0]}",
        )

    groups = list(run.pade_verdicts.groupby("design", sort=False))
    return plotting.panels(groups, draw, columns=2, height=(0.5, 1.9), legend=3, one_ylabel=True)


def _draw_cost(run: StudyRun) -> MatplotlibFigure:
    def draw(measured: tuple[str, pd.DataFrame], ax: Axes) -> None:
        label, cost = measured
        orders = cost.iloc[1:]
        plotting.draw_order_error(
            orders["order"].to_numpy(dtype=float),
            {label: orders[name].to_numpy(dtype=float) for name, label in _COSTS.items()},
            ax,
            ylabel="time over exact (-)",
            legend=False,
            title=label,
        )

    return plotting.panels(_measured(run), draw, columns=2, height=(0.6, 2.2), legend=3, one_ylabel=True)


def _measured(run: StudyRun) -> list[tuple[str, pd.DataFrame]]:
    return [(labels(run)[case.design], case.cost) for case in run.pade if case.cost is not None]
