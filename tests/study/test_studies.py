"""Every study of the folder `studies` runs, at a small size, and says what it promises."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import susp_ctrl as sc
from susp_ctrl.study import compute_study

pytestmark = [pytest.mark.end_to_end, pytest.mark.filterwarnings("ignore::susp_ctrl.errors.PadeOrderWarning")]

FOLDER = Path(__file__).parents[2] / "studies"


def shrunk(study):
    """The same study with short records, few particles and few points."""
    settings, changes = study.settings, {}
    if settings.frequency is not None:
        changes["frequency.points"] = 30
    for search in settings.tuning:
        changes |= {f"tuning[{search.key}].particles": 10, f"tuning[{search.key}].iterations": 4}
    for case in settings.time:
        changes |= {f"time[{case.key}].duration_s": 1.0, f"time[{case.key}].lead_in_s": 0.0}
        changes |= {f"time[{case.key}].pade_order": 3}
    if settings.pade is not None:
        changes |= {"pade.orders": list(settings.pade.orders[:2]), "pade.points": 30}
    return study.with_changes(changes)


LONG = ("feedback_signals",)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem in LONG else [])
        for path in sorted(FOLDER.glob("*.toml"))
    ],
)
def test_study_runs(path):
    study = sc.load_study(path)
    assert study.name == path.stem
    run = compute_study(shrunk(study))
    asked = study.settings
    assert (run.frequency is None) == (asked.frequency is None)
    assert (run.stability is None) == (asked.stability is None)
    assert (run.audit is None) == (asked.audit is None)
    assert [case.key for case in run.time] == [case.key for case in asked.time]
    assert {case.design for case in run.pade} == set(asked.pade.cases if asked.pade is not None else ())
    assert [search.key for search in run.tuning] == [search.key for search in asked.tuning]
    assert run.headlines
    assert not run.undecided
    for case in run.time:
        for history in case.histories.values():
            assert np.all(np.isfinite(history))


def script(name):
    specification = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def chatter_limit(module, periods):
    """Smallest chip width with a root on the axis for even spacing, 1 = -k (1 - e^{-jwt}) G(jw) with Re G < 0."""
    omega = np.linspace(1.0001, 3.0, 400_001) * module.FREQUENCY
    compliance = 1.0 / (1 - (omega / module.FREQUENCY) ** 2 + 2j * module.DAMPING * omega / module.FREQUENCY)
    width = -1.0 / (2 * compliance.real)
    # e^{-jwt} = 1 + 1/(k G) gives the phase of the wave left behind
    phase = (-np.angle(1 + 1 / (width * compliance))) % (2 * np.pi)
    tau = periods * 2 * np.pi / module.FREQUENCY
    limits = []
    for turn in range(int(3.0 * periods) + 2):
        delay = (phase + 2 * np.pi * turn) / omega
        cross = np.flatnonzero(np.diff(np.sign(delay - tau)) != 0)
        limits += list(width[cross])
    return min(limits)


@pytest.mark.analytical
@pytest.mark.parametrize("period", [2.2, 2.6, 3.0])
def test_chatter_limit_against_the_closed_form_of_regenerative_cutting(period):
    module = script("variable_pitch_milling")
    tau = period * 2 * np.pi / module.FREQUENCY
    found = module.limit(tau, 1.0, steps=14)
    assert found == pytest.approx(chatter_limit(module, period), abs=2.0 / 2**13)
    assert found > 2 * module.DAMPING * (1 + module.DAMPING) - 1e-3


def test_milling_study_prints(capsys):
    module = script("variable_pitch_milling")
    table = module.study(periods=(2.6,), spacings=(1.0, 0.8))
    assert table.shape == (1, 2)
    assert table.loc[2.6, "spacing 0.8"] > table.loc[2.6, "spacing 1"]


@pytest.mark.analytical
def test_neglected_delay_begins_at_the_design_without_delay():
    """Without delay the roots are those that `control.lqr` promises."""
    module = script("neglected_delay")
    plant = module.CAR.plant()
    gain = module.lqr_gain(plant, 2e5)
    deflections = plant[module.MEASURED, :]
    designed = np.linalg.eigvals(plant.A - plant[0, list(module.FORCES)].B @ gain @ deflections.C)
    roots = sc.characteristic_roots(module.controlled(plant, gain, (0.0, 0.0)), 8)
    np.testing.assert_allclose(np.sort_complex(roots), np.sort_complex(designed), rtol=1e-9)


@pytest.mark.property
def test_margins_of_a_neglected_delay_are_those_of_the_open_loop():
    """One actuator delayed, the other closed without delay: a loop with one input, whose margin is a crossover."""
    module = script("neglected_delay")
    plant, limits = module.CAR.plant(), module.margins()
    for name, gain in module.designs().items():
        closed = module.controlled(plant, gain, (0.0, 0.0))
        for n, line in ((0, "front alone"), (1, "rear alone")):
            other = 1 - n
            inner = closed.with_gains([float(k == other) for k in range(2)])
            open_loop = -inner[f"command_{module.FORCES[n]}", module.FORCES[n]]
            margin = sc.stability_margins(open_loop).delay_margin
            assert limits.loc[name, line] == pytest.approx(margin, rel=1e-6), (name, line)


def test_neglected_delay_study_ends_where_its_margin_says(monkeypatch, tmp_path, capsys):
    import matplotlib as mpl

    mpl.use("Agg")
    module = script("neglected_delay")
    limits = module.margins()["both actuators"]
    table = module.study(delays=(0.0, 0.010, 0.030))
    for row in table.itertuples():
        assert row.stable == (row.delay_ms / 1e3 < limits[row.design])
        assert np.isnan(row.body_acceleration) == (not row.stable)
    rms = table.set_index(["design", "delay_ms"])
    # what the docstring of the study says
    assert rms.loc[("LQR, comfort", 0.0), "body_acceleration"] < 0.5
    assert rms.loc[("LQR, comfort", 30.0), "body_acceleration"] > 1.0
    assert rms.loc[("LQR, road holding", 0.0), "tire_deflection_front"] < 0.85
    assert not rms.loc[("LQR, road holding", 30.0), "stable"]
    assert (rms.loc["skyhook", "body_acceleration"] < 0.95).all()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(module, "study", lambda: table)
    module.main()
    assert "delay margins" in capsys.readouterr().out
    assert (tmp_path / "out" / "neglected_delay.png").stat().st_size > 10_000


def test_the_robust_design_is_found_for_the_worst_of_the_fleet(capsys):
    """At a small size: the worst of the searched corners is no worse for the robust design than for the nominal."""
    module = script("robust_design")
    found = module.designs(particles=12, iterations=15)
    chosen = {name: [(c.gain, c.delay) for c in channels] for name, channels in found.items()}
    assert chosen["nominal"] != chosen["robust"]

    def worst(channels):
        return max(
            module.objective(
                module.car(load).plant(),
                [c.replace(delay=f * c.delay) for c, f in zip(channels, factors, strict=True)],
            )
            for load in (0.9, 1.0, 1.1)
            for factors in ((1, 1), (0.9, 0.9), (0.9, 1.1), (1.1, 0.9), (1.1, 1.1))
        )

    assert worst(found["robust"]) <= worst(found["nominal"]) * (1 + 1e-6)
    table = module.fleet_table(found, variants=5)
    assert np.all(np.isfinite(table.to_numpy()))
    module.main(particles=6, iterations=2, variants=2)
    assert "robust" in capsys.readouterr().out
