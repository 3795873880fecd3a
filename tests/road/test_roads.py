from itertools import pairwise

import numpy as np
import pytest

from susp_ctrl.errors import InputError
from susp_ctrl.road import BumpRoad, HarmonicRoad, RandomRoad
from susp_ctrl.road.sine_sum import sine_sum

MEANS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6, "F": 16384e-6, "G": 65536e-6,
         "H": 262144e-6}  # fmt: skip
BAND_RMS_MM = {"A": 3.81, "B": 7.61, "C": 15.23, "D": 30.45, "H": 487.22}


def direct_sum(t, lines):
    omegas, amplitudes, phases = lines
    rows = [np.sum(amplitudes * np.sin(omegas * tk + phases)) for tk in np.ravel(t)]
    return np.reshape(rows, np.shape(t))


# ---- sum of sines -----------------------------------------------------------------------------------


@pytest.mark.analytical
@pytest.mark.parametrize("order", ["increasing", "shuffled", "grid"])
def test_sine_sum_equals_the_direct_sum(order):
    rng = np.random.default_rng(3)
    lines = (np.geomspace(1.4, 356, 120), rng.uniform(0, 1, 120), rng.uniform(0, 6.3, 120))
    t = np.sort(rng.uniform(-3, 25, 4000)) if order != "grid" else np.linspace(0, 8, 4001)[:4000]
    if order == "shuffled":
        t = rng.permutation(t)
    t = t.reshape(2, 2000)
    expected = direct_sum(t, lines)
    found = sine_sum(t, *lines)
    assert found.shape == t.shape
    # omega t itself is only known to one rounding: 356 * 25 * 1e-16 = 1e-12 rad
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.sum(lines[1]))


@pytest.mark.analytical
def test_sine_sum_is_exact_near_zero_where_omega_t_is_exact():
    lines = (np.array([0.5, 40.0, 64.0]), np.array([1.0, 2.0, -0.3]), np.array([0.1, 2.0, 4.0]))
    t = np.linspace(-0.2, 0.2, 1001)
    np.testing.assert_allclose(sine_sum(t, *lines), direct_sum(t, lines), rtol=0, atol=2e-14)


def test_sine_sum_of_few_or_no_times():
    lines = (np.array([3.0]), np.array([2.0]), np.array([0.4]))
    assert sine_sum(np.array(1.5), *lines) == pytest.approx(2 * np.sin(4.9), abs=1e-15)
    assert sine_sum(np.zeros((0, 2)), *lines).shape == (0, 2)


# ---- harmonic road and bump -------------------------------------------------------------------------


@pytest.mark.analytical
def test_harmonic_road_arrives_with_a_kink():
    road = HarmonicRoad(0.05, 7.0)
    t = np.linspace(-1, 3, 401)
    expected = np.where(t > 0.138, 0.05 * np.sin(7 * (t - 0.138)), 0.0)
    np.testing.assert_allclose(road.profile(t, lag=0.138), expected, atol=1e-16)
    signal = road.inputs({"road_rear": 0.138})["road_rear"]
    assert signal.breakpoints == (0.138,)
    assert signal.bandwidth == 7.0
    assert signal.sines is None
    np.testing.assert_array_equal(signal(t), road.profile(t, lag=0.138))
    assert signal(0.5) == pytest.approx(0.05 * np.sin(7 * 0.362))


@pytest.mark.analytical
def test_steady_harmonic_road_exists_for_all_time():
    signal = HarmonicRoad(0.05, 7.0, steady=True).inputs({"road_rear": 0.138})["road_rear"]
    t = np.linspace(-1, 3, 401)
    np.testing.assert_allclose(signal(t), 0.05 * np.sin(7 * (t - 0.138)), atol=1e-16)
    assert signal.breakpoints == ()
    np.testing.assert_allclose(direct_sum(t, signal.sines), signal(t), atol=1e-15)


@pytest.mark.analytical
def test_bump_is_the_cosine_and_flat_elsewhere():
    bump = BumpRoad(height=0.08, length=3.0, speed=12.0)
    t = np.linspace(-0.1, 0.6, 701)
    inside = (t >= 0.05) & (t <= 0.3)
    expected = np.where(inside, 0.04 * (1 - np.cos(2 * np.pi * 12 * (t - 0.05) / 3.0)), 0.0)
    np.testing.assert_allclose(bump.profile(t, lag=0.05), expected, atol=1e-16)
    assert bump.profile(0.125) == pytest.approx(0.08)
    assert bump.signal(0.05).breakpoints == pytest.approx((0.05, 0.3))
    assert bump.signal().bandwidth is None


# ---- random road ------------------------------------------------------------------------------------


