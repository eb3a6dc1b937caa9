"""Journal of a run: everything that happened, one JSON object per line, never rewritten."""

from __future__ import annotations

import contextlib
import errno
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from executive.errors import Fault, InputError, RecordLost, explained, reason_of
from executive.events import Event
from executive.record.entry import Entry, entry_of
from executive.record.lock import lock

_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, check_circular=False)


class Journal:
    """Appends every event to a file, as it happens.

    What the tool is about to do is on the disk before it does it, and so are every placement and the end:
    after a power cut the record says what may be in the tool and what surely is in a bin. No other process
    can write to it meanwhile; the kernel gives it free when this one ends, in whatever way.

    Args:
        path: The file.
        again: Go on with the journal that is there, the torn end of its last line cut off; otherwise there
            must be none.

    Raises:
        InputError: It is being written already, holds a run although a new one begins, or cannot be opened.
    """

    def __init__(self, path: Path, *, again: bool = False) -> None:
        self._path = path
        self._broken = False
        self._unsynced = False
        with explained(InputError, f'cannot open the journal "{path}"'):
            file = os.open(path, os.O_RDWR | os.O_APPEND | (0 if again else os.O_CREAT), 0o644)
            try:
                lock(file, path)
                self._length = _mended(file) if again else _empty(file, path)
            except BaseException:
                os.close(file)
                raise
        self._file: int | None = file

    def __call__(self, event: Event) -> None:
        """Append the entry for `event`; see `append`."""
        self.append(entry_of(event))

    def append(self, entry: Entry) -> None:
        """Append `entry`.

        Raises:
            RecordLost: The disk does not take it, or the file was deleted: the run must not go on unrecorded.
                Later events are dropped without another fault, so that the arm can be brought to rest.
            Fault: JSON has no words for it; only this entry is missing.
        """
        if self._file is None or self._broken:
            return
        line = self._encode(entry)
        try:
            self._write(self._file, line)
            if entry["kind"] in ("intent", "end") or entry.get("state") == "placed":
                self._sync(self._file)
        except OSError as error:
            self._broken = True
            # A part of the line is of no use to anybody.
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self._length)
            raise RecordLost(
                f'the journal "{self._path}" cannot be written: {reason_of(error)}; '
                "the run stops because it could not be explained afterwards"
            ) from error

    def close(self) -> None:
        """Bring everything to the disk and close the file; more calls do nothing.

        Raises:
            Fault: The disk does not take it, or the file was deleted, and `append` has not said so.
        """
        if self._file is None:
            return
        file, self._file = self._file, None
        believe = "believe what you see in the cell rather than the record"
        try:
            with explained(Fault, f'the journal "{self._path}" may lack its last lines', believe):
                if self._unsynced and not self._broken:
                    self._sync(file)
        finally:
            # What it could say, the sync has said.
            with contextlib.suppress(OSError):
                os.close(file)

    def _encode(self, entry: Entry) -> bytes:
        try:
            # Half a surrogate pair, in a text that is to be kept exactly, becomes an escape of JSON.
            return (_ENCODER.encode(entry) + "\n").encode(errors="backslashreplace")
        except (TypeError, ValueError, RecursionError) as error:
            raise Fault(
                f'the journal has no words for an event of kind "{entry["kind"]}": {error}; '
                "what is to be kept exactly must be plain JSON already"
            ) from error

    def _write(self, file: int, line: bytes) -> None:
        """Write all of `line`; a disk that is nearly full takes a part of it first."""
        # One unbuffered write per line: what was said before a crash is in the file.
        rest = line
        while rest:
            rest = rest[os.write(file, rest) :]
        self._length += len(line)
        self._unsynced = True

    def _sync(self, file: int) -> None:
        os.fsync(file)
        self._unsynced = False
        if os.fstat(file).st_nlink == 0:
            # The disk takes what is written to a deleted file, and forgets it when the file is closed.
            raise FileNotFoundError(errno.ENOENT, "it was deleted while the run went on")


def read_journal(path: Path) -> list[Entry]:
    """Return the journal's entries in the order in which they came about; that of line `n` is at `n - 1`.

    What a power cut tore at the end is left out: a part of the last line, zeros where its text was to come.

    Raises:
        InputError: The file cannot be read, or another line than the last is broken.
    """
    with explained(InputError, f'cannot read the journal "{path}"'):
        content = path.read_bytes()
    entries = []
    for number, line in enumerate(content[: _whole(content)].splitlines(), start=1):
        try:
            entries.append(_entry_in(line))
        except ValueError as error:
            raise InputError(
                f"{path}:{number}: this line is not JSON ({error}); a journal is only ever appended to, "
                "so it was changed after the run, or the disk lost a part of it; bring back a copy of it"
            ) from error
    return entries


def start_of(entries: Sequence[Entry], path: Path, otherwise: str) -> Entry:
    """Return the entry for how the run in the directory `path` began.

    Raises:
        InputError: It had not begun; `otherwise` says what follows from that.
    """
    for entry in entries:
        if entry["kind"] == "run":
            return entry
    raise InputError(f'the run in "{path}" had not begun when it was cut off; {otherwise}')


def ending_of(entries: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return the `end` of a run by its journal, or None: it was cut off, or goes on.

    A run that was taken up again has ended only when it ended again.
    """
    return entries[-1] if entries and entries[-1].get("kind") == "end" else None


def _entry_in(line: bytes) -> Entry:
    """Return the entry that a line holds.

    Raises:
        ValueError: It holds none.
    """
    try:
        entry = json.loads(line.decode())
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(entry, dict):
        raise ValueError("it is no object")
    return entry


def _whole(content: bytes) -> int:
    """Return how many bytes of a journal are whole lines; the last one may lack its line end."""
    written = content.rstrip(b"\0")
    last = written.rfind(b"\n") + 1
    try:
        _entry_in(written[last:])
    except ValueError:
        return last
    return len(written)


def _mended(file: int) -> int:
    """Cut the torn end off the journal, so that the next line is one by itself; return its length."""
    with open(file, "rb", closefd=False) as journal:
        content = journal.read()
    length = _whole(content)
    os.ftruncate(file, length)
    if length and content[length - 1 : length] != b"\n":
        length += os.write(file, b"\n")
    os.fsync(file)
    return length


def _empty(file: int, path: Path) -> int:
    """Return the length of a new journal: 0."""
    if os.fstat(file).st_size:
        raise InputError(
            f'"{path}" is the record of another run; a new run needs a directory of its own, '
            "for instance below another --runs DIR"
        )
    return 0
