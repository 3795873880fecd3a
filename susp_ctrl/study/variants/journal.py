"""The journal of a sweep: every finished variant is on the disk before the next one is counted.

One line of JSON per entry, the first for the sweep itself. A line is written by one call and forced to the disk, and
carries a checksum over the sweep's identity, the variant and its data. Lines that do not fit theirs (half-written,
altered, of another sweep) and variants that stand there twice are refused when the journal is opened again: they are
told, removed, and computed anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from susp_ctrl.errors import InputError

try:
    import fcntl
except ImportError:  # Windows: no advisory locks
    fcntl = None  # type: ignore[assignment]

JOURNAL = "journal.jsonl"
_FORMAT = 2
_LONGEST_LINE = 10_000_000  # bytes; a variant has some hundred per design


def digest(content: Any) -> str:
    """Return the SHA-256 of plain data."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def probe(folder: Path) -> None:
    """Write a byte into a folder, which is made if need be, and remove it: to know at once whether one can.

    Raises
    ------
    InputError
        There is a file of that name.
    OSError
        The file system refuses.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise InputError(f"folder = {str(folder)!r} is not allowed: there is a file of that name") from None
    except OSError as problem:
        raise OSError(f"{folder}: not written: {problem.strerror}") from problem
    path = folder / f".{JOURNAL}.probe-{os.getpid()}"
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            _write(handle, b"\n")
        finally:
            os.close(handle)
            path.unlink(missing_ok=True)
    except OSError as problem:
        raise OSError(f"{folder}: not written: {problem.strerror}") from problem


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
        probe(folder)
        self._identity = dict(identity)
        self._sweep = digest(self._identity)
        self._file = self._opened()
        try:
            self._lock(self._file)
            if os.fstat(self._file).st_ino != os.stat(self.path).st_ino:  # just replaced by its owner
                raise InputError(f"{self.path}: another sweep is writing there now")
            self._read()
            if self._end == 0:
                self._append(self._first_entry())
                self._force_folder()
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
        self._append(self._signed(number, data))
        self.entries[number] = data

    def _first_entry(self) -> dict[str, Any]:
        return {"journal": "susp_ctrl sweep", "format": _FORMAT, "identity": self._identity}

    def _signed(self, number: int, data: Any) -> dict[str, Any]:
        return {"variant": number, "data": data, "checksum": digest([self._sweep, number, data])}

    def _opened(self) -> int:
        """Open the file for reading and writing, if it is one."""
        try:
            # a pipe would wait for its other end
            handle = os.open(self.path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NONBLOCK", 0), 0o666)
        except IsADirectoryError:
            raise InputError(f"{self.path}: this is a folder and no journal; choose another folder") from None
        if stat.S_ISREG(os.fstat(handle).st_mode):
            return handle
        os.close(handle)
        raise InputError(f"{self.path}: this is no regular file and no journal; choose another folder")

    def _lock(self, handle: int) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{self.path}: another sweep is writing there now") from None

    def _append(self, entry: Mapping[str, Any]) -> None:
        line = _line(entry)
        try:
            os.lseek(self._file, self._end, os.SEEK_SET)
            _write(self._file, line)
        except OSError as problem:
            os.ftruncate(self._file, self._end)
            reason = problem.strerror or str(problem)
            raise OSError(
                problem.errno, f"{self.path}: not written: {reason}; the variants stored before are kept"
            ) from problem
        self._end += len(line)

    def _read(self) -> None:
        """Take the variants that can be trusted; what else is there is told and removed."""
        found: list[dict[str, Any] | None] = []
        self._end = os.fstat(self._file).st_size
        with os.fdopen(os.dup(self._file), "rb") as file:
            lines = _lines(file)
            first = next(lines, b"")
            if first.endswith(b"\n"):
                self._check(_entry(first) or {})
                found = [self._trusted(line) for line in lines]
            elif _line(self._first_entry()).startswith(first):
                os.ftruncate(self._file, 0)  # nothing but the torn beginning of a journal of this sweep
                self._end = 0
            else:
                self._check({})
        times = Counter(entry["variant"] for entry in found if entry is not None)
        self.entries = {
            entry["variant"]: entry["data"]
            for entry in found
            if entry is not None and times[entry["variant"]] == 1
        }
        refused = len(found) - len(self.entries)
        if refused:
            warnings.warn(
                f"{self.path}: {refused} of {len(found)} variants are damaged or stand there twice: they are "
                "refused and computed again",
                stacklevel=4,
            )
            self._rewrite()

    def _trusted(self, line: bytes) -> dict[str, Any] | None:
        """Return the entry of a line if it is exactly what a sweep like this one writes."""
        entry = _entry(line)
        if entry is None or not isinstance(entry.get("variant"), int) or "data" not in entry:
            return None
        return entry if line == _line(self._signed(entry["variant"], entry["data"])) else None

    def _rewrite(self) -> None:
        """Replace the journal by one of the trusted entries, as a whole or not at all."""
        beside = self.path.with_name(f".{JOURNAL}.partial")
        handle = os.open(beside, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            self._lock(handle)
            entries = [self._first_entry(), *(self._signed(n, data) for n, data in self.entries.items())]
            content = b"".join(map(_line, entries))
            _write(handle, content)
            os.replace(beside, self.path)
        except BaseException:
            os.close(handle)
            beside.unlink(missing_ok=True)
            raise
        os.close(self._file)
        self._file, self._end = handle, len(content)
        self._force_folder()

    def _check(self, entry: Mapping[str, Any]) -> None:
        identity, theirs = self._identity, entry.get("identity")
        if entry.get("journal") and entry.get("format") != _FORMAT:
            raise InputError(
                f"{self.path}: another version of susp_ctrl wrote this journal (its format is not {_FORMAT}); "
                "choose another folder, or remove the journal"
            )
        if not isinstance(theirs, dict) or entry.get("format") != _FORMAT:
            raise InputError(f"{self.path}: this is no journal of a sweep; choose another folder")
        parts = [name for name in {**identity, **theirs} if identity.get(name) != theirs.get(name)]
        if parts:
            raise InputError(
                f"{self.path}: this journal belongs to another sweep (it differs in {', '.join(parts)}); "
                "choose another folder, or remove the journal"
            )

    def _force_folder(self) -> None:
        """Make the new file's name as lasting as its content."""
        if os.name == "posix":
            handle = os.open(self.path.parent, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)


def _line(entry: Mapping[str, Any]) -> bytes:
    return json.dumps(entry, ensure_ascii=True).encode() + b"\n"


def _lines(file: BinaryIO) -> Iterator[bytes]:
    """Yield the lines of a file; a line without end comes in pieces, each of which is none."""
    while line := file.readline(_LONGEST_LINE):
        yield line


def _write(handle: int, content: bytes) -> None:
    """Write all of it and force it to the disk."""
    written = 0
    while written < len(content):
        written += os.write(handle, content[written:])
    os.fsync(handle)


def _entry(line: bytes) -> dict[str, Any] | None:
    """Return the entry of a line, None if it is none."""
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return entry if isinstance(entry, dict) else None
