"""Journal of a run: file with the recorded events, one JSON object per line, written by one process."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Sequence
from pathlib import Path

from pydantic_core import from_json

from executive.errors import Fault, InputError, RecordLost, describe_os_error, explain_os_errors
from executive.events import ItemChanged, RunEnded, RunStarted, TimedEvent, ToolCommanded
from executive.record.journal_format import decode_events, encode_event

LOCK_LIST = Path("/proc/locks")
"""File in which Linux lists the locks on all files, each with the id of the process that holds the lock."""


class Journal:
    """Observer that appends each event to a file, which is locked for other processes.

    Commands to the tool, placements of items and the end of the run are synced to the disk before the run
    continues. Therefore the journal shows after a power cut which item the tool may hold, and which items are
    in a bin.

    Args:
        path: The file.
        resume: True to remove an incomplete last line of an existing journal and append to the journal; False
            to create a journal.

    Raises:
        InputError: Another process writes the file, the file of a new journal is not empty, or the file
            cannot be opened.
    """

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        self._path = path
        self._has_failed = False
        self._is_synced = True
        with explain_os_errors(InputError, f'cannot open the journal "{path}"'):
            file = os.open(path, os.O_RDWR | os.O_APPEND | (0 if resume else os.O_CREAT), 0o644)
            try:
                _lock(file, path)
                if not resume and os.fstat(file).st_size:
                    raise InputError(
                        f'"{path}" is the journal of another run; a new run needs its own directory: name '
                        "another folder with --runs DIR"
                    )
                self._length = _repair_end(file) if resume else 0
            except BaseException:
                os.close(file)
                raise
        self._file: int | None = file

    def __call__(self, timed: TimedEvent) -> None:
        """Append an event if its kind is recorded.

        Raises:
            RecordLost: Writing failed, or another program deleted, replaced or truncated the file.
                Later events are ignored without an exception, so that the run can brake the arm.
            Fault: JSON cannot represent the event; only this event is missing in the journal.
        """
        if self._file is None or self._has_failed or not timed.event.is_recorded:
            return
        line = encode_event(timed)
        try:
            self._write(self._file, line)
            event = timed.event
            is_placement = isinstance(event, ItemChanged) and event.state == "placed"
            if is_placement or isinstance(event, ToolCommanded | RunEnded):
                self._sync(self._file)
        except OSError as error:
            self._has_failed = True
            # Remove an incomplete line, which could not be read.
            with contextlib.suppress(OSError):
                if os.fstat(self._file).st_size > self._length:
                    os.ftruncate(self._file, self._length)
            raise RecordLost(
                f'the journal "{self._path}" cannot be written: {describe_os_error(error)}; '
                "the run stops, because without a journal it could not be explained"
            ) from error

    def close(self) -> None:
        """Sync the file to the disk and close the file; further calls have no effect.

        Raises:
            Fault: The file may lack its last lines, and no earlier `RecordLost` reported the loss.
        """
        if self._file is None:
            return
        file, self._file = self._file, None
        advice = "check what the tool holds and what is in the bins"
        try:
            with explain_os_errors(Fault, f'the journal "{self._path}" may lack its last lines', advice):
                if not self._is_synced and not self._has_failed:
                    self._sync(file)
        finally:
            # The sync has reported any error of the disk.
            with contextlib.suppress(OSError):
                os.close(file)

    def _write(self, file: int, line: bytes) -> None:
        """Write a line without a buffer, so that the file contains all lines if the process crashes."""
        unwritten = line
        while unwritten:
            # If the disk is nearly full, the system may write a part only.
            unwritten = unwritten[os.write(file, unwritten) :]
        self._length += len(line)
        self._is_synced = False

    def _sync(self, file: int) -> None:
        """Sync the file to the disk, and raise an OSError if another program changed the file."""
        os.fsync(file)
        self._is_synced = True
        status = os.fstat(file)
        # Writing to a deleted file causes no error, but its content is lost when the file is closed.
        if not self._path.exists():
            raise FileNotFoundError(errno.ENOENT, "another program deleted it during the run")
        if not os.path.samestat(status, self._path.stat()):
            raise FileExistsError(errno.EEXIST, "another program replaced it during the run")
        if status.st_size != self._length:
            raise OSError(
                errno.EIO,
                f"another program changed its length from {self._length} to {status.st_size} bytes during "
                "the run",
            )


def read_journal(path: Path) -> list[TimedEvent]:
    """Return the events of a journal, one for each line.

    An incomplete line and zeros at the end of the file are ignored, because a power cut may leave them.

    Raises:
        InputError: The file cannot be read, has another format, or has a line without an event.
    """
    with explain_os_errors(InputError, f'cannot read the journal "{path}"'):
        content = path.read_bytes()
    return decode_events(content[: _measure_valid_length(content)].splitlines(), str(path))


def find_run_start(events: Sequence[TimedEvent], path: Path, advice: str) -> RunStarted:
    """Return the event of the start of the run in the directory `path`.

    Raises:
        InputError: The journal lacks the start of the run; the message ends with `advice`.
    """
    for timed in events:
        if isinstance(timed.event, RunStarted):
            return timed.event
    raise InputError(f'the run in "{path}" was interrupted before its start; {advice}')


def find_run_end(events: Sequence[TimedEvent]) -> RunEnded | None:
    """Return the last event if it is the end of the run, or None if the run was interrupted or is running.

    In a resumed run, an earlier end does not count.
    """
    last = events[-1].event if events else None
    return last if isinstance(last, RunEnded) else None


def _measure_valid_length(content: bytes) -> int:
    """Return the length of the complete lines of a journal [bytes]; the last one may lack its line feed."""
    written = content.rstrip(b"\0")
    last_line_start = written.rfind(b"\n") + 1
    try:
        from_json(written[last_line_start:])
    except ValueError:
        return last_line_start
    return len(written)


def _repair_end(file: int) -> int:
    """Remove an incomplete last line of a journal, add a missing line feed, and return the length [bytes]."""
    with open(file, "rb", closefd=False) as journal:
        content = journal.read()
    length = _measure_valid_length(content)
    os.ftruncate(file, length)
    if length and content[length - 1 : length] != b"\n":
        length += os.write(file, b"\n")
    os.fsync(file)
    return length


def _lock(file: int, path: Path) -> None:
    """Lock the open journal for this process until the file is closed.

    Raises:
        InputError: Another process, or another `Journal` of this process, has locked the journal.
        OSError: The file system does not support locks.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = _find_lock_holder(file)
        writer, stop = (f"process {holder}", f'"kill {holder}"') if holder else ("another process", "Ctrl-C")
        raise InputError(
            f'the run directory "{path.parent}" is in use: {writer} writes its journal, and two runs cannot '
            f"share it; wait until that run has ended, or stop it with {stop}"
        ) from error


def _find_lock_holder(file: int) -> int | None:
    """Return the id of the process that holds the lock on `file`, or None if the id is unknown."""
    status = os.fstat(file)
    file_id = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    with contextlib.suppress(OSError):
        for line in LOCK_LIST.read_text().splitlines():
            # 1: FLOCK  ADVISORY  WRITE 4711 fe:00:5309462 0 EOF
            fields = line.split()
            if fields[1:2] == ["FLOCK"] and fields[5] == file_id and int(fields[4]) > 0:
                return int(fields[4])
    return None
