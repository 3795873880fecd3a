"""A folder that is replaced as a whole or not at all.

Everything is written into a partial folder beside the target, on the same file system. Only when it is complete are
the two exchanged by renaming; if anything fails before, the target is as it was. A lock beside the target lets two
runs into one folder take turns: each leaves a complete report, and the later one stays.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from susp_ctrl.errors import InputError

try:
    import fcntl
except ImportError:  # Windows: no advisory locks; each run still replaces the folder as a whole
    fcntl = None  # type: ignore[assignment]

MANIFEST = "manifest.json"
_LOCK_PATIENCE = 300.0  # s; writing a report takes some seconds


class SaveError(OSError):
    """A folder could not be written; what was there before is unchanged."""


def check_folder(folder: str | Path) -> Path:
    """Return the absolute path of a folder that a report may be written to.

    A report may go where nothing is, into an empty folder, or in place of an earlier report (a folder with a
    ``manifest.json``). Call it before a long computation, so that a bad target is known at once.

    Parameters
    ----------
    folder
        The target.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        The target is a file, the current folder or one above it, or a folder with other things in it.
    SaveError
        The file system refuses the name or the place, or has no room: a few bytes are written beside the target, and
        removed.
    """
    named = f"folder = {str(folder)!r} is not allowed"
    try:
        target = Path(folder).expanduser().resolve()
        there = target.exists()
    except (RuntimeError, ValueError):  # no such user, a name with NUL
        raise InputError(f"{named}: it is no path") from None
    except OSError as problem:
        raise SaveError(f"{folder}: not written: {_reason(problem)}") from problem
    if target == Path.cwd() or target in Path.cwd().parents:
        raise InputError(
            f"{named}: it is the current folder or holds it; name a folder of its own for the report"
        )
    if there and not target.is_dir():
        raise InputError(f"{named}: it is a file, and a folder is needed")
    above = next((one for one in target.parents if one.exists()), target)
    if not above.is_dir():
        raise InputError(f"{named}: {above} is a file, and a folder is needed")
    if not os.access(above, os.W_OK | os.X_OK):
        raise SaveError(f"{folder}: not written: {above} is read-only")
    if target.is_dir() and any(target.iterdir()) and _own_files(target) is None:
        raise InputError(
            f"{named}: it holds files but no report ({MANIFEST}); choose a new or empty folder or an earlier report"
        )
    try:
        _probe(target)
    except OSError as problem:
        raise SaveError(f"{folder}: not written: {_reason(problem)}") from problem
    return target


def _probe(target: Path) -> None:
    """Write as a report will be written, and take it away again."""
    made: list[Path] = []
    try:
        for missing in [parent for parent in reversed(target.parents) if not parent.exists()]:
            missing.mkdir()
            made.append(missing)
        # a name as long as any that is used beside the target, and longer than the target's own
        trial = _beside(target, "partial-probe")
        trial.mkdir()
        made.append(trial)
        with (trial / "byte").open("wb") as file:
            file.write(b"0")
            file.flush()
            os.fsync(file.fileno())
    finally:
        for path in reversed(made):
            shutil.rmtree(path, ignore_errors=True)


def _reason(problem: OSError) -> str:
    return "the disk is full" if problem.errno == errno.ENOSPC else problem.strerror or str(problem)


def _beside(target: Path, what: str) -> Path:
    """Return a name beside the target that nobody else uses."""
    return target.with_name(f".{target.name}.{what}-{os.getpid()}-{secrets.token_hex(4)}")


@contextmanager
def replacing(folder: str | Path) -> Iterator[Path]:
    """Give a partial folder to write into; at the end of the block it takes the place of `folder`.

    Files in `folder` that an earlier report did not write are kept.

    Parameters
    ----------
    folder
        The target, see `check_folder`.

    Yields
    ------
    Path
        The partial folder.

    Raises
    ------
    InputError, SaveError
        As `check_folder`, and SaveError for anything that the file system refuses on the way (disk full, ...).
    """
    target = check_folder(folder)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with _lock(target):
            _recover(target)
            partial = _beside(target, "partial")
            partial.mkdir()
            try:
                yield partial
                _keep_foreign_files(target, partial)
                _exchange(partial, target)
            finally:
                shutil.rmtree(partial, ignore_errors=True)
    except SaveError:
        raise
    except OSError as problem:
        raise SaveError(
            f"{folder}: not written: {_reason(problem)}; what was there before is unchanged"
        ) from problem


def write_manifest(folder: Path, about: dict[str, Any]) -> Path:
    """Write ``manifest.json``: `about`, and every file of the folder with its size and SHA-256.

    Parameters
    ----------
    folder
        The folder, complete but for the manifest.
    about
        What else the manifest says (study, versions, seeds).

    Returns
    -------
    Path
    """
    entries = []
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        content = path.read_bytes()
        entries.append(
            {
                "path": path.relative_to(folder).as_posix(),
                "bytes": len(content),
                "sha256": hashlib.sha256(content).hexdigest(),
            }
        )
    manifest = folder / MANIFEST
    text = json.dumps({**about, "files": entries}, indent=1, ensure_ascii=False)
    manifest.write_text(text + "\n", encoding="utf-8")
    return manifest


def _own_files(folder: Path) -> set[Path] | None:
    """Return the files that an earlier report wrote here, or None if this is no report."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        return {folder / MANIFEST, *(folder / entry["path"] for entry in manifest["files"])}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _keep_foreign_files(target: Path, partial: Path) -> None:
    if not target.is_dir():
        return
    own = _own_files(target) or set()
    for path in sorted(target.rglob("*")):
        copy = partial / path.relative_to(target)
        if (path.is_file() or path.is_symlink()) and path not in own and not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, copy, follow_symlinks=False)


def _exchange(partial: Path, target: Path) -> None:
    # Two renames: between them, for some microseconds, the target's name is free. A run killed just there leaves
    # the earlier report under the name of `previous`, and `_recover` puts it back.
    previous = _previous(target)
    try:
        if target.exists():
            os.rename(target, previous)
        os.rename(partial, target)
    finally:
        if previous.exists() and not target.exists():
            os.rename(previous, target)
    shutil.rmtree(previous, ignore_errors=True)


def _recover(target: Path) -> None:
    previous = _previous(target)
    if previous.exists():
        if target.exists():
            shutil.rmtree(previous, ignore_errors=True)
        else:
            os.rename(previous, target)
    start = f".{target.name}.partial-"
    # The lock is held: whoever left these behind is gone. (No glob: the name may hold its special characters.)
    for left in [path for path in target.parent.iterdir() if path.name.startswith(start)]:
        shutil.rmtree(left, ignore_errors=True)


def _previous(target: Path) -> Path:
    return target.with_name(f".{target.name}.previous")


@contextmanager
def _lock(target: Path) -> Iterator[None]:
    if fcntl is None:
        yield
        return
    path = target.with_name(f".{target.name}.lock")
    end = time.monotonic() + _LOCK_PATIENCE
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as problem:
            os.close(handle)
            if problem.errno not in (errno.EAGAIN, errno.EACCES):
                raise
            if time.monotonic() > end:
                raise SaveError(
                    f"{target}: not written: another run has been writing there for too long"
                ) from None
            time.sleep(0.05)
            continue
        # The holder before us removes the file at its end: a lock on a removed file locks nothing.
        with suppress(FileNotFoundError):
            if os.fstat(handle).st_ino == os.stat(path).st_ino:
                break
        os.close(handle)
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(handle)
