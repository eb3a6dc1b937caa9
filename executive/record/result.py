"""Result of a run: content of `result.json`, and output of `executive run --json`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter

from executive.cell.json_values import to_json
from executive.errors import ExecutiveError, ExitCode, explain_os_errors
from executive.events import RunResumed, RunStatus, TimedEvent
from executive.record.diagnosis import Diagnosis
from executive.record.journal import find_run_end
from executive.record.run_directory import RunDirectory, write_atomically
from executive.record.timeline import PlanningTotals, Timeline
from executive.station.station import AUDIT_KEYS

QUIT_REQUEST = "quit"
"""Request of the operator to end the run."""

MISTAKE_DESCRIPTIONS = {
    "wrong_bin": "in a wrong bin",
    "fell_in_wrong_bin": "fallen into a wrong bin",
    "unseen": "never seen",
}
"""Text for each audit count that must be 0; `unseen` must be 0 only if the run reported an empty table."""


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
        result = TypeAdapter(Result).validate_json(directory.result.read_bytes())
    except (OSError, ValueError):
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
