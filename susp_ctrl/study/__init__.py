"""Studies: a TOML file to typed settings, and running it to one data object. Knows neither PDF nor terminal."""

from __future__ import annotations

from susp_ctrl.study.run import compute_study
from susp_ctrl.study.settings.study_file import Study, load_study
from susp_ctrl.study.settings.variation import Factor, Range, Tolerance
from susp_ctrl.study.variants.parameter_sweep import sweep
from susp_ctrl.study.variants.sampling_plan import Grid, LatinHypercube, MonteCarlo
from susp_ctrl.study.variants.sweep_result import SweepResult

__all__ = [
    "Factor",
    "Grid",
    "LatinHypercube",
    "MonteCarlo",
    "Range",
    "Study",
    "SweepResult",
    "Tolerance",
    "compute_study",
    "load_study",
    "sweep",
]
