import os
from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import csd, welch

from susp_ctrl.errors import InputError
from susp_ctrl.road import FilteredNoiseRoad, MeasuredRoad, RandomRoad, TwoTrackRoad

# ---- filtered white noise -------------------------------------------------------------------------------------------


@pytest.mark.analytical
def test_filtered_noise_has_its_variance():
    """sigma^2 = pi n0^2 G_d(n0)/(2 n00) at every point: over 1500 independent short roads."""
    rng = np.random.default_rng(7)
    ends = np.array(
        [
            FilteredNoiseRoad(iso_class="C", speed=20.0, seed=rng, length=1.0, lead=0.0, step=0.5).profile(
                [0, 0.05]
            )
            for _ in range(1500)
        ]
    )
    expected = np.sqrt(np.pi * 0.01 * 256e-6 / (2 * 0.011))
    road = FilteredNoiseRoad(iso_class="C", speed=20.0, length=1.0)
    assert road.rms() == pytest.approx(expected, rel=1e-12)
    # 1500 values: 1.8 % (1 sigma)
    assert np.std(ends, axis=0) == pytest.approx([expected] * 2, rel=0.07)
    assert np.mean(ends, axis=0) == pytest.approx([0, 0], abs=4 * expected / np.sqrt(1500))


@pytest.mark.analytical
def test_filtered_noise_lies_on_its_class():
    """The second generator meets the same class as the sum of sines: band powers by Welch within 5 %."""
    speed, step = 25.0, 0.1
    road = FilteredNoiseRoad(iso_class="B", speed=speed, seed=3, length=60000.0, step=step)
    t = np.arange(599999) * step / speed
    n, density = welch(road.profile(t), fs=1 / step, nperseg=2**13)
    edges = 0.05 * 2.0 ** np.arange(5)
    for low, high in pairwise(edges):
        inside = (n >= low) & (n < high)
        expected = 64e-6 * 0.01 * (np.arctan(high / 0.011) - np.arctan(low / 0.011)) / 0.011
        assert np.sum(density[inside]) * n[1] / expected == pytest.approx(1, abs=0.05)
    # far above the cut-off it is the class itself
    assert road.spatial_psd(1.0) == pytest.approx(64e-6 * 0.01, rel=2e-4)
    assert road.psd(2 * np.pi * speed) == pytest.approx(road.spatial_psd(1.0) / (2 * np.pi * speed))


def test_filtered_noise_is_one_road_for_all_wheels():
    road = FilteredNoiseRoad(speed=20.0, seed=1, length=50.0)
    t = np.linspace(0, 2, 500)
    signals = road.inputs({"road_front": 0.0, "road_rear": 0.138})
    np.testing.assert_array_equal(signals["road_rear"](t), signals["road_front"](t - 0.138))
    np.testing.assert_array_equal(
        road.profile(t), FilteredNoiseRoad(speed=20.0, seed=1, length=50.0).profile(t)
    )
    with pytest.raises(InputError, match="length"):
        road.profile([3.0])
    with pytest.raises(InputError, match="lead"):
        road.profile([0.0], lag=1.0)


# ---- measured road --------------------------------------------------------------------------------------------------


@pytest.mark.analytical
@pytest.mark.parametrize(("interpolation", "tolerance"), [("cubic", 3e-8), ("linear", 2e-5)])
def test_measured_road_follows_its_samples(interpolation, tolerance):
    x = np.arange(100.0, 160.0, 0.1)
    road = MeasuredRoad(
        distance=x,
        elevation=3.0 + 0.02 * np.sin(0.5 * (x - 100)) ** 2,
        speed=10.0,
        interpolation=interpolation,
    )
    t = np.linspace(0, 5.5, 1234)
    expected = 0.02 * np.sin(0.5 * 10 * t) ** 2
    np.testing.assert_allclose(road.profile(t), expected, atol=tolerance)
    np.testing.assert_allclose(road.profile(t + 0.3, lag=0.3), road.profile(t), atol=1e-12)
    # flat before the record, the last elevation after it
    assert road.profile([-1.0, -0.1]).tolist() == [0, 0]
    assert road.profile([6.5, 9.0]) == pytest.approx([0.02 * np.sin(0.5 * 59.9) ** 2] * 2)
    assert road.length == pytest.approx(59.9)
    breakpoints = road.signal(0.3).breakpoints
    assert breakpoints[0] == 0.3
    assert breakpoints[-1] == pytest.approx(6.29)
    assert len(breakpoints) == 600


