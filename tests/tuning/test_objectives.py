"""Objectives against the 4 x 4 oracle of eq. (1), the paper's numbers and closed forms."""

from __future__ import annotations

import control
import numpy as np
import pytest
from tuning.tuning_case import (
    BAND,
    LAGS,
    PAIRS,
    WEIGHTS,
    eq6,
    magnitudes,
    objective,
    problem,
    random_designs,
    road,
    road_psd,
    road_sigmas,
)

from susp_ctrl.errors import InputError
from susp_ctrl.road import HarmonicRoad, RandomRoad
from susp_ctrl.tuning import BandMean, BandPeak, Harmonic, RoadRms, TuningProblem
from susp_ctrl.tuning.objectives.resonance_rule import resonance_rule
from susp_ctrl.tuning.sampling import channel_exponentials
from susp_ctrl.vehicle import HalfCar, QuarterCar

DESIGNS = np.vstack([random_designs(20, seed=1), [[0.0, 0.0, 0.1, 0.1]]])


@pytest.mark.analytical
def test_exponentials_to_rounding():
    rng = np.random.default_rng(0)
    gains, delays = rng.normal(size=(50, 3)), rng.uniform(0, 2, (50, 3))
    delays[0, 0], delays[1] = 0.0, np.pi / 2  # the tangent has a pole at omega = 2
    omega = np.append(rng.uniform(0, 400, 200), [0.0, 2.0])
    exact = gains[:, None, :] * np.exp(-1j * omega[:, None] * delays[:, None, :])
    np.testing.assert_allclose(channel_exponentials(gains, delays, omega), exact, rtol=0, atol=1e-13)


@pytest.mark.analytical
def test_harmonic_is_eq6_of_the_oracle():
    expected = [eq6(np.array([7.0]), x)[0] for x in DESIGNS]
    np.testing.assert_allclose(problem("harmonic").values(DESIGNS), expected, rtol=1e-11)


@pytest.mark.literature
def test_harmonic_of_the_passive_and_the_published_design():
    """Independent recomputation of eq. (1): passive J = 10.79, published harmonic design 7.93 at 7 rad/s, 20 m/s."""
    p = problem("harmonic")
    assert p.passive_value == pytest.approx(10.79, abs=0.005)
    assert p.values(np.array([[29653, -4416, 0.3255, 0.5438]]))[0] == pytest.approx(7.93, abs=0.005)


@pytest.mark.analytical
def test_band_mean_and_peak_are_those_of_the_oracle():
    grid = np.linspace(2.0, 90.0, 177)
    spectra = np.array([eq6(grid, x) for x in DESIGNS])
    lags = {"objective": None}
    for kind, expected in (
        (BandMean, np.trapezoid(spectra, grid, axis=1) / 88.0),
        (BandPeak, spectra.max(axis=1)),
    ):
        lags["objective"] = kind(grid, WEIGHTS, LAGS)
        p = TuningProblem(HalfCar().plant(), PAIRS, gain_bounds=(-4e4, 4e4), **lags)
        np.testing.assert_allclose(p.values(DESIGNS), expected, rtol=1e-11)


def test_a_band_of_two_numbers_is_sampled():
    """The mean over (from, to) agrees with a fine one of the oracle to the error of its 300 points."""
    fine = np.linspace(1.0, 100.0, 40001)
    for x, value in zip(DESIGNS[:5], problem("band_mean").values(DESIGNS[:5]), strict=True):
        assert value == pytest.approx(np.trapezoid(eq6(fine, x), fine) / 99.0, rel=2e-3)


@pytest.mark.analytical
def test_road_rms_with_300_points_against_20000():
    expected = np.array([road_sigmas(x) @ [0.7, 0.3] for x in DESIGNS])
    np.testing.assert_allclose(problem("road_rms").values(DESIGNS), expected, rtol=2e-4)
    finer = TuningProblem(
        HalfCar().plant(), PAIRS, RoadRms(road(), WEIGHTS, LAGS, points=2000), gain_bounds=(-4e4, 4e4)
    )
    np.testing.assert_allclose(finer.values(DESIGNS), expected, rtol=2e-7)


