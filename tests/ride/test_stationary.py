from itertools import pairwise

import control
import numpy as np
import oracles
import pytest
from scipy.integrate import quad

from susp_ctrl.delay_systems import FeedbackChannel, close_loop, integrate, simulate
from susp_ctrl.errors import InputError, UnstableSystemError
from susp_ctrl.ride import iso2631_weighting, response_psd, ride_indices, stationary_rms
from susp_ctrl.road import FilteredNoiseRoad, HarmonicRoad, MeasuredRoad, RandomRoad, TwoTrackRoad
from susp_ctrl.vehicle import FullCar, HalfCar, QuarterCar

SIX = oracles.RIDE_OUTPUTS[:6]
LAGS = {"road_front": 0.0, "road_rear": 0.138}


def values(table):
    return dict(zip(table["indicator"], table["value"], strict=True))


def oracle_rms(output, weighting=None, gains=(0.0, 0.0), delays=(0.0, 0.0), v=20.0, g_d=256e-6):
    """RMS by scipy's adaptive quadrature in the logarithm of f, from the 4 x 4 oracle, octave by octave."""

    def density(log_f):
        f = np.exp(log_f)
        h = oracles.ride_response(2j * np.pi * f, gains, delays)[oracles.RIDE_OUTPUTS.index(output)]
        h = h[0] + h[1] * np.exp(-2j * np.pi * f * 2.76 / v)
        if weighting:
            h = h * iso2631_weighting(2 * np.pi * f, weighting)
        return abs(h) ** 2 * g_d * 0.01 * v / f**2 * f

    edges = np.log(np.geomspace(0.011 * v, 2.83 * v, 30))
    pieces = [quad(density, a, b, epsabs=0, epsrel=1e-9, limit=200)[0] for a, b in pairwise(edges)]
    return np.sqrt(sum(pieces))


@pytest.mark.literature
def test_passive_car_on_class_c():
    """Passive Table 1 car, class C, 20 m/s, 0.011 to 2.83 cycle/m; values to four decimals."""
    road = RandomRoad(iso_class="C", speed=20.0)
    found = values(stationary_rms(HalfCar().plant(), road, LAGS))
    expected = [0.9291, 0.7078, 0.0116, 0.0112, 0.0040, 0.0042]
    assert [found[name] for name in SIX] == pytest.approx(expected, abs=5e-5)
    rougher = values(stationary_rms(HalfCar().plant(), RandomRoad(iso_class="D", speed=20.0), LAGS))
    assert [rougher[name] / found[name] for name in SIX] == pytest.approx([2] * 6, rel=1e-12)


@pytest.mark.analytical
@pytest.mark.parametrize("output", SIX)
def test_rms_equals_adaptive_quadrature_of_the_oracle(output):
    found = stationary_rms(HalfCar().plant(), RandomRoad(iso_class="C", speed=20.0), LAGS)
    assert values(found)[output] == pytest.approx(oracle_rms(output), rel=1e-9)
    assert found.attrs["relative_error"] < 1e-8


@pytest.mark.analytical
def test_weighted_rms_equals_adaptive_quadrature_of_the_oracle():
    found = values(stationary_rms(HalfCar().plant(), RandomRoad(iso_class="C", speed=20.0), LAGS))
    heave = oracle_rms("body_acceleration", "Wk")
    pitch = oracle_rms("pitch_acceleration", "We")
    assert found["body_acceleration_weighted"] == pytest.approx(heave, rel=1e-9)
    assert found["pitch_acceleration_weighted"] == pytest.approx(pitch, rel=1e-9)
    assert found["comfort_total"] == pytest.approx(np.hypot(heave, 0.4 * pitch), rel=1e-9)


