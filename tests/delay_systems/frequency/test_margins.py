"""Margins over all crossovers: closed forms, polynomials, python-control, sweeps of the delay, dense samples."""

from __future__ import annotations

import itertools
from functools import reduce

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import susp_ctrl as sc

s = ct.tf("s")

# ------------------------------------------------------------------------------------------------- closed forms


@pytest.mark.analytical
@pytest.mark.parametrize("gain", [1e-8, 1.0, 3.7e8])
def test_integrator(gain):
    """K/s crosses at K with 90 degrees."""
    margins = sc.stability_margins(ct.tf([gain], [1, 0]))
    assert margins.gain_crossovers["omega"].tolist() == pytest.approx([gain], rel=1e-12)
    assert margins.phase_margin_deg == pytest.approx(90.0, rel=1e-12)
    assert margins.delay_margin == pytest.approx(np.pi / 2 / gain, rel=1e-12)
    assert margins.gain_range == (0.0, np.inf)
    assert margins.complete


@pytest.mark.analytical
@pytest.mark.parametrize(("gain", "corner"), [(0.05, 100.0), (0.002, 30.0), (0.05, 1e6)])
def test_crossover_far_below_every_pole_and_zero(gain, corner):
    """K (1 + s)/(s (1 + s/c)): K^2 (1 + x) = x (1 + x/c^2) with x = w^2."""
    margins = sc.stability_margins(gain * (1 + s) / (s * (1 + s / corner)))
    a, b = corner**-2, 1 - gain**2
    x = 2 * gain**2 / (b + np.sqrt(b**2 + 4 * a * gain**2))
    w = np.sqrt(x)
    phase = np.pi / 2 + np.arctan(w) - np.arctan(w / corner)
    assert margins.gain_crossovers["omega"].tolist() == pytest.approx([w], rel=1e-10)
    assert margins.delay_margin == pytest.approx(phase / w, rel=1e-10)
    assert margins.complete


@pytest.mark.analytical
@pytest.mark.parametrize("damping", [1e-5, 1e-7])
@pytest.mark.parametrize("place", [3.7, 3.7e5])
def test_narrow_resonance(damping, place):
    """Beside 0.5/(s + 1) the peak of height 3 is 3/(1 + jx) with x = (w - w0)/(damping w0) near w0."""
    peak = ct.tf([6 * damping * place, 0], [1, 2 * damping * place, place**2])
    loop = sc.DelayLTI.of(peak) + 0.5 / (s + 1)
    base = 0.5 / (1j * place + 1)
    margins = loop.margins()
    x = [brentq(lambda x: abs(base + 3 / (1 + 1j * x)) - 1, *ends) for ends in ((-10, 0), (0, 10))]
    assert margins.gain_crossovers["omega"].to_numpy() == pytest.approx(
        place * (1 + damping * np.array(x)), rel=10 * damping**2
    )
    turned = np.mod(np.angle(-(base + 3 / (1 + 1j * np.array(x)))), 2 * np.pi)
    assert margins.delay_margin == pytest.approx(turned.min() / place, rel=1e-3)
    assert margins.complete


@pytest.mark.analytical
@pytest.mark.parametrize("gain", [0.9, 0.3, 2.5])
def test_phase_crossover_at_zero_frequency(gain):
    margins = sc.stability_margins(-gain / (s + 1) ** 3)
    assert margins.gain_margin == pytest.approx(1 / gain, rel=1e-12)
    assert margins.phase_crossovers["omega"].iloc[0] == 0.0
    assert margins.complete


@pytest.mark.analytical
@pytest.mark.parametrize("direct", [-0.5, 0.5, -1.0, 1.0, -2.0, 2.0])
@pytest.mark.parametrize("tau", [0.0, 0.3])
def test_direct_feedthrough(direct, tau):
    """D (s + 2)/(s + 1): the gain falls from 2 |D| to |D|, with delay it meets -1 at 1/|D| in the limit."""
    margins = (sc.DelayLTI.of(direct * (s + 2) / (s + 1)) * sc.delay(tau)).margins()
    # any delay destabilises where the gain does not fall below one, and L(0) = -1 is met as it is
    assert (margins.delay_margin == 0.0) == (abs(direct) >= 1.0 or direct == -0.5)
    phase = margins.phase_crossovers
    at_infinity = phase.loc[phase["omega"] == np.inf, "gain_margin"].tolist()
    assert at_infinity == ([1 / abs(direct)] if tau or direct < 0 else [])
    if direct < 0 and not tau:
        assert phase["gain_margin"].tolist() == pytest.approx([0.5 / -direct, 1 / -direct], rel=1e-12)
    assert margins.complete


