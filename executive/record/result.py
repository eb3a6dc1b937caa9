"""Result of a run with its diagnosis: content of `result.json`, and the text of the diagnosis."""

from __future__ import annotations

import json
import re
import shlex
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter

from executive.cell.json_values import to_json
from executive.errors import ExecutiveError, ExitCode, InputError, explain_os_errors
from executive.events import RunResumed, RunStatus, TimedEvent
from executive.record.journal import find_run_end
from executive.record.run_directory import RunDirectory, write_atomically
from executive.record.timeline import ItemHistory, Look, PlanningTotals, Timeline
from executive.station.station import AUDIT_KEYS
from executive.text.files import MAX_RECORD_SIZE, read_file

QUIT_REQUEST = "quit"
"""Request of the operator to end the run."""

MISTAKE_DESCRIPTIONS = {
    "wrong_bin": "in a wrong bin",
    "fell_in_wrong_bin": "fallen into a wrong bin",
    "unseen": "never seen",
}
"""Text for each audit count that must be 0; `unseen` must be 0 only if the run reported an empty table."""

MAX_LINE_WIDTH = 110
"""Maximum length of a line [characters]."""

_MAX_LOST_ITEMS = 3
"""Maximum number of lost items in the text."""

_LABEL_WIDTH = 12
"""Width of the column of labels [characters]."""


@dataclass(frozen=True)
class ItemCounts:
    """Number of items by final state.

    The sum of placed, rejected, skipped and lost items is `seen`. A phantom is an item without an object:
    all its detections were false.
    """

    seen: int = 0
    placed: int = 0
    rejected: int = 0
    skipped: int = 0
    lost: int = 0
    phantom: int = 0


@dataclass(frozen=True)
class Audit:
    """Number of objects by true place, in a cell with ground truth.

    Attributes:
        agrees: True if the true places confirm the counts of the ledger.
        right: Number of objects in permitted bins.
        wrong_bin: Number of objects in other bins.
        left: Number of objects on the table.
        elsewhere: Number of objects below the table, and of objects that fell into a wrong bin.
        fell_in_wrong_bin: Number of objects that fell into a wrong bin.
        unseen: Number of objects that were never detected.
    """

    agrees: bool = True
    right: int = 0
    wrong_bin: int = 0
    left: int = 0
    elsewhere: int = 0
    fell_in_wrong_bin: int = 0
    unseen: int = 0

    @staticmethod
    def from_counts(items: Mapping[str, int], audit: Mapping[str, int], is_table_empty: bool) -> Audit:
        """Return the true counts `audit`, compared with the counts `items` of the ledger."""
        is_confirmed = is_confirmed_by_audit(items, audit, is_table_empty)
        return Audit(is_confirmed, **{place: int(audit[place]) for place in AUDIT_KEYS})


@dataclass(frozen=True)
class UnexplainedEntry:
    """What images or sensors show, and no item explains.

    Attributes:
        name: Name, for instance `unexplained-1`.
        text: Sentence that describes it.
        position: Position `(3,)` [m]; empty if it has none.
        picture: File of its picture, relative to the run directory, or "".
    """

    name: str
    text: str
    position: Sequence[float]
    picture: str


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


@dataclass(frozen=True, kw_only=True)
class Result:
    """Result of a run; the fields are the keys of `result.json`.

    Attributes:
        version: Version of the schema; versions before 3 had other keys.
        mission: Name of the mission.
        status, reason, message, node, is_table_empty, held_item, ticks: Fields of the event `RunEnded`.
        seed: Seed of all random numbers.
        items: Number of items by final state, from the ledger.
        unknown_labels: Maximum number of boxes in one frame, by label that the cell file does not declare.
        assumption_reasons: Reasons for which error rates of detectors were assumed.
        unexplained: What images or sensors show, and no item explains.
        audit: True places of the objects, compared with `items`; None in a cell without ground truth.
        planning: Number of planned motions, and time for which skills waited for plans.
        requests: Requests of the operator, in order; a scripted operator repeats the run with them.
        robot_time_s, wall_time_s: Duration on the clock of the run and on a wall clock [s].
        trace: Hash of all decisions.
        run: Path of the run directory, or "".
        diagnosis: Diagnosis of a run that did not succeed, or None.
    """

    version: int = 3
    mission: str
    status: RunStatus
    reason: str
    message: str
    node: str
    held_item: str = ""
    seed: int
    items: ItemCounts = field(default_factory=ItemCounts)
    unknown_labels: Mapping[str, int] = field(default_factory=dict)
    assumption_reasons: Sequence[str] = ()
    unexplained: Sequence[UnexplainedEntry] = ()
    is_table_empty: bool = False
    audit: Audit | None = None
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    requests: Sequence[str] = ()
    ticks: int = 0
    robot_time_s: float = 0.0
    wall_time_s: float = 0.0
    trace: str = ""
    run: str = ""
    diagnosis: Diagnosis | None = None

    @property
    def verdict(self) -> str:
        """Cause of the end according to the diagnosis; without a diagnosis, the message of the end."""
        return self.message if self.diagnosis is None else self.diagnosis.verdict

    @property
    def disagreement(self) -> str:
        """Message with the counts of audit and ledger if they disagree, else ""."""
        return describe_disagreement(self.audit, self.items)