@pytest.mark.analytical
def test_harmonic_road_gives_the_exact_steady_state():
    """Passive car at 7 rad/s and 20 m/s, amplitude 0.05 m: the 4 x 4 solution at one frequency."""
    found = values(stationary_rms(HalfCar().plant(), HarmonicRoad(0.05, 7.0), LAGS))
    h = oracles.ride_response(7j)[:6]
    expected = 0.05 / np.sqrt(2) * np.abs(h[:, 0] + h[:, 1] * np.exp(-7j * 0.138))
    assert [found[name] for name in SIX] == pytest.approx(expected, rel=1e-12)


@pytest.mark.analytical
@pytest.mark.parametrize("damping", [1500.0, 1.0, 0.01])
def test_white_road_on_a_quarter_car_in_closed_form(damping):
    """Any linear system on white noise has its Lyapunov variance, however narrow its resonances."""

    class WhiteRoad:
        band = (0.0, 2e6)

        @staticmethod
        def psd(omega):
            return np.full(np.shape(omega), 1e-7)

    car = QuarterCar(damping=damping)
    plant = car.plant()
    B = plant.B[:, :1]
    covariance = control.lyap(plant.A, np.pi * 1e-7 * B @ B.T)  # one-sided G per rad/s: intensity pi G
    row = plant.C[plant.output_labels.index("suspension_deflection")]
    expected = np.sqrt(row @ covariance @ row)
    found = values(stationary_rms(plant, WhiteRoad(), vehicle=car))["suspension_deflection"]
    assert found == pytest.approx(expected, rel=1e-8)


@pytest.mark.analytical
def test_simulation_and_spectrum_agree_within_sampling_error():
    """Long simulation of the passive car against the integral, every indicator that both define.

    Of about 2 B T independent values a variance is known to 1/sqrt(B T): with B = 1 Hz and T = 400 s the RMS to 2.5 %
    (1 sigma).
    """
    car = HalfCar(seat=None)
    plant = car.plant()
    road = RandomRoad(iso_class="C", speed=20.0, seed=3)
    t = np.arange(0, 410, 2e-3)
    signals = road.inputs(LAGS)
    inputs = np.vstack([signals["road_front"](t), signals["road_rear"](t), np.zeros((2, t.size))])
    simulated = values(
        ride_indices(control.forced_response(plant, t, inputs), skip=10.0, vehicle=car, seat_position=0.4)
    )
    exact = values(stationary_rms(plant, road, LAGS, vehicle=car, seat_position=0.4))
    assert set(exact) < set(simulated)
    for name, value in exact.items():
        assert simulated[name] == pytest.approx(value, rel=0.075), name


@pytest.mark.analytical
def test_tire_loads_from_the_spectrum():
    car = HalfCar()
    found = values(stationary_rms(car.plant(), RandomRoad(iso_class="B", speed=30.0), LAGS, vehicle=car))
    assert found["tire_load_rear"] == pytest.approx(192000 * found["tire_deflection_rear"], rel=1e-12)
    assert found["load_coefficient_rear"] == pytest.approx(found["tire_load_rear"] / 3511.0, rel=1e-4)


@pytest.mark.analytical
def test_wheelbase_lag_matters_and_phase_zero_is_no_lag():
    """Equal cars, different lags: heave differs; a lag of one period of a harmonic road does not."""
    plant = HalfCar().plant()
    road = HarmonicRoad(0.05, 7.0)
    one = values(stationary_rms(plant, road, {"road_front": 0.0, "road_rear": 0.0}))
    period = values(stationary_rms(plant, road, {"road_front": 0.0, "road_rear": 2 * np.pi / 7}))
    half = values(stationary_rms(plant, road, {"road_front": 0.0, "road_rear": np.pi / 7}))
    for name in SIX:
        assert period[name] == pytest.approx(one[name], rel=1e-10)
    assert half["body_acceleration"] < 0.5 * one["body_acceleration"]