@pytest.mark.analytical
def test_loops_that_are_real_or_of_unit_gain_everywhere():
    assert sc.stability_margins(4 / s**2).gain_margin == 1.0
    assert sc.stability_margins(4 / s**2).delay_margin == 0.0
    oscillator = sc.stability_margins(0.5 / (s**2 + 1))
    assert oscillator.phase_crossovers["omega"].tolist() == pytest.approx([np.sqrt(1.5)], rel=1e-12)
    all_pass = sc.stability_margins((1 - s) / (1 + s))
    assert (all_pass.gain_margin, all_pass.phase_margin, all_pass.delay_margin) == (1.0, 0.0, 0.0)
    # -0.2 (s^2 - 4)/(s^2 - 1) is real and falls from -0.8 at zero frequency to -0.2
    bounded = sc.stability_margins(-0.2 * (s**2 - 4) / (s**2 - 1))
    assert bounded.gain_range == pytest.approx((0.0, 1.25))
    assert bounded.complete
    nothing = sc.stability_margins(0.0)
    assert (nothing.gain_margin, nothing.phase_margin, nothing.complete) == (np.inf, np.inf, True)


@pytest.mark.analytical
@pytest.mark.parametrize("gain", [0.5, 1.0, 2.0])
def test_pure_delay(gain):
    margins = (gain * sc.delay(0.7)).margins()
    assert margins.gain_margin == 1 / gain
    assert margins.delay_margin == (np.inf if gain < 1 else 0.0)
    assert margins.complete


@pytest.mark.analytical
def test_a_touch_of_the_unit_circle_counts():
    """The peak of s/(s^2 + 2 z s + 1) times 2 z is one, at one."""
    margins = sc.stability_margins(ct.tf([0.02, 0], [1, 0.02, 1]))
    assert margins.gain_crossovers["omega"].tolist() == pytest.approx([1.0], rel=1e-6)
    assert margins.phase_margin_deg == pytest.approx(180.0, abs=1e-3)


@pytest.mark.analytical
def test_a_mode_on_the_axis_that_cancels_is_not_in_the_loop():
    loop = sc.DelayLTI.of(s / (s + 1)) * sc.DelayLTI.of(2 / s) * sc.delay(0.1)
    margins = loop.margins()
    assert margins.gain_crossovers["omega"].tolist() == pytest.approx([np.sqrt(3)], rel=1e-12)
    assert margins.complete


@pytest.mark.analytical
def test_long_dead_time_lists_what_is_near_and_finds_the_nearest():
    """1/s e^{-s tau} with a thousand turns before unit gain: crossings at (2 k + 1/2) pi / tau."""
    tau = 2 * np.pi * 1000.3
    margins = (sc.DelayLTI.of(1 / s) * sc.delay(tau)).margins()
    crossings = (2 * np.arange(990, 1010) + 0.5) * np.pi / tau
    below, above = crossings[crossings < 1].max(), crossings[crossings > 1].min()
    assert margins.gain_range == pytest.approx((below, above), rel=1e-12)
    assert margins.complete


# --------------------------------------------------------------------------- polynomials, python-control, sweeps

Section = tuple[list[float], list[float]]


def value(sections: list[Section], omega):
    points = 1j * np.asarray(omega)
    with np.errstate(all="ignore"):
        return np.prod([np.polyval(n, points) / np.polyval(d, points) for n, d in sections], axis=0)


def cascade(sections: list[Section], tau: float = 0.0) -> sc.DelayLTI:
    return reduce(lambda L, part: L * sc.DelayLTI.of(ct.ss(ct.tf(*part))), sections, sc.delay(tau))


