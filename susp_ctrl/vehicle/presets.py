"""Published vehicles by name, each with its source."""

from __future__ import annotations

from dataclasses import dataclass

from susp_ctrl import validation
from susp_ctrl.vehicle.full_car import FullCar
from susp_ctrl.vehicle.half_car import HalfCar
from susp_ctrl.vehicle.quarter_car import QuarterCar

_GOLDEN_BODY_MASS = 250.0  # kg; the golden car is defined per sprung mass, so any value moves alike


@dataclass(frozen=True)
class VehiclePreset:
    """A vehicle and where its numbers come from."""

    vehicle: QuarterCar | HalfCar | FullCar
    source: str


VEHICLE_PRESETS = {
    "wu_ren_2020": VehiclePreset(
        HalfCar(),
        "K. Wu, C. Ren, Control and Stability Analysis of Double Time-Delay Active Suspension Based on Particle "
        "Swarm Optimization, Shock and Vibration, 2020, Table 1",
    ),
    "golden_car": VehiclePreset(
        QuarterCar(
            body_mass=_GOLDEN_BODY_MASS,
            unsprung_mass=0.15 * _GOLDEN_BODY_MASS,
            tire_stiffness=653.0 * _GOLDEN_BODY_MASS,
            spring_stiffness=63.3 * _GOLDEN_BODY_MASS,
            damping=6.0 * _GOLDEN_BODY_MASS,
        ),
        "M. W. Sayers, S. M. Karamihas, The Little Book of Profiling, University of Michigan, 1998: the reference "
        "quarter car of the international roughness index, per sprung mass",
    ),
    "mathworks_active_suspension": VehiclePreset(
        QuarterCar(
            body_mass=300.0,
            unsprung_mass=60.0,
            tire_stiffness=190e3,
            spring_stiffness=16e3,
            damping=1000.0,
        ),
        "MathWorks, Robust Control Toolbox, example Robust Control of an Active Suspension",
    ),
}


def vehicle_preset(name: str) -> QuarterCar | HalfCar | FullCar:
    """Return a published vehicle.

    Parameters
    ----------
    name : str
        A key of ``susp_ctrl.vehicle.VEHICLE_PRESETS``, which also holds the sources: "wu_ren_2020" (half car),
        "golden_car", "mathworks_active_suspension" (quarter cars).

    Returns
    -------
    QuarterCar, HalfCar or FullCar

    Raises
    ------
    InputError
        If there is no such vehicle.

    Examples
    --------
    >>> vehicle_preset("golden_car").spring_stiffness / vehicle_preset("golden_car").body_mass
    63.3
    """
    return VEHICLE_PRESETS[validation.one_of("name", name, VEHICLE_PRESETS)].vehicle