@pytest.mark.analytical
def test_adaptive_quadrature_in_closed_form():
    """A narrow resonance and a ripple in one pass: arctan and sine integrals to the tolerance."""

    def density(omega):
        return np.array([0.01 / ((omega - 30) ** 2 + 1e-4), 1 + np.cos(5 * omega)])

    result = integrate(density, 1.0, 100.0, 1e-10)
    narrow = np.arctan(70 / 0.01) + np.arctan(29 / 0.01)
    ripple = 99 + (np.sin(500) - np.sin(5)) / 5
    assert result.value == pytest.approx([narrow, ripple], rel=1e-10)
    assert np.all(result.relative_error < 1e-10)


def test_an_unreached_tolerance_is_reported():
    class RaggedRoad:
        band = (1.0, 300.0)

        @staticmethod
        def psd(omega):
            return 1e-6 * (1 + np.sign(np.sin(1e4 * omega)))

    with pytest.warns(RuntimeWarning, match="not to rtol"):
        stationary_rms(QuarterCar().plant(), RaggedRoad(), rtol=1e-12)


def test_an_unstable_system_has_no_stationary_response():
    plant = HalfCar().plant()
    unstable = control.StateSpace(
        plant.A + 10 * np.eye(8),
        plant.B,
        plant.C,
        plant.D,
        inputs=plant.input_labels,
        outputs=plant.output_labels,
    )
    with pytest.raises(UnstableSystemError, match="not stable"):
        stationary_rms(unstable, HarmonicRoad(0.05, 7.0), LAGS)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((HarmonicRoad(0.05, 7.0), None), "lags"),
        ((HarmonicRoad(0.05, 7.0), {}), "lags"),
        ((HarmonicRoad(0.05, 7.0), {"road_frnt": 0.0}), "road_front"),
        ((HarmonicRoad(0.05, 7.0), {"road_front": np.nan}), "road_front"),
        ((3.0, LAGS), "road"),
    ],
)
def test_bad_input_is_refused_by_name(arguments, named):
    with pytest.raises(InputError, match=named):
        stationary_rms(HalfCar().plant(), *arguments)


# ---- loops with delays, two tracks ----------------------------------------------------------------------------------

GAINS, DELAYS = (19345.0, 26150.0), (0.5530, 0.5186)


def closed_half_car(gains=GAINS, delays=DELAYS):
    channels = [
        FeedbackChannel(f"unsprung_displacement_{axle}", f"force_{axle}", gain=gain, delay=delay)
        for axle, gain, delay in zip(("front", "rear"), gains, delays, strict=True)
    ]
    return close_loop(HalfCar().plant(), channels)


@pytest.mark.analytical
@pytest.mark.parametrize("output", ["body_acceleration", "tire_deflection_rear"])
def test_rms_of_a_delayed_loop_equals_adaptive_quadrature_of_the_oracle(output):
    """The published random design of Wu and Ren, delays exact on both routes."""
    found = values(stationary_rms(closed_half_car(), RandomRoad(iso_class="C", speed=20.0), LAGS))
    assert found[output] == pytest.approx(oracle_rms(output, gains=GAINS, delays=DELAYS), rel=1e-8)


@pytest.mark.literature
def test_published_random_design_does_not_improve_the_ride():
    """On an ISO 8608 road at 20 m/s eq. (1) gives + 26 % heave and + 11 % pitch acceleration."""
    road = RandomRoad(iso_class="C", speed=20.0)
    active = values(stationary_rms(closed_half_car(), road, LAGS, known_stable=True))
    passive = values(stationary_rms(HalfCar().plant(), road, LAGS))
    change = {name: 100 * (active[name] / passive[name] - 1) for name in SIX[:2]}
    assert change["body_acceleration"] == pytest.approx(26, abs=0.5)
    assert change["pitch_acceleration"] == pytest.approx(11, abs=0.5)


def test_an_unstable_loop_has_no_stationary_response():
    with pytest.raises(UnstableSystemError):
        stationary_rms(closed_half_car(gains=(-400e3, 0.0)), RandomRoad(speed=20.0), LAGS)


