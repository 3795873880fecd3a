import numpy as np
import pytest
from scipy.signal import lsim

from susp_ctrl.errors import InputError
from susp_ctrl.ride import comfort_bands, iso2631_weighting, weighted_history


@pytest.mark.literature
@pytest.mark.parametrize(
    ("weighting", "band", "value"),
    [
        ("Wk", 0, 0.482),
        ("Wk", 3, 0.531),
        ("Wk", 6, 0.965),
        ("Wk", 8, 1.054),
        ("Wk", 12, 0.774),
        ("Wk", 19, 0.134),
        ("We", 0, 0.880),
        ("We", 6, 0.254),
        ("Wd", 0, 1.011),
    ],
)
def test_magnitude_at_third_octaves(weighting, band, value):
    """ISO 8041-1 design goals at the true third-octave centres 10^(band/10) Hz, printed to three digits."""
    omega = 2 * np.pi * 10 ** (band / 10)
    assert abs(iso2631_weighting(omega, weighting)) == pytest.approx(value, abs=6e-4)


@pytest.mark.analytical
def test_limits_of_the_weighting():
    assert iso2631_weighting(0.0) == 0
    # far above the band H_l falls as 1/omega^2 and H_t as 1/omega
    fast = np.abs(iso2631_weighting(2 * np.pi * np.array([1e4, 2e4])))
    assert fast[0] / fast[1] == pytest.approx(8, rel=1e-3)
    # far below it H_h rises as omega^2
    slow = np.abs(iso2631_weighting(2 * np.pi * np.array([1e-3, 2e-3]), "We"))
    assert slow[1] / slow[0] == pytest.approx(4, rel=1e-3)
    omega = np.array([[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_allclose(iso2631_weighting(-omega), np.conj(iso2631_weighting(omega)))


def filter_polynomials(weighting):
    """Numerator and denominator of W(s), multiplied out from the table of ISO 8041-1."""
    f3, f4, q4 = {"Wk": (12.5, 12.5, 0.63), "Wd": (2, 2, 0.63), "We": (1, 1, 0.63)}[weighting]
    w = {k: 2 * np.pi * f for k, f in {1: 0.4, 2: 100, 3: f3, 4: f4, 5: 2.37, 6: 3.35}.items()}
    numerator, denominator = np.array([1.0, 0, 0]), np.array([1, w[1] * np.sqrt(2), w[1] ** 2])
    denominator = np.polymul(denominator, [1 / w[2] ** 2, np.sqrt(2) / w[2], 1])
    numerator = np.polymul(numerator, [1 / w[3], 1])
    denominator = np.polymul(denominator, [1 / w[4] ** 2, 1 / (q4 * w[4]), 1])
    if weighting == "Wk":
        numerator = np.polymul(numerator, [1, w[5] / 0.91, w[5] ** 2]) / w[5] ** 2 * (w[5] / w[6]) ** 2
        denominator = np.polymul(denominator, [1 / w[6] ** 2, 1 / (0.91 * w[6]), 1])
    return numerator, denominator


@pytest.mark.analytical
@pytest.mark.parametrize("weighting", ["Wk", "Wd", "We"])
@pytest.mark.parametrize("frequency", [2.0, 60.0])
def test_weighted_history_equals_the_filter_as_an_ordinary_differential_equation(weighting, frequency):
    """A tone that swells up and dies away, against the state-space filter on a grid fifty times finer."""
    step, fine = 2e-3, 4e-5
    t, t_fine = np.arange(3001) * step, np.arange(150001) * fine

    def tone(at):
        return np.sin(np.pi * at / 6.0) ** 4 * np.sin(2 * np.pi * frequency * at)

    _, expected, _ = lsim(filter_polynomials(weighting), tone(t_fine), t_fine)
    found = weighted_history(tone(t), step, weighting)
    error = np.max(np.abs(found - expected[::50])) / np.max(np.abs(expected))
    # the reference itself holds the tone linear between its samples: (2 pi 60 4e-5)^2/12 = 2e-5
    assert error < (2 * np.pi * frequency * fine) ** 2 / 12 + 1e-7


@pytest.mark.analytical
@pytest.mark.parametrize("frequency", [1.0, 4.0, 80.0])
def test_steady_tone_is_scaled_by_the_magnitude(frequency):
    """From rest, after the filter's transient of some seconds: amplitude |W|, to 1e-4 at 1 kHz sampling."""
    step = 1e-3
    t = np.arange(20000) * step
    found = weighted_history(np.sin(2 * np.pi * frequency * t), step)
    expected = abs(iso2631_weighting(2 * np.pi * frequency))
    late = slice(12000, 18000)
    assert np.sqrt(2 * np.mean(found[late] ** 2)) == pytest.approx(expected, rel=1e-4)


def test_weighted_history_has_the_shape_of_the_signal():
    rng = np.random.default_rng(1)
    values = rng.standard_normal((3, 2, 400))
    found = weighted_history(values, 0.01)
    assert found.shape == values.shape
    np.testing.assert_allclose(found[1, 1], weighted_history(values[1, 1], 0.01), atol=1e-15)


@pytest.mark.parametrize(
    ("value", "bands"),
    [
        (0.0, ["not uncomfortable"]),
        (0.3, ["not uncomfortable"]),
        (0.315, ["a little uncomfortable"]),
        (0.4, ["a little uncomfortable"]),
        (0.55, ["a little uncomfortable", "fairly uncomfortable"]),
        (0.7, ["fairly uncomfortable"]),
        (0.9, ["fairly uncomfortable", "uncomfortable"]),
        (1.3, ["uncomfortable", "very uncomfortable"]),
        (2.2, ["very uncomfortable", "extremely uncomfortable"]),
        (9.0, ["extremely uncomfortable"]),
    ],
)
def test_comfort_bands_overlap(value, bands):
    assert comfort_bands(value) == bands


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: iso2631_weighting(1.0, "Wz"), "weighting"),
        (lambda: iso2631_weighting(np.nan), "omega"),
        (lambda: weighted_history([1.0, 2.0], 0.0), "step"),
        (lambda: weighted_history([1.0, np.inf], 0.1), "values"),
        (lambda: weighted_history(3.0, 0.1), "values"),
        (lambda: comfort_bands(-0.1), "weighted_rms"),
    ],
)
def test_bad_input_is_refused_by_name(make, named):
    with pytest.raises(InputError, match=named):
        make()