@pytest.mark.analytical
def test_spectrum_of_a_measured_road_is_that_of_the_road_it_came_from():
    source = RandomRoad(iso_class="D", speed=1.0, seed=5, n_min=0.005, n_max=5.0, bins=900)
    x = np.arange(0, 4000, 0.1)
    road = MeasuredRoad(distance=x, elevation=source.profile(x), speed=15.0)
    fit = road.fit_iso8608(n_min=0.02, n_max=2.0)
    assert fit.waviness == pytest.approx(2.0, abs=0.1)
    assert fit.g_d == pytest.approx(1024e-6, rel=0.1)
    omega = np.geomspace(2 * np.pi * 15 * 0.05, 2 * np.pi * 15 * 2, 4001)
    power = np.trapezoid(road.psd(omega), omega)
    assert power == pytest.approx(1024e-6 * 0.01 * (1 / 0.05 - 1 / 2), rel=0.08)
    assert road.psd(np.array([0.0, 1e6])).tolist() == [0, 0]


def test_measured_road_from_a_csv_file(tmp_path):
    file = tmp_path / "straße 1.csv"
    file.write_text(
        "# a survey\ndistance, elevation, note\n0, 1.00, a\n1, 1.01, b\n2, 1.03, c\n3, 1.00, d\n", "utf-8"
    )
    road = MeasuredRoad.from_csv(file, speed=2.0, interpolation="linear")
    assert road.profile([0, 0.25, 0.5, 1.0, 1.5]) == pytest.approx([0, 0.005, 0.01, 0.03, 0.0])
    renamed = tmp_path / "renamed.csv"
    renamed.write_text("s,z\n5,0\n6,0.01\n7,0.03\n8,0\n")
    other = MeasuredRoad.from_csv(str(renamed), speed=2.0, distance="s", elevation="z")
    assert other.profile([0.5, 1.0]) == pytest.approx([0.01, 0.03])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot be read"),
        ("", "cannot be read"),
        ("distance,height\n0,1\n", "'elevation'"),
        ("distance,elevation\n0,1\n1,two\n2,2\n3,3\n", "'two' in data row 2"),
        ("distance,elevation\n0,1\n1,\n2,2\n3,3\n", "elevation = .* in data row 2"),
        ("distance,elevation\n0,1\n2,1\n1,2\n3,3\n", "does not increase"),
        ("distance,elevation\n0,1\n1,1\n2,2\n", "at least 4"),
    ],
)
def test_a_bad_road_file_gives_one_line_that_names_it(tmp_path, text, message):
    file = tmp_path / "road.csv"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        MeasuredRoad.from_csv(file, speed=10.0)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value).strip()


# ---- two tracks -----------------------------------------------------------------------------------------------------


@pytest.mark.analytical
def test_both_tracks_carry_the_exact_power_of_every_bin():
    left = RandomRoad(iso_class="C", speed=20.0, seed=1)
    road = TwoTrackRoad(road=left, track_width=1.5, seed=2)
    np.testing.assert_array_equal(road.right_lines[0], left.lines[0])
    np.testing.assert_array_equal(road.right_lines[1], left.lines[1])
    # the co-spectrum of every line is gamma times its power: cos of the phase difference
    gamma = (1 + (left.lines[0] / 20 * 1.5 / 3.0) ** 2) ** -1.3
    np.testing.assert_allclose(np.cos(road.right_lines[2] - left.lines[2]), gamma, atol=1e-12)
    # 300 signs: the quadrature spectrum is small in the mean
    assert abs(np.mean(np.sin(road.right_lines[2] - left.lines[2]))) < 0.15


@pytest.mark.analytical
def test_coherence_of_the_profiles():
    """Co-spectrum over PSD from long profiles, octave by octave, against the model; n in cycle/m, B = 1.5 m."""
    left = RandomRoad(iso_class="B", speed=1.0, seed=4, bins=600)
    road = TwoTrackRoad(road=left, track_width=1.5, seed=5)
    x = np.arange(2**16) * 0.15
    one, two = road.signal(track="left")(x), road.signal(track="right")(x)
    n, cross = csd(one, two, fs=1 / 0.15, nperseg=2**13)
    _, auto = welch(one, fs=1 / 0.15, nperseg=2**13)
    _, auto_right = welch(two, fs=1 / 0.15, nperseg=2**13)
    for k in range(1, 7):
        low, high = left.edges[75 * k], left.edges[75 * (k + 1)]
        inside = (n >= low) & (n < high)
        middle = np.linspace(low, high, 400)
        gamma = (1 + (2 * np.pi * middle * 1.5 / 5.3) ** 2) ** -2.2
        expected = np.trapezoid(gamma / middle**2, middle) / np.trapezoid(1 / middle**2, middle)
        found = np.sum(cross[inside].real) / np.sqrt(np.sum(auto[inside]) * np.sum(auto_right[inside]))
        assert found == pytest.approx(expected, abs=0.05)


