"""How many unstable roots there are over two delays, two gains, or a gain and a delay."""

from susp_ctrl.delay_systems.maps.regions import MapRegions, Raster
from susp_ctrl.delay_systems.maps.segments import Segments
from susp_ctrl.delay_systems.maps.stability_chart import StabilityMap
from susp_ctrl.delay_systems.maps.two_delay_map import stability_map
