"""Result of a run: the object that `result.json` holds and `--json` prints."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter

from executive.cell.plain import plain
from executive.cell.workcell import PLACES
from executive.errors import ExecutiveError, explain_os_errors
from executive.events import RunResumed, TimedEvent
from executive.record.atomic_file import write_atomically
from executive.record.diagnosis.diagnosis import Diagnosis
from executive.record.journal import find_end
from executive.record.run_directory import RunDirectory
from executive.record.timeline.timeline import PlanningTotals, Timeline

QUIT = "quit"
"""Request of the operator to end the requests."""

VERSION = 2
"""Version of the schema of `result.json`; the first had no `version`, no skipped items and no `agrees`."""

MISTAKES = {
    "wrong_bin": "in a wrong bin",
    "fell_in_wrong_bin": "fallen into a wrong bin",
    "unseen": "never seen",
}
"""Description of each kind of mistake that the audit counts."""

EXIT_CODES = {"SUCCESS": 0, "FAILURE": 1, "FAULT": 3, "INCOMPLETE": 4, "HALTED": 130}
"""Exit code by the status of the run, unless the audit disagrees (`exit_code`)."""

FINAL_STATUSES = ("SUCCESS", "FAILURE")
"""Status of a run that cannot be resumed: its tree has ended, and nothing was rejected."""


@dataclass(frozen=True)
class ItemCounts:
    """Counts of the items by final state; `seen` is the sum of the next four."""

    seen: int = 0
    placed: int = 0
    rejected: int = 0
    skipped: int = 0
    lost: int = 0
    phantom: int = 0


@dataclass(frozen=True)
class Audit:
    """Counts of the objects by true place, as in `executive.cell.workcell.PLACES`.

    Attributes:
        agrees: Result of `agrees`.
    """

    agrees: bool = True
    right: int = 0
    wrong_bin: int = 0
    left: int = 0
    elsewhere: int = 0
    fell_in_wrong_bin: int = 0
    unseen: int = 0


@dataclass(frozen=True, kw_only=True)
class Result:
    """Result of a run; the fields are the keys of `result.json`.

    Attributes:
        version: Version of the schema.
        mission: Name of the mission.
        status, reason, message, node, empty, holds, ticks: As in `RunEnded`.
        seed: Seed of all random numbers.
        items: Counts of the ledger.
        unknown: Largest number of boxes in a look for each label that the cell file does not declare.
        doubts: Reasons why error rates of detectors were assumed.
        audit: Counts of the audit; None in a cell without ground truth.
        planning: Planned motions.
        requests: Requests of the operator, by `list_requests`.
        robot_time_s: Time on the clock of the run [s].
        wall_time_s: Wall time of the run [s].
        trace: Hash of all decisions.
        run: The run directory, or "".
        story: Diagnosis of a run that did not succeed, or None.
    """

    version: int = VERSION
    mission: str
    status: str
    reason: str
    message: str
    node: str
    holds: str = ""
    seed: int
    items: ItemCounts = ItemCounts()
    unknown: Mapping[str, int] = field(default_factory=dict)
    doubts: Sequence[str] = ()
    empty: bool = False
    audit: Audit | None = None
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    requests: Sequence[str] = ()
    ticks: int = 0
    robot_time_s: float = 0.0
    wall_time_s: float = 0.0
    trace: str = ""
    run: str = ""
    story: Diagnosis | None = None


def write_result(path: Path, result: Result) -> None:
    """Write `result` to `path`, atomically.

    Raises:
        ExecutiveError: The file cannot be written.
    """
    hint = "the journal beside it tells how the run ended, and so does what --json prints"
    with explain_os_errors(ExecutiveError, f'cannot write the result "{path}"', hint):
        write_atomically(
            path, json.dumps(plain(result), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        )


def read_result(directory: RunDirectory, events: Sequence[TimedEvent]) -> Result | None:
    """Return the result that belongs to a journal, or None if there is none.

    A resumed run may have the result of an earlier end.
    """
    try:
        result = TypeAdapter(Result).validate_json(directory.result.read_bytes())
    except (OSError, ValueError):
        return None
    ending = find_end(events)
    if ending is not None:
        return result if (result.status, result.ticks) == (ending.status, ending.ticks) else None
    # If the end could not be written to the journal, only the result contains the end.
    is_resumed = any(isinstance(timed.event, RunResumed) for timed in events)
    return result if result.status in EXIT_CODES and not is_resumed else None


def list_requests(timeline: Timeline) -> list[str]:
    """Return a list of requests with which a scripted operator repeats the answers of the run.

    Trailing requests to quit are omitted, because the scripted operator quits at the end of the list; a list
    with only requests to quit keeps the first.
    """
    words = [wanted or QUIT for wanted in timeline.requests]
    while len(words) > 1 and words[-1] == QUIT:
        words.pop()
    return words


def make_audit(items: Mapping[str, int], audit: Mapping[str, int], empty: bool) -> Audit:
    """Return the counts of an audit with the result of `agrees`."""
    return Audit(agrees(items, audit, empty), **{place: int(audit[place]) for place in PLACES})


def agrees(items: Mapping[str, int], audit: Mapping[str, int], empty: bool) -> bool:
    """Return True if the audit confirms the counts of the ledger.

    Args:
        items: Counts of the ledger.
        audit: Counts of the audit.
        empty: True if the run reported an empty table, which excludes unseen objects.
    """
    left = items["rejected"] + items["skipped"]
    return bool(
        audit["wrong_bin"] == audit["fell_in_wrong_bin"] == 0
        and items["placed"] == audit["right"]
        and items["lost"] == audit["elsewhere"]
        and left <= audit["left"] <= left + audit["unseen"]
        and not (empty and audit["unseen"])
    )


def disagreement(result: Result) -> str:
    """Return one sentence with the counts of audit and ledger if the audit disagrees, else ""."""
    audit, items = result.audit, result.items
    if audit is None or audit.agrees:
        return ""
    counts = {words: getattr(audit, place) for place, words in MISTAKES.items()}
    mistakes = ", ".join(f"{count} {words}" for words, count in counts.items() if count)
    comparison = (
        f"the audit found {audit.right} in their bins, {audit.left} on the table and "
        f"{audit.elsewhere} elsewhere; the executive reports {items.placed} placed, "
        f"{items.rejected} rejected, {items.skipped} skipped and {items.lost} lost"
    )
    return "THE AUDIT DISAGREES: " + "; ".join(filter(None, (mistakes, comparison)))


def exit_code(result: Result) -> int:
    """Return the exit code of a run: 1 instead of 0 or 4 if the audit disagrees."""
    code = EXIT_CODES[result.status]
    return 1 if code in (0, 4) and disagreement(result) else code
