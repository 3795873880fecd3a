"""For which delays along a line a root crosses the imaginary axis, and at what frequency."""

from susp_ctrl.delay_systems.crossings.branch_and_bound import Work
from susp_ctrl.delay_systems.crossings.crossing_search import CrossingSearch
from susp_ctrl.delay_systems.crossings.delay_independence import (
    DelayIndependence,
    delay_independent_stability,
    small_gain_of_samples,
    small_gain_supremum,
)
from susp_ctrl.delay_systems.crossings.delay_line import DelayLine, roots_always_on_axis
from susp_ctrl.delay_systems.crossings.delay_sweep import DelaySweep
from susp_ctrl.delay_systems.crossings.frequency_sweep import sweep_delays
from susp_ctrl.delay_systems.crossings.small_gain import Bands, small_gain_bands
from susp_ctrl.delay_systems.crossings.torus import bilinear_coefficients, torus_excess, torus_solutions
