import numpy as np
import pytest

from susp_ctrl.delay_systems import FeedbackChannel, close_loop
from susp_ctrl.errors import InputError
from susp_ctrl.vehicle import FullCar, HalfCar, QuarterCar

OMEGA = np.geomspace(0.1, 400, 300)
WHEELS = ["front_left", "front_right", "rear_left", "rear_right"]


def response(plant):
    values = plant(1j * OMEGA)
    return {
        (y, u): values[i, k]
        for i, y in enumerate(plant.output_labels)
        for k, u in enumerate(plant.input_labels)
    }


def assert_equal_curves(found, expected, tolerance=1e-10):
    assert np.max(np.abs(found - expected)) < tolerance * np.max(np.abs(expected))


@pytest.mark.analytical
def test_quarter_car_equals_its_two_by_two_solution():
    mb, mt, kt, ks, cs = 320.0, 42.0, 180e3, 19e3, 1100.0
    car = QuarterCar(body_mass=mb, unsprung_mass=mt, tire_stiffness=kt, spring_stiffness=ks, damping=cs)
    found = response(car.plant())
    s = 1j * OMEGA
    k = ks + cs * s
    det = (mt * s**2 + kt + k) * (mb * s**2 + k) - k**2
    x_t = {"road": (mb * s**2 + k) * kt / det, "force": (-(mb * s**2 + k) + k) / det}
    x_b = {"road": k * kt / det, "force": (-k + mt * s**2 + kt + k) / det}
    for source in ("road", "force"):
        tire = x_t[source] - (source == "road")
        expected = {
            "body_acceleration": s**2 * x_b[source],
            "suspension_deflection": x_b[source] - x_t[source],
            "tire_deflection": tire,
            "unsprung_displacement": x_t[source],
            "body_displacement": x_b[source],
            "body_velocity": s * x_b[source],
            "unsprung_velocity": s * x_t[source],
            "suspension_velocity": s * (x_b[source] - x_t[source]),
        }
        for name, curve in expected.items():
            assert_equal_curves(found[name, source], curve, 1e-12)
    assert np.all(found["actuator_force", "force"] == 1)
    assert np.all(found["actuator_force", "road"] == 0)
    assert [*expected, "actuator_force"] == car.plant().output_labels


@pytest.mark.analytical
@pytest.mark.parametrize("end", ["front", "rear"])
def test_half_car_is_two_quarter_cars_without_inertia_coupling(end):
    """m Lf Lr = I: each attachment point is a centre of percussion of the other, so the ends decouple."""
    car = HalfCar(pitch_inertia=690 * 1.25 * 1.51)
    half = response(car.plant())
    quarter = response(car.quarter_cars()[end == "rear"].plant())
    arm = {"front": -1.25, "rear": 1.51}[end]
    for source in ("road", "force"):
        here = f"{source}_{end}"
        other = f"{source}_{'rear' if end == 'front' else 'front'}"
        for name in (
            "suspension_deflection",
            "tire_deflection",
            "unsprung_displacement",
            "suspension_velocity",
        ):
            expected = quarter[name, source]
            assert_equal_curves(half[f"{name}_{end}", here], expected)
            assert np.max(np.abs(half[f"{name}_{end}", other])) < 1e-10 * np.max(np.abs(expected))
        above = half["body_acceleration", here] + arm * half["pitch_acceleration", here]
        assert_equal_curves(above, quarter["body_acceleration", source])


@pytest.mark.analytical
def test_a_coupled_half_car_is_not_two_quarter_cars():
    half, quarter = response(HalfCar().plant()), response(HalfCar().quarter_cars()[0].plant())
    gap = np.abs(half["tire_deflection_front", "road_front"] - quarter["tire_deflection", "road"])
    assert np.max(gap) > 1e-3


@pytest.mark.analytical
@pytest.mark.parametrize("bar", [0.0, 8000.0])
def test_symmetric_full_car_equals_the_half_car(bar):
    """Equal roads and forces left and right: heave, pitch and each side as the half car, no roll."""
    half_car = HalfCar(body_mass=610, axle_distance_front=1.1, damping_rear=1900)
    full_car = FullCar.from_half_car(half_car, roll_inertia=500, track_front=1.5, track_rear=1.4)
    full = response(full_car.replace(anti_roll_stiffness_front=bar).plant())
    half_plant = half_car.plant()
    half = response(half_plant)
    for source in ("road", "force"):
        for end in ("front", "rear"):
            both = {
                name: full[name, f"{source}_{end}_left"] + full[name, f"{source}_{end}_right"]
                for name in full_car.plant().output_labels
            }
            for name in half_plant.output_labels:
                expected = half[name, f"{source}_{end}"]
                sides = [name] if name in both else [f"{name}_left", f"{name}_right"]
                for side in sides:
                    if np.any(expected):
                        assert_equal_curves(both[side], expected)
                    else:
                        assert not np.any(both[side])
            for name in ("roll_angle", "roll_velocity", "roll_acceleration"):
                scale = np.max(np.abs(full[name, f"{source}_{end}_left"]))
                assert np.max(np.abs(both[name])) < 1e-10 * scale


