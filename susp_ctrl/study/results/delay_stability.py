"""Data of the stability section of a run; see `susp_ctrl.study.results.study_run` for the conventions."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import VerdictWord


@dataclass(frozen=True)
class DelayLine:
    """Frequency sweep of one design along one line of the delay plane, ``delays(tau) = start + tau direction``.

    Attributes
    ----------
    design : str
        Design key.
    line : str
        ``"equal"`` (tau1 = tau2 = tau), ``"ray"`` (through the design's own delays; tau = 1 is the design) or the name
        of the delay that varies alone (``"tau2"``: the other keeps its value).
    label : str
        The line in words.
    start, direction : tuple of float
        Of the line, one entry per channel (s, and s per unit of tau).
    up_to : float
        Largest tau of the sweep.
    tau_of_design : float or None
        The tau at which the line passes through the design itself; None if it does not.
    parameter : str
        What tau is: ``"delay (s)"`` or ``"multiple of the design's delays"``.
    figure_omega : ndarray, shape (n,)
        Angular frequency of the figure (rad/s).
    figure_values : ndarray, shape (curves, n)
        |z(jw)| of every root of the characteristic polynomial in z, or the spectral radius (one curve); nan where a
        root does not exist. Crossings are where a curve meets 1.
    figure_names : tuple of str
        One name per curve.
    crossings : DataFrame
        Columns ``tau, omega, tendency``.
    intervals : DataFrame
        Columns ``tau_from, tau_to, unstable_roots``.
    stable_intervals : tuple of (float, float)
        Intervals of tau without unstable roots.
    delay_margin : float
        First loss of stability; inf only if proven for all tau, nan if none was met up to `up_to` and none is proven.
    proven : bool
        Whether stability on the whole line (all tau >= 0) is proven.
    """

    design: str
    line: str
    label: str
    start: tuple[float, ...]
    direction: tuple[float, ...]
    up_to: float
    tau_of_design: float | None
    parameter: str
    figure_omega: FloatArray
    figure_values: FloatArray
    figure_names: tuple[str, ...]
    crossings: pd.DataFrame
    intervals: pd.DataFrame
    stable_intervals: tuple[tuple[float, float], ...]
    delay_margin: float
    proven: bool


@dataclass(frozen=True)
class DelayIndependence:
    """Small-gain proof for the whole search box: stable whatever the delays.

    Attributes
    ----------
    gains : DataFrame
        The corner of the box: ``measured, actuator, gain, unit``.
    verdict : {"stable", "unstable", "undecided"}
        ``"stable"``: proven for every gain up to the corner and every delay.
    supremum : float
        Small gain: sup_w rho(|G(jw)| diag|g|) at the corner; below 1 is the proof for every smaller gain as well.
    margin : float
        Factor by which all gains could grow before this proof fails, 1/supremum.
    exact_margin : float
        Factor at which some delays do destabilise the loop (where that is not known exactly, a bound); >= `margin`.
    omega : float
        Where the supremum is taken (rad/s).
    single_channel : DataFrame
        One channel at a time: ``measured, actuator, gain_threshold, omega_rad_per_s, unit``; smaller gains are stable
        for every delay.
    curve_omega, curve_radius : ndarray, shape (n,)
        rho(|G(jw)| diag|g|) at the corner over the frequency (rad/s).
    """

    gains: pd.DataFrame
    verdict: VerdictWord
    supremum: float
    margin: float
    exact_margin: float
    omega: float
    single_channel: pd.DataFrame
    curve_omega: FloatArray
    curve_radius: FloatArray


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
    lines : tuple of DelayLine
        Frequency sweeps, one per design and line.
    independence : DelayIndependence or None
        Of the search box.
    """

    verdicts: pd.DataFrame
    roots: pd.DataFrame
    lines: tuple[DelayLine, ...]
    independence: DelayIndependence | None
