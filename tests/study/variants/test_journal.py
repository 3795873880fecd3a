"""The journal of a sweep: what a kill, a full disk, a second run or another sweep can do to it."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from study.variants.sweep_case import VARIANTS, small_sweep

import susp_ctrl as sc
from susp_ctrl.study.variants.journal import JOURNAL, Journal

TESTS = Path(__file__).parents[2]
IDENTITY = {"the study": "1", "the variants": "2"}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """An uninterrupted sweep, its journal and its table; the journal is made in this process, for speed."""
    folder = tmp_path_factory.mktemp("finished")
    return small_sweep(folder, map).table, (folder / JOURNAL).read_bytes()


def counting(computed):
    def workers(function, tasks):
        for task in tasks:
            computed.append(task[0])
            yield function(task)

    return workers


def test_every_variant_is_on_the_disk_before_the_next_is_counted(tmp_path):
    """The number of whole lines in the file, seen from outside, whenever a further answer is asked for."""
    seen = []

    def workers(function, tasks):
        for task in tasks:
            path = tmp_path / JOURNAL
            seen.append(path.read_bytes().count(b"\n") if path.exists() else 0)
            yield function(task)

    small_sweep(tmp_path, workers)
    assert seen == list(range(1, VARIANTS + 2))  # the line of the sweep itself, then one per variant


@pytest.mark.filterwarnings("ignore:.*computed again")
@pytest.mark.parametrize("cut", [0, 1, 100, -1, -2, -40, -300, 0.5])
def test_a_torn_journal_goes_on_where_it_was_cut(finished, tmp_path, cut):
    table, content = finished
    kept = content[: int(cut * len(content)) if isinstance(cut, float) else cut]
    (tmp_path / JOURNAL).write_bytes(kept)
    computed = []
    resumed = small_sweep(tmp_path, counting(computed))
    pd.testing.assert_frame_equal(resumed.table, table, check_exact=True)
    assert len(computed) == VARIANTS + 1 - max(kept.count(b"\n") - 1, 0)
    assert (tmp_path / JOURNAL).read_bytes() == content


def test_a_finished_sweep_computes_nothing_and_other_limits_do_not_matter(finished, tmp_path):
    table, content = finished
    (tmp_path / JOURNAL).write_bytes(content)
    computed = []
    again = small_sweep(tmp_path, counting(computed), limits={"body_acceleration": 0.5})
    assert computed == []
    columns = [name for name in table if name != "within_limits"]
    pd.testing.assert_frame_equal(again.table[columns], table[columns], check_exact=True)
    assert again.table["within_limits"].sum() < table["within_limits"].sum()


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"ray_up_to": 4.0}, "range of delays"),
        ({"weights": {"body_acceleration": 1.0}}, "weights"),
    ],
)
def test_the_journal_of_another_sweep_is_refused_and_kept(finished, tmp_path, options, part):
    (tmp_path / JOURNAL).write_bytes(finished[1])
    with pytest.raises(sc.InputError, match="another sweep") as caught:
        small_sweep(tmp_path, map, **options)
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)
    assert (tmp_path / JOURNAL).read_bytes() == finished[1]


def test_other_variants_another_study_and_another_version_are_other_sweeps(tmp_path):
    for name in IDENTITY:
        folder = tmp_path / name
        with Journal(folder, IDENTITY) as journal:
            journal.store(1, [1.5])
        with pytest.raises(sc.InputError, match=f"differs in {name}"):
            Journal(folder, IDENTITY | {name: "other"})
    with pytest.raises(sc.InputError, match="differs in the version of numpy"):
        Journal(folder, IDENTITY | {"the version of numpy": "9"})


@pytest.mark.parametrize("content", [b"variant,design\n1,passive\n", b'{"a": 1}\n', b"[]\n"])
def test_a_file_that_is_no_journal_is_refused_and_kept(tmp_path, content):
    (tmp_path / JOURNAL).write_bytes(content)
    with pytest.raises(sc.InputError, match="no journal"):
        Journal(tmp_path, IDENTITY)
    assert (tmp_path / JOURNAL).read_bytes() == content


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(sc.InputError, match="file of that name"):
        Journal(tmp_path / "taken", IDENTITY)


@pytest.mark.skipif(sys.platform == "win32", reason="no advisory locks")
def test_two_sweeps_into_one_folder_do_not_mix(tmp_path):
    with Journal(tmp_path, IDENTITY) as journal:
        with pytest.raises(sc.InputError, match="another sweep is writing"):
            Journal(tmp_path, IDENTITY)
        journal.store(1, [1.0])
    with Journal(tmp_path, IDENTITY) as journal:
        assert journal.entries == {1: [1.0]}


def test_a_full_disk_keeps_what_was_stored_and_leaves_no_half_line(tmp_path, monkeypatch):
    write = os.write

    def full(file, data):
        if b'"variant": 2' in data:
            write(file, data[:7])
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(file, data)

    with Journal(tmp_path, IDENTITY) as journal:
        journal.store(1, [1.0])
        monkeypatch.setattr(os, "write", full)
        with pytest.raises(OSError, match=r"No space left.*stored before are kept"):
            journal.store(2, [2.0])
        monkeypatch.undo()
    lines = (tmp_path / JOURNAL).read_text().splitlines()
    assert [json.loads(line).get("variant") for line in lines] == [None, 1]
    with Journal(tmp_path, IDENTITY) as journal:
        journal.store(2, [2.0])
        assert journal.entries == {1: [1.0], 2: [2.0]}


def test_numbers_come_back_bit_by_bit(tmp_path):
    values = [0.1 + 0.2, float("inf"), 5e-324, -0.0, None, "Lücke\n", 3]
    with Journal(tmp_path, IDENTITY) as journal:
        journal.store(4, values)
    with Journal(tmp_path, IDENTITY) as journal:
        assert repr(journal.entries[4]) == repr(values)


# --- lines that cannot be trusted ---------------------------------------------------------------------------------


def _altered_digit(line):
    return line.replace(b"0.", b"9.", 1)


def _without(*fields):
    def change(line):
        entry = json.loads(line)
        return json.dumps({name: part for name, part in entry.items() if name not in fields}).encode() + b"\n"

    return change


def _with(**fields):
    return lambda line: json.dumps(json.loads(line) | fields).encode() + b"\n"


DAMAGE = {
    "an altered digit": _altered_digit,
    "no data": _with(data=[]),
    "another variant": _with(variant=3),
    "a variant that is none": _with(variant=True),
    "a variant that is a text": _with(variant="5"),
    "no checksum": _without("checksum"),
    "no data and no checksum": _without("data", "checksum"),
    "no variant": _without("variant"),
    "one field more": _with(more=1),
    "other spaces": lambda line: line.replace(b": ", b":"),
    "twice": lambda line: line + line,
    "half of it": lambda line: line[: len(line) // 2] + b"\n",
    "no JSON": lambda line: b"[" * 2000 + b"\n",
    "bytes": lambda line: b"\xff\x00" + line[2:],
    "a list": lambda line: b"[1, 2]\n",
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_line_that_cannot_be_trusted_is_told_and_computed_again(damage, finished, tmp_path):
    table, content = finished
    lines = content.splitlines(keepends=True)
    at = 6  # variant 5: the sweep itself and the study as it is stand before
    lines[at] = DAMAGE[damage](lines[at])
    (tmp_path / JOURNAL).write_bytes(b"".join(lines))
    computed = []
    with pytest.warns(UserWarning, match="refused and computed again") as told:
        resumed = small_sweep(tmp_path, counting(computed))
    assert len(told) == 1
    assert "\n" not in str(told[0].message)
    assert computed == [5]
    pd.testing.assert_frame_equal(resumed.table, table, check_exact=True)
    again = []
    small_sweep(tmp_path, counting(again))  # without a warning: the damaged line is gone
    assert again == []
    assert sorted((tmp_path / JOURNAL).read_bytes().splitlines()) == sorted(content.splitlines())
    assert [path.name for path in tmp_path.iterdir()] == [JOURNAL]


def test_a_line_of_another_sweep_is_refused(tmp_path):
    for name in ("one", "two"):
        with Journal(tmp_path / name, IDENTITY | {"the study": name}) as journal:
            journal.store(1, [name])
    one, two = (tmp_path / name / JOURNAL for name in ("one", "two"))
    one.write_bytes(
        one.read_bytes().splitlines(keepends=True)[0] + two.read_bytes().splitlines(keepends=True)[1]
    )
    with (
        pytest.warns(UserWarning, match="1 of 1 variants"),
        Journal(one.parent, IDENTITY | {"the study": "one"}) as journal,
    ):
        assert journal.entries == {}


def test_the_journal_of_an_earlier_form_is_refused_and_kept(tmp_path):
    content = json.dumps({"journal": "susp_ctrl sweep", "format": 1, "identity": IDENTITY}) + "\n"
    (tmp_path / JOURNAL).write_text(content)
    with pytest.raises(sc.InputError, match="another version"):
        Journal(tmp_path, IDENTITY)
    assert (tmp_path / JOURNAL).read_text() == content


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
def test_what_is_no_file_is_refused_at_once(kind, tmp_path):
    path = tmp_path / JOURNAL
    {"pipe": os.mkfifo, "folder": os.mkdir, "device": lambda at: os.symlink("/dev/zero", at)}[kind](path)
    with pytest.raises(sc.InputError, match="no journal") as caught:
        Journal(tmp_path, IDENTITY)
    assert str(path) in str(caught.value)


def test_a_huge_file_without_lines_is_refused_at_once(tmp_path):
    with (tmp_path / JOURNAL).open("wb") as file:
        file.truncate(2**36)  # 64 GiB of zeros that take no room
    began = time.process_time()
    with pytest.raises(sc.InputError, match="no journal"):
        Journal(tmp_path, IDENTITY)
    assert time.process_time() - began < 2.0


def test_a_place_that_cannot_be_written_is_known_before_anything_is_computed(tmp_path):
    def never(function, tasks):
        raise AssertionError("computed")

    with pytest.raises(OSError, match="too long"):
        small_sweep(tmp_path / ("x" * 300), never)


# --- a real process, really killed --------------------------------------------------------------------------------


def children(pid):
    threads = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(one) for thread in threads for one in thread.read_text().split()]


def wait_for(condition, seconds=90.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


@pytest.mark.end_to_end
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
@pytest.mark.slow
@pytest.mark.parametrize("kills", [(7,), (4, 11)])
def test_a_killed_sweep_loses_nothing_and_leaves_no_process_behind(tmp_path, kills):
    # The pause holds the sweep up between two variants, so that there is time to kill it.
    program = (
        "import sys, time; from study.variants.sweep_case import small_sweep; "
        "small_sweep(sys.argv[1], 2, progress=lambda stage, share: time.sleep(0.1))"
    )
    environment = {**os.environ, "PYTHONPATH": str(TESTS)}
    killed = tmp_path / "killed"
    journal = killed / JOURNAL
    for target in kills:  # at whatever moment it then is
        process = subprocess.Popen([sys.executable, "-c", program, str(killed)], env=environment)
        wait_for(lambda pid=process.pid: len(children(pid)) == 2)
        workers = children(process.pid)
        wait_for(lambda n=target: journal.exists() and journal.read_bytes().count(b"\n") >= n)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        wait_for(lambda pids=workers: not any(alive(pid) for pid in pids))
        before = journal.read_bytes()
        assert before.count(b"\n") < VARIANTS + 2, "it was finished before it was killed"
    resumed = small_sweep(killed, 1)
    uninterrupted = small_sweep(tmp_path / "whole", 1)
    pd.testing.assert_frame_equal(resumed.table, uninterrupted.table, check_exact=True)
    whole_lines = before[: before.rfind(b"\n") + 1]
    assert journal.read_bytes().startswith(whole_lines)


def alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"
