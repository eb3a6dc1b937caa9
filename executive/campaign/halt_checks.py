"""Checks of a run after its end: the arm is at rest, and journal and tool agree with the outcome."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from executive.cell.workcell import Workcell
from executive.events import NodeEnded, NodeStarted, RunEnded, TimedEvent

REST_STEPS = 6
"""Number of control steps after the end of a run in which the arm must not move."""
MAX_REST_MOVEMENT = 1e-5
"""Largest joint movement of an arm at rest [rad]; for a fake arm, movement of the tool [m]."""


def check_rest(workcell: Workcell) -> Iterator[str]:
    """Yield a problem if the arm is not at rest during `REST_STEPS` control steps."""
    arm = workcell.cell.arm
    if not arm.at_rest:
        yield "the arm is not at rest"
    positions = [arm.q]
    for _ in range(REST_STEPS):
        workcell.advance()
        positions.append(arm.q)
    movement = float(np.ptp(positions, axis=0).max())
    if movement > MAX_REST_MOVEMENT:
        yield f"the arm moved by {movement:.1e} after the run had ended"


def check_journal(events: Sequence[TimedEvent], outcome: RunEnded) -> Iterator[str]:
    """Yield a problem if the journal does not have one end, as its last entry, or if a node did not end."""
    ends = [timed.event for timed in events if isinstance(timed.event, RunEnded)]
    if len(ends) != 1 or events[-1].event is not ends[0]:
        yield f"the journal has {len(ends)} ends in its {len(events)} entries; only the last may be an end"
    elif ends[0] != outcome:
        yield f"the journal ends with {ends[0]}, but the run with {outcome}"
    running: dict[str, int] = {}
    for timed in events:
        match timed.event:
            case NodeEnded(node):
                running.pop(node, None)
            case NodeStarted(node) if node in running:
                yield f"in the journal {node} starts at tick {timed.tick}, but it is running already"
            case NodeStarted(node):
                running[node] = timed.tick
    for node, tick in running.items():
        yield f"the journal has no end of {node}, which started at tick {tick}"


def check_tool(outcome: RunEnded, workcell: Workcell) -> Iterator[str]:
    """Yield a problem if the outcome names another held item than the tool has."""
    holding = workcell.cell.tool.holding
    if holding and outcome.holds not in {item.item for item in workcell.accounts.summaries()}:
        yield f'the tool holds an object, but the run names "{outcome.holds}"'
    if not holding and outcome.holds:
        yield f'the tool holds nothing, but the run names "{outcome.holds}"'
