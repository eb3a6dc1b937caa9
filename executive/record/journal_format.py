"""Format of a journal: one line of JSON per event, with the kind, the time and the fields of the event."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from operator import attrgetter

from pydantic import JsonValue, TypeAdapter, ValidationError
from pydantic_core import from_json

from executive.errors import Fault, InputError
from executive.events import JOURNAL_FORMAT, Event, InputRead, RunStarted, TimedEvent
from executive.replay.recording_cell import check_input

MAX_TICK = 10**9
"""Maximum number of control steps of a run; 48 days at 240 control steps per second."""
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
        definitions[kind] = schema | {"required": list(schema["properties"]), "additionalProperties": False}
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": f"An event of a journal, format {JOURNAL_FORMAT}",
        "oneOf": [{"$ref": f"#/definitions/{kind}"} for kind in EVENT_CLASSES],
        "definitions": definitions,
    }


def encode_event(timed: TimedEvent) -> bytes:
    """Return the line of a journal that contains an event, in UTF-8 with a line feed.

    Raises:
        Fault: JSON cannot represent a value of the event.
    """
    kind = type(timed.event).__name__
    entry = {"kind": kind, "tick": timed.tick, "clock": timed.clock, **vars(timed.event)}
    try:
        # A file name that is not UTF-8 contains lone surrogates, which become question marks.
        return (_ENCODER.encode(entry) + "\n").encode(errors="replace")
    except (TypeError, ValueError, RecursionError) as error:
        raise Fault(f"JSON cannot represent an event of kind {kind}: {error}") from error


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


def decode_events(lines: Iterable[bytes], file_name: str) -> list[TimedEvent]:
    """Return the events in the lines of a journal.

    Raises:
        InputError: A line contains no event of this format, or the time of an event contradicts its control
            step.
    """
    events: list[TimedEvent] = []
    control_period = clock_offset = 0.0
    for line_number, line in enumerate(lines, start=1):
        try:
            timed = decode_event(line)
            event = timed.event
            if isinstance(event, RunStarted):
                control_period = event.step
            step_time = timed.tick * control_period + clock_offset
            if control_period and abs(timed.clock - step_time) > CLOCK_TOLERANCE:
                raise ValueError(f'"tick" {timed.tick} and "clock" {timed.clock} contradict each other')
            if isinstance(event, InputRead) and event.name == "clock" and not event.exception:
                if not isinstance(event.value, int | float):
                    raise ValueError(f"the clock is {event.value!r}, not a time in seconds")
                clock_offset = event.value
            elif isinstance(event, InputRead) and not event.exception:
                check_input(event.name, event.value)
        except ValueError as error:
            problem = f"{file_name}:{line_number}: this line is no event ({error})"
            cause = "an earlier version wrote the file, or somebody changed it after the run"
            raise InputError(f"{problem}; {cause}; restore a copy of the file") from error
        events.append(timed)
    return events


def _to_json_type(value: object) -> object:
    """Convert a value to a type that the JSON encoder supports, or raise a TypeError."""
    if isinstance(value, Mapping):
        return dict(value)
    if is_dataclass(value):
        return vars(value)
    raise TypeError(f"JSON has no equivalent of a {type(value).__name__}")


_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, check_circular=False, default=_to_json_type)
"""Encoder of events, which are dataclasses with mappings."""
