"""What was run: the vehicle, its signals, the designs that are compared, and the equations."""

from __future__ import annotations

import pandas as pd

from susp_ctrl.report.blocks import Block, Column, Equations, Section, Table, Text
from susp_ctrl.report.formatting import capital, exact_text, signal_text, symbol_text
from susp_ctrl.study.results import StudyRun

_KINDS = {"half_car": "half car", "quarter_car": "quarter car", "full_car": "full car"}


def parameters_section(run: StudyRun) -> Section:
    """Return the section on vehicle and designs."""
    vehicle = run.vehicle
    lags = "; ".join(
        f"{signal_text(name)}: {exact_text(lag, 6)} s" for name, lag in vehicle.lags.items() if lag > 0.0
    )
    travel = f"It travels at {exact_text(vehicle.speed)} m/s."
    behind = f" Lag behind the front wheels: {lags}." if lags else ""
    blocks: list[Block] = [
        Text(f"The vehicle is a {_KINDS.get(vehicle.kind, signal_text(vehicle.kind))}. {travel}{behind}"),
        Table(
            key="vehicle",
            caption="Parameters of the vehicle.",
            frame=vehicle.parameters,
            columns=(
                Column("parameter", "parameter", "signal"),
                Column("symbol", "symbol"),
                Column("value", "value", "exact"),
                Column("unit", "unit", "unit"),
            ),
        ),
        Table(
            key="static_loads",
            caption="Static tire loads at standstill on a level road.",
            frame=vehicle.static_loads,
            columns=(Column("wheel", "wheel", "signal"), Column("load_N", "static load (N)", "fixed", 1)),
        ),
    ]
    frame = designs_frame(run)
    if len(frame):
        blocks.append(_designs_table(run, frame))
    return Section("Vehicle and designs", tuple(blocks))


def designs_frame(run: StudyRun) -> pd.DataFrame:
    """Return every channel of every controlled design, one row per channel."""
    rows = [
        {
            "design": design.key,
            "label": design.label,
            "role": design.role,
            "channel": number,
            "measured": str(channel.measured),
            "actuator": str(channel.actuator),
            "gain": channel.gain,
            "gain_unit": _gain_unit(run, channel.measured),
            "delay_s": channel.delay,
            "reference": design.reference,
        }
        for design in run.designs
        for number, channel in enumerate(design.channels, 1)
    ]
    return pd.DataFrame(rows)


def model_section(run: StudyRun) -> Section:
    """Return the section with the equations that everything else stands on."""
    blocks: list[Block] = []
    if run.vehicle.kind == "half_car":
        blocks.append(Equations("half_car"))
    blocks.append(Equations("delayed_loop"))
    if run.frequency is not None or run.tuning:
        blocks.append(
            Equations("response" if run.vehicle.kind == "quarter_car" else "response_and_objective")
        )
    if run.stability is not None:
        blocks.append(Equations("stability"))
    if run.time:
        blocks.append(Equations("time"))
    return Section("Model and methods", tuple(blocks))


def _designs_table(run: StudyRun, frame: pd.DataFrame) -> Table:
    # One line per design where all designs act through the same pairs of signals, which is the usual case.
    by_design = frame.groupby("design", sort=False)
    pairs = {tuple(map(tuple, part[["measured", "actuator"]].to_numpy())) for _, part in by_design}
    if len(pairs) > 1:
        columns = (
            Column("measured", "measured", "signal"),
            Column("actuator", "actuator", "signal"),
            Column("gain", "gain", "number", 7),
            Column("gain_unit", "unit", "unit"),
            Column("delay_s", "delay (s)", "number", 6),
        )
        return Table("designs", "Gains and delays of all designs.", frame, columns, group="label")
    channels = pairs.pop()
    shown = []
    for _, part in by_design:
        row = {"label": part["label"].iloc[0], "role": part["role"].iloc[0]}
        row |= {f"gain_{n}": gain for n, gain in enumerate(part["gain"], 1)}
        row |= {f"delay_{n}": delay for n, delay in enumerate(part["delay_s"], 1)}
        shown.append(row | {"reference": part["reference"].iloc[0]})
    units = frame.groupby("channel")["gain_unit"].first()
    numbers = range(1, len(channels) + 1)
    gains = tuple(Column(f"gain_{n}", f"{symbol_text(f'g{n}')} ({units[n]})", "fixed", 1) for n in numbers)
    delays = tuple(Column(f"delay_{n}", f"{symbol_text(f'tau{n}')} (s)", "fixed", 6) for n in numbers)
    note = "; ".join(
        f"channel {n}: {signal_text(measured)} to {signal_text(actuator)}"
        for n, (measured, actuator) in enumerate(channels, 1)
    )
    return Table(
        key="designs",
        caption="Gains and delays of all designs.",
        frame=frame,
        columns=(
            Column("label", "design"),
            Column("role", "origin"),
            *gains,
            *delays,
        ),
        note=f"{capital(note)}.{' Tuned designs are results of this run.' if run.tuning else ''}",
        shown=pd.DataFrame(shown),
    )


def _gain_unit(run: StudyRun, measured: str | int) -> str:
    unit = run.signal_units.get(str(measured), "")
    return {"m": "N/m", "m/s": "N s/m", "m/s2": "N s2/m", "rad": "N/rad", "rad/s": "N s/rad"}.get(unit, "")
