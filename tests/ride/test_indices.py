import control
import numpy as np
import pytest

from susp_ctrl.errors import InputError
from susp_ctrl.ride import compare_indices, iso2631_weighting, ride_indices
from susp_ctrl.road import HarmonicRoad
from susp_ctrl.vehicle import FullCar, HalfCar, QuarterCar

SIX = [
    ("body_acceleration", "m/s2"),
    ("pitch_acceleration", "rad/s2"),
    ("suspension_deflection_front", "m"),
    ("suspension_deflection_rear", "m"),
    ("tire_deflection_front", "m"),
    ("tire_deflection_rear", "m"),
]


def response_of(t, **signals):
    return control.TimeResponseData(
        np.asarray(t), np.array(list(signals.values())), output_labels=list(signals), issiso=False
    )


def values(table):
    return dict(zip(table["indicator"], table["value"], strict=True))


def units(table):
    return dict(zip(table["indicator"], table["unit"], strict=True))


def test_the_six_indicators_come_first():
    t = np.linspace(0, 2, 201)
    plant = HalfCar().plant()
    road = HarmonicRoad(0.01, 7.0)
    inputs = np.vstack([road.profile(t), road.profile(t, lag=0.138), 0 * t, 0 * t])
    table = ride_indices(control.forced_response(plant, t, inputs))
    assert list(table.columns) == ["indicator", "value", "unit"]
    assert list(zip(table["indicator"], table["unit"], strict=True))[:6] == SIX
    assert table["indicator"].is_unique
    assert table["value"].dtype == float


@pytest.mark.analytical
def test_rms_and_peaks_of_sines_in_closed_form():
    """Whole periods, end points included: trapezoidal averages are exact."""
    t = np.linspace(0, 4, 4001)
    response = response_of(
        t,
        body_acceleration=1.5 * np.sin(2 * np.pi * 3 * t),
        tire_deflection_front=0.01 + 0.004 * np.cos(2 * np.pi * t),
    )
    found = values(ride_indices(response))
    assert found["body_acceleration"] == pytest.approx(1.5 / np.sqrt(2), rel=1e-12)
    assert found["body_acceleration_peak"] == pytest.approx(1.5, rel=1e-5)
    assert found["tire_deflection_front"] == pytest.approx(np.sqrt(1e-4 + 0.004**2 / 2), rel=1e-12)
    assert found["tire_deflection_front_peak"] == pytest.approx(0.014, rel=1e-12)


@pytest.mark.analytical
def test_comfort_figures_of_a_steady_tone():
    """A tone of amplitude A: a_w = |W| A/sqrt 2, VDV = a_w (3T/2)^(1/4), crest factor sqrt 2, MTVV = a_w."""
    amplitude, frequency, duration = 1.2, 5.0, 10.0
    t = np.linspace(0, 30, 30001)
    tone = amplitude * np.sin(2 * np.pi * frequency * t)
    response = response_of(
        t, body_acceleration=tone, pitch_acceleration=0.5 * tone, roll_acceleration=0.8 * tone
    )
    table = ride_indices(response, skip=20.0)
    found = values(table)
    weighted = amplitude / np.sqrt(2) * abs(iso2631_weighting(2 * np.pi * frequency, "Wk"))
    assert found["body_acceleration_weighted"] == pytest.approx(weighted, rel=2e-4)
    assert found["body_acceleration_mtvv"] == pytest.approx(weighted, rel=2e-3)
    assert found["body_acceleration_vdv"] == pytest.approx(weighted * (1.5 * duration) ** 0.25, rel=1e-3)
    assert found["body_acceleration_crest_factor"] == pytest.approx(np.sqrt(2), rel=2e-3)
    assert found["body_acceleration_mtvv_ratio"] == pytest.approx(1, rel=2e-3)
    assert found["body_acceleration_vdv_ratio"] == pytest.approx(1.5**0.25, rel=1e-3)
    pitch = 0.5 * amplitude / np.sqrt(2) * abs(iso2631_weighting(2 * np.pi * frequency, "We"))
    assert found["pitch_acceleration_weighted"] == pytest.approx(pitch, rel=1e-3)
    assert found["comfort_total"] == pytest.approx(
        np.sqrt(weighted**2 + (0.4 * pitch) ** 2 + (0.63 * 1.6 * pitch) ** 2), rel=3e-4
    )
    assert units(table)["body_acceleration_vdv"] == "m/s1.75"


