"""Padé against exact delays as a study: errors, the order for a tolerance, wrong verdicts, cost."""

from __future__ import annotations

from pathlib import Path

import control as ct
import numpy as np
import oracles
import pandas as pd
import pytest

import susp_ctrl as sc
from susp_ctrl.report.study_result import StudyResult
from susp_ctrl.study import compute_study
from susp_ctrl.study.sections.pade import _met

STUDY = Path(__file__).parents[3] / "studies" / "pade_versus_exact.toml"
ORDERS = [3, 5, 8, 20]


@pytest.fixture(scope="module")
def run():
    study = sc.load_study(STUDY).with_changes(
        {
            "pade.orders": ORDERS,
            "pade.points": 60,
            "pade.cost_repeats": 1,
            "pade.cases": {"random_published": "random"},
            "time[random].duration_s": 2.0,
            "time[random].lead_in_s": 0.0,
            "time[random].designs": ["random_published"],
        }
    )
    return compute_study(study, sections=("time", "pade"))


def unstable_roots(function, degree, radius=2e4, points=400_001):
    """Zeros of a real (quasi-)polynomial to the right of the axis, from its phase along the axis."""
    omega = radius * np.sinh(np.linspace(0.0, 12.0, points)) / np.sinh(12.0)
    turned = np.unwrap(np.angle(function(1j * omega)))
    return round(degree / 2 - (turned[-1] - turned[0]) / np.pi)


@pytest.mark.analytical
def test_verdicts_equal_counts_on_the_independent_half_car(run):
    designs = {design.key: design for design in run.designs}
    table = run.pade_verdicts
    assert set(table["design"]) == set(designs) - {"passive"}
    for key, rows in table.groupby("design"):
        gains = [channel.gain for channel in designs[key].channels]
        delays = [channel.delay for channel in designs[key].channels]
        exact = unstable_roots(
            lambda s, g=gains, tau=delays: oracles.characteristic_function(s, g, tau), degree=8
        )
        assert (rows["exact"] == ("stable" if exact == 0 else "unstable")).all()
        for row in rows[
            rows["order"] < 10
        ].itertuples():  # beyond that the coefficients of ct.pade are useless

            def polynomial(s, g=gains, tau=delays, n=row.order):
                fractions = [ct.pade(t, n) for t in tau]
                fed = [
                    k * np.polyval(num, s) / np.polyval(den, s)
                    for k, (num, den) in zip(g, fractions, strict=True)
                ]
                whole = oracles.characteristic_function(s, fed)
                for _, den in fractions:
                    whole = whole * np.polyval(den, s) / np.abs(np.polyval(den, s))
                return whole

            count = unstable_roots(polynomial, degree=8 + 2 * row.order)
            assert row.pade_says == ("stable" if count == 0 else "unstable"), (key, row.order, count)
            assert row.right == ((count == 0) == (exact == 0))


def test_low_orders_are_wrong_in_both_directions_and_high_ones_are_right(run):
    table = run.pade_verdicts
    wrong = table[~table["right"]]
    assert set(wrong["exact"]) == {"stable", "unstable"}
    assert table[table["order"] == 20]["right"].all()
    assert any("Wrong verdicts of Padé" in line for line in run.headlines)


@pytest.mark.analytical
def test_wheel_hop_root_is_an_exact_root_of_the_independent_half_car(run):
    (case,) = run.pade
    root = case.wheel_hop_root
    assert case.wheel_hop_band[0] <= root.imag <= case.wheel_hop_band[1]
    design = run.design("random_published")
    gains, delays = zip(*((c.gain, c.delay) for c in design.channels), strict=True)
    here = abs(oracles.characteristic_function(root, gains, delays))
    aside = abs(oracles.characteristic_function(root + 1e-6, gains, delays))
    assert here < 1e-4 * aside
    errors = case.table.set_index("order")
    assert errors.loc[5, "wheel_hop_root_error"] > 1.0  # a band that order 5 cannot reach
    assert errors.loc[20, "wheel_hop_root_error"] < 0.1
    assert errors.loc[20, "root_error"] < 1e-9
    assert errors.loc[5, "wheel_hop_frequency_error"] > errors.loc[20, "wheel_hop_frequency_error"]


def test_worst_indicator_is_that_of_the_table(run):
    (case,) = run.pade
    worst = case.indicators.drop(columns="order").max(axis=1)
    np.testing.assert_array_equal(case.table["rms_error"], worst)
    assert list(case.indicators.columns[1:]) == list(run.time[0].outputs)


def test_order_for_a_tolerance_is_behind_the_last_order_that_fails():
    errors = pd.DataFrame(
        {
            "order": [2, 4, 6, 8],
            "lucky": [0.001, 0.5, 0.02, 0.005],
            "never": [0.5, 0.5, 0.5, np.inf],
            "always": [0.0, 0.0, 0.0, 0.0],
            "undefined": [np.nan] * 4,
            "root_error": [9.0, 4.0, 1.0, 0.1],
        }
    )
    met = _met(errors, {"root_error": 100.0}, (0.05, 0.01)).set_index(["error", "tolerance"])["order"]
    assert met["lucky", 0.05] == 6
    assert met["lucky", 0.01] == 8
    assert met["always", 0.01] == 2
    assert met["root_error", 0.05] == 4
    assert met["root_error", 0.01] == 6
    assert np.isnan(met["never", 0.05])
    assert np.isnan(met["undefined", 0.05])


def test_cost_is_measured_and_stands_in_no_table_of_the_report(run):
    (case,) = run.pade
    assert list(case.cost["order"]) == [0, *ORDERS]
    assert list(case.cost["states"]) == [8, *(8 + 2 * order for order in ORDERS)]
    ratios = case.cost[["simulation_ratio", "roots_ratio", "frequency_ratio"]]
    assert (ratios.iloc[0] == 1.0).all()
    assert (ratios > 0.0).all(axis=None)
    result = StudyResult(run)
    assert "pade_cost" in result.figures
    assert not any(
        column.endswith(("_ratio", "_s")) and "time_s" not in column
        for name, frame in result.tables.items()
        if name.startswith("pade")
        for column in frame.columns
    )


def test_report_blocks_hold_what_was_computed(run):
    result = StudyResult(run)
    pd.testing.assert_frame_equal(result.tables["pade_verdicts"], run.pade_verdicts)
    met = result.tables["pade_order_for_tolerance"].set_index("error")
    long = run.pade[0].met.set_index(["error", "tolerance"])["order"]
    for (error, tolerance), order in long.items():
        shown = met.loc[error, f"random_published.{tolerance:g}"]
        assert shown == order or (np.isnan(shown) and np.isnan(order))
    for name in ("pade_error", "pade_verdicts", "pade_cost"):
        assert result.figures[name].axes
