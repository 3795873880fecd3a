"""Studies: a TOML file to typed settings, and running it to one data object. Knows neither PDF nor terminal."""

from __future__ import annotations

from susp_ctrl.study.run import compute_study
from susp_ctrl.study.settings import Factor, Range, Study, Tolerance, load_study
from susp_ctrl.study.variants import Grid, LatinHypercube, MonteCarlo, SweepResult, sweep
