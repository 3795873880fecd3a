"""Who computes a sweep does not matter: processes, any map, a real Dask cluster; and what happens when they fail."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest
from study.variants import worker_tasks
from study.variants.sweep_case import STUDY, VARIANTS, small_sweep
from typer.testing import CliRunner

import susp_ctrl as sc
from susp_ctrl.cli import app
from susp_ctrl.study.variants.worker_pool import evaluate_in_processes

needs_dask = pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="distributed is not installed"
)


@pytest.fixture
def importable(monkeypatch):
    """Let worker processes import the tasks of these tests."""
    monkeypatch.setattr(sys, "path", [str(Path(__file__).parents[2]), *sys.path])


@pytest.fixture(scope="module")
def by_one_process():
    return small_sweep(workers=1).table


def test_one_process_and_two_give_identical_tables(by_one_process):
    assert by_one_process["variant"].tolist() == list(range(1, VARIANTS + 1))
    assert by_one_process["error"].eq("").all()
    pd.testing.assert_frame_equal(small_sweep(workers=2).table, by_one_process, check_exact=True)


def test_anything_like_map_in_any_order_gives_the_same_table(by_one_process):
    def backwards(function, tasks):
        return [function(task) for task in reversed(list(tasks))]

    with ThreadPoolExecutor(3) as pool:
        in_threads = small_sweep(workers=pool.map).table
    in_reverse = small_sweep(workers=backwards).table
    pd.testing.assert_frame_equal(in_threads, in_reverse, check_exact=True)
    # this process may use another number of BLAS threads than the workers
    pd.testing.assert_frame_equal(in_reverse, by_one_process, rtol=1e-9)


def test_a_map_that_loses_answers_is_noticed():
    with pytest.raises(sc.InputError, match="no answer"):
        small_sweep(workers=lambda function, tasks: [function(task) for task in list(tasks)[:-1]])


# --- processes that fail ------------------------------------------------------------------------------------------


def test_a_worker_that_dies_costs_its_own_task_only(importable):
    answers = evaluate_in_processes(
        worker_tasks.ends_itself, range(6), 2, lambda task, reason: (task, reason)
    )
    found = dict(answers)
    assert found.pop(3) == "its process ended (signal 9)"
    assert found == dict.fromkeys((0, 1, 2, 4, 5), "1")


@pytest.mark.parametrize("times", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_a_worker_that_dies_while_it_starts_is_replaced(importable, tmp_path, times):
    function = worker_tasks.DiesWhileStarting(tmp_path / "left", times)
    assert sorted(evaluate_in_processes(function, range(4), 1, lambda task, reason: reason)) == [0, 1, 2, 3]


@pytest.mark.slow
def test_workers_that_never_start_are_one_line(importable, tmp_path):
    function = worker_tasks.DiesWhileStarting(tmp_path / "left", 1000)
    with pytest.raises(OSError, match=r"could not be started 4 times: its process ended \(signal 9\)"):
        list(evaluate_in_processes(function, range(4), 1, lambda task, reason: reason))


def test_a_variant_whose_processes_died_is_tried_again_by_the_next_run(by_one_process, tmp_path, monkeypatch):
    """Who is killed twice in a row, by a lack of memory perhaps, is told, but not kept as if it were a result."""
    path = "susp_ctrl.study.variants.parameter_sweep.evaluate_in_processes"

    def losing(function, tasks, workers, lost):
        for task in tasks:
            yield lost(task, "its process ended (signal 9)") if task[0] == 4 else function(task)

    monkeypatch.setattr(path, losing)
    first = small_sweep(tmp_path, 1)
    assert first.failed["variant"].tolist() == [4]
    monkeypatch.undo()
    resumed = small_sweep(tmp_path, map)
    assert resumed.failed.empty
    pd.testing.assert_frame_equal(resumed.table, by_one_process, rtol=1e-9)


def test_a_sweep_that_is_abandoned_ends_its_processes(importable):
    answers = evaluate_in_processes(worker_tasks.process_number, range(1000), 2, lambda task, reason: None)
    pids = {next(answers) for _ in range(8)}
    answers.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


# --- a real cluster -----------------------------------------------------------------------------------------------


@pytest.mark.end_to_end
@pytest.mark.slow
@needs_dask
def test_a_dask_cluster_of_two_workers_gives_the_identical_table(by_one_process, tmp_path):
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=tmp_path
    ) as cluster:
        address = cluster.scheduler_address
        table = small_sweep(scheduler=address).table
        pd.testing.assert_frame_equal(table, by_one_process, check_exact=True)

        done = CliRunner().invoke(
            app,
            [
                *("sweep", str(STUDY), "--set", "sweep.samples=5", "--scheduler", address),
                *("--out", str(tmp_path / "out"), "--json"),
            ],
        )
        assert done.exit_code == 0, done.output
        tables = json.loads(done.stdout)
        assert len(tables["variants"]) == 10
        assert all(row["error"] == "" for row in tables["variants"])


@pytest.mark.end_to_end
@pytest.mark.slow
@needs_dask
@pytest.mark.parametrize(
    ("victim", "said"), [("worker", "the last Dask worker"), ("scheduler", "the Dask scheduler")]
)
def test_a_cluster_that_dies_is_one_line_and_loses_nothing(
    victim, said, by_one_process, tmp_path, monkeypatch
):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"}

    def start(*arguments):
        command = [sys.executable, "-m", "dask", *arguments]
        return subprocess.Popen(command, env=environment, stdout=-3, stderr=-3, start_new_session=True)

    info = tmp_path / "scheduler.json"
    running = {
        "scheduler": start(
            "scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", str(info)
        )
    }
    try:
        end = time.monotonic() + 60.0
        while not info.exists() or not info.read_text():
            assert time.monotonic() < end
            time.sleep(0.1)
        address = json.loads(info.read_text())["address"]
        running["worker"] = start("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
        calls = []

        def killing(stage, share):
            calls.append(stage)
            if len(calls) == 6:
                os.killpg(running[victim].pid, signal.SIGKILL)

        monkeypatch.setattr("susp_ctrl.study.variants.dask_cluster._PATIENCE", 20.0)
        with pytest.raises(OSError, match=said) as caught:
            small_sweep(tmp_path / "out", scheduler=address, progress=killing)
        assert "\n" not in str(caught.value)
    finally:
        for process in running.values():
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    kept = (tmp_path / "out" / "journal.jsonl").read_bytes().count(b"\n")
    assert kept >= 6
    resumed = small_sweep(tmp_path / "out")
    pd.testing.assert_frame_equal(resumed.table, by_one_process, check_exact=True)


@pytest.mark.end_to_end
@needs_dask
def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch):
    monkeypatch.setattr("susp_ctrl.study.variants.dask_cluster._PATIENCE", 1.0)
    with pytest.raises(sc.InputError, match="no Dask scheduler answers") as caught:
        small_sweep(scheduler="tcp://127.0.0.1:9")
    assert "\n" not in str(caught.value)


def test_without_the_extra_the_message_says_how_to_get_it(monkeypatch):
    import builtins

    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "distributed":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(sc.InputError, match=r"pip install 'susp_ctrl\[cluster\]'"):
        small_sweep(scheduler="tcp://127.0.0.1:8786")


# --- the command --------------------------------------------------------------------------------------------------


@pytest.mark.end_to_end
def test_the_command_writes_tables_and_figures_and_goes_on_from_its_journal(tmp_path):
    out = tmp_path / "Ergebnisse für später"
    arguments = ["sweep", str(STUDY), "--set", "sweep.samples=3", "--workers", "1", "--out", str(out)]
    first = CliRunner().invoke(app, arguments)
    assert first.exit_code == 0, first.output
    assert "of 3 variants" in first.output
    written = {path.name for path in out.iterdir()}
    assert {"journal.jsonl", "variants.csv", "yields.csv", "sensitivity.csv", "distribution_J.png"} <= written
    table, journal = (out / "variants.csv").read_bytes(), (out / "journal.jsonl").read_bytes()
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert (out / "variants.csv").read_bytes() == table
    assert (out / "journal.jsonl").read_bytes() == journal
    arguments[3] = "sweep.samples=4"
    other = CliRunner().invoke(app, arguments)
    assert other.exit_code == 2
    assert len(other.stderr.strip().splitlines()) == 1
    assert "another sweep" in other.stderr


@pytest.mark.end_to_end
@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["nothing.toml"], "nothing.toml"),
        ([str(STUDY), "--set", "sweep.samples=0"], "sweep.samples"),
        ([str(STUDY), "--set", "sweep.factors=[]"], "sweep.factors"),
        ([str(STUDY), "--workers", "0"], "workers"),
        ([str(STUDY.with_name("wu_ren_2020.toml"))], "[sweep]"),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(arguments, part, tmp_path):
    done = CliRunner().invoke(app, ["sweep", *arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 2, done.output
    assert len(done.stderr.strip().splitlines()) == 1
    assert part in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.end_to_end
@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no POSIX signals")
@pytest.mark.parametrize(
    ("number", "status", "said"), [("SIGINT", 130, "interrupted"), ("SIGTERM", 143, "terminated")]
)
def test_an_interrupt_keeps_what_is_finished_and_says_so(tmp_path, number, status, said):
    arguments = ["sweep", str(STUDY), "--workers", "1", "--out", str(tmp_path)]
    process = subprocess.Popen(
        [sys.executable, "-c", "from susp_ctrl.cli import main; main()", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    journal, end = tmp_path / "journal.jsonl", time.monotonic() + 90.0
    while not journal.exists() or journal.read_bytes().count(b"\n") < 10:
        assert time.monotonic() < end
        time.sleep(0.02)
    process.send_signal(getattr(signal, number))
    _, line = process.communicate(timeout=60)
    assert process.returncode == status
    assert line == f"susp-ctrl: {said}; finished variants are kept in {tmp_path}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["journal.jsonl"]
