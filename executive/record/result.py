"""Result of a run: the object that `result.json` holds and `--json` prints."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from executive.cell.plain import plain
from executive.cell.workcell import PLACES
from executive.errors import ExecutiveError, explained
from executive.events import MotionPlanned, RequestGiven, RunEnded, RunResumed, TimedEvent
from executive.record.journal import ending_of
from executive.record.run_directory import RunDirectory
from executive.record.whole_file import write_whole

QUIT = "quit"
"""Word of the operator who wants nothing more."""

VERSION = 2
"""Version of the schema of `result.json`; the first had no `version`, no skipped items and no `agrees`."""

ITEM_COUNTS = ("seen", "placed", "rejected", "skipped", "lost", "phantom")
"""Keys of the counts of the ledger."""

MISTAKES = {
    "wrong_bin": "in a wrong bin",
    "fell_in_wrong_bin": "fallen into a wrong bin",
    "unseen": "never seen",
}
"""Words for the mistakes that the audit counts."""

EXIT_CODES = {"SUCCESS": 0, "FAILURE": 1, "FAULT": 3, "INCOMPLETE": 4, "HALTED": 130}
"""Exit code by the status of the run, unless the audit disagrees (`exit_code`)."""

ENDED = ("SUCCESS", "FAILURE")
"""Status of a run that cannot be resumed: its tree has come to its end, and nothing was rejected."""


def result_of(
    *,
    mission: str,
    seed: int,
    outcome: RunEnded,
    items: Mapping[str, Any],
    audit: Mapping[str, int] | None,
    noted: Sequence[TimedEvent],
    story: Mapping[str, Any] | None,
    wall_time: float,
    trace: str,
    run: Path,
) -> dict[str, Any]:
    """Return the result as a plain mapping; `wall_time` in seconds, `run` the run directory.

    `audit` is None in a cell that has no ground truth; `noted` are the plans and requests, and
    `story` is as `Story.tell` returns it.
    """
    return {
        "version": VERSION,
        "mission": mission,
        "status": outcome.status,
        "reason": outcome.reason,
        # It may quote a file name that is not UTF-8.
        "message": plain(outcome.message),
        "node": outcome.node,
        "holds": outcome.holds,
        "seed": seed,
        "items": {fate: int(items.get(fate, 0)) for fate in ITEM_COUNTS},
        "unknown": dict(items.get("unknown", {})),
        "doubts": list(items.get("doubts", ())),
        "empty": outcome.empty,
        "audit": None if audit is None else audit_section(items, audit, outcome.empty),
        "planning": planning_of(noted),
        "requests": requests_of(noted),
        "ticks": outcome.ticks,
        "robot_time_s": plain(outcome.robot_time),
        "wall_time_s": round(wall_time, 3),
        "trace": trace,
        "run": plain(run),
        "story": plain(story),
    }


def write_result(path: Path, result: Mapping[str, Any]) -> None:
    """Write `result` to `path`, whole or not at all.

    Raises:
        ExecutiveError: The disk does not take it.
    """
    elsewhere = "the journal beside it tells how the run ended, and so does what --json prints"
    with explained(ExecutiveError, f'cannot write the result "{path}"', elsewhere):
        write_whole(path, json.dumps(result, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def read_result(directory: RunDirectory, events: Sequence[TimedEvent]) -> Mapping[str, Any]:
    """Return the result that belongs to a journal, else the journal's end; empty if the run was cut off."""
    ending = ending_of(events)
    try:
        result = json.loads(directory.result.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        result = None
    told = result if isinstance(result, dict) else {}
    if ending is not None:
        # Of a run that was taken up again it may be that of an end before the last.
        same = (told.get("status"), told.get("ticks")) == (ending.status, ending.ticks)
        return told if same else vars(ending)
    # Where the disk did not take the end, the result alone knows of it.
    once = not any(isinstance(timed.event, RunResumed) for timed in events)
    return told if once and told.get("status") in EXIT_CODES else {}


def requests_of(events: Iterable[TimedEvent]) -> list[str]:
    """Return the requests that make the operator's answers the same again.

    An operator who is asked after the end of the list wants nothing more: that need not be listed, unless the
    list would be empty without it.
    """
    words = [one.event.wanted or QUIT for one in events if isinstance(one.event, RequestGiven)]
    while len(words) > 1 and words[-1] == QUIT:
        words.pop()
    return words


def planning_of(events: Iterable[TimedEvent]) -> dict[str, float]:
    """Return the number of plans asked for, of those made ahead, and the time waited for plans [s].

    A motion planned again counts once more, and one for which no way was found counts, too.
    """
    plans = [one.event for one in events if isinstance(one.event, MotionPlanned)]
    waited = sum(plan.waits for plan in plans)
    ahead = sum(plan.ahead for plan in plans)
    return {"motions": len(plans), "ahead": ahead, "waited_s": round(waited, 4)}


def audit_section(items: Mapping[str, int], audit: Mapping[str, int], empty: bool) -> dict[str, int | bool]:
    """Return the counts of the audit, and the result of `agrees` under the key `agrees`."""
    return {"agrees": agrees(items, audit, empty), **{place: int(audit[place]) for place in PLACES}}


def agrees(items: Mapping[str, int], audit: Mapping[str, int], empty: bool) -> bool:
    """Return True if the audit found each object where the ledger says that it is.

    Args:
        items: Counts of the ledger.
        audit: Counts of the audit.
        empty: True if the run reported the table as empty: then no object may be unseen.
    """
    left = items["rejected"] + items["skipped"]
    return bool(
        audit["wrong_bin"] == audit["fell_in_wrong_bin"] == 0
        and items["placed"] == audit["right"]
        and items["lost"] == audit["elsewhere"]
        and left <= audit["left"] <= left + audit["unseen"]
        and not (empty and audit["unseen"])
    )


def disagreement(result: Mapping[str, Any]) -> str:
    """Return one sentence with the counts of audit and ledger if the audit disagrees, else ""."""
    audit = result.get("audit")
    # Results of version 1 do not contain the answer.
    if audit is None or audit.get("agrees", True):
        return ""
    mistakes = ", ".join(f"{audit[place]} {words}" for place, words in MISTAKES.items() if audit[place])
    books = result["items"]
    comparison = (
        f"the audit found {audit['right']} in their bins, {audit['left']} on the table and "
        f"{audit['elsewhere']} elsewhere; the executive reports {books['placed']} placed, "
        f"{books['rejected']} rejected, {books['skipped']} skipped and {books['lost']} lost"
    )
    return (
        f"THE AUDIT DISAGREES: {mistakes}; {comparison}" if mistakes else f"THE AUDIT DISAGREES: {comparison}"
    )


def exit_code(result: Mapping[str, Any]) -> int:
    """Return the exit code of a run: 1 instead of 0 or 4 if the audit disagrees."""
    code = EXIT_CODES[result["status"]]
    return 1 if code in (0, 4) and disagreement(result) else code
