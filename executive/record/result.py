"""The result of a run: the object that `result.json` holds and `--json` prints."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.errors import ExecutiveError
from executive.record.plain import plain

if TYPE_CHECKING:
    from executive.runtime.run import Outcome

FATES = ("seen", "placed", "rejected", "lost", "phantom")
"""What the ledger counts."""

PLACES = ("right", "wrong_bin", "left", "elsewhere", "unseen")
"""What the audit counts."""

EXIT_CODES = {"SUCCESS": 0, "FAILURE": 1, "FAULT": 3, "HALTED": 130}
"""How a command ends, by the status of its run."""


def result_of(
    *,
    mission: str,
    seed: int,
    outcome: Outcome,
    items: Mapping[str, Any],
    audit: Mapping[str, int] | None,
    planning: Mapping[str, float],
    wall_time: float,
    trace: str,
    run: Path,
) -> dict[str, Any]:
    """Return the result as a plain mapping; `wall_time` in seconds, `run` the run directory.

    `audit` is None in a cell that has no ground truth; `planning` as `PlanningTally.figures` gives it.
    """
    return {
        "mission": mission,
        "status": outcome.status,
        "reason": outcome.reason,
        "message": outcome.message,
        "node": outcome.node,
        "seed": seed,
        "items": {fate: int(items.get(fate, 0)) for fate in FATES},
        "audit": None if audit is None else {place: int(audit[place]) for place in PLACES},
        "planning": dict(planning),
        "ticks": outcome.ticks,
        "robot_time_s": plain(outcome.robot_time),
        "wall_time_s": round(wall_time, 3),
        "trace": trace,
        "run": str(run),
    }


def write_result(path: Path, result: Mapping[str, Any]) -> None:
    """Write `result` to `path`, whole or not at all.

    Raises:
        ExecutiveError: The disk does not take it.
    """
    fresh = path.with_name(f".{path.name}.part")
    try:
        with fresh.open("w", encoding="utf-8") as file:
            json.dump(result, file, indent=2, ensure_ascii=False, allow_nan=False)
            file.write("\n")
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
    except OSError as error:
        raise ExecutiveError(
            f'cannot write the result "{path}": {(error.strerror or str(error)).lower()}; '
            "the journal beside it tells how the run ended"
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
