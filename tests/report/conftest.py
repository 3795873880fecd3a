"""A study run made of plain arrays: what the report shows is known here without any computation."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from susp_ctrl.delay_systems import DelayIndependence, DelaySweep, FeedbackChannel
from susp_ctrl.delay_systems.crossings import DelayLine
from susp_ctrl.delay_systems.model import CharacteristicMatrix
from susp_ctrl.report.study_result import StudyResult
from susp_ctrl.study import Study
from susp_ctrl.study.results.delay_stability import BoxProof, StabilitySection, SweptLine
from susp_ctrl.study.results.study_run import (
    AuditSection,
    Design,
    FrequencySection,
    PadeCase,
    Provenance,
    StudyRun,
    TimeCase,
    TuningRun,
    VehicleSection,
)

OUTPUTS = (
    "body_acceleration",
    "pitch_acceleration",
    "suspension_deflection_front",
    "suspension_deflection_rear",
    "tire_deflection_front",
    "tire_deflection_rear",
)
UNITS = dict(zip(OUTPUTS, ("m/s2", "rad/s2", "m", "m", "m", "m"), strict=True)) | {
    "unsprung_displacement_front": "m",
    "unsprung_displacement_rear": "m",
}
KEYS = ("passive", "first_published", "second_published", "first_tuned", "second_tuned")
LABELS = ("passive", "published, harmonic", "published, random", "tuned, harmonic", "tuned, random")
ROLES = ("passive", "published", "published", "tuned", "tuned")
STUDY = {
    "name": "synthetic",
    "title": "A study with $signs$, #marks and *stars* – süß",
    "source": "A. Author, B. Author, Journal, 2020",
    "description": "Made of plain arrays.",
}


def make_run(*, verdict: str = "stable", points: int = 401, step: float = 0.05) -> StudyRun:
    designs = tuple(
        Design(key, label, role, () if role == "passive" else _channels(n), "section 3")
        for n, (key, label, role) in enumerate(zip(KEYS, LABELS, ROLES, strict=True))
    )
    return StudyRun(
        study=Study.from_table(STUDY, "synthetic.toml", "ab" * 32),
        provenance=Provenance(
            "synthetic.toml", "ab" * 32, {"python": "3.11.7", "susp_ctrl": "0.1.0"}, {"first_tuned": 1}, 12.5
        ),
        vehicle=_vehicle(),
        designs=designs,
        signal_units=UNITS,
        frequency=_frequency(),
        tuning=(_tuning("first_tuned", LABELS[3]), _tuning("second_tuned", LABELS[4])),
        stability=_stability(verdict),
        time=(_time("harmonic", points, step), _time("random", points, step)),
        pade=tuple(_pade(key) for key in KEYS[1:3]),
        audit=_audit(),
        headlines=("First line.", "Second line.", "Third line."),
    )


@pytest.fixture(scope="module")
def run() -> StudyRun:
    return make_run()


@pytest.fixture(scope="module")
def result(run: StudyRun) -> StudyResult:
    return StudyResult(run)


@pytest.fixture(scope="session")
def make() -> object:
    return make_run


def _channels(n: int) -> tuple[FeedbackChannel, ...]:
    return (
        FeedbackChannel("unsprung_displacement_front", "force_front", 10000.0 * n, 0.1 * n),
        FeedbackChannel("unsprung_displacement_rear", "force_rear", -4416.0 * n, 0.05 * n),
    )


def _vehicle() -> VehicleSection:
    rows = [
        ("body_mass", "m", 690.0, "kg"),
        ("tire_stiffness_front", "ktf", 192000.0, "N/m"),
        ("axle", "", 1.25, "m"),
    ]
    return VehicleSection(
        "half_car",
        pd.DataFrame(rows, columns=["parameter", "symbol", "value", "unit"]),
        pd.DataFrame({"wheel": ["front", "rear"], "load_N": [4100.6, 3511.0]}),
        20.0,
        {"road_front": 0.0, "road_rear": 0.138},
        ("road_front", "road_rear"),
        OUTPUTS,
    )


def _frequency() -> FrequencySection:
    omega = np.geomspace(0.5, 150.0, 300)
    peak = {key: 1.0 / (1.0 + (n + 1) * 0.2j - (omega / (6.0 + n)) ** 2) for n, key in enumerate(KEYS)}
    rows = [(key, output, "lagged", 7.42, 1.181, 3.2, "1/s") for key in KEYS for output in OUTPUTS[:2]]
    return FrequencySection(
        omega=omega,
        lags={"road_front": 0.0, "road_rear": 0.138},
        outputs=OUTPUTS,
        bode={key: np.outer(np.arange(1.0, 7.0), omega**2 * h) for key, h in peak.items()},
        curve_outputs=OUTPUTS[:2],
        velocity_gain={key: np.abs(np.outer((1.0, 0.5), omega * h)) for key, h in peak.items()},
        velocity_gain_in_phase={key: np.abs(np.outer((0.9, 0.4), omega * h)) for key, h in peak.items()},
        curve_designs=KEYS,
        peaks=pd.DataFrame(
            rows, columns=["design", "output", "road", "omega_rad_per_s", "frequency_Hz", "gain", "unit"]
        ),
    )


def _tuning(key: str, label: str) -> TuningRun:
    names = ["gain of force_front", "gain of force_rear", "delay of force_front", "delay of force_rear"]
    found = [19981.2429123, 24377.2448, 0.3697571, 0.3851852]
    exact = {"measured": "unsprung_displacement_front", "actuator": "force_front"}
    factor = np.linspace(0.9, 1.1, 41)
    return TuningRun(
        key=key,
        label=label,
        objective="harmonic",
        objective_text="J at 7 rad/s.",
        unit="",
        settings={"particles": 60, "iterations": 200, "topology": "ring", "seed": 1},
        bounds=pd.DataFrame(
            {
                "parameter": names,
                "lower": [-34000.0, -44000.0, 0.001, 0.001],
                "upper": [34000.0, 44000.0, 1.0, 1.0],
                "unit": ["N/m", "N/m", "s", "s"],
                "found": found,
            }
        ),
        history=pd.DataFrame(
            {
                "iteration": np.arange(200),
                "best": 10.0 * np.exp(-0.1 * np.arange(200.0)),
                "mean": 12.0 * np.exp(-0.05 * np.arange(200.0)),
            }
        ),
        value=1e-9,
        swarm_value=5e-5,
        comparison=pd.DataFrame(
            {
                "design": KEYS,
                "role": ROLES,
                "objective_value": [10.79, 7.93, 9.1, 1e-13, 5.0],
                "ratio_to_passive": [1.0, 0.735, 0.843, 9e-15, 0.46],
            }
        ),
        closed_form=pd.DataFrame(
            [
                {
                    **exact,
                    "gain": 19981.24,
                    "delay_s": 0.369757,
                    "found_gain": 19981.24,
                    "found_delay_s": 0.369757,
                    "gain_difference": 1e-6,
                    "delay_difference_s": 1e-12,
                    "is_found": True,
                },
                {**exact, "gain": -19981.24, "delay_s": 0.818556, "is_found": False},
            ]
        ),
        detuning=pd.DataFrame(
            {"frequency_factor": factor, "omega_rad_per_s": 7.0 * factor}
            | {
                name: scale * np.abs(factor - 1.0)
                for name, scale in zip(KEYS[:4], (10.0, 8.0, 7.0, 30.0), strict=True)
            }
        ),
        message="Converged.",
    )


def _line(design: str, line: str, label: str, parameter: str) -> SweptLine:
    one = np.ones(1)
    loop = CharacteristicMatrix(-one[None], one[None], -2.0 * one[None], 0.0 * one[None], one)
    columns = ["tau_from", "tau_to", "unstable_roots"]
    sweep = DelaySweep(
        direction=one,
        start=0.0 * one,
        up_to=2.0,
        crossings=pd.DataFrame({"tau": [0.7, 1.2], "omega": [7.0, 9.0], "tendency": [1, -1]}),
        intervals=pd.DataFrame([(0.0, 0.7, 0), (0.7, 1.2, 2), (1.2, 2.0, 0)], columns=columns),
        delay_margin=0.7,
        decided=True,
        proven=True,
        axis_roots=(),
        method="made up",
        message="made up",
        line=DelayLine(loop, 0.0 * one, one, 2.0, 1.0, one, 0.0),
    )
    return SweptLine(design, line, label, 0.55, parameter, sweep)


def _stability(verdict: str) -> StabilitySection:
    lines = tuple(
        _line(key, line, label, parameter)
        for key in KEYS[1:]
        for line, label, parameter in (
            ("equal", "both delays equal", "delay (s)"),
            ("ray", "along the design's own delays", "multiple of the design's delays"),
            ("tau2", "rear delay alone", "delay (s)"),
        )
    )
    verdicts = pd.DataFrame(
        [
            {
                "design": key,
                "role": role,
                "verdict": verdict if n == 1 else "stable",
                "abscissa": -1.17254 - n,
                "abscissa_omega": 8.54527,
                "unstable_roots": 0,
                "delay_independent": "proven",
                "agreement": "roots 0, argument principle 0, sweep 0",
                "reason": "",
            }
            for n, (key, role) in enumerate(zip(KEYS, ROLES, strict=True))
        ]
    )
    roots = pd.DataFrame(
        [(key, -1.17254 - n, 8.54527 * (n + 1), 0.136, 1.36 * (n + 1)) for key in KEYS for n in range(4)],
        columns=["design", "real", "imaginary", "damping_ratio", "frequency_Hz"],
    )
    pair = {"measured": ["unsprung_displacement_front"], "actuator": ["force_front"]}
    omega = np.geomspace(0.5, 150.0, 200)
    proof = BoxProof(
        gains=pd.DataFrame(pair | {"gain": [34000.0], "unit": ["N/m"]}),
        corner=DelayIndependence(True, 1.0 / 0.4426, 8.82, 0.4441, 8.82, True, None, "made up"),
        single_channel=pd.DataFrame(
            pair | {"gain_threshold": [103229.0], "omega_rad_per_s": [65.64], "unit": ["N/m"]}
        ),
        curve=pd.DataFrame({"omega": omega, "radius": 0.4441 * np.exp(-(np.log(omega / 8.82) ** 2))}),
    )
    return StabilitySection(verdicts, roots, lines, proof)


def _time(key: str, points: int, step: float) -> TimeCase:
    timepts = step * np.arange(points)
    designs = (KEYS[0], KEYS[1], KEYS[3])
    histories, rms, printed = {}, [], []
    for n, design in enumerate(designs):
        values = np.array([(1.0 - 0.2 * n) * np.sin((7.0 + k) * timepts) for k in range(6)])
        histories[design, "exact"] = values
        if n:
            histories[design, "pade"] = values + 1e-3
        for k, output in enumerate(OUTPUTS):
            for method in ("exact", "pade", "stationary")[:: 1 if n else 2]:
                value = (3.0647 if k < 2 else 0.0383) * (1.0 - 0.282 * n)
                change = -28.2 * n if n else np.nan
                rms.append((output, UNITS[output], design, ROLES[KEYS.index(design)], method, value, change))
            if n < 2:
                printed.append((output, design, 0.5026))
    columns = ["indicator", "unit", "design", "role", "method", "value", "change_percent"]
    indices = [
        (output, UNITS[output], design, 1.0 + n) for n, design in enumerate(designs) for output in OUTPUTS
    ]
    return TimeCase(
        key=key,
        label=f"{key} road",
        road_text=f"A {key} road, 0.05 m at 7 rad/s.",
        timepts=timepts,
        road_profiles={
            "road_front": 0.05 * np.sin(7 * timepts),
            "road_rear": 0.05 * np.sin(7 * timepts - 1.0),
        },
        outputs=OUTPUTS,
        designs=designs,
        histories=histories,
        pade_orders={KEYS[1]: (12, 14), KEYS[3]: (10, 10)},
        rms=pd.DataFrame(rms, columns=columns),
        indices=pd.DataFrame(indices, columns=["indicator", "unit", "design", "value"]),
        printed=pd.DataFrame(printed, columns=["indicator", "design", "value"]),
        pade_difference=pd.DataFrame(
            [(design, output, UNITS[output], 1e-3, 2e-3) for design in designs[1:] for output in OUTPUTS],
            columns=["design", "output", "unit", "max_difference", "relative_to_peak"],
        ),
    )


def _pade(key: str) -> PadeCase:
    orders = np.array([2, 3, 5, 8, 12, 20, 30])
    return PadeCase(
        design=key,
        time_case="random",
        table=pd.DataFrame(
            {
                "order": orders,
                "frequency_error": 10.0 ** (-orders / 4.0),
                "root_error": 10.0 ** (-orders / 3.0),
                "time_error": 10.0 ** (-orders / 5.0),
                "rms_error": 10.0 ** (-orders / 6.0),
                "stable": ["unstable", *["stable"] * 6],
            }
        ),
        band=(0.5, 100.0),
        recommended_order=(20, 21),
    )


def _audit() -> AuditSection:
    evidence = (
        "No variant of the road phase of eq. (1) gives the printed column.",
        "With the misprinted matrix the printed number comes out to all its digits.",
    )
    rows = [
        {
            "item": "Table 2" if n < 24 else "eq. (15)",
            "where": f"body acceleration, number {n}",
            "published": 3.0647 + n,
            "printed": f"{3.0647 + n:.4f}",
            "computed": 3.6408 + n,
            "unit": "m/s2",
            "relative_difference": 3.6408 / 3.0647 - 1.0,
            "verdict": "not reproduced" if n < 24 else "explained by a named misprint",
            "evidence": evidence[n // 24],
        }
        for n in range(40)
    ]
    roots = {
        f"{kind}_{part}": [-1.5, -2.5]
        for kind in ("printed", "misprint", "true")
        for part in ("real", "imaginary")
    }
    return AuditSection(
        table=pd.DataFrame(rows),
        roots=pd.DataFrame(roots),
        substitutions=pd.DataFrame(
            [("A", 2, 2, "−csf/mtf", "−(csf+csr)/mtf", -37.037, -74.074)],
            columns=["matrix", "row", "column", "correct", "printed", "correct_value", "printed_value"],
        ),
        summary=pd.DataFrame(
            [("Table 2", 0, 24, 0), ("eq. (15)", 0, 0, 16), ("all", 0, 24, 16)],
            columns=["item", "reproduced", "not_reproduced", "explained"],
        ),
    )
