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


class Journal:
    """Observer that appends the recorded events to a file, and locks the file against other processes.

    The journal syncs each command to the tool, each placement of an item, and the end of the run to the disk.
    After a power cut, it therefore shows which item the tool may hold, and which items are in a bin.

    Args:
        path: The journal file.
        resume: True to append to an existing journal, without its incomplete last line; False to create one.

    Raises:
        InputError: Another process writes the file, the file of a new journal is not empty, or the file
            cannot be opened.
    """

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        self._path = path
        self._has_failed = False
        self._is_synced = True
        with explain_os_errors(InputError, f'cannot open the journal "{path}"'):
            fd = os.open(path, os.O_RDWR | os.O_APPEND | (0 if resume else os.O_CREAT), 0o644)
            try:
                _lock(fd, path)
                if not resume and os.fstat(fd).st_size:
                    advice = "a new run needs its own directory: name another folder with --runs DIR"
                    raise InputError(f'"{path}" is the journal of another run; {advice}')
                self._file_size = _repair_end(fd) if resume else 0
            except BaseException:
                os.close(fd)
                raise
        self._fd: int | None = fd

    def __call__(self, timed: TimedEvent) -> None:
        """Append an event if its kind is recorded.

        Raises:
            RecordLost: Writing failed, or another program deleted, replaced or truncated the file.
                Later events are ignored without an exception, so that the run can brake the arm.
            Fault: JSON cannot represent the event; only this event is missing in the journal.
        """
        if self._fd is None or self._has_failed or not timed.event.is_recorded:
            return
        line = encode_event(timed)
        try:
            self._write(self._fd, line)
            event = timed.event
            is_placement = isinstance(event, ItemChanged) and event.state == "placed"
            if is_placement or isinstance(event, ToolCommanded | RunEnded):
                self._sync(self._fd)
        except OSError as error:
            self._has_failed = True
            # An incomplete line would make the journal unreadable.
            with contextlib.suppress(OSError):
                if os.fstat(self._fd).st_size > self._file_size:
                    os.ftruncate(self._fd, self._file_size)
            problem = f'the journal "{self._path}" cannot be written: {describe_os_error(error)}'
            consequence = "the run stops, because nobody could explain a run without a journal"
            raise RecordLost(f"{problem}; {consequence}") from error

    def close(self) -> None:
        """Sync the file to the disk and close the file; further calls have no effect.

        Raises:
            Fault: The file may lack its last lines, and no earlier `RecordLost` reported the loss.
        """
        if self._fd is None:
            return
        fd, self._fd = self._fd, None
        advice = "check what the tool holds and what is in the bins"
        try:
            with explain_os_errors(Fault, f'the journal "{self._path}" may lack its last lines', advice):
                if not self._is_synced and not self._has_failed:
                    self._sync(fd)
        finally:
            # `_sync` has already raised an exception if the disk has an error.
            with contextlib.suppress(OSError):
                os.close(fd)

    def _write(self, fd: int, line: bytes) -> None:
        """Write a line without a buffer, so that the file contains all lines if the process crashes."""
        unwritten = line
        while unwritten:
            # If the disk is nearly full, the system may write only a part of the line.
            unwritten = unwritten[os.write(fd, unwritten) :]
        self._file_size += len(line)
        self._is_synced = False

    def _sync(self, fd: int) -> None:
        """Sync the file to the disk, and raise an OSError if another program changed the file."""
        os.fsync(fd)
        self._is_synced = True
        status = os.fstat(fd)
        # Writing to a deleted file causes no error, but its content is lost when the file is closed.
        if not self._path.exists():
            raise FileNotFoundError(errno.ENOENT, "another program deleted it during the run")
        if not os.path.samestat(status, self._path.stat()):
            raise FileExistsError(errno.EEXIST, "another program replaced it during the run")
        if status.st_size != self._file_size:
            lengths = f"from {self._file_size} to {status.st_size} bytes"
            raise OSError(errno.EIO, f"another program changed its length {lengths} during the run")


def read_journal(path: Path) -> list[TimedEvent]:
    """Return the events of a journal, one for each line.

    An incomplete line and zero bytes at the end of the file are ignored; a power cut may leave them.

    Raises:
        InputError: The file cannot be read, has another format, or has a line without an event.
    """
    with explain_os_errors(InputError, f'cannot read the journal "{path}"'):
        content = path.read_bytes()
    return decode_events(content[: _measure_valid_length(content)].splitlines(), str(path))


def find_run_start(events: Sequence[TimedEvent], path: Path, advice: str) -> RunStarted:
    """Return the event of the start of the run in the directory `path`.

    Raises:
        InputError: The events lack the start of the run; `advice` is the end of the message.
    """
    for timed in events:
        if isinstance(timed.event, RunStarted):
            return timed.event
    raise InputError(f'the run in "{path}" was interrupted before its start; {advice}')


def find_run_end(events: Sequence[TimedEvent]) -> RunEnded | None:
    """Return the last event if it is the end of the run; None if the run was interrupted or is running.

    If the run was resumed after an end, that end is not returned.
    """
    last_event = events[-1].event if events else None
    return last_event if isinstance(last_event, RunEnded) else None


def _measure_valid_length(content: bytes) -> int:
    """Return the length [bytes] of a journal up to its last complete line, with or without a line feed."""
    content = content.rstrip(b"\0")
    last_line_start = content.rfind(b"\n") + 1
    try:
        from_json(content[last_line_start:])
    except ValueError:
        return last_line_start
    return len(content)


def _repair_end(fd: int) -> int:
    """Remove an incomplete last line of a journal, add a missing line feed, and return the length [bytes]."""
    with open(fd, "rb", closefd=False) as journal:
        content = journal.read()
    length = _measure_valid_length(content)
    os.ftruncate(fd, length)
    if length and content[length - 1 : length] != b"\n":
        length += os.write(fd, b"\n")
    os.fsync(fd)
    return length


def _lock(fd: int, path: Path) -> None:
    """Lock the open journal for this process until the file is closed.

    Raises:
        InputError: Another process, or another `Journal` of this process, has locked the journal.
        OSError: The file system does not support locks.
    """
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise InputError(
            f'the run directory "{path.parent}" is in use: another process writes its journal; '
            "wait until that run has ended, or stop it with Ctrl-C"
        ) from error