def is_resumable(status: str) -> bool:
    """Return True if a run can be resumed after it ended with a status, or was interrupted."""
    return status not in ("SUCCESS", "FAILURE")


def write_result(path: Path, result: Result) -> None:
    """Write `result` to `path`, atomically.

    Raises:
        ExecutiveError: The file cannot be written.
    """
    advice = "the journal in the same folder and the output of --json contain the end of the run"
    text = json.dumps(to_json(result), indent=2, ensure_ascii=False, allow_nan=False)
    with explain_os_errors(ExecutiveError, f'cannot write the result "{path}"', advice):
        write_atomically(path, f"{text}\n")


def read_result(directory: RunDirectory, events: Sequence[TimedEvent]) -> Result | None:
    """Return the result of a run; None if the file is missing, damaged, or older than the last resumption."""
    try:
        result = TypeAdapter(Result).validate_json(read_file(directory.result, MAX_RECORD_SIZE))
    except (InputError, ValueError):
        return None
    end = find_run_end(events)
    if end is not None:
        return result if (result.status, result.ticks) == (end.status, end.ticks) else None
    # A full disk may prevent the journal from storing the end; then only the result contains the end.
    is_resumed = any(isinstance(timed.event, RunResumed) for timed in events)
    return None if is_resumed else result


def list_requests(timeline: Timeline) -> list[str]:
    """Return the requests of the operator; a scripted operator repeats the run with them.

    Requests to quit at the end are omitted, because a scripted operator quits after its last request.
    """
    requests = [request or QUIT_REQUEST for request in timeline.requests]
    while len(requests) > 1 and requests[-1] == QUIT_REQUEST:
        requests.pop()
    return requests


def find_exit_code(result: Result) -> ExitCode:
    """Return the exit code of a run; FAILURE replaces SUCCESS or INCOMPLETE if audit and ledger disagree."""
    code = ExitCode[result.status]
    is_failure = code in (ExitCode.SUCCESS, ExitCode.INCOMPLETE) and result.disagreement != ""
    return ExitCode.FAILURE if is_failure else code


def is_confirmed_by_audit(items: Mapping[str, int], audit: Mapping[str, int], is_table_empty: bool) -> bool:
    """Return True if the true counts `audit` confirm the counts `items` of the ledger.

    If the run reported an empty table (`is_table_empty`), no object may be unseen.
    """
    unsorted_count = items["rejected"] + items["skipped"]
    return bool(
        audit["wrong_bin"] == audit["fell_in_wrong_bin"] == 0
        and items["placed"] == audit["right"]
        and items["lost"] == audit["elsewhere"]
        and unsorted_count <= audit["left"] <= unsorted_count + audit["unseen"]
        and not (is_table_empty and audit["unseen"])
    )


def describe_disagreement(audit: Audit | None, items: ItemCounts) -> str:
    """Return a message with the counts of audit and ledger if they disagree, else ""."""
    if audit is None or audit.agrees:
        return ""
    counts = {text: getattr(audit, place) for place, text in MISTAKE_DESCRIPTIONS.items()}
    mistakes = ", ".join(f"{count} {text}" for text, count in counts.items() if count)
    comparison = (
        f"the audit found {audit.right} in their bins, {audit.left} on the table and "
        f"{audit.elsewhere} elsewhere; the executive reports {items.placed} placed, "
        f"{items.rejected} rejected, {items.skipped} skipped and {items.lost} lost"
    )
    return "THE AUDIT DISAGREES: " + "; ".join(filter(None, (mistakes, comparison)))


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