WHEEL_LAGS = {
    "road_front_left": 0.0,
    "road_front_right": 0.0,
    "road_rear_left": 0.138,
    "road_rear_right": 0.138,
}


@pytest.mark.analytical
def test_equal_tracks_make_the_full_car_a_half_car():
    """One road under all wheels, or two tracks of coherence one: heave and pitch of the half car, no roll."""
    single = RandomRoad(iso_class="C", speed=20.0)
    half = values(stationary_rms(HalfCar().plant(), single, LAGS))
    coherent = TwoTrackRoad(road=single, track_width=1e-9)
    for road in (single, coherent):
        full = values(stationary_rms(FullCar().plant(), road, WHEEL_LAGS))
        for name in SIX[:2]:
            assert full[name] == pytest.approx(half[name], rel=1e-9)
        assert full["tire_deflection_rear_left"] == pytest.approx(half["tire_deflection_rear"], rel=1e-9)
        assert full["roll_acceleration"] < 1e-6


@pytest.mark.analytical
def test_two_tracks_split_into_mean_and_difference():
    """Mean road: PSD G (1 + gamma)/2, moves heave only; half difference: G (1 - gamma)/2, moves roll only."""
    single = RandomRoad(iso_class="C", speed=20.0)
    road = TwoTrackRoad(road=single, track_width=1.5)
    plant = FullCar().plant()
    full = values(stationary_rms(plant, road, WHEEL_LAGS))
    labels = plant.output_labels

    class Share:
        band = single.band

        def __init__(self, sign):
            self.sign = sign

        def psd(self, omega):
            gamma = (1 + (omega / 20 * 1.5 / 3.0) ** 2) ** -1.3
            return single.psd(omega) * (1 + self.sign * gamma) / 2

    def power(output, sign):
        def density(omega):
            h = plant(1j * omega)[labels.index(output)]
            rear = np.exp(-0.138j * omega)
            h = h[0] + sign * h[1] + (h[2] + sign * h[3]) * rear
            return (np.abs(h) ** 2 * Share(sign).psd(omega))[None]

        return integrate(density, *single.band, 1e-10).value[0]

    assert full["body_acceleration"] == pytest.approx(np.sqrt(power("body_acceleration", 1)), rel=1e-8)
    assert full["roll_acceleration"] == pytest.approx(np.sqrt(power("roll_acceleration", -1)), rel=1e-8)
    name = "tire_deflection_front_left"
    assert full[name] == pytest.approx(np.sqrt(power(name, 1) + power(name, -1)), rel=1e-8)
    with pytest.raises(InputError, match="_left or _right"):
        stationary_rms(HalfCar().plant(), road, LAGS)


@pytest.mark.analytical
def test_filtered_noise_and_sum_of_sines_agree_above_the_cut_off():
    """Body acceleration hardly sees the long waves in which the two road models differ."""
    plant = HalfCar().plant()
    sines = values(stationary_rms(plant, RandomRoad(iso_class="C", speed=20.0, n_max=25.0), LAGS))
    noise = values(
        stationary_rms(plant, FilteredNoiseRoad(iso_class="C", speed=20.0, length=1.0, n_cut=1e-3), LAGS)
    )
    assert noise["body_acceleration"] == pytest.approx(sines["body_acceleration"], rel=2e-3)
    assert noise["tire_deflection_rear"] == pytest.approx(sines["tire_deflection_rear"], rel=2e-3)


@pytest.mark.analytical
@pytest.mark.slow
def test_exact_simulation_of_a_delayed_loop_agrees_with_its_spectrum():
    """200 s of the published random design: every indicator within sampling error (about 1/sqrt(B T), 3 sigma)."""
    car, road = HalfCar(), RandomRoad(iso_class="C", speed=20.0, seed=1)
    loop = closed_half_car()
    response = simulate(loop, np.arange(0, 210, 2e-3), road.inputs(LAGS))
    simulated = values(ride_indices(response, skip=10.0, vehicle=car))
    exact = values(stationary_rms(loop, road, LAGS, vehicle=car))
    assert set(exact) < set(simulated)
    for name, value in exact.items():
        assert simulated[name] == pytest.approx(value, rel=0.1), name


