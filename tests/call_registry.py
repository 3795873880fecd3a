"""One valid call of every public callable, cheap enough to be made thousands of times with one argument spoilt.

A new public name has to be entered here: `tests/test_bad_arguments.py` compares the list with ``susp_ctrl.__all__``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import control as ct
import numpy as np

import susp_ctrl as sc

STUDY = Path(__file__).parents[1] / "studies" / "wu_ren_2020.toml"

Call = tuple[Callable[..., Any], dict[str, Any]]


def small_loop() -> sc.DelayLTI:
    """x' = -x - 0.5 x(t - 0.3) + u."""
    plant = ct.ss(-1.0, 1.0, 1.0, 0.0, inputs=["u"], outputs=["y"])
    return sc.close_loop(plant, sc.FeedbackChannel("y", "u", -0.5, 0.3))


@cache
def shared() -> dict[str, Any]:
    """What is made once."""
    loop, car = small_loop(), sc.QuarterCar()
    timepts = np.linspace(0.0, 1.0, 11)
    channel = sc.FeedbackChannel("y", "u", -0.5, 0.3)
    problem = sc.TuningProblem(
        ct.ss(-1.0, [[1.0, 1.0]], 1.0, 0.0, inputs=["d", "u"], outputs=["y"]),
        pairs=[("y", "u")],
        objective=sc.Harmonic(2.0, {"y": 1.0}),
        gain_bounds=[(-0.5, 0.5)],
        delay_bounds=[(0.01, 0.2)],
    )
    passive = sc.close_loop(car.plant(), ())
    response = sc.simulate(passive, timepts, 0.01)
    road = sc.RandomRoad(speed=20.0, bins=20)
    return {
        "loop": loop,
        "car": car,
        "plant": loop.plant,
        "channel": channel,
        "timepts": timepts,
        "problem": problem,
        "passive": passive,
        "response": response,
        "road": road,
        "study": sc.load_study(STUDY),
        "indices": sc.ride_indices(response),
    }


