"""A whole study at a small size: what the data object holds, and that it is the same every time."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import oracles
import pandas as pd
import pytest

import susp_ctrl as sc
from susp_ctrl.study import compute_study
from susp_ctrl.study.sections import time as time_section

# Orders are low on purpose, to be quick.
pytestmark = [pytest.mark.end_to_end, pytest.mark.filterwarnings("ignore::susp_ctrl.errors.PadeOrderWarning")]

PUBLISHED = {
    "passive": ((0.0, 0.0), (0.0, 0.0)),
    "harmonic_published": ((29653.0, -4416.0), (0.3255, 0.5438)),
    "random_published": ((19345.0, 26150.0), (0.5530, 0.5186)),
    "fig2_damped": ((19287.0, 23930.0), (0.434, 0.452)),
    "fig2_many_peaked": ((25333.0, 23371.0), (0.906, 0.546)),
}
LAG = 2.76 / 20.0


def test_progress_runs_from_nothing_to_all(small_run, small_progress):
    assert small_run is not None
    shares = [share for _, share in small_progress]
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert np.all(np.diff(shares) >= -1e-12)
    stages = list(dict.fromkeys(stage for stage, _ in small_progress))
    assert len(stages) >= 8
    assert all(stages)


def test_designs_are_passive_then_published_then_tuned(small_run):
    assert [d.role for d in small_run.designs] == ["passive"] + ["published"] * 4 + ["tuned"] * 2
    assert small_run.design("random_tuned").label == "tuned, random"
    with pytest.raises(KeyError):
        small_run.design("nobody")


@pytest.mark.parametrize("design", PUBLISHED)
def test_velocity_gains_are_those_of_eq_6(small_run, design):
    """w |X_c/X_gf| and w |phi/X_gf| from the 4 x 4 equations, lagged and in phase."""
    section = small_run.frequency
    body = oracles.displacement_response(1j * section.omega, *PUBLISHED[design])[:, 2:]
    lagged = body[..., 0] + body[..., 1] * np.exp(-1j * section.omega * LAG)[:, None]
    expected = section.omega * np.abs(lagged.T)
    assert section.velocity_gain[design] == pytest.approx(expected, rel=1e-11)
    expected = section.omega * np.abs(body.sum(axis=-1).T)
    assert section.velocity_gain_in_phase[design] == pytest.approx(expected, rel=1e-11)


def test_bode_data_are_per_road_displacement(small_run):
    section = small_run.frequency
    ride = oracles.ride_response(1j * section.omega, *PUBLISHED["random_published"])[:, :6]
    expected = ride[..., 0] + ride[..., 1] * np.exp(-1j * section.omega * LAG)[:, None]
    found = section.bode["random_published"]
    assert np.abs(found - expected.T).max() < 1e-11 * np.abs(expected).max()
    assert section.outputs == oracles.RIDE_OUTPUTS[:6]


def test_no_sample_lies_above_a_peak(small_run):
    section = small_run.frequency
    for peak in section.peaks.itertuples():
        gains = section.velocity_gain if peak.road == "lagged" else section.velocity_gain_in_phase
        row = gains[peak.design][section.curve_outputs.index(peak.output)]
        assert peak.gain >= row.max() * (1 - 1e-12)
        assert peak.omega_rad_per_s == pytest.approx(2 * np.pi * peak.frequency_Hz)


def test_harmonic_design_cancels_the_body_motion(small_run):
    run = next(t for t in small_run.tuning if t.key == "harmonic_tuned")
    table = run.comparison.set_index("design")
    assert run.value < 1e-6 * table.loc["passive", "objective_value"]
    assert table.loc["passive", "objective_value"] == pytest.approx(10.79, abs=0.005)
    assert table.loc["harmonic_published", "objective_value"] == pytest.approx(7.93, abs=0.005)
    assert run.closed_form["is_found"].sum() == 2
    found = run.closed_form[run.closed_form["is_found"]]
    assert np.abs(found["gain_difference"]).max() < 1.0
    assert np.abs(found["delay_difference_s"]).max() < 1e-4
    narrow = run.detuning.set_index("frequency_factor")["harmonic_tuned"]
    assert narrow[1.0] < 1e-6 < narrow[0.95]
    assert narrow[1.05] > 1.0
    assert run.history["best"].is_monotonic_decreasing


def test_every_objective_value_agrees_with_the_equations(small_run):
    run = next(t for t in small_run.tuning if t.key == "harmonic_tuned")
    for row in run.comparison.itertuples():
        if row.design not in PUBLISHED:
            continue
        body = oracles.displacement_response(7j, *PUBLISHED[row.design])[2:] @ [1.0, np.exp(-7j * LAG)]
        assert row.objective_value == pytest.approx(7.0 * np.abs(body) @ [0.7, 0.3], rel=1e-10)


@pytest.mark.literature
def test_stability_of_the_published_designs(small_run):
    """Rightmost roots as in the restated paper, and the small-gain proof for its search box."""
    verdicts = small_run.stability.verdicts.set_index("design")
    assert set(verdicts["verdict"]) == {"stable"}
    assert set(verdicts["delay_independent"]) == {"proven"}
    roots = verdicts[["abscissa", "abscissa_omega"]]
    assert list(roots.loc["random_published"].round(5)) == [-1.17254, 8.54527]
    assert list(roots.loc["harmonic_published"].round(5)) == [-2.24877, 7.71738]
    box = small_run.stability.independence
    assert round(box.corner.small_gain, 4) == 0.4441
    assert round(box.corner.small_gain_omega, 2) == 8.82
    assert box.verdict == "stable"
    assert list(box.single_channel["gain_threshold"].round()) == [103229.0, 99402.0]
    assert list(box.single_channel["omega_rad_per_s"].round(2)) == [65.64, 63.12]
    assert box.curve["radius"].max() <= box.corner.small_gain * (1 + 1e-12)
    assert box.curve["radius"].max() == pytest.approx(box.corner.small_gain, rel=1e-3)
    assert box.corner.margin >= box.margin
    assert not small_run.undecided


def test_every_root_solves_the_characteristic_equation(small_run):
    for row in small_run.stability.roots.itertuples():
        if row.design in PUBLISHED:
            root = complex(row.real, row.imaginary)
            scale = abs(root) ** 8
            assert abs(oracles.characteristic_function(root, *PUBLISHED[row.design])) < 1e-9 * scale


def test_sweeps_of_every_line(small_run):
    lines = {(line.design, line.line): line for line in small_run.stability.lines}
    assert len(lines) == 6 * 2
    for line in lines.values():
        assert line.sweep.crossings.empty
        assert line.stable_for_every_delay
    alone = lines["random_published", "tau2"]
    assert (tuple(alone.sweep.start), tuple(alone.sweep.direction)) == ((0.5530, 0.0), (0.0, 1.0))
    assert alone.tau_of_design == 0.5186
    figure = alone.sweep.figure_data
    # |z2| on the axis, from det Z with the front channel closed: z2 = -Z(no rear gain)/(slope in the rear gain)
    s = 1j * figure["omega"].to_numpy()
    without = oracles.characteristic_function(s, (19345.0, 0.0), (0.5530, 0.0))
    with_rear = oracles.characteristic_function(s, (19345.0, 26150.0), (0.5530, 0.0))
    assert figure["z1"].to_numpy() == pytest.approx(np.abs(without / (with_rear - without)), rel=1e-6)


def test_histories_have_the_shapes_they_say(small_run):
    for case, duration in zip(small_run.time, (3.0, 2.0), strict=True):
        assert case.timepts == pytest.approx(np.arange(round(duration / 0.01) + 1) * 0.01, abs=1e-12)
        for key in case.designs:
            methods = ("exact",) if key == "passive" else ("exact", "pade")
            for method in methods:
                history = case.histories[key, method]
                assert history.shape == (6, case.timepts.size)
                assert np.all(np.isfinite(history))
        assert set(case.pade_orders) == set(case.designs) - {"passive"}
        assert all(orders == (5, 5) for orders in case.pade_orders.values())
        assert set(case.road_profiles) == {"road_front", "road_rear"}


def test_the_rear_wheel_meets_the_same_road_later(small_run):
    harmonic, _ = small_run.time
    t = harmonic.timepts
    front = 0.05 * np.sin(7 * t)
    rear = np.where(t > LAG, 0.05 * np.sin(7 * (t - LAG)), 0.0)
    assert harmonic.road_profiles["road_front"] == pytest.approx(front, abs=1e-12)
    assert harmonic.road_profiles["road_rear"] == pytest.approx(rear, abs=1e-12)


def test_rms_table_is_that_of_the_histories(small_run):
    """From the report step the RMS differs a little from that of the finer step, no more."""
    case = small_run.time[0]
    table = case.rms.set_index(["design", "method", "indicator"]).sort_index()["value"]
    for (design, method), history in case.histories.items():
        coarse = np.sqrt(np.mean(history**2, axis=1))
        assert table[design, method][list(case.outputs)].to_numpy() == pytest.approx(coarse, rel=0.02)
    change = case.rms.set_index(["design", "method", "indicator"]).sort_index()["change_percent"]
    ratio = table["harmonic_tuned", "exact"] / table["passive", "exact"]
    assert change["harmonic_tuned", "exact"].to_numpy() == pytest.approx(100 * (ratio - 1).to_numpy())
    assert change["passive"].isna().all()


def test_exact_and_pade_differ_by_what_the_table_says(small_run):
    case = small_run.time[0]
    found = case.pade_difference.set_index(["design", "output"])["max_difference"]
    for design in ("harmonic_published", "harmonic_tuned"):
        coarse = np.abs(case.histories[design, "pade"] - case.histories[design, "exact"]).max(axis=1)
        assert np.all(coarse <= found[design][list(case.outputs)].to_numpy() * (1 + 1e-12))
        assert np.all(coarse > 0)
        # relative to the peak of the exact run, which stands between the samples
        row = case.pade_difference.set_index(["design", "output"]).loc[design]
        peak = (row["max_difference"] / row["relative_to_peak"])[list(case.outputs)].to_numpy()
        sampled = np.abs(case.histories[design, "exact"]).max(axis=1)
        assert np.all((sampled <= peak * (1 + 1e-12)) & (peak < 1.02 * sampled))


def test_what_no_table_shows_is_not_simulated(small_study, monkeypatch):
    """Ride indices are those of the exact runs; a look between the samples serves difference and peak."""
    calls: dict[str, list[str]] = {"ride_indices": [], "extremes": []}
    for name, made in calls.items():
        original = getattr(time_section, name)

        def counted(first, *rest, made=made, original=original, **options):
            made.append(getattr(first, "method", ""))
            return original(first, *rest, **options)

        monkeypatch.setattr(time_section, name, counted)
    run = compute_study(small_study, sections=("time",))
    assert calls["ride_indices"] == ["exact"] * sum(len(case.designs) for case in run.time)
    assert len(calls["extremes"]) == sum(len(case.pade_orders) for case in run.time)


def test_pade_errors_fall_with_the_order(small_run):
    assert [case.design for case in small_run.pade] == ["random_published", "harmonic_tuned"]
    for case in small_run.pade:
        low, high = (case.table.iloc[k] for k in (0, 1))
        for error in ("root_error", "time_error", "rms_error"):
            assert 0 <= high[error] < low[error]
        assert len(case.recommended_order) == 2


def test_published_numbers_stand_beside_the_computed_ones(small_run):
    printed = small_run.time[1].printed.set_index(["indicator", "design"])["value"]
    assert printed["body_acceleration", "random_published"] == 1.2578
    assert printed["tire_deflection_rear", "passive"] == 0.0067
    assert len(printed) == 12


def test_headlines_are_three_sentences(small_run):
    assert len(small_run.headlines) == 3
    assert "7 stable" in small_run.headlines[0]
    assert "0.4441" in small_run.headlines[0]
    assert all(line.endswith(".") and "\n" not in line for line in small_run.headlines)


def test_the_headline_of_a_random_road_is_not_that_of_one_record(small_run):
    rms = small_run.time[1].rms
    rows = rms[(rms["indicator"] == "body_acceleration") & (rms["design"] == "random_published")]
    change = rows.set_index("method")["change_percent"]
    line = small_run.headlines[1]
    assert f"{change['stationary']:+.1f} %" in line.split("(in the record of 2 s ")[0]
    assert f"{change['exact']:+.1f} %" in line.split("(in the record of 2 s ")[1]


def test_provenance(small_run, small_study):
    provenance = small_run.provenance
    assert provenance.study_file == "wu_ren_2020.toml"
    assert provenance.versions["numpy"] == np.__version__
    assert provenance.seeds == {"harmonic_tuned": 1, "random_tuned": 1, "time.random": 1}
    assert provenance.duration > 0
    assert small_run.study is small_study


def test_vehicle_section_shows_table_1(small_run):
    table = small_run.vehicle.parameters.set_index("symbol")
    assert table.loc["ktf", "value"] == 192000.0
    assert table.loc["ktf", "unit"] == "N/m"
    assert table.loc["I", "unit"] == "kg m2"
    loads = small_run.vehicle.static_loads.set_index("wheel")["load_N"]
    assert list(loads.round(1)) == [4100.6, 3511.0]


def flattened(value, path=""):
    """Every number and table of a run by its path, the duration left out."""
    if isinstance(value, pd.DataFrame):
        return {path: value.to_csv(index=False)}
    if isinstance(value, np.ndarray):
        return {path: value.tobytes()}
    if dataclasses.is_dataclass(value):
        found = {}
        for field in dataclasses.fields(value):
            if field.name not in ("duration", "study"):
                found |= flattened(getattr(value, field.name), f"{path}.{field.name}")
        return found
    if isinstance(value, dict):
        return {k: v for key, item in value.items() for k, v in flattened(item, f"{path}[{key}]").items()}
    if isinstance(value, tuple):
        return {k: v for n, item in enumerate(value) for k, v in flattened(item, f"{path}[{n}]").items()}
    return {path: repr(value)}


def test_the_same_study_gives_the_same_numbers(small_run, small_study):
    again = flattened(compute_study(small_study))
    first = flattened(small_run)
    assert first.keys() == again.keys()
    assert len(first) > 100
    assert [path for path in first if first[path] != again[path]] == []


def test_another_seed_gives_another_road(small_run, small_study):
    changed = small_study.with_changes({"time[random].road.seed": 2})
    again = compute_study(changed, sections=["time"])
    assert not np.array_equal(
        again.time[1].histories["passive", "exact"], small_run.time[1].histories["passive", "exact"]
    )


def test_a_run_survives_pickling(small_run):
    again = pickle.loads(pickle.dumps(small_run))
    assert flattened(again) == flattened(small_run)


def test_one_section_alone(small_study):
    run = compute_study(small_study, sections=["stability"])
    assert run.frequency is None
    assert run.audit is None
    assert run.time == run.tuning == run.pade == ()
    assert [d.role for d in run.designs] == ["passive"] + ["published"] * 4
    assert len(run.headlines) == 1


def test_an_unknown_section_is_refused(small_study):
    with pytest.raises(sc.InputError, match="did you mean 'stability'"):
        compute_study(small_study, sections=["stabillity"])


QUARTER_CAR = """
name = "quarter"
title = "Quarter car with delayed velocity feedback over a bump"
[vehicle]
kind = "quarter_car"
speed_m_per_s = 8.0
[[designs]]
key = "skyhook"
label = "delayed skyhook"
channels = [ { measured = "body_velocity", actuator = "force", gain_N_s_per_m = -1500.0, delay_s = 0.02 } ]
[[designs]]
key = "late"
label = "too late"
channels = [ { measured = "body_velocity", actuator = "force", gain_N_s_per_m = -30000.0, delay_s = 0.2 } ]
[frequency]
points = 40
outputs = ["body_acceleration", "tire_deflection"]
curve_outputs = ["body_acceleration"]
[[tuning]]
key = "found"
label = "found"
objective = "band_peak"
omega_from_rad_per_s = 2.0
omega_to_rad_per_s = 20.0
weights = { body_acceleration = 1.0 }
particles = 12
iterations = 15
compare = ["skyhook"]
[[tuning.pairs]]
measured = "body_velocity"
actuator = "force"
gain_from_N_s_per_m = -4000.0
gain_to_N_s_per_m = 4000.0
delay_to_s = 0.1
[stability]
up_to_s = 0.5
[[time]]
key = "bump"
label = "bump"
duration_s = 2.0
step_s = 0.005
report_step_s = 0.01
designs = ["skyhook", "late"]
outputs = ["body_acceleration", "suspension_deflection", "tire_deflection"]
road = { kind = "bump", height_m = 0.05, length_m = 2.0 }
[pade]
orders = [2, 4]
omega_to_rad_per_s = 50.0
points = 30
cases = { skyhook = "bump" }
"""


@pytest.fixture(scope="module")
def quarter_run(tmp_path_factory):
    path = tmp_path_factory.mktemp("studies") / "quarter.toml"
    path.write_text(QUARTER_CAR, encoding="utf-8")
    return compute_study(sc.load_study(path))


def test_a_quarter_car_with_other_feedback(quarter_run):
    verdicts = quarter_run.stability.verdicts.set_index("design")
    assert verdicts.loc["skyhook", "verdict"] == "stable"
    assert verdicts.loc["late", "verdict"] == "unstable"
    assert verdicts.loc["late", "unstable_roots"] >= 2
    assert verdicts.loc["found", "verdict"] == "stable"
    tuned = quarter_run.tuning[0].comparison.set_index("design")["objective_value"]
    assert tuned["found"] < tuned["skyhook"] < tuned["passive"]
    assert quarter_run.tuning[0].closed_form is None
    assert quarter_run.frequency.velocity_gain_in_phase is None


def test_the_sweep_loses_stability_at_the_margin(quarter_run):
    line = next(x for x in quarter_run.stability.lines if (x.design, x.line) == ("late", "equal"))
    assert not line.stable_for_every_delay
    assert 0 < line.sweep.delay_margin < 0.2
    assert line.tau_of_design == 0.2
    assert line.sweep.crossings["tau"].min() == pytest.approx(line.sweep.delay_margin)
    assert line.sweep.stable_intervals[0] == (0.0, pytest.approx(line.sweep.delay_margin))


def test_an_unstable_design_is_simulated_but_has_no_stationary_value(quarter_run):
    rms = quarter_run.time[0].rms
    assert set(rms["method"]) == {"exact", "pade"}
    value = rms.set_index(["design", "method", "indicator"])["value"]
    assert value["late", "exact", "body_acceleration"] > 10 * value["passive", "exact", "body_acceleration"]
    assert quarter_run.time[0].printed is None


def test_undecided_verdicts_are_told(small_run):
    verdicts = small_run.stability.verdicts.assign(verdict="undecided")
    stability = dataclasses.replace(small_run.stability, verdicts=verdicts)
    assert dataclasses.replace(small_run, stability=stability).undecided


@pytest.mark.slow
def test_the_whole_paper_study(main_study):
    """Full size: in time, exact and Padé alike at the order stated, the tuned designs what they should be."""
    run = compute_study(main_study)
    assert run.provenance.duration < 60.0
    for case in run.time:
        value = case.rms.set_index(["method", "design", "indicator"]).sort_index()["value"]
        tuned = [design for design in case.designs if design != "passive"]
        for design in tuned:
            exact, pade = value["exact", design], value["pade", design]
            assert pade.to_numpy() == pytest.approx(exact.to_numpy(), rel=1e-3)
    # A record of 20 s holds some 25 periods of the body: its RMS is known to about a tenth.
    assert value["exact"].to_numpy() == pytest.approx(value["stationary"].to_numpy(), rel=0.15)
    for search in run.tuning:
        table = search.comparison.set_index("design")["objective_value"]
        assert table[search.key] == table.min() < table["passive"]
    assert set(run.stability.verdicts["verdict"]) == {"stable"}
    assert {(line.line) for line in run.stability.lines} == {"equal", "ray", "tau2"}
    assert len(run.audit.table) == 24 + 24 + 8 + 4 + 1 + 8
    assert list(run.audit.summary.iloc[-1][["reproduced", "explained"]]) == [9, 11]
