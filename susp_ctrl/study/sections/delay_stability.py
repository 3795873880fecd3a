"""Stability of all designs: verdicts, roots, frequency sweeps along lines of delays, and the small-gain proof."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import pandas as pd

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import (
    VERDICT_WORDS,
    DelayLTI,
    FeedbackChannel,
    characteristic_roots,
    close_loop,
    delay_independent_stability,
    stability,
    sweep_delays,
)
from susp_ctrl.errors import UndecidedStabilityWarning
from susp_ctrl.study.results import BoxProof, Design, StabilitySection, SweptLine
from susp_ctrl.study.sections.workbench import Report, Workbench
from susp_ctrl.study.settings import BoxSettings, StabilitySettings, gain_unit

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
    # The verdict itself says so, in the table and in the exit status.
    with warnings.catch_warnings(action="ignore", category=UndecidedStabilityWarning):
        verdict = stability(loop)
    proven = delay_independent_stability(loop).stable if design.channels else verdict.stable
    return {
        "design": design.key,
        "role": design.role,
        "verdict": VERDICT_WORDS[verdict.stable],
        "abscissa": verdict.abscissa,
        "abscissa_omega": abs(float(verdict.roots[0].imag)) if verdict.roots.size else np.nan,
        "unstable_roots": verdict.unstable_roots,
        "delay_independent": "proven" if proven else "not proven",
        "agreement": ", ".join(
            f"{name} {'cannot tell' if count is None else count}" for name, count in verdict.agreement.items()
        ),
        "reason": verdict.reason,
    }


def _roots(design: Design, loop: DelayLTI, count: int) -> list[dict[str, object]]:
    return [
        {
            "design": design.key,
            "real": float(root.real),
            "imaginary": float(root.imag),
            "damping_ratio": float(-root.real / abs(root)) if root else np.nan,
            "frequency_Hz": float(abs(root) / (2 * np.pi)),
        }
        for root in characteristic_roots(loop, count=count)
        if root.imag >= 0
    ]


def delay_line(design: Design, loop: DelayLTI, name: str, settings: StabilitySettings) -> SweptLine | None:
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
    with warnings.catch_warnings(action="ignore", category=UndecidedStabilityWarning):
        swept = sweep_delays(loop, direction=direction, start=start, up_to=up_to)
    return SweptLine(design.key, name, label, at, parameter, swept)


def _independence(bench: Workbench, box: Sequence[BoxSettings]) -> BoxProof:
    """Ask for delay-independent stability at the corner of the box, for all channels and for each alone."""
    corner = [FeedbackChannel(b.measured, b.actuator, abs(b.gain), 1.0) for b in box]
    whole = delay_independent_stability(close_loop(bench.plant, corner))
    alone = [delay_independent_stability(close_loop(bench.plant, [channel])) for channel in corner]
    paths = pd.DataFrame([(b.measured, b.actuator) for b in box], columns=["measured", "actuator"])
    units = [gain_unit(b.measured) for b in box]
    centre = max(whole.small_gain_omega, 1e-3)
    omega = np.geomspace(centre / 30, centre * 30, _CURVE_POINTS)
    return BoxProof(
        gains=paths.assign(gain=[b.gain for b in box], unit=units),
        corner=whole,
        single_channel=paths.assign(
            gain_threshold=[one.margin * c.gain for one, c in zip(alone, corner, strict=True)],
            omega_rad_per_s=[one.omega for one in alone],
            unit=units,
        ),
        curve=pd.DataFrame({"omega": omega, "radius": _radius(bench, corner, omega)}),
    )


def _radius(bench: Workbench, channels: Sequence[FeedbackChannel], omega: FloatArray) -> FloatArray:
    """Return rho(|G(jw)| diag|g|), G from the actuators to the measured signals."""
    rows = [bench.plant.output_labels.index(str(c.measured)) for c in channels]
    columns = [bench.plant.input_labels.index(str(c.actuator)) for c in channels]
    response = np.abs(np.asarray(bench.loop(bench.keys[0])(1j * omega, squeeze=False)))[np.ix_(rows, columns)]
    weighted = np.moveaxis(response, -1, 0) * np.array([abs(c.gain) for c in channels])
    radius: FloatArray = np.abs(np.linalg.eigvals(weighted)).max(axis=-1)
    return radius