def polynomial_crossovers(sections: list[Section]) -> tuple[np.ndarray, np.ndarray]:
    """Unit gain and negative real values from the roots of |N|^2 - |D|^2 and Im(N conj D) in w."""
    numerator, denominator = (reduce(np.polymul, parts) for parts in zip(*sections, strict=True))

    def on_axis(p):
        return p * 1j ** np.arange(len(p) - 1, -1, -1)

    n, d = on_axis(numerator), on_axis(denominator)
    gain = np.polysub(np.polymul(n, n.conj()), np.polymul(d, d.conj())).real
    phase = np.polymul(n, d.conj()).imag
    found = []
    for polynomial in (gain, phase):
        roots = np.roots(polynomial)
        roots = roots[(np.abs(roots.imag) < 1e-5 * np.abs(roots)) & (roots.real > 1e-9)].real
        found.append(np.unique(roots))
    negative = value(sections, found[1]).real < 0
    pole = np.abs(np.polyval(denominator, 1j * found[1])) < 1e-13 * np.polyval(np.abs(denominator), found[1])
    return found[0], found[1][negative & ~pole]


FEATURES: dict[str, Section] = {
    "integrator": ([1.0, 0.4], [1.0, 0.0]),
    "two integrators": ([1.0, 2.1, 0.7], [1.0, 0.0, 0.0]),
    "undamped pole": ([1.0, 0.3, 1.3], [1.0, 0.0, 1.7]),
    "negative at zero": ([0.5, -1.2], [1.0, 0.6]),
    "narrow resonance": ([1.0, 0.8, 4.0], [1.0, 3e-6, 3.1]),
    "lag": ([0.9], [1.0, 1.0]),
    "feedthrough below one": ([0.5, 2.0], [1.0, 1.1]),
    "feedthrough of one": ([1.0, 2.0], [1.0, 1.1]),
    "feedthrough above one": ([1.9, 0.2], [1.0, 1.2]),
}


def rescaled(section: Section, scale: float) -> Section:
    n, d = (list(np.array(p) * scale ** np.arange(len(p))) for p in section)
    lift = scale ** (len(d) - len(n))
    return [lift * c for c in n], d


PAIRS = list(itertools.combinations_with_replacement(FEATURES, 2))


def check_pair(first: str, second: str, scale: float) -> None:
    sections = [FEATURES[first], FEATURES[second]]
    gain, phase = polynomial_crossovers(sections)
    margins = cascade([rescaled(part, scale) for part in sections]).margins()
    found = [margins.gain_crossovers["omega"].to_numpy(), margins.phase_crossovers["omega"].to_numpy()]
    for own, expected in zip(found, (gain, phase), strict=True):
        inner = own[(own > 0.0) & np.isfinite(own)] / scale
        assert inner == pytest.approx(expected, rel=2e-5)
    assert margins.complete


@pytest.mark.property
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_pairs_of_features(first, second):
    """Every pair, in slow, ordinary or fast units in turn, against polynomials."""
    check_pair(first, second, [1e-8, 1.0, 1e8][PAIRS.index((first, second)) % 3])


@pytest.mark.property
@pytest.mark.parametrize(("first", "second"), PAIRS[::6])
def test_pairs_of_features_with_dead_time(first, second):
    sections = [FEATURES[first], FEATURES[second]]
    check_dead_time(sections, 0.6, polynomial_crossovers(sections)[0])


@pytest.mark.property
@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_pairs_of_features_in_all_units_and_with_dead_times(first, second):
    for scale in (1e-8, 1.0, 1e8):
        check_pair(first, second, scale)
    sections = [FEATURES[first], FEATURES[second]]
    for tau in (0.08, 0.6, 1.9):
        check_dead_time(sections, tau, polynomial_crossovers(sections)[0])