@pytest.mark.analytical
def test_roll_of_the_full_car_equals_its_own_newton_equations():
    """Roads opposite left and right on a car with equal axles: roll decouples from the rest."""
    inertia, track, ks, cs, kt, mt, kb = 480.0, 1.44, 20e3, 1300.0, 190e3, 40.0, 5e3
    car = FullCar(
        roll_inertia=inertia, track_front=track, track_rear=track,
        axle_distance_front=1.4, axle_distance_rear=1.4,
        spring_stiffness_front=ks, spring_stiffness_rear=ks, damping_front=cs, damping_rear=cs,
        tire_stiffness_front=kt, tire_stiffness_rear=kt, unsprung_mass_front=mt, unsprung_mass_rear=mt,
        anti_roll_stiffness_front=kb, anti_roll_stiffness_rear=kb,
    )  # fmt: skip
    found = response(car.plant())
    s = 1j * OMEGA
    b = track / 2
    # left suspension deflection e = b theta - x, right one -e: the bar adds 2 kb e to the left force
    spring = ks + 2 * kb + cs * s
    # (mt s2 + kt + spring) x - spring b theta = kt,   (Ir s2 + 4 b2 spring) theta - 4 b spring x = 0
    det = (mt * s**2 + kt + spring) * (inertia * s**2 + 4 * b**2 * spring) - 4 * b**2 * spring**2
    roll = kt * 4 * b * spring / det
    wheel = kt * (inertia * s**2 + 4 * b**2 * spring) / det
    signs = {"front_left": 1, "front_right": -1, "rear_left": 1, "rear_right": -1}
    moved = {
        name: sum(sign * found[name, f"road_{wheel_name}"] for wheel_name, sign in signs.items())
        for name in car.plant().output_labels
    }
    assert_equal_curves(moved["roll_angle"], roll)
    assert_equal_curves(moved["roll_acceleration"], s**2 * roll)
    assert_equal_curves(moved["unsprung_displacement_front_left"], wheel)
    assert_equal_curves(moved["unsprung_displacement_rear_right"], -wheel)
    assert_equal_curves(moved["suspension_deflection_rear_left"], b * roll - wheel)
    assert_equal_curves(moved["tire_deflection_front_left"], wheel - 1)
    assert np.max(np.abs(moved["body_displacement"])) < 1e-12


def test_full_car_signals_and_loads():
    car = FullCar()
    plant = car.plant()
    assert plant.nstates == 14
    assert plant.input_labels == [f"{kind}_{w}" for kind in ("road", "force") for w in WHEELS]
    assert plant.output_labels[:7] == [
        "body_acceleration",
        "pitch_acceleration",
        "roll_acceleration",
        *(f"suspension_deflection_{w}" for w in WHEELS),
    ]
    assert plant.output_labels[-4:] == [f"actuator_force_{w}" for w in WHEELS]
    assert {tire.deflection for tire in car.tires} < set(plant.output_labels)
    half = HalfCar().static_loads()
    expected = {w: half[w.split("_")[0]] for w in WHEELS}
    assert car.static_loads() == pytest.approx(expected)
    assert car.axle_lag(10) == pytest.approx(0.276)
    assert QuarterCar().static_loads() == {"wheel": pytest.approx(half["front"])}


@pytest.mark.parametrize(
    ("vehicle", "field", "value"),
    [
        (QuarterCar, "body_mass", 0),
        (QuarterCar, "tire_stiffness", -1),
        (QuarterCar, "damping", -1),
        (FullCar, "roll_inertia", 0),
        (FullCar, "track_rear", np.nan),
        (FullCar, "anti_roll_stiffness_front", -5),
    ],
)
def test_bad_fields_are_named(vehicle, field, value):
    with pytest.raises(InputError, match=rf"{vehicle.__name__}\.{field} = .* is not allowed"):
        vehicle(**{field: value})


def test_stability_without_road():
    """Every passive vehicle with damping is stable."""
    for car in (QuarterCar(), HalfCar(), FullCar(), FullCar(anti_roll_stiffness_rear=1e4)):
        assert np.max(car.plant().poles().real) < 0


@pytest.mark.analytical
def test_four_delayed_channels_on_the_full_car_equal_two_on_the_half_car():
    """Symmetric gains and delays, equal roads on both sides: heave and pitch of the closed half car."""
    gains, delays = {"front": 19345.0, "rear": 26150.0}, {"front": 0.5530, "rear": 0.5186}

    def closed(plant, suffixes):
        return close_loop(
            plant,
            [
                FeedbackChannel(
                    f"unsprung_displacement_{end}{suffix}",
                    f"force_{end}{suffix}",
                    gain=gains[end],
                    delay=delays[end],
                )
                for end in ("front", "rear")
                for suffix in suffixes
            ],
        )

    half_plant, full_plant = HalfCar().plant(), FullCar(anti_roll_stiffness_front=6e3).plant()
    half = closed(half_plant, [""])(1j * OMEGA)
    full = closed(full_plant, ["_left", "_right"])(1j * OMEGA)
    for name in ("body_acceleration", "pitch_acceleration", "body_displacement"):
        row, full_row = half_plant.output_labels.index(name), full_plant.output_labels.index(name)
        for k, columns in enumerate(([0, 1], [2, 3])):
            assert_equal_curves(full[full_row, columns].sum(axis=0), half[row, k])
