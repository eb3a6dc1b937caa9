"""Journal of a run: everything that happened, one JSON object per line, never rewritten."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Sequence
from pathlib import Path

from pydantic_core import from_json

from executive.errors import Fault, InputError, RecordLost, explained, reason_of
from executive.events import ItemChanged, RunEnded, RunStarted, TimedEvent, ToolCommanded
from executive.record.journal_format import decode_all, encode
from executive.record.lock import lock


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

    def __call__(self, timed: TimedEvent) -> None:
        """Append an event if its kind is recorded.

        Raises:
            RecordLost: The disk does not take it, or another program deleted, replaced or truncated the file:
                the run must not go on unrecorded.
                Later events are dropped without another fault, so that the arm can be brought to rest.
            Fault: JSON cannot hold the event; only this event is missing.
        """
        if self._file is None or self._broken or not timed.event.is_recorded:
            return
        line = encode(timed)
        try:
            self._write(self._file, line)
            event = timed.event
            is_placement = isinstance(event, ItemChanged) and event.state == "placed"
            if is_placement or isinstance(event, ToolCommanded | RunEnded):
                self._sync(self._file)
        except OSError as error:
            self._broken = True
            # A part of the line is of no use to anybody.
            with contextlib.suppress(OSError):
                if os.fstat(self._file).st_size > self._length:
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
        status = os.fstat(file)
        # The disk takes what is written to a deleted file, and forgets it when the file is closed.
        if not self._path.exists():
            raise FileNotFoundError(errno.ENOENT, "it was deleted while the run went on")
        if not os.path.samestat(status, self._path.stat()):
            raise FileExistsError(errno.EEXIST, "another program replaced it while the run went on")
        if status.st_size != self._length:
            raise OSError(
                errno.EIO,
                f"another program changed its length from {self._length} to {status.st_size} bytes while the "
                "run went on",
            )


def read_journal(path: Path) -> list[TimedEvent]:
    """Return the events of a journal in order; that of line `n` is at `n - 1`.

    A line that a power cut left incomplete at the end, or zeros in its place, are left out.

    Raises:
        InputError: The file cannot be read, has another format, or a line holds no event.
    """
    with explained(InputError, f'cannot read the journal "{path}"'):
        content = path.read_bytes()
    return decode_all(content[: _whole(content)].splitlines(), str(path))


def start_of(events: Sequence[TimedEvent], path: Path, otherwise: str) -> RunStarted:
    """Return the start of the run in the directory `path`.

    Raises:
        InputError: It had not begun; `otherwise` says what follows from that.
    """
    for timed in events:
        if isinstance(timed.event, RunStarted):
            return timed.event
    raise InputError(f'the run in "{path}" had not begun when it was cut off; {otherwise}')


def ending_of(events: Sequence[TimedEvent]) -> RunEnded | None:
    """Return the end of a run by its journal, or None if the run was cut off or goes on.

    A resumed run has ended only when it ended again.
    """
    last = events[-1].event if events else None
    return last if isinstance(last, RunEnded) else None


def _whole(content: bytes) -> int:
    """Return the number of bytes in whole lines of a journal; the last line may lack its line end."""
    written = content.rstrip(b"\0")
    last = written.rfind(b"\n") + 1
    try:
        from_json(written[last:])
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
