"""How the system responds over frequency: band, margins, zeros, norms."""

from susp_ctrl.delay_systems.frequency.adaptive_quadrature import integrate
from susp_ctrl.delay_systems.frequency.disk_margins import DiskMargin, disk_margin
from susp_ctrl.delay_systems.frequency.frequency_range import default_frequencies
from susp_ctrl.delay_systems.frequency.margins import StabilityMargins, stability_margins
from susp_ctrl.delay_systems.frequency.norms import h2_norm, hinf_norm, output_rms
from susp_ctrl.delay_systems.frequency.zeros import transmission_zeros
