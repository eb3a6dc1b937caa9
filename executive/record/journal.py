"""Journal of a run: file with the recorded events, one JSON object per line, and their observer."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from operator import attrgetter
from pathlib import Path

from pydantic import JsonValue, TypeAdapter, ValidationError
from pydantic_core import from_json

from executive import events
from executive.errors import Fault, InputError, RecordLost, describe_os_error, explain_os_errors
from executive.events import JOURNAL_FORMAT, Event, RunEnded, RunStarted, TimedEvent
from executive.record.picture_recorder import PictureRecorder
from executive.record.run_directory import RunDirectory
from executive.station.border import check_input
from executive.text.files import read_lines

MAX_TICK = 10**9
"""Maximum number of control steps of a run; 48 days at 240 control steps per second."""
MAX_LINE_LENGTH = 1_000_000
"""Maximum length of an event in a journal [byte]; the largest events of a run without errors have 2000."""
CLOCK_TOLERANCE = 1e-5
"""Maximum difference between the clock of an event and the time of its control step [s]."""

EVENT_CLASSES: Mapping[str, type[Event]] = {
    cls.__name__: cls for cls in sorted(Event.__subclasses__(), key=attrgetter("__name__")) if cls.is_recorded
}
"""Classes of the recorded events by kind, which is the name of the class."""

_ADAPTER_BY_KIND: Mapping[str, TypeAdapter[Event]] = {k: TypeAdapter(cls) for k, cls in EVENT_CLASSES.items()}
"""Decoder of the fields of an event, by the kind of the event."""


def make_journal_schema() -> dict[str, JsonValue]:
    """Return the JSON Schema of one line of a journal."""
    definitions: dict[str, JsonValue] = {}
    for kind, adapter in _ADAPTER_BY_KIND.items():
        schema = adapter.json_schema(ref_template="#/definitions/{model}")
        definitions |= schema.pop("$defs", {})
        schema["properties"] = {
            "kind": {"const": kind},
            "tick": {"type": "integer", "minimum": 0, "maximum": MAX_TICK},
            "clock": {"type": "number", "minimum": 0},
        } | schema.get("properties", {})
        required = ["kind", "tick", "clock", *schema.get("required", ())]
        definitions[kind] = schema | {"required": required, "additionalProperties": False}
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": f"An event of a journal, format {JOURNAL_FORMAT}",
        "oneOf": [{"$ref": f"#/definitions/{kind}"} for kind in EVENT_CLASSES],
        "definitions": definitions,
    }


def _to_json_type(value: object) -> object:
    """Convert a value to a type that the JSON encoder supports, or raise a TypeError."""
    if isinstance(value, Mapping):
        return dict(value)
    if is_dataclass(value):
        return vars(value)
    raise TypeError(f"JSON has no equivalent of a {type(value).__name__}")


_ENCODER = json.JSONEncoder(
    ensure_ascii=False, allow_nan=False, check_circular=False, separators=(",", ":"), default=_to_json_type
)
"""Encoder of events, which are dataclasses with mappings."""


def encode_event(timed: TimedEvent) -> bytes:
    """Return the line of a journal that contains an event, in UTF-8 with a line feed.

    Raises:
        Fault: JSON cannot represent a value of the event, or the line would be too long.
    """
    kind = type(timed.event).__name__
    values = vars(timed.event).items()
    # A line contains no empty value that is the default of its field.
    fields = {key: value for key, value in values if value or value != getattr(type(timed.event), key, ...)}
    entry = {"kind": kind, "tick": timed.tick, "clock": timed.clock, **fields}
    try:
        # A file name that is not UTF-8 contains lone surrogates, which become question marks.
        line = (_ENCODER.encode(entry) + "\n").encode(errors="replace")
    except (TypeError, ValueError, RecursionError) as error:
        raise Fault(f"JSON cannot represent an event of kind {kind}: {error}") from error
    if len(line) > MAX_LINE_LENGTH:
        source = getattr(timed.event, "skill", "") or getattr(timed.event, "name", "")
        limit = f"at most {MAX_LINE_LENGTH} are allowed"
        raise Fault(f"an event {kind} of {source or 'the run'} has {len(line)} bytes; {limit}")
    return line


def decode_event(line: bytes) -> TimedEvent:
    """Return the event in a line of a journal.

    Raises:
        ValueError: The line contains no event in this format.
    """
    entry = from_json(line, allow_inf_nan=False)
    if not isinstance(entry, dict):
        raise ValueError("it contains no JSON object")
    kind, tick, clock = (entry.get(key) for key in ("kind", "tick", "clock"))
    if not isinstance(kind, str) or kind not in _ADAPTER_BY_KIND:
        raise ValueError(f'"kind" is {kind!r}; allowed are {", ".join(EVENT_CLASSES)}')
    if isinstance(tick, bool) or not isinstance(tick, int) or not 0 <= tick <= MAX_TICK:
        raise ValueError(f'"tick" is {tick!r}, not an integer from 0 to {MAX_TICK}')
    if isinstance(clock, bool) or not isinstance(clock, int | float) or clock < 0:
        raise ValueError(f'"clock" is {clock!r}, not a time in seconds')
    try:
        event = _ADAPTER_BY_KIND[kind].validate_json(line)
    except ValidationError as error:
        first_error = error.errors(include_url=False)[0]
        field = ".".join(map(str, first_error["loc"]))
        raise ValueError(f'"{field}" of {kind}: {first_error["msg"]}') from error
    return TimedEvent(tick, float(clock), event)


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
            # The file is written without a buffer, so that it contains all lines if the process crashes.
            unwritten = line
            while unwritten:
                # If the disk is nearly full, the system may write only a part of the line.
                unwritten = unwritten[os.write(self._fd, unwritten) :]
            self._file_size += len(line)
            event = timed.event
            is_placement = isinstance(event, events.ItemChanged) and event.state == "placed"
            if is_placement or isinstance(event, events.ToolCommanded | RunEnded):
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
        advice = "check what the tool holds and what is in the bins"
        try:
            with explain_os_errors(Fault, f'the journal "{self._path}" may lack its last lines', advice):
                if not self._has_failed:
                    self._sync(self._fd)
        finally:
            # `_sync` has already raised an exception if the disk has an error.
            with contextlib.suppress(OSError):
                os.close(self._fd)
            self._fd = None

    def _sync(self, fd: int) -> None:
        """Sync the file to the disk, and raise an OSError if another program changed the file."""
        os.fsync(fd)
        status = os.fstat(fd)
        # Writing to a deleted file causes no error, but its content is lost when the file is closed.
        if not self._path.exists():
            raise FileNotFoundError(errno.ENOENT, "another program deleted it during the run")
        if not os.path.samestat(status, self._path.stat()):
            raise FileExistsError(errno.EEXIST, "another program replaced it during the run")
        if status.st_size != self._file_size:
            lengths = f"from {self._file_size} to {status.st_size} bytes"
            raise OSError(errno.EIO, f"another program changed its length {lengths} during the run")


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


def read_journal(path: Path) -> Iterator[TimedEvent]:
    """Yield the events of a journal, one for each line, while the file is read.

    An incomplete line and zero bytes at the end of the file are ignored; a power cut may leave them.

    Raises:
        InputError: The file cannot be read or has another format, a line contains no event, or the time of
            an event contradicts its control step.
    """
    control_period = 0.0
    has_present_inputs = True
    clock_offsets = [(0, 0.0)]  # Tick and value of each reading of the clock, without discarded ticks.
    for line_number, line in enumerate(read_lines(path, MAX_LINE_LENGTH), start=1):
        if not line.endswith(b"\n") and not _measure_valid_length(line):
            return
        try:
            timed = decode_event(line.rstrip(b"\0"))
            event = timed.event
            if isinstance(event, RunStarted):
                control_period = event.step
                has_present_inputs = event.format == JOURNAL_FORMAT
            elif isinstance(event, events.RunResumed):
                kept_offsets = [reading for reading in clock_offsets if reading[0] < event.valid_ticks]
                clock_offsets = kept_offsets or [(0, 0.0)]
            step_time = timed.tick * control_period + clock_offsets[-1][1]
            if control_period and abs(timed.clock - step_time) > CLOCK_TOLERANCE:
                raise ValueError(f'"tick" {timed.tick} and "clock" {timed.clock} contradict each other')
            if isinstance(event, events.InputRead) and event.name == "clock" and not event.exception:
                if not isinstance(event.value, int | float):
                    raise ValueError(f"the clock is {event.value!r}, not a time in seconds")
                clock_offsets.append((timed.tick, event.value))
            elif isinstance(event, events.InputRead) and not event.exception and has_present_inputs:
                check_input(event.name, event.value)
        except ValueError as error:
            problem = f"{path}:{line_number}: this line is no event ({error})"
            cause = "an earlier version wrote the file, or somebody changed it after the run"
            raise InputError(f"{problem}; {cause}; restore a copy of the file") from error
        yield timed


def find_run_start(timed_events: Iterable[TimedEvent], path: Path, advice: str) -> RunStarted:
    """Return the event of the start of the run in the directory `path`.

    Raises:
        InputError: The events lack the start of the run; `advice` is the end of the message.
    """
    for timed in timed_events:
        if isinstance(timed.event, RunStarted):
            return timed.event
    raise InputError(f'the run in "{path}" was interrupted before its start; {advice}')


def find_run_end(timed_events: Sequence[TimedEvent]) -> RunEnded | None:
    """Return the last event if it is the end of the run; None if the run was interrupted or is running.

    If the run was resumed after an end, that end is not returned.
    """
    last_event = timed_events[-1].event if timed_events else None
    return last_event if isinstance(last_event, RunEnded) else None


_DECISION_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), check_circular=False)
"""Encoder with a unique text for each value, so that equal decisions have equal hashes."""


class Trace:
    """Hash of the starts and ends of nodes, the changes of items and the selected targets, with their ticks.

    Wall times, messages and paths of files are not hashed, so that the same mission, seed and weights of
    detectors give the same trace on the same kind of processor.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def __call__(self, timed: TimedEvent) -> None:
        """Add an event to the hash if it is a decision."""
        event = timed.event
        match event:
            case events.NodeStarted(node, skill, item):
                decision = ["status", node, "RUNNING", *(("", item) if skill else (None, None)), None]
            case events.NodeEnded(node, status, skill):
                details = (event.reason, event.item) if skill else (event.reason or None, None)
                decision = ["status", node, status, *details, event.outputs]
            case events.ItemChanged(item, label, state, position):
                decision = ["item", item, state, label, position, event.bin]
            case events.TargetSelected(item, label, frame):
                decision = ["decision", item, label, frame]
            case _:
                return
        self._hash.update(_DECISION_ENCODER.encode([timed.tick, *decision]).encode() + b"\n")

    def hexdigest(self) -> str:
        """Return the first 16 hexadecimal digits of the SHA-256 of all decisions up to now."""
        return self._hash.hexdigest()[:16]