@pytest.mark.analytical
def test_exact_simulation_on_a_harmonic_road_reaches_its_steady_state():
    """Six periods after the slowest root (abscissa -1.17) has died by e^-35 the RMS is the phasor solution."""
    road = HarmonicRoad(0.05, 7.0)
    loop = closed_half_car()
    period = 2 * np.pi / 7
    t = np.arange(0, 40 * period + 1e-9, period / 200)
    found = values(ride_indices(simulate(loop, t, road.inputs(LAGS)), skip=34 * period))
    exact = values(stationary_rms(loop, road, LAGS))
    for name in (*SIX, "actuator_force_front", "actuator_force_rear"):
        assert found[name] == pytest.approx(exact[name], rel=1e-7), name


@pytest.mark.analytical
def test_response_psd_of_a_delayed_loop_equals_the_oracle():
    road = RandomRoad(iso_class="C", speed=20.0)
    omega = np.linspace(*road.band, 500)
    table = response_psd(closed_half_car(), road, omega, LAGS)
    h = oracles.ride_response(1j * omega, GAINS, DELAYS)
    h = h[..., 0] + h[..., 1] * np.exp(-0.138j * omega)[:, None]
    road_psd = 256e-6 * 0.01 * 20.0 / (omega / (2 * np.pi)) ** 2 / (2 * np.pi)
    for k, name in enumerate(SIX):
        expected = np.abs(h[:, k]) ** 2 * road_psd
        np.testing.assert_allclose(table[name], expected, rtol=1e-9)
    expected = np.abs(h[:, 0] * iso2631_weighting(omega, "Wk")) ** 2 * road_psd
    np.testing.assert_allclose(table["body_acceleration_weighted"], expected, rtol=1e-9)
    np.testing.assert_array_equal(table["omega"], omega)


@pytest.mark.analytical
def test_response_psd_integrates_to_the_rms():
    road = RandomRoad(iso_class="C", speed=20.0)
    plant, omega = HalfCar().plant(), np.geomspace(*road.band, 4001)
    densities = response_psd(plant, road, omega, LAGS, seat_position=0.5)
    rms = values(stationary_rms(plant, road, LAGS, seat_position=0.5))
    for name in (*SIX, "seat_acceleration", "seat_acceleration_weighted"):
        assert np.sqrt(np.trapezoid(densities[name], omega)) == pytest.approx(rms[name], rel=1e-4)
    with pytest.raises(InputError, match="psd"):
        response_psd(plant, HarmonicRoad(0.05, 7.0), omega, LAGS)
    with pytest.raises(InputError, match="omega"):
        response_psd(plant, road, [1.0, np.nan], LAGS)
    with pytest.raises(UnstableSystemError):
        response_psd(closed_half_car(gains=(-400e3, 0.0)), road, omega, LAGS)


@pytest.mark.analytical
def test_measured_record_of_a_random_road_gives_its_ride():
    """4 km of a class C road as a record, its Welch estimate against the spectrum it came from."""
    source = RandomRoad(iso_class="C", speed=1.0, seed=5, bins=900)
    x = np.arange(0, 4000, 0.1)
    record = MeasuredRoad(distance=x, elevation=source.profile(x), speed=20.0)
    plant = HalfCar().plant()
    found = values(stationary_rms(plant, record, LAGS, rtol=1e-2))
    exact = values(stationary_rms(plant, RandomRoad(iso_class="C", speed=20.0), LAGS))
    # the record resolves waves up to 110 m, shorter than the longest of the road: deflections see little of it
    for name in SIX:
        assert found[name] == pytest.approx(exact[name], rel=0.05), name
