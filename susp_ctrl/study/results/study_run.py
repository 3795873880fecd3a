"""`StudyRun`: everything a study computed, as one immutable data object.

The object holds settings, arrays and tables only: no figure, no text layout, no file. Units are SI, angular
frequencies rad/s, phases rad. Every design is known by a short `key` (``"passive"``, ``"random_published"``, ...),
which is used in all dictionaries and in the column ``design`` of all tables; `StudyRun.design` gives the rest.
Sections that the study file does not contain are None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import pandas as pd

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems import FeedbackChannel
from susp_ctrl.study.results.delay_stability import StabilitySection
from susp_ctrl.study.results.maps import StabilityMapCase
from susp_ctrl.study.results.pade import PadeCase
from susp_ctrl.study.settings import Study

Role = Literal["passive", "published", "tuned"]
AuditVerdict = Literal["reproduced", "not reproduced", "explained by a named misprint"]


@dataclass(frozen=True)
class Provenance:
    """What was run, with what.

    Attributes
    ----------
    study_file : str
        Name of the study file without its folder (the folder would differ between machines).
    study_sha256 : str
        SHA-256 of the bytes of the study file, hexadecimal; empty for a study built in Python.
    versions : mapping of str to str
        ``python, susp_ctrl, control, numpy, scipy, pandas``.
    seeds : mapping of str to int
        Random seeds by use: the key of each tuning run, ``"road"`` of each time case as ``"time.<key>"``.
    duration : float
        Wall time of the computation (s). The only field that differs between two equal runs.
    """

    study_file: str
    study_sha256: str
    versions: Mapping[str, str]
    seeds: Mapping[str, int]
    duration: float


@dataclass(frozen=True)
class VehicleSection:
    """The vehicle of the study.

    Attributes
    ----------
    kind : str
        ``"half_car"``, ``"quarter_car"`` or ``"full_car"``.
    parameters : DataFrame
        Columns ``parameter`` (field name), ``symbol`` (as in the source paper, "" if it has none), ``value``, ``unit``.
    static_loads : DataFrame
        Columns ``wheel``, ``load_N``.
    speed : float
        Vehicle speed (m/s).
    lags : mapping of str to float
        Lag (s) of every road input behind the front one.
    inputs, outputs : tuple of str
        All signals of the plant.
    """

    kind: str
    parameters: pd.DataFrame
    static_loads: pd.DataFrame
    speed: float
    lags: Mapping[str, float]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Design:
    """A controller that the study looks at.

    Attributes
    ----------
    key : str
        Short identifier, ``[a-z0-9_]+``; ``"passive"`` for the car without control.
    label : str
        Name for tables and legends.
    role : {"passive", "published", "tuned"}
        Without control, given in the study file, or found by this run.
    channels : tuple of FeedbackChannel
        Empty for the passive car.
    reference : str
        Where the design comes from.
    """

    key: str
    label: str
    role: Role
    channels: tuple[FeedbackChannel, ...]
    reference: str = ""


@dataclass(frozen=True)
class FrequencySection:
    """Frequency responses with exact delays.

    The road acts on all wheels: unit amplitude at the front, the same road later at the others by `lags` ("lagged"),
    or on all wheels at once ("in phase").

    Attributes
    ----------
    omega : ndarray, shape (n,)
        Angular frequency (rad/s), increasing.
    lags : mapping of str to float
        Lag (s) of every road input in the "lagged" responses.
    outputs : tuple of str
        Outputs of `bode`.
    bode : mapping of design key to complex ndarray, shape (len(outputs), n)
        Response to road *displacement*, lagged: unit of the output per metre.
    curve_outputs : tuple of str
        Outputs of the two curves of eq. (6), in the order heave, pitch.
    velocity_gain : mapping of design key to ndarray, shape (len(curve_outputs), n)
        |H| per road *velocity*, lagged: w |X_c/X_gf| (1/s) and w |phi/X_gf| (rad/(m s)).
    velocity_gain_in_phase : mapping of design key to ndarray, or None
        The same with all wheels in phase; None for a vehicle with a single road input.
    curve_designs : tuple of str
        Keys of the designs in the paper's figure of |H| (Fig. 2) and the tuned ones, in order; `bode` and
        `velocity_gain` hold all of them.
    peaks : DataFrame
        One row per design, output and phase: ``design, output, road`` ("lagged" | "in phase"),
        ``omega_rad_per_s, frequency_Hz, gain, unit``: the highest point of |H| per road velocity.
    """

    omega: FloatArray
    lags: Mapping[str, float]
    outputs: tuple[str, ...]
    bode: Mapping[str, ComplexArray]
    curve_outputs: tuple[str, ...]
    velocity_gain: Mapping[str, FloatArray]
    velocity_gain_in_phase: Mapping[str, FloatArray] | None
    curve_designs: tuple[str, ...]
    peaks: pd.DataFrame


@dataclass(frozen=True)
class TuningRun:
    """One search for gains and delays.

    Attributes
    ----------
    key : str
        Key of the design found.
    label : str
        Its label.
    objective : str
        ``"harmonic"``, ``"band_mean"``, ``"band_peak"`` or ``"road_rms"``.
    objective_text : str
        The objective in one sentence, with its numbers.
    unit : str
        Unit of J, "" where terms of different units are added.
    settings : mapping of str to object
        ``particles, iterations, topology, seed`` as used.
    bounds : DataFrame
        Columns ``parameter, lower, upper, unit, found``, one row per searched number.
    history : DataFrame
        At least ``iteration, best, mean`` (J of the best so far, mean J of the feasible particles).
    value : float
        J of the design found.
    swarm_value : float
        J of the best particle, before the local polish that ends the search.
    comparison : DataFrame
        Columns ``design, role, objective_value, ratio_to_passive``; passive, published and tuned designs.
    closed_form : DataFrame or None
        For a single frequency: the exact optima of J = 0 inside the bounds, one row per channel and solution, columns
        ``measured, actuator, gain, delay_s, found_gain, found_delay_s, gain_difference, delay_difference_s, is_found``
        (`is_found`: this is the one that the search arrived at).
    detuning : DataFrame or None
        For a single frequency: J of the designs around it, columns ``frequency_factor, omega_rad_per_s`` and one
        column of J per design key (passive, published for the same purpose, tuned).
    message : str
        What the optimiser said.
    """

    key: str
    label: str
    objective: str
    objective_text: str
    unit: str
    settings: Mapping[str, object]
    bounds: pd.DataFrame
    history: pd.DataFrame
    value: float
    swarm_value: float
    comparison: pd.DataFrame
    closed_form: pd.DataFrame | None
    detuning: pd.DataFrame | None
    message: str


@dataclass(frozen=True)
class TimeCase:
    """Simulation on one road.

    Attributes
    ----------
    key : str
        ``"harmonic"``, ``"random"``, ...
    label : str
        The case in words.
    road_text : str
        The road in one sentence, with its numbers.
    timepts : ndarray, shape (n,)
        Report instants (s), from 0, equally spaced by `report_step_s`. RMS values are taken on the finer `step_s`.
    road_profiles : mapping of road input to ndarray, shape (n,)
        Road elevation (m) under each wheel.
    outputs : tuple of str
        Outputs of the histories: the six of the paper.
    designs : tuple of str
        Keys of the designs simulated, passive first.
    histories : mapping (design key, method) to ndarray, shape (len(outputs), n)
        `method` is ``"exact"`` or ``"pade"``; the passive car has no delay and only ``"exact"``.
    pade_orders : mapping of design key to tuple of int
        Padé order per channel.
    rms : DataFrame
        Long form: ``indicator`` (output name), ``unit, design, role, method`` ("exact" | "pade" | "stationary"),
        ``value, change_percent`` (against the passive car by the same method; "exact" for "pade"; nan for passive).
        ``"stationary"`` is the value without simulation: phasors for a harmonic road, integral over the PSD for a
        random one; it has no transient and no sampling error.
    indices : DataFrame
        All ride indices of `ride_indices` from the exact histories: ``indicator, unit, design, value``.
    printed : DataFrame or None
        The numbers the source prints: ``indicator, design`` (key), ``value``.
    pade_difference : DataFrame
        Padé against exact over the whole record: ``design, output, unit, max_difference, relative_to_peak``.
    """

    key: str
    label: str
    road_text: str
    timepts: FloatArray
    road_profiles: Mapping[str, FloatArray]
    outputs: tuple[str, ...]
    designs: tuple[str, ...]
    histories: Mapping[tuple[str, str], FloatArray]
    pade_orders: Mapping[str, tuple[int, ...]]
    rms: pd.DataFrame
    indices: pd.DataFrame
    printed: pd.DataFrame | None
    pade_difference: pd.DataFrame


@dataclass(frozen=True)
class AuditSection:
    """Published numbers against computed ones.

    Attributes
    ----------
    table : DataFrame
        One row per printed number: ``item`` ("Table 2", "eq. (15)", ...), ``where`` (row and column, in words),
        ``published`` (float), ``printed`` (str, as the source prints it), ``computed`` (float; nan if there is none),
        ``unit, relative_difference`` (computed/published - 1; nan if undefined), ``verdict`` (an `AuditVerdict`),
        ``evidence`` (one or two sentences). Complex numbers take two rows (real and imaginary part).
    roots : DataFrame or None
        Eq. (15) side by side: ``printed_real, printed_imaginary, misprint_real, misprint_imaginary`` (spectrum of the
        misprinted matrix), ``true_real, true_imaginary`` (eq. (1) with the published gains, no delay), paired by
        closeness; imaginary >= 0.
    substitutions : DataFrame or None
        The misprints that explain eq. (15): ``matrix, row, column, correct, printed, correct_value, printed_value``.
    summary : DataFrame
        Columns ``item, reproduced, not_reproduced, explained`` (counts), last row "all".
    """

    table: pd.DataFrame
    roots: pd.DataFrame | None
    substitutions: pd.DataFrame | None
    summary: pd.DataFrame


@dataclass(frozen=True)
class StudyRun:
    """Everything that one run of a study computed.

    Attributes
    ----------
    study : Study
        The settings.
    provenance : Provenance
    vehicle : VehicleSection
    designs : tuple of Design
        Passive first, then published, then tuned.
    signal_units : mapping of str to str
        Unit of every plant signal, such as ``"m/s2"``.
    frequency, tuning, stability, time, pade, audit, stability_maps
        The sections; None (or an empty tuple) where the study file has none.
    headlines : tuple of str
        The three lines a person most wants to know, as plain sentences.
    pade_verdicts : DataFrame or None
        What Padé says about stability, beside the truth: ``design, order, pade_says`` ("stable" | "unstable"),
        ``pade_abscissa`` (1/s, rightmost eigenvalue), ``exact`` ("stable" | "unstable" | "undecided"),
        ``exact_abscissa, right`` (whether the two agree).
    """

    study: Study
    provenance: Provenance
    vehicle: VehicleSection
    designs: tuple[Design, ...]
    signal_units: Mapping[str, str]
    frequency: FrequencySection | None
    tuning: tuple[TuningRun, ...]
    stability: StabilitySection | None
    time: tuple[TimeCase, ...]
    pade: tuple[PadeCase, ...]
    audit: AuditSection | None
    headlines: tuple[str, ...]
    pade_verdicts: pd.DataFrame | None = None
    stability_maps: tuple[StabilityMapCase, ...] = ()

    def design(self, key: str) -> Design:
        """Return the design with this key; KeyError if there is none."""
        return {design.key: design for design in self.designs}[key]

    @property
    def undecided(self) -> bool:
        """Whether the verdict on any design is open."""
        if self.stability is None:
            return False
        return bool((self.stability.verdicts["verdict"] == "undecided").any())
