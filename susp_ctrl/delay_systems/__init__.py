"""Linear systems with exact delays: the class, closing loops, stability, simulation, norms.

This room knows nothing of vehicles, roads or files.
"""

from susp_ctrl.delay_systems.algebra import append, delay, feedback, parallel, series
from susp_ctrl.delay_systems.channels import FeedbackChannel, close_loop, loop_plant, open_loop
from susp_ctrl.delay_systems.comparison import compare_pade
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.delay_systems.pade import pade_approximation, pade_order

__all__ = [
    "DelayLTI",
    "FeedbackChannel",
    "append",
    "close_loop",
    "compare_pade",
    "delay",
    "feedback",
    "loop_plant",
    "open_loop",
    "pade_approximation",
    "pade_order",
    "parallel",
    "series",
]
