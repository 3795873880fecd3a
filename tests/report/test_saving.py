"""A folder is replaced as a whole or not at all, whatever happens on the way."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from susp_ctrl.errors import InputError
from susp_ctrl.report.saving import MANIFEST, SaveError, check_folder, replacing, write_manifest
from susp_ctrl.terminal import Terminated, catch_signals


def _write(folder: Path, text: str = "new") -> None:
    with replacing(folder) as partial:
        (partial / "tables").mkdir()
        (partial / "tables" / "a.csv").write_text(text)
        write_manifest(partial, {"title": text})


def _content(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): p.read_text() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture
def report(tmp_path: Path) -> Path:
    folder = tmp_path / "report"
    _write(folder, "old")
    return folder


@pytest.mark.parametrize("name", ["plain", "mit Leerzeichen", "Fahrwerk – Größe µ", "stars*[x]?", "a/b/c"])
def test_a_report_is_written_and_nothing_else_is_left(name: str, tmp_path: Path) -> None:
    folder = tmp_path / name
    _write(folder)
    _write(folder, "newer")
    assert _content(folder)["tables/a.csv"] == "newer"
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_manifest_names_every_file_with_size_and_hash(report: Path) -> None:
    manifest = json.loads((report / MANIFEST).read_text())
    assert manifest["title"] == "old"
    assert manifest["files"] == [
        {"path": "tables/a.csv", "bytes": 3, "sha256": hashlib.sha256(b"old").hexdigest()},
    ]


@pytest.mark.parametrize("failure", [RuntimeError("a fault"), KeyboardInterrupt(), SystemExit(3)])
def test_a_failure_in_the_middle_leaves_the_old_report(failure: BaseException, report: Path) -> None:
    before = _content(report)

    def fail() -> None:
        with replacing(report) as partial:
            (partial / "half").write_text("half")
            raise failure

    with pytest.raises(type(failure)):
        fail()
    assert _content(report) == before
    assert [path.name for path in report.parent.iterdir()] == ["report"]


def test_a_failure_leaves_no_new_folder(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), replacing(tmp_path / "new"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_in_one_line_and_changes_nothing(report: Path) -> None:
    before = _content(report)
    told = pytest.raises(SaveError, match="the disk is full; what was there before is unchanged")
    with told as caught, replacing(report):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert "\n" not in str(caught.value)
    assert _content(report) == before


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_a_real_full_device_gives_the_same_error(report: Path) -> None:
    with (
        pytest.raises(SaveError, match="the disk is full"),
        replacing(report),
        open("/dev/full", "w") as full,
    ):
        full.write("x" * 100_000)


def test_a_failing_exchange_puts_the_old_report_back(report: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = _content(report)
    real = os.rename

    def failing(source: Path, target: Path) -> None:
        if ".partial-" in str(source):
            raise PermissionError(errno.EACCES, "Permission denied")
        real(source, target)

    monkeypatch.setattr(os, "rename", failing)
    with pytest.raises(SaveError, match="Permission denied"):
        _write(report)
    monkeypatch.undo()
    assert _content(report) == before
    assert [path.name for path in report.parent.iterdir()] == ["report"]


def test_a_read_only_place_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        os, "access", lambda path, mode: False
    )  # the tests may run as root, who may write anywhere
    with pytest.raises(SaveError, match="read-only"):
        check_folder(tmp_path / "report")


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc here")
def test_a_place_where_no_folder_can_be_made_is_refused() -> None:
    with pytest.raises(SaveError, match="not written"):
        _write(Path("/proc/report"))


def test_targets_that_are_not_for_a_report_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    with pytest.raises(InputError, match="it is a file"):
        check_folder(file)
    with pytest.raises(InputError, match="is a file"):
        check_folder(file / "below")
    with pytest.raises(InputError, match="holds files but no report"):
        _write(tmp_path)
    assert file.read_text() == "mine"
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="current folder"):
        check_folder(".")
    with pytest.raises(InputError, match="current folder"):
        check_folder(tmp_path.parent)


@pytest.mark.parametrize("name", ["x" * 250, "x" * 300, "a/" + "y" * 250])
def test_a_name_that_is_too_long_is_known_before_anything_is_written(name: str, tmp_path: Path) -> None:
    with pytest.raises(SaveError, match="too long") as caught:
        check_folder(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="no path"):
        check_folder("a\0b")


def test_a_full_disk_is_known_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SaveError, match="the disk is full"):
        check_folder(tmp_path / "new" / "report")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["report", "more/than/one"])
def test_the_trial_leaves_nothing(name: str, tmp_path: Path) -> None:
    assert check_folder(tmp_path / name) == (tmp_path / name).resolve()
    assert list(tmp_path.iterdir()) == []


def _end_in_the_middle(folder: Path) -> None:
    with replacing(folder) as partial:
        (partial / "half").write_text("half")
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(5.0)  # the signal comes at once


@pytest.mark.skipif(not hasattr(signal, "SIGTERM") or os.name == "nt", reason="no POSIX signals")
def test_a_request_to_end_removes_lock_and_partial_files(report: Path) -> None:
    before, handler = _content(report), signal.getsignal(signal.SIGTERM)
    try:
        catch_signals()
        with pytest.raises(Terminated) as stopped:
            _end_in_the_middle(report)
    finally:
        signal.signal(signal.SIGTERM, handler)
    assert stopped.value.status == 143
    assert _content(report) == before
    assert [path.name for path in report.parent.iterdir()] == ["report"]


def test_an_empty_folder_is_fine(tmp_path: Path) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    _write(folder)
    assert _content(folder)["tables/a.csv"] == "new"


def test_files_of_the_user_in_an_earlier_report_are_kept(report: Path) -> None:
    (report / "notes.txt").write_text("mine")
    (report / "more").mkdir()
    (report / "more" / "x.csv").write_text("mine too")
    with replacing(report) as partial:
        (partial / "b.csv").write_text("new")
        write_manifest(partial, {})
    content = _content(report)
    assert content["notes.txt"] == "mine"
    assert content["more/x.csv"] == "mine too"
    assert content["b.csv"] == "new"
    assert "tables/a.csv" not in content, "a file of the earlier report that the new one does not have"


def test_runs_into_one_folder_at_once_take_turns(tmp_path: Path) -> None:
    folder, inside, most, failures = tmp_path / "report", [0], [0], []

    def run(text: str) -> None:
        try:
            with replacing(folder) as partial:
                inside[0] += 1
                most[0] = max(most[0], inside[0])
                (partial / "a").write_text(text)
                time.sleep(0.05)
                (partial / "b").write_text(text)
                write_manifest(partial, {"title": text})
                inside[0] -= 1
        except Exception as problem:
            failures.append(problem)

    threads = [threading.Thread(target=run, args=(str(n),)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert most[0] == 1
    content = _content(folder)
    assert content["a"] == content["b"] == json.loads(content[MANIFEST])["title"]
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_a_killed_run_changes_nothing_and_the_next_one_clears_up(report: Path) -> None:
    before = _content(report)
    program = (
        "import os, signal, sys\n"
        "from susp_ctrl.report.saving import replacing\n"
        "with replacing(sys.argv[1]) as partial:\n"
        "    (partial / 'half').write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", program, str(report)], check=False, timeout=60)
    assert done.returncode == -signal.SIGKILL
    assert _content(report) == before
    assert any(".partial-" in path.name for path in report.parent.iterdir())
    _write(report)
    assert [path.name for path in report.parent.iterdir()] == ["report"]
    assert _content(report)["tables/a.csv"] == "new"


def test_a_run_killed_between_the_two_renames_is_put_right(report: Path) -> None:
    before = _content(report)
    os.rename(report, report.with_name(".report.previous"))
    with pytest.raises(RuntimeError), replacing(report):
        raise RuntimeError
    assert _content(report) == before
