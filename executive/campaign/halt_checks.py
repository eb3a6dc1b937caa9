"""What has to be true of a run that was halted, whenever that was."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from executive.cell.workcell import Workcell
from executive.run.outcome import Outcome

AFTER = 6
"""Control steps after the end of a run in which the arm must not move any more."""
STILL = 1e-5
"""Joint movement in them that is none [rad]; for a fake arm, movement of its tool [m]."""


def check_rest(workcell: Workcell) -> Iterator[str]:
    """Yield a sentence if the arm is not at rest; lets a few control steps pass."""
    arm = workcell.cell.arm
    if not arm.at_rest:
        yield "the arm is not at rest"
    positions = [arm.q]
    for _ in range(AFTER):
        workcell.advance()
        positions.append(arm.q)
    moved = float(np.ptp(positions, axis=0).max())
    if moved > STILL:
        yield f"the arm moved by {moved:.1e} after the run had ended"


def check_journal(entries: Sequence[Mapping[str, Any]], outcome: Outcome) -> Iterator[str]:
    """Yield what the journal lacks: it has one end, its last entry, and every node that began has ended."""
    ends = [number for number, entry in enumerate(entries) if entry["kind"] == "end"]
    if ends != [len(entries) - 1]:
        yield f"the journal has {len(ends)} ends in its {len(entries)} entries; only the last may be one"
    elif any(entries[-1][key] != getattr(outcome, key) for key in ("status", "holds", "ticks")):
        yield f"the journal ends with {entries[-1]}, and the run with {outcome}"
    running: dict[str, int] = {}
    for entry in entries:
        if entry["kind"] != "status":
            continue
        if entry["status"] != "RUNNING":
            running.pop(entry["node"], None)
        elif entry["node"] in running:
            yield f"the journal lets {entry['node']} begin at tick {entry['tick']} while it runs"
        else:
            running[entry["node"]] = entry["tick"]
    for node, tick in running.items():
        yield f"the journal says no end of {node}, which began at tick {tick}"


def check_tool(outcome: Outcome, workcell: Workcell) -> Iterator[str]:
    """Yield a sentence if the run does not tell what its tool holds."""
    holding = workcell.cell.tool.holding
    if holding and outcome.holds not in {row["item"] for row in workcell.accounts.rows()}:
        yield f'the tool holds an object, and the run says "{outcome.holds}"'
    if not holding and outcome.holds:
        yield f'the tool holds nothing, and the run says "{outcome.holds}"'
