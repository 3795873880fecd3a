"""Stability of all designs: verdicts, roots, frequency sweeps along lines of delays, and the small-gain proof."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import (
    DelayLTI,
    FeedbackChannel,
    characteristic_roots,
    close_loop,
    delay_independent_stability,
    stability,
    sweep_delays,
)
from susp_ctrl.errors import UndecidedStabilityWarning
from susp_ctrl.ride import signal_unit
from susp_ctrl.study.results.study_run import (
    DelayIndependence,
    DelayLine,
    Design,
    StabilitySection,
    StabilityWord,
)
from susp_ctrl.study.sections.workbench import FloatArray, Report, Workbench
from susp_ctrl.study.settings.study import StabilitySettings
from susp_ctrl.study.settings.units import GAIN_UNITS, readable
from susp_ctrl.study.settings.vehicle import BoxSettings

_WORDS: dict[bool | None, StabilityWord] = {True: "stable", False: "unstable", None: "undecided"}
_CURVE_POINTS = 1200


def stability_section(bench: Workbench, settings: StabilitySettings, report: Report) -> StabilitySection:
    """Give a verdict on every design, sweep its delays, and look for a proof for the whole box of gains.

    Parameters
    ----------
    bench : Workbench
    settings : StabilitySettings
    report : callable
        Told the share done.

    Returns
    -------
    StabilitySection
    """
    designs = bench.chosen(settings.designs)
    verdicts, roots, lines = [], [], []
    for n, design in enumerate(designs):
        loop = bench.loop(design.key)
        verdicts.append(_verdict(design, loop))
        roots += _roots(design, loop, settings.roots)
        if design.channels:
            lines += [line for name in settings.lines if (line := delay_line(design, loop, name, settings))]
        report((n + 1) / (len(designs) + 1))
    independence = _independence(bench, settings.box) if settings.box else None
    report(1.0)
    return StabilitySection(pd.DataFrame(verdicts), pd.DataFrame(roots), tuple(lines), independence)


def _verdict(design: Design, loop: DelayLTI) -> dict[str, object]:
    with warnings.catch_warnings():
        # The verdict itself says so, in the table and in the exit status.
        warnings.simplefilter("ignore", UndecidedStabilityWarning)
        verdict = stability(loop)
    rightmost = verdict.roots[0] if len(verdict.roots) else complex(np.nan, np.nan)
    proven = (
        verdict.stable is True if not design.channels else delay_independent_stability(loop).stable is True
    )
    return {
        "design": design.key,
        "role": design.role,
        "verdict": _WORDS[verdict.stable],
        "abscissa": float(verdict.abscissa),
        "abscissa_omega": abs(float(np.imag(rightmost))),
        "unstable_roots": verdict.unstable_roots,
        "delay_independent": "proven" if proven else "not proven",
        "agreement": ", ".join(
            f"{name} {'cannot tell' if count is None else count}" for name, count in verdict.agreement.items()
        ),
        "reason": verdict.reason,
    }


def _roots(design: Design, loop: DelayLTI, count: int) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for root in characteristic_roots(loop, count=count):
        if root.imag < 0:
            continue
        size = abs(root)
        rows.append(
            {
                "design": design.key,
                "real": float(root.real),
                "imaginary": float(root.imag),
                "damping_ratio": float(-root.real / size) if size else np.nan,
                "frequency_Hz": float(size / (2 * np.pi)),
            }
        )
    return rows


def delay_line(design: Design, loop: DelayLTI, name: str, settings: StabilitySettings) -> DelayLine | None:
    """Sweep a loop along one line of delays; None where the design has no such line."""
    own = np.array([channel.delay for channel in design.channels])
    start, up_to, at = np.zeros(own.size), settings.up_to, None
    if name == "equal":
        direction, parameter = np.ones(own.size), "delay (s)"
        label = "all delays equal" if own.size > 1 else "the delay"
        at = float(own[0]) if np.ptp(own) == 0 else None
    elif name == "ray":
        direction, parameter = own.copy(), "multiple of the design's delays"
        label, up_to, at = "all delays in the proportion of the design", settings.ray_up_to, 1.0
        if not np.any(own):
            return None
    else:
        k = int(name.removeprefix("tau")) - 1
        if k >= own.size:
            return None
        start, direction = own.copy(), np.eye(own.size)[k]
        start[k], at, parameter = 0.0, float(own[k]), "delay (s)"
        fixed = ", ".join(f"tau{j + 1} = {tau:.6g} s" for j, tau in enumerate(own) if j != k)
        label = f"{name} alone" + (f", {fixed}" if fixed else "")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UndecidedStabilityWarning)
        swept = sweep_delays(loop, direction=direction, start=start, up_to=up_to)
    omega, values, names = _figure(swept.figure_data)
    return DelayLine(
        design=design.key,
        line=name,
        label=label,
        start=tuple(start.tolist()),
        direction=tuple(direction.tolist()),
        up_to=up_to,
        tau_of_design=at,
        parameter=parameter,
        figure_omega=omega,
        figure_values=values,
        figure_names=names,
        crossings=swept.crossings,
        intervals=swept.intervals,
        stable_intervals=tuple((float(a), float(b)) for a, b in swept.stable_intervals),
        delay_margin=float(swept.delay_margin),
        proven=bool(np.isposinf(swept.delay_margin)),
    )


def _figure(data: pd.DataFrame) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Split the data of the figure of |z| into frequencies, curves and their names."""
    names = tuple(str(column) for column in data.columns if column != "omega")
    curves = data[list(names)].to_numpy(dtype=float).T if names else np.zeros((0, len(data)))
    return data["omega"].to_numpy(dtype=float), curves, names


