"""Arrays in, matplotlib axes out: the drawing functions and the one style they share.

Every function takes plain arrays in SI units and an optional ``ax``, draws into it and returns it. Frequencies
come in rad/s and are drawn in Hz. No function computes an engineering number and none changes the user's
matplotlib settings. Where the arrays come from is not known here.
"""

from __future__ import annotations

from susp_ctrl.plotting.comparison import draw_changes, draw_order_error
from susp_ctrl.plotting.delay_sweeps import draw_intervals, draw_unit_modulus
from susp_ctrl.plotting.files import save_figure
from susp_ctrl.plotting.frequency import draw_bode, draw_magnitude, frequency_axis
from susp_ctrl.plotting.histories import draw_history, draw_road
from susp_ctrl.plotting.regions import draw_stability_map, map_legend, map_picture
from susp_ctrl.plotting.roots import draw_root_locus, draw_roots
from susp_ctrl.plotting.search import draw_convergence, draw_detuning
from susp_ctrl.plotting.style import (
    axes_for,
    curve_style,
    new_figure,
    powers_of_ten,
    shared_legend,
    sparse_markers,
    styled,
    styles_for,
)
from susp_ctrl.plotting.trade_off import draw_trade_off
from susp_ctrl.plotting.variants import draw_distribution, draw_heat_map, draw_sensitivity

__all__ = [
    "axes_for",
    "curve_style",
    "draw_bode",
    "draw_changes",
    "draw_convergence",
    "draw_detuning",
    "draw_distribution",
    "draw_heat_map",
    "draw_history",
    "draw_intervals",
    "draw_magnitude",
    "draw_order_error",
    "draw_road",
    "draw_root_locus",
    "draw_roots",
    "draw_sensitivity",
    "draw_stability_map",
    "draw_trade_off",
    "draw_unit_modulus",
    "frequency_axis",
    "map_legend",
    "map_picture",
    "new_figure",
    "powers_of_ten",
    "save_figure",
    "shared_legend",
    "sparse_markers",
    "styled",
    "styles_for",
]
