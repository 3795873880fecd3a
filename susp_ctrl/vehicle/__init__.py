"""Quarter, half and full car as plants with named signals: linear, about the static position.

Every vehicle is a chain of masses M q'' + C q' + K q = W u with road and actuator inputs u; gravity only
enters the static loads. The rooms of delays and roads are not known here.
"""

from __future__ import annotations

from susp_ctrl.vehicle.full_car import FullCar
from susp_ctrl.vehicle.half_car import HalfCar
from susp_ctrl.vehicle.mechanics import GRAVITY, Tire
from susp_ctrl.vehicle.presets import VEHICLE_PRESETS, VehiclePreset, vehicle_preset
from susp_ctrl.vehicle.quarter_car import QuarterCar
from susp_ctrl.vehicle.seat import Seat
