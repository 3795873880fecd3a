"""Linear systems with exact delays: the class, closing loops, stability, simulation, norms.

This room knows nothing of vehicles, roads or files.
"""

from susp_ctrl.delay_systems.approximation.pade import pade_approximation, pade_order
from susp_ctrl.delay_systems.approximation.spectral import spectral_approximation
from susp_ctrl.delay_systems.channels import FeedbackChannel, close_loop, loop_plant, open_loop
from susp_ctrl.delay_systems.comparison import compare_pade
from susp_ctrl.delay_systems.connections import append, delay, feedback, parallel, series
from susp_ctrl.delay_systems.crossings.delay_independence import (
    DelayIndependence,
    delay_independent_stability,
    small_gain_of_samples,
    small_gain_supremum,
)
from susp_ctrl.delay_systems.crossings.delay_sweep import DelaySweep
from susp_ctrl.delay_systems.crossings.frequency_sweep import sweep_delays
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.delay_systems.frequency.adaptive_quadrature import integrate
from susp_ctrl.delay_systems.frequency.margins import StabilityMargins, stability_margins
from susp_ctrl.delay_systems.frequency.norms import h2_norm, hinf_norm, output_rms
from susp_ctrl.delay_systems.maps.stability_chart import StabilityMap
from susp_ctrl.delay_systems.maps.two_delay_map import stability_map
from susp_ctrl.delay_systems.roots.argument_principle import count_roots_right_of, count_unstable_roots
from susp_ctrl.delay_systems.roots.rightmost import characteristic_roots, spectral_abscissa
from susp_ctrl.delay_systems.roots.root_loci import RootLocus, root_locus
from susp_ctrl.delay_systems.simulation.simulation_response import SimulationResponse
from susp_ctrl.delay_systems.simulation.sinusoidal import steady_response
from susp_ctrl.delay_systems.simulation.time_response import simulate, simulate_many
from susp_ctrl.delay_systems.verdict import VERDICT_WORDS, StabilityVerdict, stability

__all__ = [
    "VERDICT_WORDS",
    "DelayIndependence",
    "DelayLTI",
    "DelaySweep",
    "FeedbackChannel",
    "RootLocus",
    "SimulationResponse",
    "StabilityMap",
    "StabilityMargins",
    "StabilityVerdict",
    "append",
    "characteristic_roots",
    "close_loop",
    "compare_pade",
    "count_roots_right_of",
    "count_unstable_roots",
    "delay",
    "delay_independent_stability",
    "feedback",
    "h2_norm",
    "hinf_norm",
    "integrate",
    "loop_plant",
    "open_loop",
    "output_rms",
    "pade_approximation",
    "pade_order",
    "parallel",
    "root_locus",
    "series",
    "simulate",
    "simulate_many",
    "small_gain_of_samples",
    "small_gain_supremum",
    "spectral_abscissa",
    "spectral_approximation",
    "stability",
    "stability_map",
    "stability_margins",
    "steady_response",
    "sweep_delays",
]
