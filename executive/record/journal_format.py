"""Format of a journal: one JSON object per event, with its kind, its time and its fields."""

from __future__ import annotations

import json
from collections.abc import Iterable, KeysView, Mapping
from dataclasses import fields, is_dataclass

from pydantic import JsonValue, TypeAdapter, ValidationError
from pydantic_core import from_json

from executive.errors import Fault, InputError
from executive.events import JOURNAL_FORMAT, Event, InputRead, RunStarted, TimedEvent
from executive.replay.recorded_cell import check_input

MAX_TICK = 10**9
"""Maximum number of control steps: 48 days in simulation."""
CLOCK_TOLERANCE = 1e-5
"""Maximum difference between the clock of an event and the time of its control step [s]."""

KINDS: Mapping[str, type[Event]] = {
    kind.__name__: kind
    for kind in sorted(Event.__subclasses__(), key=lambda kind: kind.__name__)
    if kind.is_recorded
}
"""Recorded kinds of events by name."""

_TIME_KEYS = ("kind", "tick", "clock")

_KEYS: Mapping[str, KeysView[str]] = {
    name: dict.fromkeys([*_TIME_KEYS, *(field.name for field in fields(kind))]).keys()
    for name, kind in KINDS.items()
}
"""Keys of the lines of each kind."""

_ADAPTERS: Mapping[str, TypeAdapter[Event]] = {name: TypeAdapter(kind) for name, kind in KINDS.items()}


def journal_schema() -> dict[str, JsonValue]:
    """Return the JSON Schema of one line of a journal."""
    definitions: dict[str, JsonValue] = {}
    for name, adapter in _ADAPTERS.items():
        schema = adapter.json_schema(ref_template="#/definitions/{model}")
        definitions |= schema.pop("$defs", {})
        time = {
            "kind": {"const": name},
            "tick": {"type": "integer", "minimum": 0, "maximum": MAX_TICK},
            "clock": {"type": "number", "minimum": 0},
        }
        schema["properties"] = time | schema.get("properties", {})
        definitions[name] = schema | {"required": list(_KEYS[name]), "additionalProperties": False}
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": f"An event of a journal, format {JOURNAL_FORMAT}",
        "oneOf": [{"$ref": f"#/definitions/{name}"} for name in KINDS],
        "definitions": definitions,
    }


def encode(timed: TimedEvent) -> bytes:
    """Return the line of an event, with a line feed.

    Raises:
        Fault: JSON cannot represent a value of the event.
    """
    kind = type(timed.event).__name__
    entry = {"kind": kind, "tick": timed.tick, "clock": timed.clock, **vars(timed.event)}
    try:
        # A lone surrogate, as in a file name that is not UTF-8, becomes a question mark.
        return (_ENCODER.encode(entry) + "\n").encode(errors="replace")
    except (TypeError, ValueError, RecursionError) as error:
        raise Fault(f"the journal cannot hold an event of kind {kind}: {error}") from error


def decode(line: bytes) -> TimedEvent:
    """Return the event of a line.

    Raises:
        ValueError: The line holds no event of this format.
    """
    entry = from_json(line, allow_inf_nan=False)
    if not isinstance(entry, dict):
        raise ValueError("it is no object")
    kind, tick, clock = (entry.get(key) for key in _TIME_KEYS)
    if not isinstance(kind, str) or kind not in _ADAPTERS:
        raise ValueError(f'"kind" is {kind!r}; allowed are {", ".join(KINDS)}')
    if isinstance(tick, bool) or not isinstance(tick, int) or not 0 <= tick <= MAX_TICK:
        raise ValueError(f'"tick" is {tick!r}, not an integer from 0 to {MAX_TICK}')
    if isinstance(clock, bool) or not isinstance(clock, int | float) or clock < 0:
        raise ValueError(f'"clock" is {clock!r}, not a time in seconds')
    if differing := entry.keys() ^ _KEYS[kind]:
        problem = "has no" if differing <= _KEYS[kind] else "has the unknown"
        raise ValueError(f'{kind} {problem} key "{min(differing)}"; its keys are {", ".join(_KEYS[kind])}')
    try:
        event = _ADAPTERS[kind].validate_json(line)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f'"{place}" of {kind}: {first["msg"][:1].lower()}{first["msg"][1:]}') from error
    return TimedEvent(tick, float(clock), event)


def decode_all(lines: Iterable[bytes], name: str) -> list[TimedEvent]:
    """Return the events of the lines of a journal.

    Raises:
        InputError: A line holds no event, or an event whose clock contradicts its control step; the message
            begins with `name` and the number of the line.
    """
    events: list[TimedEvent] = []
    step = ahead = 0.0
    for number, line in enumerate(lines, start=1):
        try:
            timed = decode(line)
            event = timed.event
            if isinstance(event, RunStarted):
                step = event.step
            if step and abs(timed.clock - timed.tick * step - ahead) > CLOCK_TOLERANCE:
                raise ValueError(f'"tick" {timed.tick} and "clock" {timed.clock} contradict each other')
            if isinstance(event, InputRead) and event.name == "clock" and not event.raised:
                ahead = _read_clock_offset(event.value)
            elif isinstance(event, InputRead) and not event.raised:
                check_input(event.name, event.value)
        except ValueError as error:
            if number == 1 and (old := _describe_old_format(line)):
                raise InputError(f"{name}: {old}") from error
            raise InputError(
                f"{name}:{number}: this line is no event ({error}); a journal is only ever appended to, so "
                "somebody changed it after the run, or the disk lost a part of it; restore a copy"
            ) from error
        events.append(timed)
    return events


def _read_clock_offset(value: JsonValue) -> float:
    """Return the recorded time of the cell's clock minus the time of all control steps [s].

    Raises:
        ValueError: The value is no number.
    """
    if not isinstance(value, int | float):
        raise ValueError(f'"value" of the input "clock" is {value!r}, not a time in seconds')
    return value


def _describe_old_format(line: bytes) -> str:
    """Return a message if the first line of a journal is of format 1, which states no version, else ""."""
    try:
        entry = from_json(line)
    except ValueError:
        return ""
    if not isinstance(entry, dict) or entry.get("kind") != "run":
        return ""
    versions = entry.get("versions")
    version = versions.get("executive", "0.1") if isinstance(versions, dict) else "0.1"
    return (
        f"this journal has format 1, written by executive {version}; this version reads format "
        f"{JOURNAL_FORMAT}; read it with executive {version}, or run the mission again"
    )


def _as_json(value: object) -> object:
    """Convert a value to a type that the JSON encoder supports.

    Raises:
        TypeError: JSON has no equivalent of the value.
    """
    if isinstance(value, Mapping):
        return dict(value)
    if is_dataclass(value):
        return vars(value)
    raise TypeError(f"a {type(value).__name__} is not plain")


_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, check_circular=False, default=_as_json)
