"""The result of a run: the object that `result.json` holds and `--json` prints."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.errors import ExecutiveError
from executive.record.plain import plain
from executive.record.whole_file import write_whole

if TYPE_CHECKING:
    from executive.runtime.outcome import Outcome

FATES = ("seen", "placed", "rejected", "lost", "phantom")
"""What the ledger counts."""

PLACES = ("right", "wrong_bin", "left", "elsewhere", "unseen")
"""What the audit counts."""

EXIT_CODES = {"SUCCESS": 0, "FAILURE": 1, "FAULT": 3, "HALTED": 130}
"""How a command ends, by the status of its run."""

ENDED = ("SUCCESS", "FAILURE")
"""Status of a run that cannot be taken up again: its tree has come to its end."""


def result_of(
    *,
    mission: str,
    seed: int,
    outcome: Outcome,
    items: Mapping[str, Any],
    audit: Mapping[str, int] | None,
    planning: Mapping[str, float],
    requests: Sequence[str],
    story: Mapping[str, Any] | None,
    wall_time: float,
    trace: str,
    run: Path,
) -> dict[str, Any]:
    """Return the result as a plain mapping; `wall_time` in seconds, `run` the run directory.

    `audit` is None in a cell that has no ground truth; `planning` as `PlanningTally.figures` gives it,
    `requests` as `Requests.words` and `story` as `Story.tell` do.
    """
    return {
        "mission": mission,
        "status": outcome.status,
        "reason": outcome.reason,
        # It may quote a file name that is not UTF-8.
        "message": plain(outcome.message),
        "node": outcome.node,
        "holds": outcome.holds,
        "seed": seed,
        "items": {fate: int(items.get(fate, 0)) for fate in FATES},
        "audit": None if audit is None else {place: int(audit[place]) for place in PLACES},
        "planning": dict(planning),
        "requests": list(requests),
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
    try:
        write_whole(path, json.dumps(result, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    except OSError as error:
        raise ExecutiveError(
            f'cannot write the result "{path}": {(error.strerror or str(error)).lower()}; '
            "the journal beside it tells how the run ended, and so does what --json prints"
        ) from error


def ledger_agrees(result: Mapping[str, Any]) -> bool:
    """Tell whether what the robot believes is what the audit found; true where there was no audit."""
    items, audit = result["items"], result["audit"]
    if audit is None:
        return True
    return bool(
        items["placed"] == audit["right"] + audit["wrong_bin"]
        and items["rejected"] == audit["left"]
        and items["lost"] == audit["elsewhere"]
        and audit["wrong_bin"] == 0
        and audit["unseen"] == 0
    )
