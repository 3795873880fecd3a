"""The searches for gains and delays: bounds, convergence, what was found, how narrow it is."""

from __future__ import annotations

from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl.report.blocks import Block, Column, Figure, Heading, Section, Table, Text
from susp_ctrl.report.formatting import capital, number_text, sentence, symbol_text, with_unit
from susp_ctrl.report.looks import labels, looks
from susp_ctrl.study.results import StudyRun, TuningRun

_PAGE = 8.6  # inch; a higher figure would run off the page


def tuning_section(run: StudyRun) -> Section | None:
    """Return the section on tuning, or None if the study tunes nothing."""
    if not run.tuning:
        return None
    blocks: list[Block] = [
        Text(
            "Every candidate that is not shown to be stable is infeasible, whatever its objective; the swarm is "
            "followed by a bounded local polish, and the design that is returned has passed the full stability verdict."
        )
    ]
    for search in run.tuning:
        blocks += _search(run, search)
    blocks.append(
        Figure(
            key="convergence",
            caption="Convergence of the searches: best objective so far and mean of the feasible particles.",
            draw=partial(_convergence, run),
        )
    )
    return Section("Tuning", tuple(blocks))


def _search(run: StudyRun, search: TuningRun) -> list[Block]:
    names = labels(run)
    settings = ", ".join(f"{name} {value}" for name, value in search.settings.items())
    unit = search.unit
    blocks: list[Block] = [
        Heading(capital(search.label)),
        Text(
            f"{sentence(search.objective_text)} Settings: {settings}. The swarm reached "
            f"J = {number_text(search.swarm_value)}, the local polish {number_text(search.value)}. "
            f"{sentence(search.message)}"
        ),
        Table(
            key=f"tuning_{search.key}",
            caption=f"{capital(search.label)}: search bounds and the design found.",
            frame=search.bounds,
            shown=search.bounds.assign(parameter=search.bounds["parameter"].map(symbol_text)),
            columns=(
                Column("parameter", "parameter"),
                Column("lower", "lower bound", "exact"),
                Column("upper", "upper bound", "exact"),
                Column("found", "found", "number", 8),
                Column("unit", "unit", "unit"),
            ),
        ),
        Table(
            key=f"objective_{search.key}",
            caption=f"{capital(search.label)}: objective of all designs.",
            frame=search.comparison,
            columns=(
                Column("design", "design", words=names),
                Column("role", "origin"),
                Column("objective_value", with_unit("J", unit), "number", 5),
                Column("ratio_to_passive", "J/J of the passive car", "number", 4),
            ),
        ),
        Table(
            f"convergence_{search.key}",
            f"{capital(search.label)}: convergence.",
            search.history,
            in_document=False,
        ),
    ]
    if search.closed_form is not None:
        blocks.append(_closed_form(search))
    if search.detuning is not None:
        blocks += _detuning(run, search)
    return blocks


def _closed_form(search: TuningRun) -> Table:
    assert search.closed_form is not None
    # The difference is of interest for the optimum that was found, not for its mirror image.
    shown = search.closed_form.copy()
    shown.loc[~shown["is_found"].astype(bool), ["gain_difference", "delay_difference_s"]] = float("nan")
    return Table(
        key=f"closed_form_{search.key}",
        caption=f"{capital(search.label)}: the exact optima J = 0 inside the bounds, and the one that was found.",
        frame=search.closed_form,
        shown=shown,
        columns=(
            Column("measured", "measured", "signal"),
            Column("gain", "gain", "number", 8),
            Column("delay_s", "delay (s)", "number", 7),
            Column("is_found", "found", "check"),
            Column("gain_difference", "found − exact, gain", "number", 2),
            Column("delay_difference_s", "delay (s)", "number", 2),
        ),
        emphasis="is_found",
    )


def _detuning(run: StudyRun, search: TuningRun) -> list[Block]:
    detuning = search.detuning
    assert detuning is not None
    names = labels(run)
    designs = [name for name in detuning.columns if name in names]
    # The table shows about nine rows around the design frequency; the CSV holds them all.
    step = max((len(detuning) - 1) // 8, 1)
    shown = detuning.iloc[::step].assign(percent=lambda rows: 100.0 * (rows["frequency_factor"] - 1.0))
    return [
        Table(
            key=f"detuning_{search.key}",
            caption=f"{capital(search.label)}: how J grows when the road's frequency is not the one tuned for.",
            frame=detuning,
            shown=shown,
            columns=(
                Column("percent", "frequency error (%)", "fixed", 1),
                Column("omega_rad_per_s", "ω (rad/s)", "number", 4),
                *(Column(key, f"J, {names[key]}", "number", 4) for key in designs),
            ),
        ),
        Figure(
            key=f"detuning_{search.key}",
            caption=f"{capital(search.label)}: J over the error in frequency; dotted lines at ±5 %.",
            draw=partial(_draw_detuning, run, search),
        ),
    ]


def _draw_detuning(run: StudyRun, search: TuningRun) -> MatplotlibFigure:
    assert search.detuning is not None
    figure, axes = plotting.new_figure(height=2.5)
    names = labels(run)
    plotting.draw_detuning(
        search.detuning["frequency_factor"].to_numpy() - 1.0,
        {names[key]: search.detuning[key].to_numpy() for key in search.detuning.columns if key in names},
        axes[0, 0],
        ylabel=with_unit("J", search.unit),
        styles=looks(run.designs),
        legend=False,
    )
    plotting.shared_legend(figure, axes)
    return figure


def _convergence(run: StudyRun) -> MatplotlibFigure:
    def draw(search: TuningRun, ax: Axes) -> None:
        curves = {"best so far": search.history["best"].to_numpy()}
        if "mean" in search.history:
            curves["mean of the feasible"] = search.history["mean"].to_numpy()
        plotting.draw_convergence(
            curves,
            ax,
            ylabel=with_unit("J", search.unit),
            styles={"best so far": "tuned", "mean of the feasible": "passive"},
            title=search.label,
        )

    columns = 2 if len(run.tuning) <= 6 else 3
    return plotting.panels(run.tuning, draw, columns=columns, height=(0.3, 2.5), highest=_PAGE)
