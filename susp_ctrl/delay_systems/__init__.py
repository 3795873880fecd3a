"""Linear systems with exact delays: the class, closing loops, stability, simulation, norms.

This room knows nothing of vehicles, roads or files.
"""

from susp_ctrl.delay_systems.approximation import pade_approximation, pade_order, spectral_approximation
from susp_ctrl.delay_systems.channels import FeedbackChannel, close_loop, loop_plant, open_loop
from susp_ctrl.delay_systems.comparison import compare_pade
from susp_ctrl.delay_systems.connections import append, delay, feedback, parallel, series
from susp_ctrl.delay_systems.crossings import (
    DelayIndependence,
    DelaySweep,
    delay_independent_stability,
    small_gain_of_samples,
    small_gain_supremum,
    sweep_delays,
)
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.delay_systems.frequency import (
    DiskMargin,
    StabilityMargins,
    disk_margin,
    h2_norm,
    hinf_norm,
    integrate,
    output_rms,
    stability_margins,
)
from susp_ctrl.delay_systems.maps import StabilityMap, stability_map
from susp_ctrl.delay_systems.proof import StabilityProof, prove_stability
from susp_ctrl.delay_systems.roots import (
    RootLocus,
    characteristic_roots,
    count_roots_right_of,
    count_unstable_roots,
    root_locus,
    spectral_abscissa,
)
from susp_ctrl.delay_systems.simulation import SimulationResponse, simulate, simulate_many, steady_response
from susp_ctrl.delay_systems.verdict import VERDICT_WORDS, StabilityVerdict, VerdictWord, stability
