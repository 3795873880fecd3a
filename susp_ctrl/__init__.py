"""Linear systems closed through delayed feedback: exact responses, stability verdicts, tuning, ride.

``import susp_ctrl as sc`` gives every public name below. The names are resolved on first use (PEP 562), so
that a bare import loads neither python-control nor pandas nor matplotlib.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PUBLIC: dict[str, tuple[str, ...]] = {
    "susp_ctrl.errors": (
        "InputError",
        "NeutralLoopError",
        "UndecidedStabilityWarning",
        "TooMuchWorkError",
        "UnstableSystemError",
        "PadeOrderWarning",
    ),
    "susp_ctrl.vehicle": ("QuarterCar", "HalfCar", "FullCar", "Seat", "vehicle_preset"),
    "susp_ctrl.road": (
        "HarmonicRoad",
        "RandomRoad",
        "BumpRoad",
        "MeasuredRoad",
        "FilteredNoiseRoad",
        "TwoTrackRoad",
    ),
    "susp_ctrl.ride": (
        "ride_indices",
        "stationary_rms",
        "response_psd",
        "compare_indices",
        "iso2631_weighting",
        "weighted_history",
        "comfort_bands",
    ),
    "susp_ctrl.delay_systems": (
        "DelayLTI",
        "FeedbackChannel",
        "close_loop",
        "open_loop",
        "delay",
        "feedback",
        "series",
        "parallel",
        "append",
        "characteristic_roots",
        "spectral_abscissa",
        "count_unstable_roots",
        "stability",
        "prove_stability",
        "sweep_delays",
        "delay_independent_stability",
        "stability_map",
        "h2_norm",
        "hinf_norm",
        "output_rms",
        "simulate",
        "simulate_many",
        "steady_response",
        "compare_pade",
        "pade_order",
        "spectral_approximation",
        "stability_margins",
        "disk_margin",
        "root_locus",
    ),
    "susp_ctrl.tuning": (
        "pso",
        "tune",
        "TuningProblem",
        "Limit",
        "pareto_front",
        "SpectralAbscissa",
        "Harmonic",
        "BandMean",
        "BandPeak",
        "RoadRms",
    ),
    "susp_ctrl.study": (
        "load_study",
        "sweep",
        "Grid",
        "LatinHypercube",
        "MonteCarlo",
        "Range",
        "Tolerance",
        "Factor",
    ),
    "susp_ctrl.report": ("run_study",),
}

_ROOM_OF = {name: room for room, names in _PUBLIC.items() for name in names}

__all__ = ["__version__", *sorted(_ROOM_OF)]


def __getattr__(name: str) -> Any:
    try:
        room = _ROOM_OF[name]
    except KeyError:
        raise AttributeError(f"module 'susp_ctrl' has no attribute {name!r}") from None
    value = getattr(import_module(room), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_ROOM_OF})
