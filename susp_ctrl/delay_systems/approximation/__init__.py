"""What an ordinary state-space system would say: Padé and spectral approximations of the delays."""

from susp_ctrl.delay_systems.approximation.delay_bank import Orders
from susp_ctrl.delay_systems.approximation.order_choice import approximated
from susp_ctrl.delay_systems.approximation.pade import HIGHEST_ORDER, pade_approximation, pade_order
from susp_ctrl.delay_systems.approximation.spectral import (
    chebyshev_differentiation,
    discretized_matrix,
    spectral_approximation,
)