class Recorder:
    """Observer that passes events to the journal, the trace and the recorder of pictures.

    Args:
        directory: The run directory.
        saves_pictures: True to save pictures.
        resume: True to append to the journal of an interrupted run.

    Attributes:
        directory: The run directory.
        trace: Trace of all events; the caller adds the events from before a resumption.

    Raises:
        InputError: The journal cannot be opened.
    """

    def __init__(self, directory: RunDirectory, *, saves_pictures: bool = True, resume: bool = False) -> None:
        self.directory = directory
        self.trace = Trace()
        self._journal = Journal(directory.journal, resume=resume)
        self._pictures = PictureRecorder(directory.pictures) if saves_pictures else None
        self._problem = ""

    def __call__(self, timed: TimedEvent) -> None:
        """Record an event, first in the trace: an exception of the journal must not affect the trace."""
        self.trace(timed)
        self._journal(timed)
        if self._pictures is not None:
            try:
                self._pictures(timed)
            except Exception as error:
                # The run continues, because a record without pictures still explains the run.
                self._problem = f"not every picture was drawn: {type(error).__name__}: {error}"

    def close(self, *, wait: bool = True) -> None:
        """Sync the journal to the disk and, if `wait` is True, draw all queued pictures.

        Afterwards `problem` describes the missing parts of the record. Further calls have no effect.
        """
        try:
            self._journal.close()
        except Fault as fault:
            self._problem = str(fault)
        if self._pictures is not None:
            self._pictures.close(wait=wait)

    @property
    def problem(self) -> str:
        """Message about the missing parts of the record, or ""."""
        picture_problem = "" if self._pictures is None else self._pictures.problem
        return "; ".join(filter(None, (self._problem, picture_problem)))