@pytest.mark.literature
def test_road_rms_of_the_passive_car():
    """Recomputed from the PSD: 0.9291 m/s2 and 0.7078 rad/s2 on class C at 20 m/s; doubling per class."""
    for name, sigma in (("body_acceleration", 0.9291), ("pitch_acceleration", 0.7078)):
        for iso_class, factor in (("C", 1.0), ("D", 2.0)):
            rough = RandomRoad(iso_class=iso_class, speed=20.0)
            p = TuningProblem(
                HalfCar().plant(), PAIRS, RoadRms(rough, {name: 1.0}, LAGS), gain_bounds=(-1, 1)
            )
            assert p.passive_value == pytest.approx(factor * sigma, abs=1.1e-4 * factor)


@pytest.mark.analytical
def test_resonance_rule_integrates_a_narrow_resonance():
    """Integral of a Lorentzian whose width is a thousandth of the band, in closed form."""
    pole, (low, high) = -0.1 + 50.0j, BAND
    omega, weights = resonance_rule(BAND, np.array([pole, pole.conjugate()]), 300)
    assert omega.size == 300
    assert weights.sum() == pytest.approx(high - low, rel=1e-13)
    value = weights @ (0.1 / ((omega - 50.0) ** 2 + 0.01))
    exact = np.arctan((high - 50.0) / 0.1) - np.arctan((low - 50.0) / 0.1)
    assert value == pytest.approx(exact, rel=1e-6)


@pytest.mark.property
def test_weights_scale_and_swarm_equals_single_designs():
    p = problem("road_rms")
    together = p.values(DESIGNS)
    np.testing.assert_allclose(together, [p.values(x[None])[0] for x in DESIGNS], rtol=1e-13)
    double = p.replace(objective=RoadRms(road(), {k: 2 * w for k, w in WEIGHTS.items()}, LAGS))
    np.testing.assert_allclose(double.values(DESIGNS), 2 * together, rtol=1e-13)


@pytest.mark.analytical
def test_iso_weighting_filters_the_outputs():
    """Wk and We of ISO 2631-1 written out here: factors of the oracle's spectra and of the road integral."""

    def second(s, f, q):
        w = 2 * np.pi * f
        return 1 + s / (q * w) + (s / w) ** 2

    def weight(omega, f3, f4, q4, step=None):
        s = 1j * omega
        w1 = 2 * np.pi * 0.4
        h = 1 / (1 + np.sqrt(2) * w1 / s + (w1 / s) ** 2) / second(s, 100.0, 1 / np.sqrt(2))
        h = h * (1 + s / (2 * np.pi * f3)) / second(s, f4, q4)
        if step:
            f5, q5, f6, q6 = step
            h = h * second(s, f5, q5) / second(s, f6, q6) * (f5 / f6) ** 2
        return np.abs(h)

    filters = {"body_acceleration": "Wk", "pitch_acceleration": "We"}
    omega = np.geomspace(*BAND, 20000)
    factors = np.column_stack(
        [weight(omega, 12.5, 12.5, 0.63, (2.37, 0.91, 3.35, 0.91)), weight(omega, 1.0, 1.0, 0.63)]
    )
    x = DESIGNS[0]
    psd = road_psd(omega)
    sigma = np.sqrt(
        np.trapezoid((magnitudes(omega, x) * factors) ** 2 * (psd * omega)[:, None], np.log(omega), axis=0)
    )
    p = TuningProblem(
        HalfCar().plant(), PAIRS, RoadRms(road(), WEIGHTS, LAGS, weighting=filters), gain_bounds=(-4e4, 4e4)
    )
    assert p.values(x[None])[0] == pytest.approx(sigma @ [0.7, 0.3], rel=2e-4)
    few = np.array([3.0, 8.0, 60.0])
    factors = np.column_stack(
        [weight(few, 12.5, 12.5, 0.63, (2.37, 0.91, 3.35, 0.91)), weight(few, 1.0, 1.0, 0.63)]
    )
    expected = ((magnitudes(few, x) * factors) @ [0.7, 0.3] / few).max()
    peak = TuningProblem(
        HalfCar().plant(), PAIRS, BandPeak(few, WEIGHTS, LAGS, weighting=filters), gain_bounds=(-4e4, 4e4)
    )
    assert peak.values(x[None])[0] == pytest.approx(expected, rel=1e-10)


