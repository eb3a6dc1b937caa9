"""Checks of an ended run, with or without injected faults."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.campaign.faults.planned_fault import InjectedError, PlannedFault
from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.frame import Frame, FrameCaptured
from executive.cell.workcell import Workcell
from executive.events import FrameSearched, ItemChanged, NodeEnded, NodeStarted, RunEnded, TimedEvent
from executive.geometry import Array
from executive.ledger.item import State
from executive.ledger.outcomes import is_balanced
from executive.mission.flow_analysis import UnhandledFailure
from executive.record.timeline.timeline import Timeline
from executive.testing.faults.world_access import TrueObject

DISPLACING_EFFECTS = frozenset({"object_removed", "object_moved", "seal_breaks"})
"""Values of `FaultInjected.name` for the faults that may move an object out of reach of the arm."""
MIN_BORDER_DISTANCE = 30.0
"""Minimum distance between the centre of a visible object and the image border [pixel]."""
REST_CHECK_STEPS = 6
"""Number of control steps after the end of a run during which the arm must not move."""
MAX_MOVEMENT_AT_REST = 1e-5
"""Maximum movement of a joint of an arm at rest [rad]; for a fake arm, movement of the tool [m]."""


class UnobservedCounts(NamedTuple):
    """Numbers of objects, outside and inside of bins, that the ledger cannot have found where they are."""

    outside_bins: int = 0
    inside_bins: int = 0


def check_end(
    run_end: RunEnded,
    faults: Sequence[PlannedFault],
    unhandled_failures: Sequence[UnhandledFailure],
    is_bug_raised: bool,
) -> Iterator[str]:
    """Yield a problem if the run did not end as its faults require.

    Args:
        run_end: End of the run.
        faults: Injected faults.
        unhandled_failures: Failures with which the mission may end, according to the check of the mission.
        is_bug_raised: True if an injected exception was raised; the run must then end as FAULT at its node.
    """
    if run_end.status == "FAULT":
        nodes = [fault.location for fault in faults if fault.is_bug]
        if not is_bug_raised or InjectedError.__name__ not in run_end.message:
            yield f"the run ended as FAULT at {run_end.node or 'no node'}: {run_end.message}"
        elif not any(node == run_end.node or run_end.message.startswith(f"{node}: ") for node in nodes):
            yield f"the bug was in {' or '.join(nodes)}, but the run names {run_end.node}: {run_end.message}"
    elif is_bug_raised:
        yield f"the injected error was raised, but the run ended as {run_end.status} {run_end.reason}"
    if run_end.status == "FAILURE" and run_end.reason != "lost":
        ends = {(failure.node, f"{failure.source}.{failure.reason}") for failure in unhandled_failures}
        if (run_end.node, run_end.reason) not in ends:
            yield f"the run ended with {run_end.reason} at {run_end.node}; `check` lists no such end"


def check_tree(root: Behaviour) -> Iterator[str]:
    """Yield a problem for each node that is still running after the end of the run."""
    for node in root.iterate():
        if node.status is Status.RUNNING:
            yield f"{getattr(node, 'path', node.name)} is still running"


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


def count_unobserved_objects(
    objects: Sequence[TrueObject], bins: Collection[Bin], events: Sequence[TimedEvent]
) -> UnobservedCounts:
    """Return the numbers of objects that the ledger cannot have found since the last drop.

    An object outside of the bins is unobserved if no image shows its position. An object inside of a bin is
    unobserved if no detector searched a full image that shows its position: if the executive cannot look
    into the bin, it reports the object as lost.
    """
    changes = [(timed.tick, timed.event) for timed in events if isinstance(timed.event, ItemChanged)]
    drop_ticks = [tick for tick, change in changes if change.state == State.DROPPED.value]
    if not drop_ticks:
        return UnobservedCounts()
    later_events = [timed.event for timed in events if timed.tick > drop_ticks[-1]]
    frames = [event.frame for event in later_events if isinstance(event, FrameCaptured)]
    searches = [event for event in later_events if isinstance(event, FrameSearched)]
    full_view_ids = {search.frame for search in searches if search.view == "full"}
    frames_of_bins = [frame for frame in frames if frame.id in full_view_ids]
    inside_count = outside_count = 0
    for position in (true_object.position for true_object in objects):
        if any(bin.contains(position, BIN_THICKNESS) for bin in bins):
            inside_count += not any(_is_visible(position, frame) for frame in frames_of_bins)
        else:
            outside_count += not any(_is_visible(position, frame) for frame in frames)
    return UnobservedCounts(outside_count, inside_count)


def check_ledger(
    run_end: RunEnded,
    items: Mapping[str, Any],
    audit: Mapping[str, int] | None,
    removed_count: int,
    unobserved: UnobservedCounts,
) -> Iterator[str]:
    """Yield a problem if the ledger does not balance, an object is misplaced, or the audit disagrees.

    After an early end of the run, the ledger may lack objects, and dropped items may count as lost.

    Args:
        run_end: End of the run.
        items: Number of items in the ledger, by state.
        audit: True object counts by `AUDIT_KEYS`, for instance `left` for the table; None if unknown.
        removed_count: Number of removed objects; the ledger may count each as lost, or still contain it.
        unobserved: Numbers of unobserved objects, which the ledger may count as lost.
    """
    ledger_text = f"the ledger says {format_counts(items)}"
    if not is_balanced(items):
        yield f"the ledger does not balance: {ledger_text}"
    if audit is None:
        return
    if audit["wrong_bin"]:
        yield f"{audit['wrong_bin']} objects in wrong bins; {ledger_text}; the audit {format_counts(audit)}"
    unnoticed_removal_count = min(max(audit["elsewhere"] - items["lost"], 0), removed_count)
    unplaced_objects = audit["left"] + unnoticed_removal_count
    unplaced_items = items["rejected"] + items["skipped"]
    if run_end.status == "FAULT" or run_end.node:
        is_confirmed = items["placed"] <= audit["right"] and unplaced_items <= unplaced_objects
    else:
        # Any number of the unobserved objects outside of bins, and inside of bins, may count as lost.
        is_confirmed = any(
            items["placed"] == audit["right"] + audit["wrong_bin"] - inside_count
            and unplaced_items <= unplaced_objects - outside_count <= unplaced_items + audit["unseen"]
            and items["lost"] == audit["elsewhere"] - unnoticed_removal_count + outside_count + inside_count
            for outside_count in range(unobserved.outside_bins + 1)
            for inside_count in range(unobserved.inside_bins + 1)
        )
    if not is_confirmed:
        yield f"{ledger_text}; the audit {format_counts(audit)}"


def check_detection(run_end: RunEnded, audit: Mapping[str, int] | None, timeline: Timeline) -> Iterator[str]:
    """Yield a problem if detectors were used and the run succeeded, but some objects were never detected."""
    has_tree_succeeded = run_end.status in ("SUCCESS", "INCOMPLETE")
    if timeline.items.look is not None and has_tree_succeeded and audit is not None and audit["unseen"]:
        counts = format_counts(audit)
        yield f"the run succeeded, but {audit['unseen']} objects were never seen; the audit {counts}"


def check_losses(audit: Mapping[str, int] | None, timeline: Timeline) -> Iterator[str]:
    """Yield a problem if more objects are out of reach than the faults have displaced."""
    displaced_count = sum(count_injected_faults(timeline, name) for name in DISPLACING_EFFECTS)
    if audit is not None and audit["elsewhere"] > displaced_count:
        yield f"{audit['elsewhere']} objects are out of reach, but the faults displaced {displaced_count}"


def _is_visible(position: Array, frame: Frame) -> bool:
    """Return True if an object with its centre at `position` `(3,)` [m] would be visible in the frame."""
    height, width = frame.visible.shape
    positions = position[np.newaxis]
    is_inside = frame.compute_area_mask(positions, (0, 0, width, height), MIN_BORDER_DISTANCE)
    return bool((is_inside & frame.compute_unoccluded_mask(positions))[0])


def count_injected_faults(timeline: Timeline, name: str) -> int:
    """Return the number of injected faults with this name."""
    return sum(fault == name for _, fault in timeline.faults)


def describe_unexpected_reason(run_end: RunEnded, faults: Sequence[PlannedFault]) -> str:
    """Return a remark if the run failed with a reason that no fault should cause; otherwise ""."""
    if run_end.status != "FAILURE" or run_end.reason == "lost":
        return ""
    reasons = [fault.kind if fault.is_failure_reason else fault.expected_reason for fault in faults]
    expected_reasons = list(filter(None, reasons))
    if run_end.reason.rpartition(".")[2] in expected_reasons:
        return ""
    expectation = f", not of {' and '.join(expected_reasons)}" if expected_reasons else ""
    return f"failed because of {run_end.reason}{expectation}"


def format_counts(counts: Mapping[str, Any]) -> str:
    """Return the integers of a mapping as text: `seen 3, placed 2`."""
    return ", ".join(f"{name} {count}" for name, count in counts.items() if isinstance(count, int))
