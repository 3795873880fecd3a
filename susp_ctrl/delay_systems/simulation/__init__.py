"""How the system responds in time: to any input, to steps and impulses, steadily to sines."""

from susp_ctrl.delay_systems.simulation.simulation_response import SimulationResponse
from susp_ctrl.delay_systems.simulation.sinusoidal import steady_response
from susp_ctrl.delay_systems.simulation.standard_responses import impulse_response, step_response
from susp_ctrl.delay_systems.simulation.time_response import simulate, simulate_many
