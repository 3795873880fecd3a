"""The marches: from inputs and past to states and outputs, delays exact."""

from susp_ctrl.delay_systems.integrators.input_signals import (
    LOOKS,
    Inputs,
    announced_breakpoints,
    as_inputs,
    looking_times,
)
from susp_ctrl.delay_systems.integrators.trajectory import (
    Past,
    Run,
    side_by_side,
    superposed,
    with_last_instant,
)
from susp_ctrl.delay_systems.integrators.uniform_march import TooCoarseError
