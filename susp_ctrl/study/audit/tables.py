"""Audit of printed RMS tables: every entry, every percentage, and what could explain the differences."""

from __future__ import annotations

import numpy as np
import pandas as pd

from susp_ctrl.road import HarmonicRoad
from susp_ctrl.study.audit.rows import EXPLAINED, NOT_REPRODUCED, REPRODUCED, AuditRow, agrees, compared
from susp_ctrl.study.results import TimeCase
from susp_ctrl.study.sections import EXACT, STATIONARY, Workbench, build_road
from susp_ctrl.study.settings import PASSIVE, PrintedRow, PrintedTable, printed_number

_PHASES = 720  # of the rear road against the front one, tried on a harmonic road


def audit_printed_table(
    bench: Workbench, printed: PrintedTable, case: TimeCase, tolerance: float
) -> list[AuditRow]:
    """Hold a printed RMS table against the simulation of its case, passive and active, and its percentages."""
    values = case.rms.set_index(["indicator", "design", "method"])["value"]
    about = _phase_evidence(bench, printed) if printed.road_printed else _scale_evidence(values, printed)
    rows = []
    for row in printed.rows:
        for column, key, text in (("passive", PASSIVE, row.passive), ("active", printed.active, row.active)):
            simulated = float(values[row.indicator, key, EXACT])
            unit = str(case.rms.loc[case.rms["indicator"] == row.indicator, "unit"].iloc[0])
            evidence = _entry_evidence(values, row, key, unit, printed)
            if column == "passive" and row.indicator in about:
                evidence += f" {about[row.indicator]}"
            where = f"{row.indicator}, {column}"
            rows.append(compared(printed.item, where, text, simulated, unit, tolerance, evidence))
    for row in printed.rows:
        if row.change_percent is not None:
            rows += _percentages(printed, row, row.change_percent, values, tolerance)
    return rows


def _entry_evidence(values: pd.Series, row: PrintedRow, key: str, unit: str, printed: PrintedTable) -> str:
    simulated = values[row.indicator, key, EXACT]
    text = f"Simulated over the record {simulated:.4g} {unit}"
    if (row.indicator, key, STATIONARY) in values.index:
        text += f", exact stationary value {values[row.indicator, key, STATIONARY]:.4g} {unit}"
    text += "."
    if not printed.road_printed:
        passive, active = printed_number(row.passive).value, printed_number(row.active).value
        ratio = values[row.indicator, printed.active, EXACT] / values[row.indicator, PASSIVE, EXACT]
        text += (
            f" No road amplitudes are printed; active/passive is {active / passive:.3f} as printed, {ratio:.3f} as "
            "computed, whatever the road class."
        )
    return text


def _scale_evidence(values: pd.Series, printed: PrintedTable) -> dict[str, str]:
    """Say, by indicator, which factor of the road's amplitude the printed passive entry needs."""
    factors = {
        row.indicator: printed_number(row.passive).value / float(values[row.indicator, PASSIVE, EXACT])
        for row in printed.rows
    }
    least, most = min(factors.values()), max(factors.values())
    return {
        indicator: f"Printed is {factor:.2f} times computed; a rougher road of the same shape would scale the whole "
        f"column by one factor, but its entries need {least:.2f} to {most:.2f}."
        for indicator, factor in factors.items()
    }


def _percentages(
    printed: PrintedTable, row: PrintedRow, text: str, values: pd.Series, tolerance: float
) -> list[AuditRow]:
    """Two rows: whether the percentage follows from the printed entries, and whether from the computed ones."""
    number = printed_number(text)
    passive, active = printed_number(row.passive), printed_number(row.active)
    implied = 100 * (active.value / passive.value - 1)
    # Entries are rounded, and so is what follows from them.
    spread = 100 * (active.half_digit / passive.value + active.value * passive.half_digit / passive.value**2)
    follows = agrees(number._replace(half_digit=number.half_digit + spread), implied, tolerance)
    verdict = REPRODUCED if follows else EXPLAINED if row.misprint else NOT_REPRODUCED
    evidence = f"The printed entries {row.passive} and {row.active} give {implied:.2f} %."
    if not follows and row.misprint:
        evidence += f" Printed instead: {row.misprint}."
    item, where = f"{printed.item}, percentages", f"{row.indicator}, from the printed entries"
    arithmetic = AuditRow(item, where, number, implied, "%", verdict, evidence)

    before, after = values[row.indicator, PASSIVE, EXACT], values[row.indicator, printed.active, EXACT]
    change, entries = float(100 * (after / before - 1)), f"Computed entries {before:.4g} and {after:.4g}."
    where = f"{row.indicator}, from eq. (1)"
    return [arithmetic, compared(item, where, text, change, "%", tolerance, entries)]


def _phase_evidence(bench: Workbench, printed: PrintedTable) -> dict[str, str]:
    """Say, by indicator, what a steady state gives over all phases of the rear road against the front one."""
    case = next(case for case in bench.study.settings.time if case.key == printed.time)
    road = build_road(case.road, bench.speed)
    if not isinstance(road, HarmonicRoad) or len(bench.lags) != 2:
        return {}
    loop = bench.loop(PASSIVE)
    indicators = [row.indicator for row in printed.rows]
    rows = [loop.output_labels.index(name) for name in indicators]
    columns = [loop.input_labels.index(name) for name in bench.lags]
    response = np.asarray(loop(np.array([1j * road.omega]), squeeze=False))[rows][:, columns, 0]
    turns = np.exp(-1j * np.linspace(0, 2 * np.pi, _PHASES, endpoint=False))
    rms = np.abs(response[:, :1] + response[:, 1:] * turns) * road.amplitude / np.sqrt(2)
    target = np.array([printed_number(row.passive).value for row in printed.rows])
    misfit = 100 * np.abs(rms / target[:, None] - 1).max(axis=0).min()
    return {
        name: f"Over all phases of the rear road the stationary value lies between {found.min():.4g} and "
        f"{found.max():.4g} (wheels in phase: {found[0]:.4g}); at the best phase an entry of the column is off by "
        f"{misfit:.0f} %."
        for name, found in zip(indicators, rms, strict=True)
    }
