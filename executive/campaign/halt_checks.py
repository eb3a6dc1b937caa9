"""What has to be true of a run that was halted, whenever that was."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from executive.cell.workcell import Workcell
from executive.events import NodeEnded, NodeStarted, RunEnded, TimedEvent

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


def check_journal(events: Sequence[TimedEvent], outcome: RunEnded) -> Iterator[str]:
    """Yield what the journal lacks: it has one end, its last entry, and every node that began has ended."""
    ends = [one.event for one in events if isinstance(one.event, RunEnded)]
    if len(ends) != 1 or events[-1].event is not ends[0]:
        yield f"the journal has {len(ends)} ends in its {len(events)} entries; only the last may be one"
    elif ends[0] != outcome:
        yield f"the journal ends with {ends[0]}, and the run with {outcome}"
    running: dict[str, int] = {}
    for one in events:
        match one.event:
            case NodeEnded(node):
                running.pop(node, None)
            case NodeStarted(node) if node in running:
                yield f"the journal lets {node} begin at tick {one.tick} while it runs"
            case NodeStarted(node):
                running[node] = one.tick
    for node, tick in running.items():
        yield f"the journal says no end of {node}, which began at tick {tick}"


def check_tool(outcome: RunEnded, workcell: Workcell) -> Iterator[str]:
    """Yield a sentence if the run does not tell what its tool holds."""
    holding = workcell.cell.tool.holding
    if holding and outcome.holds not in {item.item for item in workcell.accounts.summaries()}:
        yield f'the tool holds an object, and the run says "{outcome.holds}"'
    if not holding and outcome.holds:
        yield f'the tool holds nothing, and the run says "{outcome.holds}"'
