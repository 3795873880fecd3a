"""The three lines that a person most wants to know of a finished study."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import VERDICT_WORDS
from susp_ctrl.study.results import AuditSection, PadeCase, StabilitySection, TimeCase, TuningRun
from susp_ctrl.study.sections.workbench import Workbench
from susp_ctrl.study.settings import PASSIVE


def headlines(
    bench: Workbench,
    tuning: tuple[TuningRun, ...],
    stability: StabilitySection | None,
    time: tuple[TimeCase, ...],
    audit: AuditSection | None,
    pade: tuple[PadeCase, ...] = (),
    pade_verdicts: pd.DataFrame | None = None,
) -> tuple[str, ...]:
    """Return up to three plain sentences: stability, effect of the designs, audit; without audit, on Padé."""
    lines = [_stability_line(stability)]
    if audit is None:
        lines += [_tolerance_line(bench, pade), _verdict_line(bench, pade_verdicts)]
    lines += [_effect_line(bench, tuning, time), _audit_line(audit)]
    return tuple(line for line in lines if line)[:3]


def _stability_line(stability: StabilitySection | None) -> str:
    if stability is None:
        return ""
    verdicts = stability.verdicts
    counts = {word: int((verdicts["verdict"] == word).sum()) for word in VERDICT_WORDS.values()}
    told = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    line = f"Stability of {len(verdicts)} designs: {told}"
    box = stability.independence
    if box is not None and box.verdict == "stable":
        gain = box.corner.small_gain
        line += f"; every design in the search box is stable for all delays (small gain {gain:.4f} < 1)"
    return f"{line}."


def _effect_line(bench: Workbench, tuning: tuple[TuningRun, ...], time: tuple[TimeCase, ...]) -> str:
    """Tell the change that each design brings: on a random road the stationary one, for a record is one of many."""
    parts = []
    for case in time:
        active = case.rms[case.rms["design"] != PASSIVE]
        exact = active[active["method"] == "exact"]
        if exact.empty:
            continue
        indicator = exact["indicator"].iloc[0]
        first = exact[exact["indicator"] == indicator]
        lasting = active[(active["method"] == "stationary") & (active["indicator"] == indicator)]
        expected = dict(zip(lasting["design"], lasting["change_percent"], strict=True))
        changes = ", ".join(
            f"{bench.design(row.design).label} {change_text(expected.get(row.design, row.change_percent))}"
            for row in first.itertuples()
        )
        if any(
            abs(expected.get(row.design, np.nan) - row.change_percent) > 0.05 for row in first.itertuples()
        ):
            record = ", ".join(change_text(change) for change in first["change_percent"])
            changes += f" (in the record of {case.timepts[-1] - case.timepts[0]:g} s {record})"
        name = str(indicator).replace("_", " ")
        parts.append(f"{case.label}: {changes}")
        lead = f"RMS {name} against passive"
    if parts:
        return f"{lead}: {'; '.join(parts)}."
    found = [f"{run.label}: J = {run.value:.4g}" for run in tuning]
    return f"Tuning: {'; '.join(found)}." if found else ""


def change_text(percent: float) -> str:
    """Return a change in words; there is none where a run left the range of numbers, or the passive car is at rest."""
    return f"{percent:+.1f} %" if math.isfinite(percent) else "undefined (no finite RMS to compare)"


def _audit_line(audit: AuditSection | None) -> str:
    if audit is None or audit.summary.empty:
        return ""
    total = audit.summary.iloc[-1]
    number = total["reproduced"] + total["not_reproduced"] + total["explained"]
    return (
        f"Audit of {number} printed numbers: {total['reproduced']} reproduced, {total['explained']} explained by a "
        f"named misprint, {total['not_reproduced']} not reproduced."
    )


def _tolerance_line(bench: Workbench, pade: tuple[PadeCase, ...]) -> str:
    told = []
    for case in pade:
        if case.met is None:
            continue
        tolerance = case.met["tolerance"].max()
        worst = case.met.loc[case.met["tolerance"] == tolerance, "order"].max(skipna=False)
        needed = f"from order {worst:.0f} on" if worst == worst else "at none of the orders"
        told.append(f"{bench.design(case.design).label} {needed}")
    return f"Padé keeps every error below {100 * tolerance:g} %: {'; '.join(told)}." if told else ""


def _verdict_line(bench: Workbench, verdicts: pd.DataFrame | None) -> str:
    if verdicts is None:
        return ""
    told = []
    for key, rows in verdicts.groupby("design", sort=False):
        wrong = rows[~rows["right"] & (rows["exact"] != "undecided")]
        if not wrong.empty:
            first = wrong.iloc[0]
            orders = ", ".join(str(order) for order in wrong["order"])
            said = wrong["pade_says"].iloc[0]
            told.append(f"{bench.design(str(key)).label} is {first['exact']}, {said} at order {orders}")
    return f"Wrong verdicts of Padé on stability: {'; '.join(told)}." if told else ""
