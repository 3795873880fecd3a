"""Studies: a TOML file to typed settings, and running it to one data object. Knows neither PDF nor terminal."""

from __future__ import annotations

from susp_ctrl.study.run import compute_study
from susp_ctrl.study.study_file import Study, load_study

__all__ = ["Study", "compute_study", "load_study"]