@pytest.mark.literature
@pytest.mark.parametrize("iso_class", MEANS)
def test_class_means_of_iso_8608(iso_class):
    """G_d(0.1 cycle/m) of ISO 8608 table C.1 (geometric means)."""
    road = RandomRoad(iso_class=iso_class, speed=20.0)
    assert road.spatial_psd(0.1) == pytest.approx(MEANS[iso_class], rel=1e-12)
    assert road.spatial_psd(0.2) == pytest.approx(MEANS[iso_class] / 4, rel=1e-12)


@pytest.mark.analytical
@pytest.mark.parametrize("iso_class", BAND_RMS_MM)
def test_band_rms_in_closed_form(iso_class):
    road = RandomRoad(iso_class=iso_class, speed=20.0, seed=4)
    assert 1e3 * road.rms() == pytest.approx(BAND_RMS_MM[iso_class], abs=0.005)
    by_hand = np.sqrt(MEANS[iso_class] * 0.01 * (1 / 0.011 - 1 / 2.83))
    assert road.rms() == pytest.approx(by_hand, rel=1e-12)
    # the sines carry exactly this power, whatever the number of bins
    for bins in (7, 300):
        amplitudes = RandomRoad(iso_class=iso_class, speed=20.0, bins=bins).lines[1]
        assert np.sqrt(np.sum(amplitudes**2) / 2) == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.analytical
@pytest.mark.parametrize("waviness", [1.0, 1.6, 2.0, 2.4, 3.0])
def test_every_bin_is_exact_for_any_waviness(waviness):
    """Power and slope power of each line against adaptive quadrature of G_d and n^2 G_d over its bin."""
    from scipy.integrate import quad

    v = 13.0
    road = RandomRoad(g_d=90e-6, speed=v, waviness=waviness, n_min=0.02, n_max=4.0, bins=9)
    omegas, amplitudes, _ = road.lines
    for k in range(9):
        low, high = road.edges[k : k + 2]
        power, _ = quad(lambda n: 90e-6 * (n / 0.1) ** -waviness, low, high, epsabs=0, epsrel=1e-12)
        slope, _ = quad(lambda n: n**2 * 90e-6 * (n / 0.1) ** -waviness, low, high, epsabs=0, epsrel=1e-12)
        n = omegas[k] / (2 * np.pi * v)
        assert low < n < high
        assert amplitudes[k] ** 2 / 2 == pytest.approx(power, rel=1e-10)
        assert n**2 * amplitudes[k] ** 2 / 2 == pytest.approx(slope, rel=1e-10)


@pytest.mark.analytical
def test_line_of_a_bin_for_waviness_two():
    road = RandomRoad(iso_class="B", speed=25.0, bins=50)
    low, high = road.edges[:-1], road.edges[1:]
    omegas, amplitudes, _ = road.lines
    np.testing.assert_allclose(omegas, 2 * np.pi * 25 * np.sqrt(low * high), rtol=1e-12)
    np.testing.assert_allclose(amplitudes, np.sqrt(2 * 64e-6 * 0.01 * (1 / low - 1 / high)), rtol=1e-10)


@pytest.mark.analytical
def test_temporal_psd_is_the_textbook_form():
    """G_q(f) = G_d(n0) n0^2 v/f^2 (m2/Hz), here per rad/s: divided by 2 pi; zero off the band."""
    v = 17.0
    road = RandomRoad(iso_class="C", speed=v)
    f = np.geomspace(0.2, 40, 30)
    np.testing.assert_allclose(road.psd(2 * np.pi * f), 256e-6 * 0.01 * v / f**2 / (2 * np.pi), rtol=1e-12)
    assert road.psd(2 * np.pi * v * np.array([0.0, 0.0109, 2.84])).tolist() == [0, 0, 0]
    assert np.all(road.psd(np.array(road.band)) > 0)
    omega = np.geomspace(*road.band, 4001)
    assert np.sqrt(np.trapezoid(road.psd(omega), omega)) == pytest.approx(road.rms(), rel=1e-5)


@pytest.mark.analytical
@pytest.mark.parametrize(("iso_class", "speed"), [("A", 10.0), ("C", 20.0), ("E", 30.0)])
def test_welch_psd_of_the_profile_lies_on_its_class(iso_class, speed):
    """Time profile, Welch, octave by octave: within 5 % of the class mean over the whole band.

    A PSD built from class limits (x 2), from two-sided noise (x 2) or from amplitudes low by sqrt(pi) fails by far.
    """
    from scipy.signal import welch

    road = RandomRoad(iso_class=iso_class, speed=speed, seed=11)
    dx = 0.1  # m: Nyquist 5 cycle/m
    x = np.arange(2**18) * dx
    n, density = welch(road.profile(x / speed), fs=1 / dx, nperseg=2**16, window="hann")
    edges = road.edges[::37]  # octaves that end where bins end
    assert edges[-1] / edges[0] > 200
    for low, high in pairwise(edges):
        inside = (n >= low) & (n < high)
        power = np.sum(density[inside]) * (n[1] - n[0])
        expected = MEANS[iso_class] * 0.01 * (1 / low - 1 / high)
        assert power / expected == pytest.approx(1, abs=0.05), (low, high)