@pytest.mark.analytical
def test_running_rms_finds_the_loudest_second():
    """A burst of one second in a quiet record: MTVV is the RMS of the burst, VDV does not grow with silence."""
    t = np.linspace(0, 40, 40001)
    window = np.where((t > 20) & (t < 21), np.sin(np.pi * (t - 20)) ** 2, 0.0)
    burst = window * np.sin(2 * np.pi * 8 * t)
    long = values(ride_indices(response_of(t, body_acceleration=burst)))
    short = values(ride_indices(response_of(t[:30001], body_acceleration=burst[:30001])))
    # mean of sin^4 is 3/8, halved by the tone
    expected = np.sqrt(3 / 16) * abs(iso2631_weighting(2 * np.pi * 8))
    assert long["body_acceleration_mtvv"] == pytest.approx(expected, rel=0.02)
    assert long["body_acceleration_vdv"] == pytest.approx(short["body_acceleration_vdv"], rel=1e-6)
    assert long["body_acceleration_mtvv_ratio"] > 5


def test_short_records_have_no_running_rms():
    t = np.linspace(0, 0.5, 501)
    found = values(ride_indices(response_of(t, body_acceleration=np.sin(40 * t))))
    assert np.isnan(found["body_acceleration_mtvv"])
    assert found["body_acceleration_weighted"] > 0


def test_a_car_at_rest_has_zeros_and_no_ratios():
    t = np.linspace(0, 3, 301)
    found = values(ride_indices(response_of(t, body_acceleration=0 * t)))
    assert found["body_acceleration"] == 0
    assert found["body_acceleration_weighted"] == 0
    assert np.isnan(found["body_acceleration_crest_factor"])


@pytest.mark.analytical
def test_skip_cuts_the_transient():
    t = np.linspace(0, 6, 6001)
    signal = np.where(t < 2, 100.0, np.sin(2 * np.pi * t))
    found = values(ride_indices(response_of(t, suspension_deflection_front=signal), skip=2.0))
    assert found["suspension_deflection_front"] == pytest.approx(np.sqrt(0.5), rel=1e-9)


@pytest.mark.analytical
def test_uneven_times_give_the_same_indices():
    rng = np.random.default_rng(0)
    even = np.linspace(0, 10, 10001)
    uneven = np.sort(np.concatenate([[0, 10], rng.uniform(0, 10, 20000)]))
    uneven = uneven[np.concatenate([[True], np.diff(uneven) > 2e-4])]

    def table_at(t):
        return values(
            ride_indices(response_of(t, body_acceleration=np.sin(np.pi * t / 10) ** 2 * np.sin(30 * t)))
        )

    expected, found = table_at(even), table_at(uneven)
    assert set(found) == set(expected)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-3), name


@pytest.mark.analytical
def test_tire_loads_stroke_and_lift_off():
    """Dynamic load -k_t times the tire deflection on the static load of Table 1 (4100.6 N in front)."""
    t = np.linspace(0, 2, 2001)
    car = HalfCar()
    response = response_of(
        t,
        tire_deflection_front=0.02 * np.sin(2 * np.pi * t),
        tire_deflection_rear=0.03 * np.sin(2 * np.pi * t),
        suspension_deflection_front=0.04 * np.sin(2 * np.pi * t),
    )
    found = values(ride_indices(response, vehicle=car, stroke_limit=0.1))
    static = (690 * 1.51 / 2.76 + 40.5) * 9.81
    assert found["tire_load_front"] == pytest.approx(192000 * 0.02 / np.sqrt(2), rel=1e-9)
    assert found["load_coefficient_front"] == pytest.approx(192000 * 0.02 / np.sqrt(2) / static, rel=1e-9)
    assert found["tire_load_front_min"] == pytest.approx(static - 3840, rel=1e-6)
    assert found["tire_load_front_max"] == pytest.approx(static + 3840, rel=1e-6)
    assert found["lift_off_front"] == 0
    assert found["lift_off_rear"] == 1  # 5760 N on a static load of 3511 N
    assert found["suspension_deflection_front_stroke_use"] == pytest.approx(0.4, rel=1e-5)