def test_single_road_needs_no_lags():
    car = QuarterCar()
    p = TuningProblem(
        car.plant(), [("unsprung_displacement", "force")], RoadRms(road(), {"body_acceleration": 1.0}),
        gain_bounds=(-1e4, 1e4),
    )  # fmt: skip
    plant = car.plant()
    omega = np.geomspace(*BAND, 20000)
    h = np.abs(control.frequency_response(plant["body_acceleration", "road"], omega).complex) ** 2
    psd = 256e-6 * 0.01 * 20.0 / (omega / 2 / np.pi) ** 2 / (2 * np.pi)
    assert p.passive_value == pytest.approx(np.sqrt(np.trapezoid(h * psd * omega, np.log(omega))), rel=1e-5)


@pytest.mark.parametrize(
    ("make", "part"),
    [
        (lambda: Harmonic(0.0, WEIGHTS, LAGS), "omega = 0"),
        (lambda: Harmonic(7.0, {}, LAGS), "weights"),
        (lambda: Harmonic(7.0, {"body_acceleration": -1.0}, LAGS), "body_acceleration.*-1"),
        (lambda: Harmonic(7.0, {"body_acceleration": 0.0}, LAGS), "all zero"),
        (lambda: Harmonic(7.0, WEIGHTS, {"road_front": -0.1}), "road_front.*-0.1"),
        (lambda: BandMean([], WEIGHTS, LAGS), "omega"),
        (lambda: BandMean([5.0], WEIGHTS, LAGS), "empty band"),
        (lambda: BandMean((9.0, 2.0), WEIGHTS, LAGS), "does not increase"),
        (lambda: BandPeak((0.0, 2.0), WEIGHTS, LAGS), "omega > 0"),
        (lambda: RoadRms(HarmonicRoad(0.05, 7.0), WEIGHTS, LAGS), "road"),
        (lambda: RoadRms(None, WEIGHTS, LAGS), "road = None"),
        (lambda: Harmonic(7.0, WEIGHTS, LAGS, weighting={"body_acceleration": "Wq"}), "Wq"),
        (
            lambda: Harmonic(7.0, WEIGHTS, LAGS, weighting={"body_velocity": "Wk"}),
            "weighting = 'body_velocity'",
        ),
        (lambda: Harmonic(7.0, WEIGHTS, LAGS, weighting="Wk"), "weighting = 'Wk'"),
        (lambda: RoadRms(RandomRoad(iso_class="C", speed=20.0), WEIGHTS, LAGS, points=3), "points"),
    ],
)
def test_bad_description_is_named(make, part):
    with pytest.raises(InputError, match=part):
        make()


@pytest.mark.parametrize(
    ("lags", "part"),
    [
        (None, "2 road inputs"),
        ({"road_front": 0.0}, "no entry for 'road_rear'"),
        ({"road_front": 0.0, "road_reer": 0.1}, "did you mean 'road_rear'"),
    ],
)
@pytest.mark.parametrize("name", ["harmonic", "road_rms"])
def test_the_wheelbase_cannot_be_forgotten(name, lags, part):
    base = objective(name)
    kind = type(base)
    first = base.omega if name == "harmonic" else base.road
    with pytest.raises(InputError, match=part):
        TuningProblem(HalfCar().plant(), PAIRS, kind(first, WEIGHTS, lags), gain_bounds=(-1, 1))


def test_unknown_output_names_the_nearest():
    with pytest.raises(InputError, match="did you mean 'body_acceleration'"):
        TuningProblem(HalfCar().plant(), PAIRS, Harmonic(7.0, {"body_aceleration": 1.0}, LAGS), (-1, 1))