def check_dead_time(sections: list[Section], tau: float, gain: np.ndarray) -> None:
    margins = cascade(sections, tau).margins()
    found = margins.gain_crossovers["omega"].to_numpy()
    assert found[(found > 0) & np.isfinite(found)] == pytest.approx(gain, rel=2e-5)
    crossings = margins.phase_crossovers.loc[np.isfinite(margins.phase_crossovers["omega"])]
    omega = crossings["omega"].to_numpy()
    top = max(omega.max(initial=0.0) * (1 + 1e-9), 12 * np.pi / tau)
    poles = np.concatenate([np.roots(d) for _, d in sections])
    around = np.geomspace(1e-4, 1e3, 60)
    width = np.maximum(-poles.real, 1e-12)[:, None] * np.append(-around, around)
    grid = np.concatenate([np.geomspace(1e-3, top, 4000), np.linspace(1e-3, top, 12000)])
    grid = np.unique(np.concatenate([grid, (np.abs(poles.imag)[:, None] + width).ravel()]))
    grid = grid[(grid > 1e-3) & (grid <= top)]
    L = value(sections, grid) * np.exp(-1j * grid * tau)
    with np.errstate(invalid="ignore"):
        near = np.abs(np.angle(L[1:] / L[:-1])) < 0.5
    changes = np.flatnonzero((L[1:].imag * L[:-1].imag < 0) & (L[1:].real < 0) & near)

    def imaginary(w: float) -> float:
        return float((value(sections, w) * np.exp(-1j * w * tau)).imag)

    dense = np.array([brentq(imaginary, grid[k], grid[k + 1], xtol=1e-14) for k in changes])
    assert omega[omega > 1e-3] == pytest.approx(dense[dense <= omega.max(initial=0.0) * (1 + 1e-6)], rel=1e-6)
    factors = 1 / np.abs(value(sections, dense))
    low, high = margins.gain_range
    assert not np.any((factors > low * (1 + 1e-6)) & (factors < high * (1 - 1e-6)))
    assert margins.complete


@pytest.mark.property
@pytest.mark.parametrize("seed", range(3))
def test_equal_to_python_control_without_delay(seed):
    np.random.seed(seed)  # noqa: NPY002, control.rss draws from the global generator
    loop = ct.rss(6, 1, 1, strictly_proper=True) * 20
    margins = sc.stability_margins(loop)
    gm, pm, _, w_phase, w_gain, _ = ct.stability_margins(loop, returnall=True)
    own = margins.phase_crossovers
    assert own["omega"].to_numpy() == pytest.approx(np.sort(w_phase), rel=1e-6, abs=1e-9)
    assert np.sort(own["gain_margin"]) == pytest.approx(np.sort(gm), rel=1e-6)
    assert margins.gain_crossovers["omega"].to_numpy() == pytest.approx(np.sort(w_gain), rel=1e-6)
    turned = np.mod(margins.gain_crossovers["phase_margin_deg"].to_numpy(), 360.0)
    assert np.sort(turned) == pytest.approx(np.sort(np.mod(pm, 360.0)), rel=1e-5)


@pytest.mark.analytical
@pytest.mark.parametrize(
    "loop",
    [
        sc.DelayLTI.of(0.05 * (1 + s) / (s * (1 + s / 100))),
        sc.DelayLTI.of(2 / (s + 1)) * sc.delay(0.3),
        sc.DelayLTI.of(0.4 * (s + 1) / s) * sc.feedback(sc.DelayLTI.of(1 / (s + 0.5)), sc.delay(0.4)),
        sc.DelayLTI.of(0.5 / (s + 1)) + ct.tf([2e-4, 0], [1, 1e-4, 13.0]),
    ],
)
def test_delay_margin_equals_that_of_the_sweep(loop):
    margin = loop.margins().delay_margin
    closed = sc.feedback(loop * sc.delay(1.0))
    fixed = closed.delays.copy()
    moving = np.zeros(fixed.size)
    moving[loop.delays.size] = 1.0
    start = fixed * (1.0 - moving)
    swept = sc.sweep_delays(closed, direction=moving, start=start, up_to=1.5 * margin).delay_margin
    assert margin == pytest.approx(swept, rel=1e-8)