@pytest.mark.analytical
def test_a_wheel_that_rises_unloads_its_tire():
    t = np.linspace(0, 1, 1001)
    found = values(ride_indices(response_of(t, tire_deflection=0.01 * t), vehicle=QuarterCar()))
    static = (377.5 + 40.5) * 9.81
    assert found["tire_load_min"] == pytest.approx(static - 1920)
    assert found["tire_load_max"] == pytest.approx(static)


@pytest.mark.analytical
def test_actuator_force_rate_and_power():
    """f = F cos(w t) and s' = V cos(w t): mean power F V/2, rate F w."""
    t = np.linspace(0, 2, 20001)
    w = 2 * np.pi * 2
    response = response_of(
        t,
        body_acceleration=np.cos(w * t),
        actuator_force_rear=800 * np.cos(w * t),
        suspension_velocity_rear=0.3 * np.cos(w * t),
    )
    table = ride_indices(response)
    found = values(table)
    assert found["actuator_force_rear"] == pytest.approx(800 / np.sqrt(2), rel=1e-9)
    assert found["actuator_force_rear_peak"] == pytest.approx(800)
    assert found["actuator_force_rear_rate_peak"] == pytest.approx(800 * w, rel=1e-5)
    assert found["actuator_power_rear_mean"] == pytest.approx(120, rel=1e-9)
    assert found["actuator_power_rear_peak"] == pytest.approx(240)
    assert [
        units(table)[f"actuator_{k}"] for k in ("force_rear", "force_rear_rate_peak", "power_rear_mean")
    ] == [
        "N",
        "N/s",
        "W",
    ]


@pytest.mark.analytical
def test_seat_position_combines_heave_and_pitch():
    t = np.linspace(0, 4, 4001)
    heave, pitch = np.sin(9 * t), np.cos(13 * t)
    response = response_of(t, body_acceleration=heave, pitch_acceleration=pitch)
    found = values(ride_indices(response, seat_position=-0.7))
    expected = np.sqrt(np.trapezoid((heave - 0.7 * pitch) ** 2, t) / 4)
    assert found["seat_acceleration"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("car", [QuarterCar(), HalfCar(), FullCar()])
def test_every_vehicle_has_its_indices(car):
    plant = car.plant()
    t = np.linspace(0, 3, 601)
    inputs = np.zeros((plant.ninputs, t.size))
    inputs[: plant.ninputs // 2] = 0.01 * np.sin(8 * t)
    found = values(ride_indices(control.forced_response(plant, t, inputs), vehicle=car, stroke_limit=0.1))
    assert len([name for name in found if name.startswith("load_coefficient")]) == len(car.tires)
    assert len([name for name in found if name.endswith("_stroke_use")]) == len(car.tires)
    assert found["body_acceleration_weighted"] > 0
    assert found["comfort_total"] >= found["body_acceleration_weighted"]


@pytest.mark.analytical
def test_passive_beside_active_with_the_change_in_percent():
    t = np.linspace(0, 2, 2001)

    def table(size):
        return ride_indices(response_of(t, body_acceleration=size * np.sin(9 * t), pitch_acceleration=0 * t))

    compared = compare_indices({"passive": table(2.0), "active": table(1.5)}).set_index("indicator")
    row = compared.loc["body_acceleration"]
    assert row["active_change"] == pytest.approx(-25)
    assert row["active"] / row["passive"] == pytest.approx(0.75)
    assert row["unit"] == "m/s2"
    assert np.isnan(compared.loc["pitch_acceleration", "active_change"])
    with pytest.raises(InputError, match="tables"):
        compare_indices({})


T = np.linspace(0, 2, 201)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: ride_indices(3), "response"),
        (lambda: ride_indices(response_of(T, body_acceleration=T), skip=2.0), "skip"),
        (lambda: ride_indices(response_of(T, body_acceleration=T), skip=-1), "skip"),
        (lambda: ride_indices(response_of(T, body_acceleration=T * np.nan)), "response"),
        (lambda: ride_indices(response_of(T, body_velocity=T)), "body_velocity"),
        (lambda: ride_indices(response_of(T, body_acceleration=T), stroke_limit=0), "stroke_limit"),
        (lambda: ride_indices(response_of(T, body_acceleration=T), seat_position=1), "pitch_acceleration"),
    ],
)
def test_bad_input_is_refused_by_name(make, named):
    with pytest.raises(InputError, match=named):
        make()
