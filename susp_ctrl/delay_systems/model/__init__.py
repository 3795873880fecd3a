"""The system itself: its data, its response at any point, arithmetic, and the loop as algorithms see it."""

from susp_ctrl.delay_systems.model.characteristic import (
    CharacteristicMatrix,
    Modes,
    Points,
    distance_to_far_right,
)
from susp_ctrl.delay_systems.model.folding import FoldedLoop, direct_paths, fold, loop_rate
from susp_ctrl.delay_systems.model.lft import (
    Realization,
    SampledPlant,
    around_resonances,
    closed,
    inverses,
    lft_response,
    loop_response,
    return_determinant,
    return_solve,
    sample_plant,
)
from susp_ctrl.delay_systems.model.perron import perron_bound, scaled_row_sums
from susp_ctrl.delay_systems.model.realizations import state_space
from susp_ctrl.delay_systems.model.rounding import (
    balancing,
    distance_to_singular,
    eigenvalues_with_uncertainty,
)
from susp_ctrl.delay_systems.model.signal_names import name_list, names_together
from susp_ctrl.delay_systems.model.system import DelaySystem
from susp_ctrl.delay_systems.model.system_matrix import DelayPolynomials, SystemMatrix