@pytest.mark.property
@pytest.mark.parametrize(("inner", "outer"), [(0.7, 0.0), (0.4, 0.2), (2.5, 0.0), (0.05, 1.0)])
@pytest.mark.parametrize("gain", [0.8, 6.0])
def test_internal_delay_against_dense_samples(inner, outer, gain):
    """3 g/((s + 1) (s + 2)) within a loop through a delay, before another."""
    inside = sc.feedback(sc.DelayLTI.of(3 / (s**2 + 0.1 * s + 2)), 0.4 * sc.delay(inner))
    margins = (gain * inside * sc.DelayLTI.of((s + 3) / (s + 1)) * sc.delay(outer)).margins()

    def L(w):
        p = 1j * w
        core = 3 / (p**2 + 0.1 * p + 2)
        return gain * core / (1 + 0.4 * core * np.exp(-p * inner)) * (p + 3) / (p + 1) * np.exp(-p * outer)

    grid = np.linspace(1e-3, 80.0, 200_000)
    values = L(grid)
    gains = grid[1:][np.diff(np.sign(np.abs(values) - 1)) != 0]
    assert margins.gain_crossovers["omega"].to_numpy() == pytest.approx(gains, abs=5e-4)
    sign = np.diff(np.sign(values.imag)) != 0
    factors = 1 / np.abs(values[1:][sign & (values[1:].real < 0)])
    low, high = margins.gain_range
    assert low == pytest.approx(factors[factors <= 1].max(initial=0.0), rel=1e-2)
    assert high == pytest.approx(factors[factors >= 1].min(initial=np.inf), rel=1e-2)
    assert margins.complete


def random_sections(seed: int) -> list[Section]:
    rng = np.random.default_rng(seed)
    sections = []
    for _ in range(rng.integers(1, 5)):
        a, b, z = 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-5, 0)
        kinds: list[Section] = [
            ([1.0, a], [1.0, b]),
            ([a], [1.0, a]),
            ([1.0, a], [1.0, 0.0]),
            ([a * a], [1.0, 2 * z * a, a * a]),
            ([1.0, a], [1.0, 0.0, b * b]),
            ([1.0, 1e-4 * a, a * a], [1.0, 2 * a, a * a]),
            ([1.0, -a], [1.0, b]),
        ]
        sections.append(kinds[rng.integers(len(kinds))])
    numerator, denominator = sections[0]
    return [([10.0 ** rng.uniform(-1.5, 1.5) * c for c in numerator], denominator), *sections[1:]]


def check_random_loop(seed: int, tau: float) -> None:
    """Signs on a dense grid never show a crossover that is not listed, and every one listed is one."""
    sections = random_sections(seed)
    margins = cascade(sections, tau).margins()
    assert margins.complete
    omega = margins.gain_crossovers["omega"].to_numpy()
    omega = omega[np.isfinite(omega)]
    assert np.abs(value(sections, omega)) == pytest.approx(1.0, abs=1e-4)
    listed = margins.phase_crossovers.loc[np.isfinite(margins.phase_crossovers["omega"]), "omega"].to_numpy()
    turned = value(sections, listed) * np.exp(-1j * listed * tau)
    assert np.angle(-turned) == pytest.approx(0.0, abs=1e-4)
    grid = np.geomspace(1e-3, 1e3, 20_000)
    L = value(sections, grid) * np.exp(-1j * grid * tau)
    above = np.abs(L) > 1
    expected = np.searchsorted(omega, grid[1:]) - np.searchsorted(omega, grid[:-1])
    assert np.array_equal(above[1:] != above[:-1], expected % 2 == 1)
    crossing = (L[1:].imag * L[:-1].imag < 0) & (L[1:].real < 0)
    crossing &= np.abs(np.log(L[1:] / L[:-1])) < 0.04
    factors = 1 / np.abs(L[1:][crossing])
    low, high = margins.gain_range
    assert not np.any((factors > low * 1.05) & (factors < high / 1.05))


@pytest.mark.property
@settings(max_examples=12)
@given(st.integers(0, 2**31), st.sampled_from([0.0, 0.05, 1.3]))
def test_random_loops(seed, tau):
    check_random_loop(seed, tau)


@pytest.mark.property
@pytest.mark.slow
@settings(max_examples=400)
@given(st.integers(0, 2**31), st.sampled_from([0.0, 0.01, 0.05, 0.4, 1.3, 6.0]))
def test_many_random_loops(seed, tau):
    check_random_loop(seed, tau)
