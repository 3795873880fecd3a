import control
import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from susp_ctrl.errors import InputError
from susp_ctrl.vehicle import HalfCar, Seat

OUTPUTS = [
    "body_acceleration",
    "pitch_acceleration",
    "suspension_deflection_front",
    "suspension_deflection_rear",
    "tire_deflection_front",
    "tire_deflection_rear",
    "unsprung_displacement_front",
    "unsprung_displacement_rear",
    "body_displacement",
    "pitch_angle",
    "body_velocity",
    "pitch_velocity",
    "unsprung_velocity_front",
    "unsprung_velocity_rear",
    "suspension_velocity_front",
    "suspension_velocity_rear",
    "actuator_force_front",
    "actuator_force_rear",
]
OTHER_CAR = {
    "m": 1100.0, "I": 1900.0, "mtf": 60.0, "mtr": 35.0, "ktf": 210e3, "ktr": 175e3,
    "ksf": 31e3, "ksr": 18e3, "Lf": 1.05, "Lr": 1.62, "csf": 900.0, "csr": 2100.0,
}  # fmt: skip
FIELD_OF = {
    "m": "body_mass", "I": "pitch_inertia", "mtf": "unsprung_mass_front", "mtr": "unsprung_mass_rear",
    "ktf": "tire_stiffness_front", "ktr": "tire_stiffness_rear", "ksf": "spring_stiffness_front",
    "ksr": "spring_stiffness_rear", "Lf": "axle_distance_front", "Lr": "axle_distance_rear",
    "csf": "damping_front", "csr": "damping_rear",
}  # fmt: skip


def car_of(values):
    return HalfCar(**{FIELD_OF[key]: value for key, value in values.items()})


def relative_error(found, expected, axis):
    return np.max(np.abs(found - expected) / np.max(np.abs(expected), axis=axis, keepdims=True))


def test_signals_are_named_in_the_public_order():
    plant = HalfCar().plant()
    assert isinstance(plant, control.StateSpace)
    assert plant.input_labels == ["road_front", "road_rear", "force_front", "force_rear"]
    assert plant.output_labels == OUTPUTS
    assert plant.nstates == 8
    assert plant.isctime(strict=True)
    # the state is [q, q'], each state also an output of the same name: C picks it out
    for k, state in enumerate(plant.state_labels):
        row = plant.C[OUTPUTS.index(state)]
        assert row[k] == 1
        assert np.count_nonzero(row) == 1


@pytest.mark.analytical
@pytest.mark.parametrize("values", [oracles.TABLE_1, OTHER_CAR], ids=["table_1", "other"])
def test_response_to_the_road_equals_the_direct_solution(values):
    """Against a direct solve of the 4 x 4 complex system of eq. (1), each entry relative to its peak."""
    s = np.concatenate([1j * np.geomspace(0.05, 600, 200), [0.3 + 5j, -1.1 + 60j, 2.0]])
    expected = oracles.ride_response(s, car=values)
    plant = car_of(values).plant()
    found = np.moveaxis(plant(s), 2, 0)[:, :8, :2]
    assert relative_error(found, expected, axis=0) < 1e-12


@pytest.mark.analytical
def test_response_to_the_actuators_equals_the_direct_solution():
    s = 1j * np.geomspace(0.05, 600, 100)
    z = oracles.dynamic_stiffness(s)
    lf, lr = oracles.TABLE_1["Lf"], oracles.TABLE_1["Lr"]
    load = np.array([[-1, 0], [0, -1], [1, 1], [-lf, lr]], dtype=complex)
    q = np.linalg.solve(z, np.broadcast_to(load, (s.size, 4, 2)))
    found = np.moveaxis(HalfCar().plant()(s), 2, 0)[:, :, 2:]
    s_ = s[:, None]
    expected = {
        "body_acceleration": s_**2 * q[:, 2],
        "pitch_acceleration": s_**2 * q[:, 3],
        "suspension_deflection_front": q[:, 2] - lf * q[:, 3] - q[:, 0],
        "suspension_deflection_rear": q[:, 2] + lr * q[:, 3] - q[:, 1],
        "tire_deflection_front": q[:, 0],
        "tire_deflection_rear": q[:, 1],
        "body_displacement": q[:, 2],
        "pitch_angle": q[:, 3],
        "body_velocity": s_ * q[:, 2],
        "pitch_velocity": s_ * q[:, 3],
        "unsprung_velocity_front": s_ * q[:, 0],
        "unsprung_velocity_rear": s_ * q[:, 1],
        "suspension_velocity_front": s_ * (q[:, 2] - lf * q[:, 3] - q[:, 0]),
        "suspension_velocity_rear": s_ * (q[:, 2] + lr * q[:, 3] - q[:, 1]),
        "actuator_force_front": np.broadcast_to([1, 0], (s.size, 2)),
        "actuator_force_rear": np.broadcast_to([0, 1], (s.size, 2)),
    }
    for name, value in expected.items():
        assert relative_error(found[:, OUTPUTS.index(name)], value, axis=(0, 1)) < 1e-12, name


