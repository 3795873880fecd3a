"""Sweeps: which variants, what is computed of each against independent oracles, and what the table says."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from oracles import TABLE_1, ride_response
from scipy.integrate import quad
from study.variants.sweep_case import DELAYS, STUDY, small_plan

import susp_ctrl as sc
from susp_ctrl.study.variants.sampling_plan import draw_variants
from susp_ctrl.study.variants.sweep_summary import (
    heat_map,
    percentile_table,
    sensitivity_table,
    wilson_interval,
)

MASS, SPEED = "vehicle.body_mass_kg", "vehicle.speed_m_per_s"
SIX = (
    "body_acceleration",
    "pitch_acceleration",
    "suspension_deflection_front",
    "suspension_deflection_rear",
    "tire_deflection_front",
    "tire_deflection_rear",
)


@pytest.fixture(scope="module")
def study():
    return sc.load_study(STUDY)


@pytest.fixture(scope="module")
def result(study):
    """Two masses and two road classes; in this process, for speed."""
    grid = {MASS: [621.0, 759.0], "time[random].road.iso_class": ["A", "C"]}
    return sc.sweep(study, grid, map, limits={"body_acceleration": 0.7, "delay_reserve": 1.1})


# --- which variants ---------------------------------------------------------------------------------------------


@pytest.mark.analytical
def test_a_grid_is_every_combination_with_the_last_factor_fastest(study):
    drawn = draw_variants(study, {MASS: [600.0, 700.0], SPEED: sc.Range(10.0, 30.0, levels=3)})
    assert [tuple(change.values()) for change in drawn.changes] == [
        (600.0, 10.0), (600.0, 20.0), (600.0, 30.0), (700.0, 10.0), (700.0, 20.0), (700.0, 30.0)
    ]  # fmt: skip


@pytest.mark.analytical
def test_a_latin_hypercube_uses_every_slice_once(study):
    plan = sc.LatinHypercube({MASS: sc.Range(500.0, 600.0), SPEED: sc.Range(10.0, 20.0)}, samples=40, seed=5)
    drawn = draw_variants(study, plan)
    for name, low, high in ((MASS, 500.0, 600.0), (SPEED, 10.0, 20.0)):
        slices = np.floor((drawn.coordinates[name].to_numpy() - low) / (high - low) * 40).astype(int)
        assert sorted(slices) == list(range(40))


@pytest.mark.analytical
def test_monte_carlo_keeps_its_first_samples_and_depends_on_its_seed(study):
    def drawn(samples, seed):
        return draw_variants(study, sc.MonteCarlo({MASS: sc.Tolerance(0.1)}, samples, seed)).coordinates[MASS]

    few, many = drawn(10, 1), drawn(50, 1)
    assert few.tolist() == many[:10].tolist()
    assert few.tolist() != drawn(10, 2).tolist()


@pytest.mark.analytical
def test_keys_of_one_factor_move_together_relative_to_their_own_values(study):
    drawn = draw_variants(study, sc.MonteCarlo({DELAYS: sc.Tolerance(-0.05, 0.1)}, 200, 0))
    share = drawn.coordinates.iloc[:, 0].to_numpy()
    assert -0.05 <= share.min() < -0.04
    assert 0.09 < share.max() <= 0.1
    for n, change in enumerate(drawn.changes):
        assert change[DELAYS[0]] == pytest.approx(0.5530 * (1.0 + share[n]), rel=1e-15)
        assert change[DELAYS[1]] == pytest.approx(0.5186 * (1.0 + share[n]), rel=1e-15)


@pytest.mark.analytical
def test_a_normal_tolerance_has_three_standard_deviations_to_either_end(study):
    plan = sc.LatinHypercube({MASS: sc.Tolerance(0.3, distribution="normal")}, samples=4000, seed=0)
    share = draw_variants(study, plan).coordinates[MASS].to_numpy()
    assert np.abs(share).max() <= 0.3
    # standard deviation of a normal one cut at 3 sigma: sqrt(1 - 2 * 3 phi(3) / (2 Phi(3) - 1)) = 0.98658
    assert share.std() == pytest.approx(0.1 * 0.98658, rel=2e-3)
    assert np.mean(np.abs(share) < 0.1) == pytest.approx(0.68269 / 0.9973, abs=2e-3)


@pytest.mark.parametrize("as_frame", [True, False])
def test_samples_may_be_given(study, as_frame):
    samples = [{MASS: 650.0, SPEED: 15}, {MASS: 700.0, SPEED: 25}]
    drawn = draw_variants(study, pd.DataFrame(samples) if as_frame else samples)
    assert [dict(change) for change in drawn.changes] == samples


@pytest.mark.parametrize(
    ("grid", "parts"),
    [
        ({"vehicle.body_mas_kg": sc.Tolerance(0.1)}, ("body_mas_kg", "body_mass_kg")),
        ({"vehicle.body_mas_kg": [700.0]}, ("body_mas_kg", "body_mass_kg")),
        ({"vehicel.body_mass_kg": [700.0]}, ("vehicel", "vehicle")),
        ({"designs[nobody].channels[1].delay_s": [0.1]}, ("nobody", "no entry")),
        ({MASS: [-1.0, -2.0]}, ("body_mass_kg", "-1", "greater than 0")),
        ({"vehicle.kind": sc.Tolerance(0.1)}, ("vehicle.kind", "number")),
        ({MASS: []}, (MASS, "at least one value")),
        ({MASS: 700.0}, (MASS, "list of values")),
        ({}, ("factors",)),
        ({"stability.ray_up_to": [2.0]}, ("stability.ray_up_to", "nothing that a sweep computes")),
        ([{MASS: 1.0}, {SPEED: 1.0}], ("grid_or_samples[1]", MASS)),
        (7, ("grid_or_samples", "7")),
    ],
)
def test_bad_keys_and_grids_are_one_line_before_anything_is_computed(study, grid, parts):
    def never(function, tasks):
        raise AssertionError("computed")

    with pytest.raises(sc.InputError) as caught:
        sc.sweep(study, grid, never)
    assert "\n" not in str(caught.value)
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ({"designs": ["random_publishd"]}, ("random_publishd", "random_published")),
        ({"time": "rndom"}, ("rndom", "random")),
        ({"limits": {"body_aceleration": 1.0}}, ("body_aceleration", "body_acceleration")),
        ({"weights": {"body_velocity": 1.0}}, ("body_velocity",)),
        ({"ray_up_to": 0.5}, ("ray_up_to", "0.5")),
        ({"workers": 0}, ("workers", "0")),
    ],
)
def test_bad_options_are_one_line(study, options, parts):
    with pytest.raises(sc.InputError) as caught:
        sc.sweep(study, {MASS: [700.0]}, **options)
    assert "\n" not in str(caught.value)
    for part in parts:
        assert part in str(caught.value)


# --- what is computed of each ------------------------------------------------------------------------------------


@pytest.mark.analytical
def test_rms_of_a_variant_equals_the_integral_of_the_four_by_four_model(result):
    """The 4 x 4 model from eq. (1) and the spectrum of ISO 8608 written out, integrated by another quadrature."""
    row = result.table.query("variant == 2 and design == 'random_published'").iloc[0]
    assert (row[MASS], row["time[random].road.iso_class"]) == (621.0, "C")
    car, speed, lag = TABLE_1 | {"m": 621.0}, 20.0, (1.25 + 1.51) / 20.0

    def density(omega, output):
        answer = ride_response(np.array(1j * omega), (19345.0, 26150.0), (0.5530, 0.5186), car)[output]
        return abs(answer[0] + answer[1] * np.exp(-1j * omega * lag)) ** 2 * 256e-6 * 0.01 * speed / omega**2

    low, high = 2.0 * np.pi * speed * 0.011, 2.0 * np.pi * speed * 2.83
    for output, name in enumerate(SIX):
        # G_q(f) df = G_q(omega/2 pi) d omega/2 pi
        pieces = np.geomspace(low, high, 60)
        total = sum(quad(density, a, b, args=(output,), epsrel=1e-9)[0] for a, b in pairwise(pieces))
        assert row[name] == pytest.approx(np.sqrt(total * 2.0 * np.pi), rel=1e-5)
    assert (
        pytest.approx(0.7 * row["body_acceleration"] + 0.3 * row["pitch_acceleration"], rel=1e-12) == row["J"]
    )


@pytest.mark.literature
def test_rms_doubles_with_every_road_class(result):
    """ISO 8608: class means rise by a factor of 4 in the spectrum per class; from A to C 4 in the RMS."""
    ours = result.table[result.table["design"] == "random_published"]
    for smooth, rough in ((0, 1), (2, 3)):
        ratio = ours.iloc[rough][list(SIX)].astype(float) / ours.iloc[smooth][list(SIX)].astype(float)
        assert np.allclose(ratio, 4.0, rtol=1e-12)


@pytest.mark.literature
def test_the_study_itself_stands_beside_its_variants(result):
    """Rightmost root of the random design as computed from eq. (1) by an independent program."""
    own = result.nominal.set_index("design").loc["random_published"]
    assert own["verdict"] == "stable"
    assert round(own["abscissa"], 5) == -1.17254
    assert own["delay_margin"] == own["delay_reserve"] == np.inf


def test_delay_margins_are_those_of_the_sweep_along_the_ray(study):
    gain = "designs[random_published].channels[1].gain_N_per_m"
    table = sc.sweep(
        study, {gain: [19345.0, 150000.0], MASS: [690.0]}, map, designs=["random_published"]
    ).table
    row = table.iloc[1]
    channels = [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", 150000.0, 0.5530),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", 26150.0, 0.5186),
    ]
    loop = sc.close_loop(sc.HalfCar().plant(), channels)
    assert row["verdict"] == ("stable" if sc.stability(loop).stable else "unstable")
    assert row["verdict"] == "unstable"
    assert np.isnan(row["J"])
    assert row["error"] == ""
    assert row["delay_reserve"] == 0.0

    def rightmost(tau):
        return sc.spectral_abscissa(loop.with_delays([0.5530 * tau, 0.5186 * tau]))

    margin = row["delay_margin"]
    assert 0.0 < margin < 1.0
    assert rightmost(margin * (1.0 - 1e-4)) < 0.0 < rightmost(margin * (1.0 + 1e-4))


def test_reserve_is_the_next_loss_after_the_design(study):
    """A front gain of 150 kN/m is stable up to 12.5 ms, again from 72.6 to 87.6 ms (both delays equal): 80 ms here."""
    base, delay = "designs[random_published].channels", 0.080
    changes = {f"{base}[1].gain_N_per_m": 150000.0, f"{base}[1].delay_s": delay, f"{base}[2].delay_s": delay}
    found = sc.sweep(study.with_changes(changes), {MASS: [690.0]}, map, designs=["random_published"])
    row = found.table.iloc[0]
    loop = sc.close_loop(
        sc.HalfCar().plant(),
        [
            sc.FeedbackChannel("unsprung_displacement_front", "force_front", 150000.0, delay),
            sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", 26150.0, delay),
        ],
    )

    def rightmost(tau):
        return sc.spectral_abscissa(loop.with_delays([delay * tau, delay * tau]))

    assert row["verdict"] == "stable"
    for name, low, high in (("delay_margin", 0.0, 1.0), ("delay_reserve", 1.0, 3.0)):
        loss = row[name]
        assert low < loss < high
        assert rightmost(loss * (1.0 - 1e-4)) < 0.0 < rightmost(loss * (1.0 + 1e-4))


def test_a_variant_that_fails_is_a_row_with_its_error_and_the_others_stand(study):
    found = sc.sweep(study, {MASS: [690.0, -1.0, 700.0]}, map, designs=["passive", "random_published"])
    failed = found.failed
    assert failed["variant"].tolist() == [2, 2]
    assert failed["design"].tolist() == ["passive", "random_published"]
    assert all("body_mass_kg = -1.0" in text and "greater than 0" in text for text in failed["error"])
    assert failed["verdict"].tolist() == ["failed", "failed"]
    assert failed["J"].isna().all()
    fine = found.table[found.table["error"] == ""]
    assert fine["verdict"].eq("stable").all()
    assert fine["J"].notna().all()
    assert found.yields["failed"].tolist() == [1, 1]
    assert found.yields["yield"].tolist() == pytest.approx([2 / 3, 2 / 3])


def test_a_searched_design_is_searched_once_and_then_kept():
    main = sc.load_study(STUDY.with_name("wu_ren_2020.toml"))
    changes = {"tuning[random_tuned].particles": 8, "tuning[random_tuned].iterations": 4}
    small = main.with_changes(changes)
    delay = "designs[random_tuned].channels[1].delay_s"
    found = sc.sweep(small, {MASS: [690.0, 700.0]}, map, designs=["random_tuned"])
    assert found.table["verdict"].eq("stable").all()
    assert found.table["J"].iloc[0] == found.nominal["J"].iloc[0]
    with pytest.raises(sc.InputError, match="retune"):
        sc.sweep(small, {"tuning[random_tuned].seed": [1, 2]}, map, designs=["random_tuned"])
    again = sc.sweep(small, {"tuning[random_tuned].seed": [1, 2]}, map, designs=["random_tuned"], retune=True)
    assert again.table["J"].iloc[0] == pytest.approx(found.nominal["J"].iloc[0], rel=1e-9)
    assert again.table["J"].iloc[1] != again.table["J"].iloc[0]
    assert delay not in found.table


def test_the_study_file_and_python_say_the_same(study, tmp_path):
    text = STUDY.read_text(encoding="utf-8").replace("samples = 1000", "samples = 4")
    path = tmp_path / "robustness.toml"
    path.write_text(text, encoding="utf-8")
    from_file = sc.sweep(sc.load_study(path), workers=map)
    plan = sc.LatinHypercube(
        [
            sc.Factor(MASS, sc.Tolerance(0.1), "body mass"),
            sc.Factor(
                ["vehicle.spring_stiffness_front_N_per_m", "vehicle.spring_stiffness_rear_N_per_m"],
                sc.Tolerance(0.1),
                "spring stiffness",
            ),
            sc.Factor(DELAYS[0], sc.Tolerance(0.1, distribution="normal"), "delay of the front channel"),
            sc.Factor(DELAYS[1], sc.Tolerance(0.1, distribution="normal"), "delay of the rear channel"),
            sc.Factor(SPEED, sc.Range(15.0, 25.0), "speed"),
        ],
        samples=4,
        seed=1,
    )
    in_python = sc.sweep(study, plan, map)
    pd.testing.assert_frame_equal(from_file.table, in_python.table, check_exact=True)
    assert len(from_file.table) == 8


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('kind = "latin_hypercube"', 'kind = "latin_square"', ("sweep.kind", "latin_hypercube")),
        ("samples = 1000", "sampels = 1000", ("sweep.sampels", "samples")),
        ('kind = "latin_hypercube"', 'kind = "grid"', ("sweep.samples", "grid")),
        ("relative = [-0.10, 0.10]", "relative = [0.10, -0.10]", ("sweep.factors", "relative", "empty")),
        ("relative = [-0.10, 0.10]", "relative = [0.10]", ("sweep.factors", "relative", "two numbers")),
        ("relative = [-0.10, 0.10]", "", ("sweep.factors", "relative, range and values")),
        ("relative = [-0.10, 0.10]", "values = []", ("sweep.factors", "values", "list")),
        ('name = "spring stiffness"', 'name = "body mass"', ("sweep.factors", "body mass", "two")),
        ("body_acceleration_m_per_s2 = 1.25", "body_acceleration_m = 1.25", ("sweep.limits", "m_per_s2")),
        ('time = "random" # whose', 'time = "randm" # whose', ("sweep.time", "randm", "random")),
        ('designs = ["passive", "random_published"]', 'designs = ["none"]', ("sweep.designs", "none")),
    ],
)  # fmt: skip
def test_a_bad_section_is_one_line_with_file_key_and_what_is_allowed(tmp_path, old, new, parts):
    text = STUDY.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "edited.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(sc.InputError) as caught:
        sc.load_study(path)
    assert "\n" not in str(caught.value)
    for part in ("edited.toml", *parts):
        assert part in str(caught.value)


# --- what the table says ------------------------------------------------------------------------------------------


def test_yield_counts_variants_within_every_limit(result):
    ours = result.table[result.table["design"] == "random_published"]
    good = (ours["body_acceleration"] <= 0.7) & (ours["delay_reserve"] >= 1.1)
    assert ours["within_limits"].tolist() == good.tolist() == [True, False, True, False]
    row = result.yields.set_index("design").loc["random_published"]
    assert (row["variants"], row["stable"], row["within_limits"], row["yield"]) == (4, 4, 2, 0.5)
    assert row["broken_limits"] == "body_acceleration: 2"


@pytest.mark.literature
def test_wilson_interval():
    """R. G. Newcombe, Statistics in Medicine 17, 1998, table I, method 3: 81 of 263 and 15 of 148, and 0 of 20."""
    assert wilson_interval(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson_interval(15, 148) == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert wilson_interval(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)


def synthetic(formula, factors):
    coordinates = pd.DataFrame(factors)
    values = formula(**factors)
    table = pd.DataFrame(
        {"variant": np.arange(1, len(values) + 1), "design": "one", "y": values, "error": ""}
    )
    return table, coordinates


@pytest.mark.analytical
def test_shares_of_variance_of_a_sum_are_the_squares_of_its_terms():
    """y = 3 a + b of equally wide uniform a and b: 9/10 and 1/10; c has no part in it."""
    rng = np.random.default_rng(0)
    draws = dict(zip("abc", rng.random((3, 4000)), strict=True))
    table, coordinates = synthetic(lambda a, b, c: 3.0 * a + b, draws)
    found = sensitivity_table(table, coordinates, ["y"], random=True)
    assert found["factor"].tolist() == ["a", "b", "c"]
    assert found["share"].tolist() == pytest.approx([0.9, 0.1, 0.0], abs=0.02)
    assert found["spearman"].iloc[0] > 0.9


@pytest.mark.analytical
def test_shares_see_what_a_correlation_cannot():
    """y = (a - 1/2)^2 has no correlation with a and depends on nothing else."""
    rng = np.random.default_rng(1)
    draws = {"a": rng.random(2000), "b": rng.random(2000)}
    found = sensitivity_table(*synthetic(lambda a, b: (a - 0.5) ** 2, draws), ["y"], random=True)
    assert found["factor"].iloc[0] == "a"
    assert found["share"].iloc[0] > 0.95
    assert abs(found["spearman"].iloc[0]) < 0.1


@pytest.mark.analytical
def test_shares_of_a_full_grid_are_exact_and_texts_are_factors_too():
    """y = a + 2 t over 3 x 2 levels: variances 2/3 and 1."""
    a, t = np.repeat([0.0, 1.0, 2.0], 2), ["C", "A"] * 3
    table, coordinates = synthetic(
        lambda a, t: a + 2.0 * np.array([one == "C" for one in t]), {"a": a, "t": t}
    )
    found = sensitivity_table(table, coordinates, ["y"], random=False).set_index("factor")
    assert found.loc["t", "share"] == pytest.approx(1.0 / (1.0 + 2.0 / 3.0), rel=1e-12)
    assert found.loc["a", "share"] == pytest.approx((2.0 / 3.0) / (1.0 + 2.0 / 3.0), rel=1e-12)
    assert np.isnan(found.loc["t", "spearman"])


@pytest.mark.analytical
def test_a_heat_map_holds_the_means_of_its_cells():
    a, b = np.repeat([1.0, 2.0], 4), np.tile([10.0, 10.0, 20.0, 20.0], 2)
    values = np.array([1.0, 3.0, 5.0, np.nan, 7.0, 9.0, np.nan, np.nan])
    table, coordinates = synthetic(lambda a, b: values, {"a": a, "b": b})
    found = heat_map(table, coordinates, "one", "y", "a", "b")
    assert found.x_groups == ("1", "2")
    assert found.y_groups == ("10", "20")
    assert np.array_equal(found.values, [[2.0, 8.0], [5.0, np.nan]], equal_nan=True)
    assert found.counts.tolist() == [[2, 2], [1, 0]]


@pytest.mark.analytical
def test_percentiles_count_infinite_values_and_leave_missing_ones_out():
    table = pd.DataFrame(
        {"design": "one", "y": [1.0, 2.0, np.inf, np.nan, 3.0], "z": [1.0, 2.0, 3.0, 4.0, 5.0]}
    )
    found = percentile_table(table, table.head(1), ["y", "z"]).set_index("indicator")
    assert found.loc["y", "variants"] == 4
    assert found.loc["y", "p50"] == 2.0
    assert found.loc["y", "p95"] == np.inf
    assert np.isnan(found.loc["y", "mean"])
    assert found.loc["z", ["p25", "p50", "p75", "mean"]].tolist() == [2.0, 3.0, 4.0, 3.0]


def test_figures_show_the_data_and_a_name_that_does_not_exist_is_refused(result):
    from matplotlib.figure import Figure

    for kind in ("sensitivity", "distribution", "heat_map"):
        ax = Figure().subplots()
        assert result.plot(kind, ax, design="random_published") is ax
    bars = result.plot("sensitivity", Figure().subplots(), design="random_published")
    widths = sorted(patch.get_width() for patch in bars.patches)
    expected = result.ranking("J").query("design == 'random_published'")["share"]
    assert widths == pytest.approx(sorted(expected))
    with pytest.raises(sc.InputError, match="heat_map"):
        result.plot("heatmap")
    with pytest.raises(sc.InputError, match="body_acceleration"):
        result.plot(indicator="body_aceleration")
    one = sc.sweep(sc.load_study(STUDY), {MASS: [690.0]}, map, designs=["passive"])
    with pytest.raises(sc.InputError, match="two factors"):
        one.heat_map()


def test_saved_files_hold_the_tables_in_full_precision(result, tmp_path):
    folder = tmp_path / "Ergebnis mit Lücke"
    written = result.save(folder)
    assert sorted(path.name for path in folder.iterdir()) == sorted(path.name for path in written)
    read = pd.read_csv(folder / "variants.csv", keep_default_na=True)
    assert read["J"].tolist() == pytest.approx(result.table["J"].tolist(), rel=1e-14, nan_ok=True)
    assert {"variants.csv", "yields.csv", "percentiles.csv", "sensitivity.csv"} < {p.name for p in written}
    assert any(path.suffix == ".png" for path in written)
    assert "random_published" in result._repr_html_()


def test_plans_refuse_what_they_cannot_mean():
    with pytest.raises(sc.InputError, match="empty"):
        sc.Range(2.0, 1.0)
    with pytest.raises(sc.InputError, match="samples"):
        small_plan(samples=0)
    with pytest.raises(sc.InputError, match="two of them"):
        sc.Grid({MASS: [1.0], (MASS, SPEED): [2.0]})
    with pytest.raises(sc.InputError, match="variants"):
        draw_variants(
            sc.load_study(STUDY), {MASS: sc.Range(1, 2, levels=2000), SPEED: sc.Range(1, 2, levels=2000)}
        )