def test_tracks_are_told_apart_by_the_names_of_the_inputs():
    left = RandomRoad(iso_class="C", speed=20.0, seed=1)
    road = TwoTrackRoad(road=left, track_width=1.5, seed=2)
    lags = {"road_front_left": 0.0, "road_front_right": 0.0, "road_rear_left": 0.1, "road_rear_right": 0.1}
    signals = road.inputs(lags)
    t = np.linspace(0, 3, 700)
    np.testing.assert_array_equal(signals["road_front_left"](t), left.profile(t))
    np.testing.assert_array_equal(signals["road_rear_right"](t), signals["road_front_right"](t - 0.1))
    assert np.max(np.abs(signals["road_front_left"](t) - signals["road_front_right"](t))) > 1e-3
    assert signals["road_rear_right"].sines is not None
    with pytest.raises(InputError, match="road_front'"):
        road.inputs({"road_front": 0.0})


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: FilteredNoiseRoad(speed=20.0, length=-1), "length"),
        (lambda: FilteredNoiseRoad(speed=20.0, length=1, iso_class="Q"), "iso_class"),
        (lambda: FilteredNoiseRoad(speed=20.0, length=1, g_d=0), "g_d"),
        (lambda: MeasuredRoad(distance=[0, 1, 2, 3], elevation=[0, 1, 2], speed=1), "elevation"),
        (lambda: MeasuredRoad(distance=[0, 1, 1, 3], elevation=[0, 1, 2, 3], speed=1), "distance"),
        (lambda: MeasuredRoad(distance=[0, 1, 2, 3], elevation=[0, 1, 2, 3], speed=0), "speed"),
        (
            lambda: MeasuredRoad(
                distance=[0, 1, 2, 3], elevation=[0, 1, 2, 3], speed=1, interpolation="cubik"
            ),
            "'cubic'",
        ),
        (lambda: TwoTrackRoad(road=3, track_width=1.5), "road"),
        (lambda: TwoTrackRoad(road=RandomRoad(speed=20.0), track_width=0), "track_width"),
        (lambda: TwoTrackRoad(road=RandomRoad(speed=20.0, iso_class="F"), track_width=1.5), "omega_p"),
    ],
)
def test_bad_input_is_refused_by_name(make, named):
    with pytest.raises(InputError, match=named):
        make()


def test_truth_values_are_no_elevations(tmp_path):
    file = tmp_path / "road.csv"
    file.write_text("distance,elevation\n0,0\n1,True\n2,0\n3,0\n")
    with pytest.raises(InputError, match="'True' in data row 2"):
        MeasuredRoad.from_csv(file, speed=10.0)


def test_numbers_are_read_to_the_last_bit(tmp_path):
    file = tmp_path / "road.csv"
    elevation = np.random.default_rng(0).normal(size=50) * 10.0 ** np.arange(-25, 25)
    file.write_text(
        "distance,elevation\n" + "".join(f"{n},{z!r}\n" for n, z in enumerate(elevation.tolist()))
    )
    road = MeasuredRoad.from_csv(file, speed=10.0)
    np.testing.assert_array_equal(road.samples[1], elevation - elevation[0])


def test_the_first_line_of_any_file_is_not_told(tmp_path):
    file = tmp_path / "secret.txt"
    file.write_text("root:password\x1b[2J:0:0," + "x" * 50_000 + "\n1,2\n")
    with pytest.raises(InputError) as caught:
        MeasuredRoad.from_csv(file, speed=10.0)
    text = str(caught.value)
    assert "password" not in text
    assert "'distance'" in text
    assert len(text) <= 300
    file.write_text("Distance,elevation\n0,1\n")
    with pytest.raises(InputError, match="did you mean 'Distance'"):
        MeasuredRoad.from_csv(file, speed=10.0)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
def test_pipes_devices_and_huge_files_are_no_roads(tmp_path):
    pipe, huge = tmp_path / "pipe.csv", tmp_path / "huge.csv"
    os.mkfifo(pipe)
    with huge.open("wb") as file:
        file.truncate(2**36)
    for path in (pipe, "/dev/zero", tmp_path):
        with pytest.raises(InputError, match="no regular file"):
            MeasuredRoad.from_csv(path, speed=10.0)
    with pytest.raises(InputError, match="bytes"):
        MeasuredRoad.from_csv(huge, speed=10.0)
    with pytest.raises(InputError, match="path"):
        MeasuredRoad.from_csv(3.5, speed=10.0)