@pytest.mark.literature
def test_passive_roots_of_table_1():
    """Roots of eq. (1) without feedback, recomputed from the paper's Table 1 to four decimals."""
    expected = [-18.8010 + 68.3799j, -16.9644 + 65.5068j, -2.0801 + 7.9949j, -1.7683 + 6.3849j]
    poles = HalfCar().plant().poles()
    upper = sorted(poles[poles.imag > 0], key=lambda p: p.real)
    np.testing.assert_allclose(upper, expected, atol=1e-4)


@pytest.mark.analytical
def test_standing_on_a_raised_road_only_lifts_the_car():
    """At s = 0 the body follows the road: heave and pitch from the two contact heights, nothing deflected."""
    plant = HalfCar().plant()
    y = dict(zip(OUTPUTS, plant.dcgain() @ [0.02, 0.05, 0, 0], strict=True))
    assert y["pitch_angle"] == pytest.approx(0.03 / 2.76, rel=1e-9)
    assert y["body_displacement"] == pytest.approx(0.02 + 1.25 * 0.03 / 2.76, rel=1e-9)
    for name in OUTPUTS[:6]:
        assert y[name] == pytest.approx(0, abs=1e-12)


@pytest.mark.analytical
def test_static_loads_and_axle_lag():
    car = HalfCar()
    assert car.static_loads() == pytest.approx({"front": 4100.6, "rear": 3511.0}, abs=0.05)
    total = (690 + 40.5 + 45.4) * 9.81
    assert sum(car.static_loads().values()) == pytest.approx(total)
    assert car.axle_lag(20.0) == pytest.approx(0.138)
    assert [tire.deflection for tire in car.tires] == OUTPUTS[4:6]


@pytest.mark.parametrize("field", [f for f in FIELD_OF.values() if not f.startswith("damping")])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "heavy", None, True])
def test_a_field_out_of_range_is_named(field, value):
    with pytest.raises(InputError, match=rf"HalfCar\.{field} = .* is not allowed: .*greater than 0"):
        HalfCar(**{field: value})


@pytest.mark.parametrize("field", ["damping_front", "damping_rear"])
def test_damping_may_be_zero_but_not_negative(field):
    assert getattr(HalfCar(**{field: 0}), field) == 0.0
    with pytest.raises(InputError, match=rf"HalfCar\.{field} = -1 is not allowed: .*at least 0"):
        HalfCar(**{field: -1})


def test_replace_makes_a_checked_copy():
    car = HalfCar()
    heavier = car.replace(body_mass=800)
    assert (car.body_mass, heavier.body_mass) == (690.0, 800.0)
    assert heavier.replace(body_mass=690) == car
    with pytest.raises(InputError, match="body_mass"):
        car.replace(body_mas=800)
    with pytest.raises(InputError, match="greater than 0"):
        car.replace(body_mass=-800)
    with pytest.raises(AttributeError):
        car.body_mass = 3
    with pytest.raises(TypeError):
        HalfCar(690.0)


@pytest.mark.parametrize("speed", [0, -3, np.nan])
def test_speed_must_be_positive(speed):
    with pytest.raises(InputError, match="speed"):
        HalfCar().axle_lag(speed)


@pytest.mark.analytical
def test_rigid_seat_adds_the_acceleration_of_its_point():
    seated = HalfCar(seat=Seat(position=-0.4)).plant()
    assert seated.output_labels == [*OUTPUTS, "seat_acceleration"]
    s = 1j * np.geomspace(0.1, 300, 40)
    response = seated(s)
    expected = response[0] - 0.4 * response[1]
    assert relative_error(response[18], expected, axis=1) < 1e-12
    np.testing.assert_array_equal(response[:18], HalfCar().plant()(s))


