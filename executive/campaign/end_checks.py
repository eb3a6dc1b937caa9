"""Checks of an ended run: the arm is at rest, and journal and tool agree with the event `RunEnded`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from executive.cell.workcell import Workcell
from executive.events import NodeEnded, NodeStarted, RunEnded, TimedEvent

REST_CHECK_STEPS = 6
"""Number of control steps after the end of a run during which the arm must not move."""
MAX_MOVEMENT_AT_REST = 1e-5
"""Maximum movement of a joint of an arm at rest [rad]; for a fake arm, movement of the tool [m]."""


def check_arm_at_rest(workcell: Workcell) -> Iterator[str]:
    """Yield a problem if the arm is not at rest now, or moves during `REST_CHECK_STEPS` control steps."""
    arm = workcell.cell.arm
    if not arm.at_rest:
        yield "the arm is not at rest"
    positions = [arm.q]
    for _ in range(REST_CHECK_STEPS):
        workcell.advance()
        positions.append(arm.q)
    movement = float(np.ptp(positions, axis=0).max())
    if movement > MAX_MOVEMENT_AT_REST:
        yield f"the arm moved by {movement:.1e} after the run had ended"


def check_journal(events: Sequence[TimedEvent], run_end: RunEnded) -> Iterator[str]:
    """Yield a problem unless the last event is the only `RunEnded`, and each node ends before it restarts."""
    ends = [timed.event for timed in events if isinstance(timed.event, RunEnded)]
    if len(ends) != 1 or events[-1].event is not ends[0]:
        yield f"the journal has {len(ends)} RunEnded in {len(events)} events; only the last must be one"
    elif ends[0] != run_end:
        yield f"the journal ends with {ends[0]}, but the run ended with {run_end}"
    start_ticks_by_path: dict[str, int] = {}
    for timed in events:
        match timed.event:
            case NodeEnded(node):
                start_ticks_by_path.pop(node, None)
            case NodeStarted(node) if node in start_ticks_by_path:
                yield f"in the journal {node} starts at tick {timed.tick}, but it is running already"
            case NodeStarted(node):
                start_ticks_by_path[node] = timed.tick
    for node, tick in start_ticks_by_path.items():
        yield f"in the journal {node} starts at tick {tick} and does not end"


def check_held_item(run_end: RunEnded, workcell: Workcell) -> Iterator[str]:
    """Yield a problem if the tool is empty and `RunEnded` names a held item, or vice versa."""
    is_holding = workcell.cell.tool.holding
    if is_holding and run_end.held_item not in {summary.item for summary in workcell.accounts.list_items()}:
        yield f'the tool holds an object, but the held item of the run is "{run_end.held_item}"'
    if not is_holding and run_end.held_item:
        yield f'the tool is empty, but the held item of the run is "{run_end.held_item}"'