@pytest.mark.analytical
def test_velocity_of_the_road_has_its_rms():
    """The profile's derivative: sigma^2 = (2 pi v)^2 G_d(n0) n0^2 (n_max - n_min)."""
    v = 20.0
    road = RandomRoad(iso_class="C", speed=v, seed=2)
    t = np.arange(0, 200, 1e-3)
    h = 1e-4
    velocity = (road.profile(t + h) - road.profile(t - h)) / (2 * h)
    expected = 2 * np.pi * v * np.sqrt(256e-6 * 0.01 * (2.83 - 0.011))
    assert np.std(velocity) == pytest.approx(expected, rel=0.02)


def test_rear_wheel_meets_the_same_road():
    road = RandomRoad(iso_class="D", speed=20.0, seed=8)
    lag = 0.138
    t = np.linspace(0, 10, 5001)
    signals = road.inputs({"road_front": 0.0, "road_rear": lag})
    np.testing.assert_array_equal(signals["road_rear"](t), signals["road_front"](t - lag))
    np.testing.assert_array_equal(road.profile(t, lag=lag), signals["road_rear"](t))
    np.testing.assert_allclose(direct_sum(t[:200], signals["road_rear"].sines), signals["road_rear"](t[:200]),
                               atol=1e-13)  # fmt: skip
    assert signals["road_rear"].breakpoints == ()
    assert signals["road_rear"].bandwidth <= road.band[1]


def test_seed_fixes_the_road():
    t = np.linspace(0, 5, 100)
    one = RandomRoad(speed=20.0, seed=1).profile(t)
    np.testing.assert_array_equal(one, RandomRoad(speed=20.0, seed=1).profile(t))
    np.testing.assert_array_equal(one, RandomRoad(speed=20.0, seed=np.random.default_rng(1)).profile(t))
    assert np.max(np.abs(one - RandomRoad(speed=20.0, seed=2).profile(t))) > 1e-3
    # one road object stays the same road although its generator moves on
    road = RandomRoad(speed=20.0, seed=np.random.default_rng(5))
    np.testing.assert_array_equal(road.profile(t), road.profile(t))


def test_road_does_not_repeat():
    road = RandomRoad(speed=20.0, seed=1)
    x = road.profile(np.arange(0, 200, 0.01))
    x = x - x.mean()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(x, 2 * x.size)) ** 2)[: x.size // 2]
    # 10 s and later: no return to more than chance
    assert np.max(correlation[1000:]) < 0.7 * correlation[0]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"iso_class": "I", "speed": 20}, "iso_class"),
        ({"iso_class": None, "speed": 20}, "iso_class"),
        ({"speed": 0}, "speed"),
        ({"speed": 20, "g_d": -1}, "g_d"),
        ({"speed": 20, "n_min": 3.0}, "n_max"),
        ({"speed": 20, "bins": 0}, "bins"),
        ({"speed": 20, "bins": 2.5}, "bins"),
        ({"speed": 20, "seed": -1}, "seed"),
        ({"speed": 20, "seed": "x"}, "seed"),
        ({"speed": 20, "waviness": np.nan}, "waviness"),
    ],
)
def test_bad_random_road_is_refused_by_name(arguments, named):
    with pytest.raises(InputError, match=named):
        RandomRoad(**arguments)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: HarmonicRoad(-0.1, 7), "amplitude"),
        (lambda: HarmonicRoad(0.1, 0), "omega"),
        (lambda: HarmonicRoad(0.1, 7, steady="yes"), "steady"),
        (lambda: BumpRoad(height=np.inf, length=1, speed=1), "height"),
        (lambda: BumpRoad(height=0.1, length=0, speed=1), "length"),
        (lambda: BumpRoad(height=0.1, length=1, speed=-1), "speed"),
        (lambda: HarmonicRoad(0.1, 7).profile([0.0, np.nan]), "timepts"),
        (lambda: HarmonicRoad(0.1, 7).profile("soon"), "timepts"),
        (lambda: HarmonicRoad(0.1, 7).profile([0.0], lag=-1), "lag"),
        (lambda: HarmonicRoad(0.1, 7).inputs({}), "lags"),
        (lambda: HarmonicRoad(0.1, 7).inputs({"road_rear": -0.1}), "road_rear"),
        (lambda: HarmonicRoad(0.1, 7).inputs([0.1]), "lags"),
    ],
)
def test_bad_input_is_refused_by_name(make, named):
    with pytest.raises(InputError, match=named):
        make()
