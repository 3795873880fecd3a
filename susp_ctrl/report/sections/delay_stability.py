"""Stability: the verdict on every design, its rightmost roots, the delay sweeps, the proof for the search box."""

from __future__ import annotations

from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl.report.blocks import Block, Column, Figure, Section, Table, Text
from susp_ctrl.report.formatting import capital, exact_text, number_text, symbol_text
from susp_ctrl.report.looks import labels
from susp_ctrl.study.results import BoxProof, StabilitySection, StudyRun, SweptLine


def stability_section(run: StudyRun) -> Section | None:
    """Return the section on stability, or None if the study has none."""
    data = run.stability
    if data is None:
        return None
    names = labels(run)
    blocks: list[Block] = [
        Text(
            "A verdict is never taken from one method: the characteristic roots, a count by the argument principle "
            "and the frequency sweep must agree, otherwise the verdict is “undecided”."
        ),
        Table(
            key="stability",
            caption="Stability of all designs. Rightmost root: real part (spectral abscissa) and imaginary part.",
            frame=data.verdicts,
            columns=(
                Column("design", "design", words=names),
                Column("verdict", "verdict"),
                Column("abscissa", "abscissa (1/s)", "fixed", 5),
                Column("abscissa_omega", "at ω (rad/s)", "fixed", 5),
                Column("unstable_roots", "unstable roots", "integer"),
                Column("delay_independent", "for every delay"),
                Column("agreement", "the methods", "long"),
            ),
        ),
        Table(
            key="roots",
            caption="Rightmost characteristic roots (one of each conjugate pair).",
            frame=data.roots,
            shown=data.roots.assign(label=data.roots["design"].map(names)),
            columns=(
                Column("real", "real part (1/s)", "fixed", 5),
                Column("imaginary", "imaginary part (rad/s)", "fixed", 5),
                Column("damping_ratio", "damping ratio", "fixed", 4),
                Column("frequency_Hz", "frequency (Hz)", "fixed", 4),
            ),
            group="label",
        ),
    ]
    if data.lines:
        blocks += _lines(run, data)
    if data.independence is not None:
        blocks += _independence(data.independence)
    return Section("Stability against delay", tuple(blocks))


def _lines(run: StudyRun, data: StabilitySection) -> list[Block]:
    crossings = pd.concat([_keyed(line, line.sweep.crossings) for line in data.lines], ignore_index=True)
    tables = [
        Table(
            key="delay_intervals",
            caption="Intervals of the delay parameter τ with the number of unstable roots in each.",
            frame=pd.concat([_keyed(line, line.sweep.intervals) for line in data.lines], ignore_index=True),
            shown=_interval_rows(run, data),
            columns=(
                Column("label", "design"),
                Column("from", "τ from", "exact"),
                Column("to", "to", "exact"),
                Column("roots", "unstable roots", "integer"),
                Column("design_at", "design at", "exact"),
                Column("margin", "delay margin", "text"),
                Column("crossings", "crossings", "integer"),
            ),
            group="line",
            note="Delay margin: the first loss of stability along the line; ∞ only where stability is proven for "
            "all τ ≥ 0, “none met” where no loss was met up to the end of the sweep but none is excluded beyond it.",
        ),
        Table(
            key="delay_crossings",
            caption="Crossings of the imaginary axis: a root pair lies on the axis at ±jω when the delay is τ.",
            frame=crossings,
            shown=crossings.assign(label=crossings["design"].map(labels(run))),
            columns=(
                Column("label", "design"),
                Column("line", "line"),
                Column("tau", "τ", "number", 6),
                Column("omega", "ω (rad/s)", "number", 6),
                Column("tendency", "tendency", "integer"),
            ),
            note="Tendency: +1 to the right (a pair becomes unstable), −1 back to the left, 0 a touch.",
            in_document=0 < len(crossings) <= 60,
        ),
    ]
    sweeps = [
        Figure(
            key=f"sweep_{kind}",
            caption=f"Frequency sweep: {_line_title(data, kind)}. A root pair can reach the "
            "imaginary axis only where a curve meets the line at 1.",
            draw=partial(_draw_sweeps, run, lines),
        )
        for kind, lines in _by_kind(data).items()
    ]
    intervals = Figure(
        key="delay_intervals",
        caption="Stable (white) and unstable (hatched, with the number of unstable roots) intervals of τ. "
        "Triangles: the design itself.",
        draw=partial(_draw_intervals, run, data),
    )
    return [*tables, *sweeps, intervals]


def _by_kind(data: StabilitySection) -> dict[str, list[SweptLine]]:
    kinds: dict[str, list[SweptLine]] = {}
    for line in data.lines:
        kinds.setdefault(line.line, []).append(line)
    return kinds


def _keyed(line: SweptLine, table: pd.DataFrame) -> pd.DataFrame:
    keyed = table.copy()
    keyed.insert(0, "design", line.design)
    keyed.insert(1, "line", line.line)
    return keyed