@pytest.mark.analytical
def test_a_passenger_on_a_stiff_seat_is_part_of_the_body():
    """As k -> inf a passenger at the centre of mass only adds body mass; the error falls as 1/k."""
    s = 1j * np.geomspace(0.1, 60, 40)
    rigid = HalfCar(body_mass=770).plant()(s)[0, :2]
    errors = []
    for stiffness in (1e8, 1e9):
        car = HalfCar(seat=Seat(position=0.0, passenger_mass=80, stiffness=stiffness, damping=1e3))
        errors.append(relative_error(car.plant()(s)[0, :2], rigid, axis=1))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.05)


@pytest.mark.analytical
def test_passenger_equations_hold_at_any_frequency():
    """Newton's equation of the passenger and of the body with a passenger, written out."""
    mp, k, c, x = 75.0, 12e3, 300.0, 0.35
    s = np.array([3j, 17j, 60j, 0.2 + 9j])
    plant = HalfCar(seat=Seat(position=x, passenger_mass=mp, stiffness=k, damping=c)).plant()
    response = dict(zip(plant.output_labels, plant(s)[:, 0], strict=True))
    deflection = response["seat_displacement"] - response["body_displacement"] - x * response["pitch_angle"]
    np.testing.assert_allclose(response["seat_deflection"], deflection, rtol=1e-10)
    force = (k + c * s) * deflection  # on the body, upwards
    np.testing.assert_allclose(mp * response["seat_acceleration"], -force, rtol=1e-10)
    lift = sum(
        (oracles.TABLE_1[f"ks{end[0]}"] + oracles.TABLE_1[f"cs{end[0]}"] * s)
        * response[f"suspension_deflection_{end}"]
        * np.array([[1.0], [arm]])
        for end, arm in (("front", -1.25), ("rear", 1.51))
    )
    np.testing.assert_allclose(690 * response["body_acceleration"], force - lift[0], rtol=1e-9)
    np.testing.assert_allclose(1200 * response["pitch_acceleration"], x * force - lift[1], rtol=1e-9)


def test_static_loads_with_a_passenger_keep_moment_balance():
    car = HalfCar(seat=Seat(position=0.5, passenger_mass=80, stiffness=1e4))
    loads, bare = car.static_loads(), HalfCar().static_loads()
    front, rear = loads["front"] - bare["front"], loads["rear"] - bare["rear"]
    assert front + rear == pytest.approx(80 * 9.81)
    assert -1.25 * front + 1.51 * rear == pytest.approx(0.5 * 80 * 9.81)


def test_seat_is_checked():
    with pytest.raises(InputError, match=r"Seat\.stiffness"):
        Seat(position=0.1, passenger_mass=70)
    with pytest.raises(InputError, match=r"Seat\.position"):
        Seat(position=np.inf)
    with pytest.raises(InputError, match=r"HalfCar\.seat"):
        HalfCar(seat=0.4)


@pytest.mark.property
@given(
    masses=st.tuples(*[st.floats(20, 3000)] * 4),
    stiffnesses=st.tuples(*[st.floats(5e3, 5e5)] * 4),
    dampings=st.tuples(*[st.floats(100, 1e4)] * 2),
    distances=st.tuples(*[st.floats(0.5, 3)] * 2),
)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_any_car_equals_the_direct_solution_and_is_stable(masses, stiffnesses, dampings, distances):
    values = dict(zip(("m", "I", "mtf", "mtr"), masses, strict=True))
    values |= dict(zip(("ktf", "ktr", "ksf", "ksr"), stiffnesses, strict=True))
    values |= dict(zip(("csf", "csr", "Lf", "Lr"), (*dampings, *distances), strict=True))
    plant = car_of(values).plant()
    s = 1j * np.geomspace(0.5, 300, 30)
    expected = oracles.ride_response(s, car=values)
    found = np.moveaxis(plant(s), 2, 0)[:, :8, :2]
    assert relative_error(found, expected, axis=(0, 2)) < 1e-10
    assert np.max(plant.poles().real) < 0
    loads = car_of(values).static_loads()
    assert sum(loads.values()) == pytest.approx((values["m"] + values["mtf"] + values["mtr"]) * 9.81)
