"""The journal of a sweep: every finished variant is on the disk before the next one is counted.

One line of JSON per entry, the first for the sweep itself. A line is written by one call and forced to the disk; what
a kill or a full disk leaves of a last line is cut off when the journal is opened again.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from susp_ctrl.errors import InputError

try:
    import fcntl
except ImportError:  # Windows: no advisory locks
    fcntl = None  # type: ignore[assignment]

JOURNAL = "journal.jsonl"
_FORMAT = 1


def digest(content: Any) -> str:
    """Return the SHA-256 of plain data."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


class Journal:
    """An append-only record of finished variants; a context manager that holds the file for one sweep.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    identity : mapping of str to str
        What makes the sweep this one: name of a part -> digest or version.

    Attributes
    ----------
    entries : dict of int to data
        What earlier runs stored, by variant.

    Raises
    ------
    InputError
        The journal there belongs to another sweep, is in use, or is no journal.
    OSError
        The file system refuses.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str]) -> None:
        self.path = folder / JOURNAL
        self.entries: dict[int, Any] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError):
            raise InputError(
                f"folder = {str(folder)!r} is not allowed: there is a file of that name"
            ) from None
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            self._lock()
            self._end = self._read(dict(identity))
            os.ftruncate(self._file, self._end)
            if self._end == 0:
                self._append({"journal": "susp_ctrl sweep", "format": _FORMAT, "identity": dict(identity)})
                self._force_folder(folder)
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._file)

    def store(self, number: int, data: Any) -> None:
        """Store a finished variant; it is on the disk when this returns."""
        self._append({"variant": number, "data": data})
        self.entries[number] = data

    def _lock(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{self.path}: another sweep is writing there now") from None

    def _append(self, entry: Mapping[str, Any]) -> None:
        line = json.dumps(entry, ensure_ascii=True).encode() + b"\n"
        try:
            os.lseek(self._file, self._end, os.SEEK_SET)
            written = 0
            while written < len(line):
                written += os.write(self._file, line[written:])
            os.fsync(self._file)
        except OSError as problem:
            os.ftruncate(self._file, self._end)
            reason = problem.strerror or str(problem)
            raise OSError(
                problem.errno, f"{self.path}: not written: {reason}; the variants stored before are kept"
            ) from problem
        self._end += len(line)

    def _read(self, identity: dict[str, str]) -> int:
        """Read all whole lines and return where they end."""
        end = 0
        with os.fdopen(os.dup(self._file), "rb") as lines:
            for line in lines:
                entry = _entry(line)
                if not line.endswith(b"\n"):
                    break  # torn: it is cut off
                if end == 0:
                    self._check(entry or {}, identity)
                elif entry is not None and "variant" in entry:
                    self.entries[int(entry["variant"])] = entry["data"]
                end += len(line)
        return end

    def _check(self, entry: Mapping[str, Any], identity: dict[str, str]) -> None:
        theirs = entry.get("identity")
        if entry.get("format") != _FORMAT or not isinstance(theirs, dict):
            raise InputError(f"{self.path}: this is no journal of a sweep; choose another folder")
        parts = [name for name in {**identity, **theirs} if identity.get(name) != theirs.get(name)]
        if parts:
            raise InputError(
                f"{self.path}: this journal belongs to another sweep (it differs in {', '.join(parts)}); "
                "choose another folder, or remove the journal"
            )

    @staticmethod
    def _force_folder(folder: Path) -> None:
        """Make the new file's name as lasting as its content."""
        if os.name == "posix":
            handle = os.open(folder, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)


def _entry(line: bytes) -> dict[str, Any] | None:
    """Return the entry of a line, None if it is none."""
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None