def calls() -> dict[str, Call]:
    """Return every public callable, and methods of the results, with arguments that are right."""
    s = shared()
    loop, t, omega = s["loop"], s["timepts"], np.array([0.5, 1.0, 2.0])
    open_plant = ct.ss(-1.0, 1.0, 1.0, 0.0, inputs=["u"], outputs=["y"])
    weights = {"y": 1.0}
    range_ = {"low": 0.5, "high": 1.5, "levels": 3, "distribution": "uniform"}
    factors = {"vehicle.body_mass": sc.Range(600.0, 700.0)}
    functions: dict[str, Call] = {
        "BandMean": (sc.BandMean, {"omega": omega, "weights": weights, "lags": None, "weighting": None}),
        "BandPeak": (sc.BandPeak, {"omega": omega, "weights": weights, "lags": None, "weighting": None}),
        "BumpRoad": (sc.BumpRoad, {"height": 0.05, "length": 1.0, "speed": 20.0}),
        "DelayLTI": (
            sc.DelayLTI,
            {"plant": s["plant"], "delays": [0.3], "gains": [0.5], "widths": [1], "inputs": ["u"],
             "outputs": ["y"], "states": ["x"], "name": "P"},
        ),
        "DelayLTI.from_state_delays": (
            sc.DelayLTI.from_state_delays,
            {"A": [[[-1.0]], [[-0.5]]], "delays": [0.3], "B": [[1.0]], "C": [[1.0]], "D": [[0.0]],
             "input_terms": [([[1.0]], 0.2)], "inputs": ["u"], "name": "P"},
        ),
        "Factor": (sc.Factor, {"keys": "vehicle.body_mass", "spread": sc.Range(600.0, 700.0), "name": "m"}),
        "FeedbackChannel": (
            sc.FeedbackChannel,
            {"measured": "y", "actuator": "u", "gain": 1.0, "delay": 0.1, "actuator_bandwidth": 50.0},
        ),
        "FilteredNoiseRoad": (
            sc.FilteredNoiseRoad,
            {"iso_class": "C", "speed": 20.0, "seed": 1, "length": 20.0, "lead": 1.0, "step": 0.05,
             "g_d": None, "n_cut": 0.011},
        ),
        "FullCar": (sc.FullCar, {"body_mass": 1380.0, "roll_inertia": 460.0}),
        "Grid": (sc.Grid, {"factors": factors}),
        "HalfCar": (sc.HalfCar, {"body_mass": 690.0, "pitch_inertia": 1200.0}),
        "Harmonic": (sc.Harmonic, {"omega": 7.0, "weights": weights, "lags": None, "weighting": None}),
        "HarmonicRoad": (sc.HarmonicRoad, {"amplitude": 0.01, "omega": 7.0, "steady": False}),
        "LatinHypercube": (sc.LatinHypercube, {"factors": factors, "samples": 5, "seed": 1}),
        "Limit": (sc.Limit, {"objective": sc.Harmonic(2.0, weights), "at_most": 1.0}),
        "MeasuredRoad": (
            sc.MeasuredRoad,
            {"distance": [0.0, 1.0, 2.0, 3.0], "elevation": [0.0, 0.01, 0.0, 0.0], "speed": 10.0,
             "interpolation": "cubic"},
        ),
        "MonteCarlo": (sc.MonteCarlo, {"factors": factors, "samples": 5, "seed": 1}),
        "QuarterCar": (sc.QuarterCar, {"body_mass": 377.5, "damping": 1500.0}),
        "RandomRoad": (
            sc.RandomRoad,
            {"iso_class": "C", "speed": 20.0, "seed": 1, "g_d": None, "waviness": 2.0, "n_min": 0.011,
             "n_max": 2.83, "bins": 20},
        ),
        "Range": (sc.Range, range_),
        "RoadRms": (
            sc.RoadRms,
            {"road": s["road"], "weights": weights, "lags": None, "points": 50, "weighting": None},
        ),
        "Seat": (sc.Seat, {"position": 0.5, "passenger_mass": 70.0, "stiffness": 1e4, "damping": 500.0}),
        "SpectralAbscissa": (sc.SpectralAbscissa, {"order": 10}),
        "Tolerance": (sc.Tolerance, {"low": -0.1, "high": 0.1, "levels": 3, "distribution": "uniform"}),
        "TuningProblem": (
            sc.TuningProblem,
            {"plant": ct.ss(-1.0, [[1.0, 1.0]], 1.0, 0.0, inputs=["d", "u"], outputs=["y"]),
             "pairs": [("y", "u")], "objective": sc.Harmonic(2.0, weights), "gain_bounds": [(-0.5, 0.5)],
             "delay_bounds": [(0.01, 0.2)]},
        ),
        "TwoTrackRoad": (
            sc.TwoTrackRoad, {"road": s["road"], "track_width": 1.5, "seed": 2, "omega_p": None}
        ),
        "append": (sc.append, {"first": loop}),
        "prove_stability": (sc.prove_stability, {"sys": loop, "right_of": 0.0, "precision": 64, "most_boxes": 20}),
        "characteristic_roots": (sc.characteristic_roots, {"sys": loop, "count": 3}),
        "close_loop": (sc.close_loop, {"plant": open_plant, "channels": s["channel"], "name": "L"}),
        "comfort_bands": (sc.comfort_bands, {"weighted_rms": 0.4}),
        "compare_indices": (sc.compare_indices, {"tables": {"a": s["indices"], "b": s["indices"]}}),
        "compare_pade": (sc.compare_pade, {"sys": loop, "orders": [2], "omega": omega}),
        "count_unstable_roots": (sc.count_unstable_roots, {"sys": loop}),
        "delay": (sc.delay, {"tau": 0.5, "inputs": "u", "outputs": "y", "name": "D"}),
        "delay_independent_stability": (sc.delay_independent_stability, {"sys": loop}),
        "disk_margin": (sc.disk_margin, {"sys": sc.delay(0.2) * open_plant, "skew": 0.5}),
        "feedback": (sc.feedback, {"sys1": loop, "sys2": 1, "sign": -1, "name": "F"}),
        "h2_norm": (sc.h2_norm, {"sys": loop, "tolerance": 1e-6}),
        "hinf_norm": (sc.hinf_norm, {"sys": loop, "tolerance": 1e-6}),
        "iso2631_weighting": (sc.iso2631_weighting, {"omega": omega, "weighting": "Wk"}),
        "load_study": (sc.load_study, {"path": STUDY}),
        "open_loop": (sc.open_loop, {"plant": open_plant, "channels": s["channel"], "name": "L"}),
        "output_rms": (
            sc.output_rms,
            {"sys": loop, "psd": lambda w: np.ones_like(w), "omega_range": (0.1, 10.0), "tolerance": 1e-6},
        ),
        "pade_order": (sc.pade_order, {"sys": loop, "omega_max": 10.0, "tolerance": 0.01}),
        "parallel": (sc.parallel, {"first": loop}),
        "pareto_front": (
            sc.pareto_front,
            {"problem": s["problem"], "against": sc.Harmonic(3.0, weights), "points": 2, "particles": 4,
             "iterations": 2, "seed": 1},
        ),
        "pso": (
            sc.pso,
            {"objective": lambda x: np.sum(x**2, axis=1), "lower": [-1.0], "upper": [1.0], "particles": 4,
             "iterations": 3, "topology": "ring", "seed": 1},
        ),
        "response_psd": (
            sc.response_psd,
            {"system": s["passive"], "road": s["road"], "omega": omega, "lags": None, "seat_position": None},
        ),
        "ride_indices": (
            sc.ride_indices,
            {"response": s["response"], "skip": 0.1, "vehicle": s["car"], "stroke_limit": 0.1},
        ),
        "root_locus": (
            sc.root_locus, {"sys": loop, "parameter": "gains", "values": [0.5, 1.0], "count": 3}
        ),
        "run_study": (sc.run_study, {"study": None, "progress": None}),
        "series": (sc.series, {"first": loop}),
        "simulate": (
            sc.simulate,
            {"sys": loop, "timepts": t, "inputs": 1.0, "method": "exact", "order": None, "history": 0.0,
             "hold": "linear", "breakpoints": [0.5], "rtol": 1e-6},
        ),
        "simulate_many": (
            sc.simulate_many,
            {"systems": [loop, loop], "timepts": t, "inputs": {"u": np.sin}, "history": 0.0, "hold": "linear",
             "breakpoints": [0.5], "rtol": 1e-6},
        ),
        "spectral_abscissa": (sc.spectral_abscissa, {"sys": loop}),
        "spectral_approximation": (sc.spectral_approximation, {"sys": loop, "order": 5}),
        "stability": (sc.stability, {"sys": loop}),
        "stability_map": (
            sc.stability_map, {"sys": loop, "tau1": (0.0, 1.0), "gain1": (-1.0, 1.0), "channels": (0, 0)}
        ),
        "stability_margins": (
            sc.stability_margins,
            {"sys": sc.delay(0.2) * open_plant, "omega_range": (0.1, 10.0), "channel": 0},
        ),
        "stationary_rms": (
            sc.stationary_rms,
            {"system": s["passive"], "road": s["road"], "lags": None, "vehicle": s["car"], "rtol": 1e-4},
        ),
        "steady_response": (
            sc.steady_response,
            {"sys": loop, "timepts": t, "inputs": sc.HarmonicRoad(0.01, 7.0, steady=True).inputs({"u": 0.0})},
        ),
        "sweep": (sc.sweep, {"study": None, "grid_or_samples": sc.Grid(factors), "workers": 1}),
        "sweep_delays": (sc.sweep_delays, {"sys": loop, "direction": [1.0], "start": [0.0], "up_to": 2.0}),
        "tune": (
            sc.tune, {"problem": s["problem"], "particles": 4, "iterations": 2, "seed": 1, "polish_starts": 1}
        ),
        "vehicle_preset": (sc.vehicle_preset, {"name": "wu_ren_2020"}),
        "weighted_history": (
            sc.weighted_history, {"values": np.sin(np.arange(50) / 5.0), "step": 0.01, "weighting": "Wk"}
        ),
    }  # fmt: skip
    methods: dict[str, Call] = {
        "DelayLTI()": (loop.__call__, {"x": 1j * omega, "squeeze": None}),
        "DelayLTI.pade": (loop.pade, {"order": 3, "omega_max": 1.0}),
        "DelayLTI.spectral": (loop.spectral, {"order": 3}),
        "DelayLTI.feedback": (loop.feedback, {"other": 1, "sign": -1}),
        "DelayLTI.append": (loop.append, {"other": loop}),
        "DelayLTI.poles": (loop.poles, {"count": 3}),
        "DelayLTI.zeros": (loop.zeros, {"count": 3}),
        "DelayLTI.with_delays": (loop.with_delays, {"delays": [0.1]}),
        "DelayLTI.with_gains": (loop.with_gains, {"gains": [0.1]}),
        "DelayLTI.with_names": (loop.with_names, {"name": "L"}),
        "DelayLTI[]": (loop.__getitem__, {"key": (0, 0)}),
        "DelayLTI+": (lambda other: loop + other, {"other": 1.0}),
        "DelayLTI*": (lambda other: loop * other, {"other": 1.0}),
        "DelayLTI/": (lambda other: loop / other, {"other": 2.0}),
    }
    return functions | methods
