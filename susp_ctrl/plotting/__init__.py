"""Arrays in, matplotlib axes out: the drawing functions and the one style they share.

Every function takes plain arrays in SI units and an optional ``ax``, draws into it and returns it. Frequencies
come in rad/s and are drawn in Hz. No function computes an engineering number and none changes the user's
matplotlib settings. Where the arrays come from is not known here.
"""

from __future__ import annotations

from susp_ctrl.plotting.comparison import draw_abscissa_over_order, draw_changes, draw_order_error
from susp_ctrl.plotting.delay_sweeps import draw_intervals, draw_unit_modulus
from susp_ctrl.plotting.figures import fresh_figure, lay_out, new_figure, panels, save_figure, shared_legend
from susp_ctrl.plotting.frequency import draw_bode, draw_magnitude, frequency_axis
from susp_ctrl.plotting.histories import draw_history, draw_road
from susp_ctrl.plotting.regions import draw_stability_map, map_legend, map_picture
from susp_ctrl.plotting.roots import draw_root_locus, draw_roots
from susp_ctrl.plotting.search import draw_convergence, draw_detuning, draw_trade_off
from susp_ctrl.plotting.style import axes_for, curve_style, powers_of_ten, sparse_markers, styled, styles_for
from susp_ctrl.plotting.variants import draw_distribution, draw_heat_map, draw_sensitivity
