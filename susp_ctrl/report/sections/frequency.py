"""Frequency responses: Bode plots, |H| per road velocity, and its peaks."""

from __future__ import annotations

from functools import partial
from itertools import product

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl.report.blocks import Block, Column, Figure, Section, Table, Text
from susp_ctrl.report.formatting import signal_text, unit_text, with_unit
from susp_ctrl.report.looks import labels, looks
from susp_ctrl.study.results import FrequencySection, StudyRun

_ROADS = (
    " “Lagged” means that the same road meets the following wheels later by the travel time over the wheelbase, “in "
    "phase” that it meets all wheels at once."
)
_BODE_OUTPUTS = ("body_acceleration", "pitch_acceleration")


def frequency_section(run: StudyRun) -> Section | None:
    """Return the section on frequency responses, or None if the study has none."""
    data = run.frequency
    if data is None:
        return None
    in_phase = bool(data.velocity_gain_in_phase)
    rows = " Upper row: lagged road; lower row: wheels in phase." if in_phase else ""
    blocks: list[Block] = [
        Text(
            "All responses are evaluated with the exact delay factor at every frequency; nothing is approximated."
            + (_ROADS if in_phase else "")
        ),
        Figure(
            key="velocity_gain",
            caption=f"|H| per road velocity of passive car, published and tuned designs.{rows}",
            draw=partial(_velocity_gain, run, data),
        ),
        _peaks_table(run, data),
    ]
    blocks += [
        Figure(
            key=f"bode_{output}",
            caption=f"Bode plot from road displacement to {signal_text(output)}, exact delays"
            f"{', lagged road' if in_phase else ''}: magnitude and unwrapped phase.",
            draw=partial(_bode, run, data, output),
        )
        for output in [name for name in _BODE_OUTPUTS if name in data.outputs] or data.outputs[:2]
    ]
    return Section("Frequency response", tuple(blocks))


def _peaks_table(run: StudyRun, data: FrequencySection) -> Table:
    # One line per design, one pair of columns per curve: where its highest point is, and how high.
    peaks = data.peaks
    curves = (
        peaks[["output", "road", "unit"]]
        .drop_duplicates()
        .sort_values(["road", "output"], ascending=[False, True])
    )
    shown = pd.DataFrame({"design": list(dict.fromkeys(peaks["design"]))})
    columns = [Column("design", "design", words=labels(run))]
    spans = [("", 1)]
    for number, (output, road, unit) in enumerate(curves.itertuples(index=False)):
        curve = peaks[(peaks["output"] == output) & (peaks["road"] == road)].set_index("design")
        shown[f"frequency_{number}"] = curve["frequency_Hz"].reindex(shown["design"]).to_numpy()
        shown[f"gain_{number}"] = curve["gain"].reindex(shown["design"]).to_numpy()
        columns.append(Column(f"frequency_{number}", "f (Hz)", "number", 4))
        columns.append(Column(f"gain_{number}", with_unit("|H|", unit), "number", 4))
        spans.append(
            (f"{signal_text(output)}\n{road}" if data.velocity_gain_in_phase else signal_text(output), 2)
        )
    return Table(
        key="frequency_peaks",
        caption="Highest point of |H| per road velocity.",
        frame=peaks,
        shown=shown,
        columns=tuple(columns),
        spans=tuple(spans),
    )


def _bode(run: StudyRun, data: FrequencySection, output: str) -> MatplotlibFigure:
    figure, axes = plotting.new_figure(2, 1, height=4.4, sharex=True, height_ratios=(1.25, 1.0))
    row = data.outputs.index(output)
    names = labels(run)
    unit = run.signal_units.get(output, "")
    plotting.draw_bode(
        data.omega,
        {names[key]: data.bode[key][row] for key in data.curve_designs},
        (axes[0, 0], axes[1, 0]),
        ylabel=f"{signal_text(output)}\n(dB re 1 {unit_text(unit)} per m)",
        styles=looks(run.designs),
        legend=False,
    )
    plotting.shared_legend(figure, axes[:1], columns=3)
    return figure


def _velocity_gain(run: StudyRun, data: FrequencySection) -> MatplotlibFigure:
    roads = {"lagged": data.velocity_gain}
    if data.velocity_gain_in_phase:
        roads["in phase"] = data.velocity_gain_in_phase
    names = labels(run)

    def draw(panel: tuple[str, str], ax: Axes) -> None:
        road, output = panel
        curve = data.curve_outputs.index(output)
        unit = "rad/(m s)" if run.signal_units.get(output, "").startswith("rad") else "1/s"
        plotting.draw_magnitude(
            data.omega,
            {names[key]: roads[road][key][curve] for key in data.curve_designs},
            ax,
            ylabel=f"|H| ({unit})",
            styles=looks(run.designs),
            legend=False,
            title=f"{signal_text(output)}, {road}" if len(roads) > 1 else signal_text(output),
        )

    each = list(product(roads, data.curve_outputs))
    return plotting.panels(
        each, draw, columns=len(data.curve_outputs), height=(0.6, 2.6), legend=3, sharex=True
    )
