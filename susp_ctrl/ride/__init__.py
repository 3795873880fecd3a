"""Ride comfort, road holding, working space and actuator effort, from a time or a frequency response.

`ride_indices` takes a simulated response, `stationary_rms` the exact frequency response and the spectrum of
the road; what both define, both name alike.
"""

from __future__ import annotations

from susp_ctrl.ride.comfort import comfort_bands
from susp_ctrl.ride.indicators import signal_unit
from susp_ctrl.ride.indices import compare_indices, ride_indices
from susp_ctrl.ride.spectra import response_psd
from susp_ctrl.ride.stationary import stationary_rms
from susp_ctrl.ride.weighting import iso2631_weighting, weighted_history
