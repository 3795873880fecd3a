"""What becomes of the study in many variants: plan, processes, journal, table."""

from susp_ctrl.study.variants.parameter_sweep import sweep
from susp_ctrl.study.variants.sampling_plan import Grid, LatinHypercube, MonteCarlo
from susp_ctrl.study.variants.sweep_result import SweepResult
