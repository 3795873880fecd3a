"""Data of the stability section of a run; see `susp_ctrl.study.results.study_run` for the conventions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pandas as pd

from susp_ctrl.delay_systems import VERDICT_WORDS, DelayIndependence, DelaySweep, VerdictWord


@dataclass(frozen=True)
class SweptLine:
    """Frequency sweep of one design along one line of the delay plane.

    Attributes
    ----------
    design : str
        Design key.
    line : str
        ``"equal"`` (tau1 = tau2 = tau), ``"ray"`` (through the design's own delays; tau = 1 is the design) or the name
        of the delay that varies alone (``"tau2"``: the other keeps its value).
    label : str
        The line in words.
    tau_of_design : float or None
        The tau at which the line passes through the design itself; None if it does not.
    parameter : str
        What tau is: ``"delay (s)"`` or ``"multiple of the design's delays"``.
    sweep : DelaySweep
        Line, crossings, intervals and delay margin.
    """

    design: str
    line: str
    label: str
    tau_of_design: float | None
    parameter: str
    sweep: DelaySweep

    @property
    def stable_for_every_delay(self) -> bool:
        """Whether stability on the whole line (all tau >= 0) is proven."""
        return self.sweep.delay_margin == math.inf


@dataclass(frozen=True)
class BoxProof:
    """Small-gain proof for the whole search box: stable whatever the delays.

    Attributes
    ----------
    gains : DataFrame
        The corner of the box: ``measured, actuator, gain, unit``.
    corner : DelayIndependence
        Of the loop at the corner; if it is stable by its `small_gain`, every smaller gain is as well.
    single_channel : DataFrame
        One channel at a time: ``measured, actuator, gain_threshold, omega_rad_per_s, unit``; smaller gains are stable
        for every delay.
    curve : DataFrame
        Columns ``omega`` (rad/s) and ``radius``: rho(|G(jw)| diag|g|) at the corner.
    """

    gains: pd.DataFrame
    corner: DelayIndependence
    single_channel: pd.DataFrame
    curve: pd.DataFrame

    @property
    def verdict(self) -> VerdictWord:
        """``"stable"``: proven for every gain up to the corner and every delay."""
        return VERDICT_WORDS[self.corner.stable]

    @property
    def margin(self) -> float:
        """Factor by which all gains could grow before the small-gain proof fails."""
        return 1.0 / self.corner.small_gain if self.corner.small_gain else math.inf


@dataclass(frozen=True)
class StabilitySection:
    """Stability of every design.

    Attributes
    ----------
    verdicts : DataFrame
        One row per design: ``design, role, verdict`` ("stable" | "unstable" | "undecided"), ``abscissa`` (1/s, real
        part of the rightmost root), ``abscissa_omega`` (its imaginary part, rad/s), ``unstable_roots,
        delay_independent`` ("proven" | "not proven"), ``agreement`` (what each method counted), ``reason`` (in words).
    roots : DataFrame
        Rightmost roots: ``design, real, imaginary`` (imaginary >= 0; 1/s and rad/s), ``damping_ratio, frequency_Hz``.
    lines : tuple of SweptLine
        Frequency sweeps, one per design and line.
    independence : BoxProof or None
        Of the search box.
    """

    verdicts: pd.DataFrame
    roots: pd.DataFrame
    lines: tuple[SweptLine, ...]
    independence: BoxProof | None
