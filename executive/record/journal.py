"""The journal: everything that happened in a run, one JSON object per line, never rewritten."""

from __future__ import annotations

import json
import os
from pathlib import Path

from executive.errors import Fault, InputError
from executive.events import Event
from executive.record.entry import Entry, entry_of

_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, check_circular=False)


class Journal:
    """Appends every event to a file, as it happens.

    What the tool is about to do is on the disk before it does it, and so is every placement: after a
    power cut the record says what may be in the tool and what surely is in a bin.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._file: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise InputError(f'cannot open the journal "{path}": {(error.strerror or "").lower()}') from error

    def __call__(self, event: Event) -> None:
        """Append the entry for `event`; see `append`."""
        self.append(entry_of(event))

    def append(self, entry: Entry) -> None:
        """Append `entry`.

        Raises:
            Fault: The disk does not take it; the run must not go on unrecorded. Later events are
                dropped without another fault, so that the arm can be brought to rest.
        """
        if self._file is None:
            return
        try:
            # One unbuffered write per line: what was said before a crash is in the file.
            _write_all(self._file, _line_of(entry))
            if _must_last(entry):
                os.fsync(self._file)
        except OSError as error:
            os.close(self._file)
            self._file = None
            raise Fault(
                f'the journal "{self._path}" cannot be written: {(error.strerror or str(error)).lower()}; '
                "the run stops because it could not be explained afterwards"
            ) from error

    def close(self) -> None:
        """Bring everything to the disk and close the file; more calls do nothing."""
        if self._file is None:
            return
        file, self._file = self._file, None
        try:
            os.fsync(file)
        finally:
            os.close(file)


def read_journal(path: Path) -> list[Entry]:
    """Return the journal's entries; a last line torn by a power cut is left out.

    Raises:
        InputError: The file is missing, or another line than the last is broken.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise InputError(
            f'cannot read the journal "{path}": {(error.strerror or str(error)).lower()}'
        ) from error
    entries = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
        except ValueError as error:
            # Only the text after the last line end can be torn.
            if number == len(lines):
                break
            raise InputError(
                f"{path}:{number}: this line is not JSON ({error}); a journal is only ever appended to, "
                "so it was changed after the run"
            ) from error
        entries.append(entry)
    return entries


def _line_of(entry: Entry) -> bytes:
    return (_ENCODER.encode(entry) + "\n").encode()


def _must_last(entry: Entry) -> bool:
    return entry["kind"] == "intent" or (entry["kind"] == "item" and entry.get("state") == "placed")


def _write_all(file: int, line: bytes) -> None:
    """Write all of `line`; a disk that is nearly full takes a part of it first."""
    while line:
        line = line[os.write(file, line) :]
