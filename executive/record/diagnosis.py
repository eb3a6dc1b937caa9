"""Diagnosis of a run that did not succeed: cause, measured values and advice, and its text for a person."""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from executive.record.timeline import ItemHistory, Look

MAX_LINE_WIDTH = 110
"""Maximum length of a line [characters]."""

_MAX_LOST_ITEMS = 3
"""Maximum number of lost items in the text."""

_LABEL_WIDTH = 12
"""Width of the column of labels [characters]."""


@dataclass(frozen=True)
class FailureNode:
    """Node that determined the status of a run, or control node that did not handle its failure.

    Attributes:
        path: Path of the node in the tree.
        name: Name of the node with its item or subtree: `Grasp of cube-1`, `look: retry`.
        place: File and line of the node.
        explanation: Reason why the node did not handle the failure; "" for the origin of the failure.
    """

    path: str
    name: str
    place: str
    explanation: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """Explanation of a run that did not succeed.

    Attributes:
        status: `FAILURE`, `FAULT` or `HALTED`.
        reason: Name of the failure.
        clock: Robot time at the end of the run [s].
        mission: Path of the mission file.
        verdict: Cause of the end of the run, as a sentence.
        node: Node that determined the status, or None.
        item: Name of the item of `node`, else of a halted skill, else of the first lost item; "" for none.
        passed_nodes: Failure path: nodes that did not handle the failure, from the root down, and the origin.
        last_look: Last look with a detection of `item`, else the last look of the run; None without a look.
        lost_items: Histories of the items whose loss made the run fail.
        halted_skills: Names of the halted skills with their items: `Grasp of cube-1`.
        unsorted_items: Names of the unsorted items whose class has a bin.
        arm_state: `at rest`, or a text about the state of the arm.
        held_item: Item that the tool holds, `something` for an unknown object, or "".
        raised_at: File, line and function in which the exception of a fault was raised, or "".
        is_recorded: True if the journal contains the whole run.
        can_resume: True if the run can be resumed.
        picture: File of the picture of the failure, relative to the run directory, or "".
        advice: Sentences with advice, the most urgent first.
    """

    status: str
    reason: str
    clock: float
    mission: str
    verdict: str
    node: FailureNode | None
    item: str
    passed_nodes: Sequence[FailureNode]
    last_look: Look | None
    lost_items: Sequence[ItemHistory]
    halted_skills: Sequence[str]
    unsorted_items: Sequence[str]
    arm_state: str
    held_item: str
    raised_at: str
    is_recorded: bool
    can_resume: bool
    picture: str
    advice: Sequence[str]


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
    node = diagnosis.node
    rows = [(each.name, each.explanation, each.place) for each in diagnosis.passed_nodes if each.explanation]
    if not rows or node is None:
        return []
    rows.append((node.name, node.path, node.place))
    width = max(len(name) for name, _, _ in rows)
    lines = [f"why no node in {diagnosis.mission} handled the failure, from the root down:"]
    for name, explanation, place in rows:
        location = re.sub(f"^{re.escape(diagnosis.mission)}:", "line ", place)
        lines += wrap_lines(f"{explanation} ({location})", f"  {name:{width}}  ", " " * (width + 4))
    return lines


def wrap_lines(text: str, first_indent: str, other_indent: str, *, max_lines: int = 2) -> list[str]:
    """Return a text as at most `max_lines` indented lines."""
    return textwrap.wrap(
        text, MAX_LINE_WIDTH, initial_indent=first_indent, subsequent_indent=other_indent,
        max_lines=max_lines, placeholder=" ...", break_on_hyphens=False,
    )  # fmt: skip


def _format_look(look: Look | None) -> str:
    """Return image, detection and counts of the last look as text."""
    if look is None:
        return "none so far"
    image = f"frame {look.frame}, camera {look.camera}, by {look.detector}, at {look.clock:.2f} s"
    if look.item is None:
        return f"{image}: {_format_count(look.found, 'object')}"
    detection = "" if look.confidence is None else f" as {look.label} {look.confidence:.2f}"
    counts = f"{_format_count(look.looks, 'look')}, {_format_count(look.attempts, 'failed attempt')} in all"
    return f"{look.item}{detection}{_format_position(look.position)}: {image}; {counts}"


def _format_lost_item(item: ItemHistory) -> str:
    """Return last look, drop and last failure of a lost item as text."""
    text = item.item
    if item.look is not None:
        text += f" last detected{_format_position(item.look.position)} at {item.look.clock:.2f} s"
        text += f", not detected in the {_format_count(item.later_looks, 'later look')}"
    if item.dropped_at is not None and not item.last_failure:
        text += f"; dropped at {item.dropped_at:.2f} s"
    return text + (f"; {item.last_failure}" if item.last_failure else "")


def _format_position(position: Sequence[float] | None) -> str:
    return "" if position is None else " at ({:.3f}, {:.3f}, {:.3f}) m".format(*position)


def _format_count(count: int | None, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