def _independence(bench: Workbench, box: Sequence[BoxSettings]) -> DelayIndependence:
    """Ask for delay-independent stability at the corner of the box, for all channels and for each alone."""
    corner = [FeedbackChannel(b.measured, b.actuator, abs(b.gain), 1.0) for b in box]
    whole = delay_independent_stability(close_loop(bench.plant, corner))
    units = [readable(GAIN_UNITS[signal_unit(b.measured)]) for b in box]
    names = [{"measured": b.measured, "actuator": b.actuator} for b in box]
    single = []
    for channel, name, unit in zip(corner, names, units, strict=True):
        alone = delay_independent_stability(close_loop(bench.plant, [channel]))
        threshold = {
            "gain_threshold": alone.margin * channel.gain,
            "omega_rad_per_s": alone.omega,
            "unit": unit,
        }
        single.append(name | threshold)
    centre = max(float(whole.small_gain_omega), 1e-3)
    omega = np.geomspace(centre / 30, centre * 30, _CURVE_POINTS)
    return DelayIndependence(
        gains=pd.DataFrame(
            [n | {"gain": b.gain, "unit": u} for n, b, u in zip(names, box, units, strict=True)]
        ),
        verdict=_WORDS[whole.stable],
        supremum=float(whole.small_gain),
        margin=float(1.0 / whole.small_gain) if whole.small_gain else np.inf,
        exact_margin=float(whole.margin),
        omega=float(whole.small_gain_omega),
        single_channel=pd.DataFrame(single),
        curve_omega=omega,
        curve_radius=_radius(bench, corner, omega),
    )


def _radius(bench: Workbench, channels: Sequence[FeedbackChannel], omega: FloatArray) -> FloatArray:
    """Return rho(|G(jw)| diag|g|), G from the actuators to the measured signals."""
    rows = [bench.plant.output_labels.index(str(c.measured)) for c in channels]
    columns = [bench.plant.input_labels.index(str(c.actuator)) for c in channels]
    response = np.abs(np.asarray(bench.loop(bench.keys[0])(1j * omega, squeeze=False)))[np.ix_(rows, columns)]
    weighted = np.moveaxis(response, -1, 0) * np.array([abs(c.gain) for c in channels])
    radius: FloatArray = np.abs(np.linalg.eigvals(weighted)).max(axis=-1)
    return radius
