import numpy as np
import pytest

from susp_ctrl.errors import InputError
from susp_ctrl.vehicle import VEHICLE_PRESETS, HalfCar, vehicle_preset


def test_every_preset_names_its_source_and_is_stable():
    for name, preset in VEHICLE_PRESETS.items():
        assert vehicle_preset(name) is preset.vehicle
        assert len(preset.source) > 40
        assert np.max(preset.vehicle.plant().poles().real) < 0
    assert vehicle_preset("wu_ren_2020") == HalfCar()
    with pytest.raises(InputError, match="golden_car"):
        vehicle_preset("goldencar")


@pytest.mark.literature
def test_golden_car_answers_most_to_waves_of_16_and_2_4_metres():
    """Sayers and Karamihas: at 80 km/h the largest gains from profile slope to suspension speed per distance
    lie at wavelengths of about 16 m and 2.4 m, of about 1.5 and 1.65.
    """
    v = 80 / 3.6
    wavelength = np.geomspace(1.0, 40.0, 4000)
    omega = 2 * np.pi * v / wavelength
    plant = vehicle_preset("golden_car").plant()
    # the ratio of two rates is the ratio of the displacements
    gain = np.abs(plant(1j * omega)[plant.output_labels.index("suspension_deflection"), 0])
    peaks = np.flatnonzero((gain[1:-1] > gain[:-2]) & (gain[1:-1] > gain[2:])) + 1
    assert wavelength[peaks] == pytest.approx([2.4, 16.0], rel=0.05)
    assert gain[peaks] == pytest.approx([1.65, 1.5], rel=0.03)


@pytest.mark.literature
def test_invariant_frequencies_of_the_mathworks_car():
    """The example states a tire-hop frequency of 56.27 rad/s and a rattlespace frequency of 22.97 rad/s: there the
    actuator does not act on body acceleration and on suspension deflection.
    """
    plant = vehicle_preset("mathworks_active_suspension").plant()
    column = plant.input_labels.index("force")
    for output, frequency in (("body_acceleration", 56.27), ("suspension_deflection", 22.97)):
        row = plant.output_labels.index(output)
        near = np.abs(plant(1j * np.array([frequency, 0.8 * frequency]))[row, column])
        assert near[0] < 1e-3 * near[1]