def _interval_rows(run: StudyRun, data: StabilitySection) -> pd.DataFrame:
    rows: list[dict[str, Any]] = []
    names = labels(run)
    for line in chain.from_iterable(_by_kind(data).values()):
        once: dict[str, Any] = {
            "label": names[line.design],
            "design_at": line.tau_of_design,
            "margin": _margin(line),
            "crossings": len(line.sweep.crossings),
        }
        for interval in line.sweep.intervals.to_dict(orient="records"):
            rows.append(
                {
                    "line": f"{capital(_line_title(data, line.line))}: τ is the {line.parameter}",
                    "from": interval["tau_from"],
                    "to": interval["tau_to"],
                    "roots": interval["unstable_roots"],
                    **once,
                }
            )
            once = dict.fromkeys(once, "")
    return pd.DataFrame(rows)


def _line_title(data: StabilitySection, kind: str) -> str:
    titles = list(dict.fromkeys(line.label for line in data.lines if line.line == kind))
    if len(titles) == 1:
        return symbol_text(titles[0])
    # One delay varies and the others differ from design to design: name what is common.
    return f"{symbol_text(kind)} alone, the other delay as in the design"


def _curve_name(name: str) -> str:
    return "ρ" if name == "rho" else f"|{symbol_text(name)}|" if name.startswith("z") else name


def _margin(line: SweptLine) -> str:
    if line.stable_for_every_delay:
        return "∞ (proven)"
    margin = line.sweep.delay_margin
    return "none met" if np.isnan(margin) else number_text(margin, 6)


def _draw_sweeps(run: StudyRun, lines: list[SweptLine]) -> MatplotlibFigure:
    names = labels(run)

    def draw(line: SweptLine, ax: Axes) -> None:
        data = line.sweep.figure_data
        curves = {_curve_name(name): data[name].to_numpy() for name in data.columns if name != "omega"}
        plotting.draw_unit_modulus(
            data["omega"].to_numpy(),
            curves,
            ax,
            crossings=line.sweep.crossings["omega"].to_numpy(),
            ylabel="spectral radius ρ" if "rho" in data else "|z|",
            styles=dict(zip(curves, (2, 1, 3, 4), strict=False)),
            legend=False,
            title=names[line.design],
        )

    return plotting.panels(lines, draw, columns=3, height=(0.5, 1.65), legend=4, one_ylabel=True, sharex=True)


def _draw_intervals(run: StudyRun, data: StabilitySection) -> MatplotlibFigure:
    names = labels(run)
    kinds = _by_kind(data)

    def draw(kind: str, ax: Axes) -> None:
        same = kinds[kind]
        rows = {
            names[line.design]: [
                (float(start), float(stop), int(roots))
                for start, stop, roots in line.sweep.intervals[
                    ["tau_from", "tau_to", "unstable_roots"]
                ].to_numpy()
            ]
            for line in same
        }
        marks = {names[line.design]: line.tau_of_design for line in same if line.tau_of_design is not None}
        plotting.draw_intervals(
            rows,
            ax,
            marks=marks,
            mark_label="the design",
            xlabel=f"τ: {same[0].parameter}",
            legend=False,
            title=_line_title(data, kind),
        )

    counts = [len(lines) for lines in kinds.values()]
    height = 0.5 + sum(0.55 + 0.21 * count for count in counts)
    return plotting.panels(list(kinds), draw, columns=1, height=(height, 0.0), legend=4, height_ratios=counts)


def _independence(proof: BoxProof) -> list[Block]:
    corner = proof.corner
    gains = ", ".join(f"{exact_text(gain)}" for gain in proof.gains["gain"])
    units = ", ".join(dict.fromkeys(proof.gains["unit"]))
    outcome = {
        "stable": "Since this is below 1, every design inside the box is stable for every pair of delays.",
        "unstable": "The loop at the corner of the box is not stable for every pair of delays.",
        "undecided": "The test does not decide whether the box is stable for every pair of delays.",
    }[proof.verdict]
    return [
        Text(
            f"The whole search box at once: at its corner (gains {gains} {units}) the supremum of ρ(|G(jω)| diag|g|) "
            f"is {number_text(corner.small_gain, 5)}, at ω = {number_text(corner.small_gain_omega, 5)} rad/s. "
            f"{outcome} All gains could grow by the factor {number_text(proof.margin, 5)} before this proof fails, and "
            f"by {number_text(corner.margin, 5)} before some delays do destabilise the loop."
        ),
        Table(
            key="delay_independence",
            caption="One channel at a time: gains smaller than the threshold are stable for every delay.",
            frame=proof.single_channel,
            columns=(
                Column("measured", "measured", "signal"),
                Column("actuator", "actuator", "signal"),
                Column("gain_threshold", "threshold", "number", 7),
                Column("unit", "unit", "unit"),
                Column("omega_rad_per_s", "at ω (rad/s)", "number", 5),
            ),
        ),
        Figure(
            key="delay_independence",
            caption="Small gain at the corner of the search box: below 1 throughout means stable for all delays.",
            draw=partial(_draw_independence, proof),
        ),
    ]


def _draw_independence(proof: BoxProof) -> MatplotlibFigure:
    figure, axes = plotting.new_figure(height=2.3)
    plotting.draw_unit_modulus(
        proof.curve["omega"].to_numpy(),
        {"ρ(|G(jω)| diag|g|)": proof.curve["radius"].to_numpy()},
        axes[0, 0],
        ylabel="spectral radius",
        styles={"ρ(|G(jω)| diag|g|)": "tuned"},
    )
    return figure
