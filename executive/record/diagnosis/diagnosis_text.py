"""Text of a diagnosis in the terminal and in the report."""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Iterator, Sequence

from executive.record.diagnosis.diagnosis import Diagnosis, LostItem
from executive.record.timeline.activation import Reading
from executive.record.timeline.items import Look, Sighting

MAX_LINE_WIDTH = 110
"""Maximum length of a line [characters]."""

MAX_SHOWN_NODES = 5
"""Maximum number of control nodes in the text; the nodes nearest to the root are omitted."""

_MAX_READINGS = _MAX_LOST_ITEMS = 3
"""Maximum number of readings, and maximum number of lost items, in the text."""

_LABEL_WIDTH = 12
"""Width of the column of labels [characters]."""

_SPACE_BEFORE_UNIT = re.compile(r"(?<=[0-9)]) (?=(?:s|m)\b)")
"""Space between a number or a closing parenthesis and the unit s or m."""

_NO_BREAK_SPACE = "\N{NO-BREAK SPACE}"
"""Space at which `textwrap` does not break a line."""


def make_resume_command(folder: str) -> str:
    """Return the command that resumes the run in the directory `folder`."""
    return shlex.join(["executive", "run", "--resume", folder])


def format_diagnosis(diagnosis: Diagnosis, folder: str, repeat_command: str, report: str = "") -> list[str]:
    """Return the lines of a diagnosis, then the unwrapped lines with paths and commands.

    The run directory is `folder`; `report` is the path of the report, or "".
    """
    heading = f"{diagnosis.status} after {diagnosis.clock:.2f} s: {diagnosis.verdict}"
    lines = wrap_lines(heading, "", "  ", max_lines=3) + _format_failure_path(diagnosis)
    for label, text in list_labelled_sentences(diagnosis):
        lines += wrap_lines(text, f"{label:{_LABEL_WIDTH}}", " " * _LABEL_WIDTH, max_lines=3)
    commands = {"record": folder, "report": report, "repeat": repeat_command}
    if diagnosis.can_resume:
        commands["resume"] = make_resume_command(folder)
    return lines + [f"{label:{_LABEL_WIDTH}}{command}" for label, command in commands.items() if command]


def list_labelled_sentences(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """Yield label and sentence of each part of a diagnosis, except the verdict and the failure path."""
    node = diagnosis.node
    if node is not None and not any(entry.explanation for entry in diagnosis.passed_nodes):
        yield "where", f"{node.path} ({node.place})"
    if diagnosis.raised_at:
        note = '; the whole traceback is in the journal, event "FaultRaised"' if diagnosis.is_recorded else ""
        yield "raised at", diagnosis.raised_at + note
    if diagnosis.readings:
        readings = diagnosis.readings[:_MAX_READINGS]
        yield "readings", ", ".join(_format_reading(reading, diagnosis.verdict) for reading in readings)
    for item in diagnosis.lost_items[:_MAX_LOST_ITEMS]:
        yield "lost", _format_lost_item(item)
    # The text of a lost item already contains its last look.
    if not diagnosis.lost_items:
        yield "last look", _format_look(diagnosis.last_look)
    if diagnosis.picture:
        yield "picture", diagnosis.picture
    tool_texts = {"": "is empty", "something": "holds an unknown object"}
    arm = "the arm is at rest" if diagnosis.arm_state == "at rest" else f"the arm: {diagnosis.arm_state}"
    yield "now", f"{arm}, the tool {tool_texts.get(diagnosis.held_item, 'holds ' + diagnosis.held_item)}"
    if diagnosis.unsorted_items:
        yield "left to do", f"{len(diagnosis.unsorted_items)}: {', '.join(diagnosis.unsorted_items)}"
    for sentence in diagnosis.advice:
        yield "next", sentence


def _format_failure_path(diagnosis: Diagnosis) -> list[str]:
    """Return a line for each node that did not handle the failure, and for the origin of the failure."""
    mission_prefix, node = f"{diagnosis.mission}:", diagnosis.node
    rows = [(each.name, each.explanation, each.place) for each in diagnosis.passed_nodes if each.explanation]
    if not rows or node is None:
        return []
    omitted = f", {len(rows) - MAX_SHOWN_NODES} nodes omitted" if len(rows) > MAX_SHOWN_NODES else ""
    rows = [*rows[-MAX_SHOWN_NODES:], (node.name, node.path, node.place)]
    width = max(len(name) for name, _, _ in rows)
    lines = [f"why no node in {diagnosis.mission} handled the failure, from the root down{omitted}:"]
    for name, explanation, place in rows:
        location = f"line {place.removeprefix(mission_prefix)}" if place.startswith(mission_prefix) else place
        lines += wrap_lines(f"{explanation} ({location})", f"  {name:{width}}  ", " " * (width + 4))
    return lines


def wrap_lines(text: str, first_indent: str, other_indent: str, *, max_lines: int = 2) -> list[str]:
    """Return a text as at most `max_lines` indented lines; a number and its unit stay on one line."""
    lines = textwrap.wrap(
        _SPACE_BEFORE_UNIT.sub(_NO_BREAK_SPACE, text), MAX_LINE_WIDTH, max_lines=max_lines,
        initial_indent=first_indent, subsequent_indent=other_indent,
        placeholder=" ...", break_on_hyphens=False,
    )  # fmt: skip
    return [line.replace(_NO_BREAK_SPACE, " ") for line in lines]


def _format_reading(reading: Reading, verdict: str) -> str:
    """Return a reading as text; the message of an exception is omitted if the verdict contains it."""
    name, value, time_text = reading.name, reading.value, f"({reading.clock:.2f} s)"
    if reading.raised:
        text = "" if str(value) in verdict else f": {value}"
        return f"{name} raised {reading.raised} {time_text}{text}"
    return f"{name} = {value:g} {time_text}" if isinstance(value, float) else f"{name} = {value} {time_text}"


def _format_look(look: Sighting | Look | None) -> str:
    """Return image, detection and counts of the last look as text."""
    if look is None:
        return "none so far"
    image = f"frame {look.frame}, camera {look.camera}, by {look.detector}, at {look.clock:.2f} s"
    if isinstance(look, Look):
        return f"{image}: {_format_count(look.found, 'box', 'boxes')}"
    detection = "" if look.confidence is None else f" as {look.label} {look.confidence:.2f}"
    counts = f"{_format_count(look.looks, 'look')}, {_format_count(look.attempts, 'failed attempt')} in all"
    return f"{look.item}{detection}{_format_position(look.position)}: {image}; {counts}"


def _format_lost_item(item: LostItem) -> str:
    """Return last look, drop and last failure of a lost item as text."""
    look, failure, drop_time = item.look, item.last_failure, item.dropped_at
    clauses = [item.item]
    if look is not None:
        clauses[0] += f" last detected{_format_position(look.position)} at {look.clock:.2f} s"
        clauses[0] += f", not detected in the {_format_count(item.later_looks, 'later look')}"
    if drop_time is not None and (failure is None or failure.clock != drop_time):
        clauses.append(f"dropped at {drop_time:.2f} s")
    if failure is not None:
        clauses.append(f"{failure.failure} at {failure.clock:.2f} s: {failure.message}")
    return "; ".join(clauses)


def _format_position(position: Sequence[float] | None) -> str:
    return "" if position is None else " at ({:.3f}, {:.3f}, {:.3f}) m".format(*position)


def _format_count(count: int, singular: str, plural: str = "") -> str:
    return f"{count} {singular if count == 1 else plural or singular + 's'}"
