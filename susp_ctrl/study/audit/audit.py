"""The audit: every printed number of the source against the computed one, with a verdict and its evidence.

The model is never bent towards a printed number. A number is *reproduced* if it agrees within its last digit (or the
tolerance of the study), *explained* if a misprint named in the study file gives it, else *not reproduced*.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from susp_ctrl.study.audit.roots import audit_roots
from susp_ctrl.study.audit.rows import AuditRow, audit_summary, audit_table, compared
from susp_ctrl.study.audit.tables import audit_printed_table
from susp_ctrl.study.results import (
    AuditSection,
    FrequencySection,
    StabilitySection,
    SweptLine,
    TimeCase,
    TuningRun,
)
from susp_ctrl.study.sections import Report, Workbench
from susp_ctrl.study.settings import (
    AuditSettings,
    PrintedInterval,
    PrintedOptimum,
    PrintedPeak,
    printed_number,
)


@dataclass(frozen=True)
class Computed:
    """The sections of the run that the audit reads."""

    frequency: FrequencySection | None
    tuning: tuple[TuningRun, ...]
    stability: StabilitySection | None
    time: tuple[TimeCase, ...]


def audit_section(
    bench: Workbench, settings: AuditSettings, computed: Computed, report: Report
) -> AuditSection:
    """Hold every printed number against the run; what was not computed is left out.

    Parameters
    ----------
    bench : Workbench
    settings : AuditSettings
        The printed numbers.
    computed : Computed
    report : callable
        Told the share done.

    Returns
    -------
    AuditSection
    """
    rows: list[AuditRow] = []
    cases = {case.key: case for case in computed.time}
    for given in settings.tables:
        if given.time in cases and given.active in cases[given.time].designs:
            rows += audit_printed_table(bench, given, cases[given.time], settings.tolerance)
    report(0.4)
    roots = [
        audit_roots(bench, printed, settings.tolerance)
        for printed in settings.roots
        if printed.design in bench.keys
    ]
    for found in roots:
        rows += found.rows
    report(0.7)
    for interval in settings.intervals:
        rows += _interval_rows(interval, computed.stability, settings.tolerance)
    for peak in settings.peaks:
        rows += _peak_rows(peak, computed.frequency, settings.tolerance)
    for optimum in settings.optima:
        rows += _optimum_rows(bench, optimum, computed.tuning, settings.tolerance)
    report(1.0)
    table = audit_table(rows)
    return AuditSection(
        table=table,
        roots=_joined([found.roots for found in roots]),
        substitutions=_joined([found.substitutions for found in roots]),
        summary=audit_summary(table),
    )


def _joined(tables: list[pd.DataFrame]) -> pd.DataFrame | None:
    return pd.concat(tables, ignore_index=True) if tables else None


# --- stability intervals ------------------------------------------------------------------------------------------


def _interval_rows(
    printed: PrintedInterval, stability: StabilitySection | None, tolerance: float
) -> list[AuditRow]:
    if stability is None:
        return []
    lines = [line for line in stability.lines if line.design == printed.design]
    if not lines:
        return []
    upper = printed_number(printed.upper)
    losses = [line.sweep.delay_margin for line in lines if np.isfinite(line.sweep.delay_margin)]
    computed = min(losses, key=lambda loss: abs(loss - upper.value)) if losses else _without_loss(lines)
    evidence = " ".join(filter(None, (_line_evidence(lines), _box_evidence(stability), _earlier(printed))))
    compare = partial(compared, printed.item, tolerance=tolerance, evidence=evidence)
    rows = [compare("upper end of the stable interval", printed.upper, computed, "s")]
    found = np.concatenate([line.sweep.crossings["omega"].to_numpy(dtype=float) for line in lines])
    for text in printed.crossings:
        value = printed_number(text).value
        nearest = float(found[np.argmin(np.abs(found - value))]) if found.size else np.nan
        rows.append(compare("crossing frequency", text, nearest, "rad/s"))
    return rows


def _without_loss(lines: list[SweptLine]) -> float:
    """Return inf if every line is proven stable for ever, else nan."""
    return float("inf") if all(line.stable_for_every_delay for line in lines) else float("nan")


def _line_evidence(lines: list[SweptLine]) -> str:
    crossings = sum(len(line.sweep.crossings) for line in lines)
    names = ", ".join(line.line for line in lines)
    if crossings:
        return f"Sweeps along {names}: {crossings} crossings of the axis."
    proven = (
        ", stability proven for every delay" if all(line.stable_for_every_delay for line in lines) else ""
    )
    return f"Sweeps along {names}: no crossing of the axis at any frequency{proven}."


def _box_evidence(stability: StabilitySection) -> str:
    box = stability.independence
    if box is None or box.verdict != "stable":
        return ""
    gains = ", ".join(f"{gain:g}" for gain in box.gains["gain"])
    return (
        f"sup rho(|G| diag|g|) = {box.corner.small_gain:.4f} < 1 at the corner of the search box, g = ({gains}) N/m: "
        "every design in it is stable whatever its delays."
    )


def _earlier(printed: PrintedInterval) -> str:
    """Say which earlier crossings the printed ones would imply: delays at one frequency repeat every 2 pi/omega."""
    if not printed.crossings:
        return ""
    first, upper = printed.crossings[0], printed_number(printed.upper).value
    period = 2 * np.pi / printed_number(first).value
    times = " and ".join(f"{upper - k * period:.4f}" for k in range(1, int(upper / period) + 1))
    if not times:
        return ""
    return (
        f"A crossing at {first} rad/s and {printed.upper} s would imply earlier ones at {times} s, "
        "so the printed numbers contradict each other too."
    )


# --- peaks and optima ---------------------------------------------------------------------------------------------


def _peak_rows(printed: PrintedPeak, frequency: FrequencySection | None, tolerance: float) -> list[AuditRow]:
    if frequency is None or printed.output not in frequency.curve_outputs:
        return []
    peaks = frequency.peaks
    chosen = peaks[(peaks["design"] == printed.design) & (peaks["output"] == printed.output)]
    if chosen.empty:
        return []
    value = printed_number(printed.frequency).value
    nearest = chosen.iloc[int(np.argmin(np.abs(chosen["frequency_Hz"].to_numpy() - value)))]
    every = "; ".join(
        f"{peak.road}: {peak.omega_rad_per_s:.4g} rad/s = {peak.frequency_Hz:.4g} Hz"
        for peak in chosen.itertuples()
    )
    evidence = f"|H| of {printed.output} peaks at: {every}. {printed.frequency} fits neither unit."
    if abs(nearest["omega_rad_per_s"] - value) <= tolerance * value:
        evidence = f"|H| of {printed.output} peaks at: {every}. The number fits rad/s, not Hz."
    where, computed = f"peak of |H| of {printed.output}, {printed.design}", float(nearest["frequency_Hz"])
    return [compared(printed.item, where, printed.frequency, computed, "Hz", tolerance, evidence)]


def _optimum_rows(
    bench: Workbench, printed: PrintedOptimum, tuning: tuple[TuningRun, ...], tolerance: float
) -> list[AuditRow]:
    runs = [run for run in tuning if run.key == printed.tuned]
    if not runs or printed.tuned not in bench.keys:
        return []
    run, published, tuned = runs[0], bench.design(printed.published), bench.design(printed.tuned)
    values = run.comparison.set_index("design")["objective_value"]
    evidence = f"J = {run.value:.4g} here ({run.objective_text})"
    if printed.published in values.index:
        evidence += f"; the published design has J = {values[printed.published]:.4g}, the passive car "
        evidence += f"{values['passive']:.4g}"
    evidence += ". Eq. (6) does not say at which frequency, or over which band, it is taken."
    compare = partial(compared, printed.item, tolerance=tolerance, evidence=evidence)
    rows = []
    for k, (theirs, ours) in enumerate(zip(published.channels, tuned.channels, strict=False), 1):
        unit = str(run.bounds["unit"].iloc[k - 1])
        rows.append(compare(f"optimal g{k}", f"{theirs.gain:g}", float(ours.gain), unit))
        rows.append(compare(f"optimal tau{k}", f"{theirs.delay:g}", float(ours.delay), "s"))
    return rows
