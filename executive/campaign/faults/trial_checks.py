"""Checks of an ended run with injected faults; each check yields one text per problem."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.campaign.faults.planned_fault import InjectedError, PlannedFault
from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.frame import Frame, FrameCaptured
from executive.events import FaultInjected, FrameSearched, ItemChanged, RunEnded, TimedEvent
from executive.geometry import Array
from executive.ledger.item import State
from executive.ledger.outcomes import is_balanced
from executive.mission.flow.unhandled_failures import UnhandledFailure
from executive.testing.faults.world_access import TrueObject

DISPLACING_EFFECTS = frozenset({"object_removed", "object_moved", "seal_breaks"})
"""Names of the effects that may move an object out of reach of the arm."""
MIN_BORDER_DISTANCE = 30.0
"""Minimum distance between the centre of a visible object and the image border [pixel]."""


class UnobservedCounts(NamedTuple):
    """Numbers of unobserved objects, whose places no image shows: `outside` and `inside` of bins."""

    outside: int
    inside: int


NO_UNOBSERVED_OBJECTS = UnobservedCounts(0, 0)


def check_end(
    outcome: RunEnded,
    faults: Sequence[PlannedFault],
    unhandled_failures: Sequence[UnhandledFailure],
    is_bug_raised: bool,
) -> Iterator[str]:
    """Yield a problem if the run did not end as its faults require.

    `unhandled_failures` are the failures with which the mission may end. If `is_bug_raised` is True, an
    injected bug was raised, and the run must end as a fault at the node of the bug.
    """
    if outcome.status == "FAULT":
        nodes = [fault.location for fault in faults if fault.ends_run]
        if not is_bug_raised or InjectedError.__name__ not in outcome.message:
            yield f"it ended as FAULT at {outcome.node or 'no node'}: {outcome.message}"
        elif not any(node == outcome.node or outcome.message.startswith(f"{node}: ") for node in nodes):
            yield f"the bug was in {' or '.join(nodes)}, but the run names {outcome.node}: {outcome.message}"
    elif is_bug_raised:
        yield f"a bug was raised, but the run ended as {outcome.status} {outcome.reason}"
    if outcome.status == "FAILURE" and outcome.reason != "lost":
        known = {(failure.node, f"{failure.source}.{failure.reason}") for failure in unhandled_failures}
        if (outcome.node, outcome.reason) not in known:
            yield f"it ended with {outcome.reason} at {outcome.node}, which the mission checker excludes"


def check_tree(root: Behaviour) -> Iterator[str]:
    """Yield a problem for each node that is still running after the end of the run."""
    for node in root.iterate():
        if node.status is Status.RUNNING:
            yield f"{getattr(node, 'path', node.name)} is still running"


def count_unobserved_objects(
    objects: Sequence[TrueObject], bins: Collection[Bin], events: Sequence[TimedEvent]
) -> UnobservedCounts:
    """Return the numbers of objects whose places no image has shown since the last drop."""
    changes = [(timed.tick, timed.event) for timed in events if isinstance(timed.event, ItemChanged)]
    drop_ticks = [tick for tick, change in changes if change.state == State.DROPPED.value]
    if not drop_ticks:
        return NO_UNOBSERVED_OBJECTS
    later = (timed.event for timed in events if timed.tick > drop_ticks[-1])
    frames = [event.frame for event in later if isinstance(event, FrameCaptured)]
    positions = (true_object.position for true_object in objects)
    unseen = [position for position in positions if not any(_is_visible(position, frame) for frame in frames)]
    inside = sum(any(bin.contains(position, BIN_THICKNESS) for bin in bins) for position in unseen)
    return UnobservedCounts(len(unseen) - inside, inside)


def check_ledger(
    outcome: RunEnded,
    items: Mapping[str, Any],
    audit: Mapping[str, int] | None,
    removed_count: int = 0,
    unobserved: UnobservedCounts = NO_UNOBSERVED_OBJECTS,
) -> Iterator[str]:
    """Yield a problem if the ledger does not balance, an object is misplaced, or the audit disagrees.

    Allowed differences: if the run ended early, the ledger lacks unseen objects, and an object that has just
    fallen counts as lost wherever it lies. `unobserved` objects may always count as lost. The run need not
    notice the removal of `removed_count` objects.
    """
    ledger_text = f"the ledger says {format_counts(items)}"
    if not is_balanced(items):
        yield f"the ledger does not balance: {ledger_text}"
    if audit is None:
        return
    if audit["wrong_bin"]:
        yield f"{audit['wrong_bin']} objects in wrong bins; {ledger_text}; the audit {format_counts(audit)}"
    unnoticed_count = min(max(audit["elsewhere"] - items["lost"], 0), removed_count)
    left = audit["left"] + unnoticed_count
    not_placed = items["rejected"] + items["skipped"]
    if outcome.status == "FAULT" or outcome.node:
        agrees = items["placed"] <= audit["right"] and not_placed <= left
    else:
        agrees = any(
            items["placed"] == audit["right"] + audit["wrong_bin"] - inside
            and not_placed <= left - outside <= not_placed + audit["unseen"]
            and items["lost"] == audit["elsewhere"] - unnoticed_count + outside + inside
            for outside in range(unobserved.outside + 1)
            for inside in range(unobserved.inside + 1)
        )
    if not agrees:
        yield f"{ledger_text}; the audit {format_counts(audit)}"


def check_success(
    outcome: RunEnded, audit: Mapping[str, int] | None, events: Sequence[TimedEvent]
) -> Iterator[str]:
    """Yield a problem if a run that searched an image succeeded although objects were never detected."""
    has_searched = any(isinstance(timed.event, FrameSearched) for timed in events)
    is_complete = outcome.status in ("SUCCESS", "INCOMPLETE")
    if has_searched and is_complete and audit is not None and audit["unseen"]:
        yield f"it succeeded, but {audit['unseen']} objects were never seen; the audit {format_counts(audit)}"


def check_losses(audit: Mapping[str, int] | None, events: Sequence[TimedEvent]) -> Iterator[str]:
    """Yield a problem if more objects are out of reach than the faults have displaced."""
    displaced_count = sum(count_injected_faults(events, name) for name in DISPLACING_EFFECTS)
    if audit is not None and audit["elsewhere"] > displaced_count:
        yield f"{audit['elsewhere']} objects are out of reach, but the faults displaced {displaced_count}"


def _is_visible(position: Array, frame: Frame) -> bool:
    """Return True if an object with its centre at `position` `(3,)` [m] would be visible in the frame."""
    height, width = frame.visible.shape
    place = position[None]
    is_inside = frame.is_in_area(place, (0, 0, width, height), MIN_BORDER_DISTANCE)
    return bool((is_inside & frame.is_unoccluded(place))[0])


def count_injected_faults(events: Sequence[TimedEvent], name: str) -> int:
    """Return the number of injected faults with this name."""
    return sum(isinstance(timed.event, FaultInjected) and timed.event.name == name for timed in events)


def describe_unexpected_reason(outcome: RunEnded, faults: Sequence[PlannedFault]) -> str:
    """Return a remark if the run failed with another reason than those of the faults, or ""."""
    if outcome.status != "FAILURE" or outcome.reason == "lost":
        return ""
    reasons = [fault.kind if fault.is_failure_reason else fault.expected_reason for fault in faults]
    intended = [reason for reason in reasons if reason]
    if outcome.reason.rpartition(".")[2] in intended:
        return ""
    intention = f", not of {' and '.join(intended)}" if intended else ""
    return f"failed because of {outcome.reason}{intention}"


def format_counts(counts: Mapping[str, Any]) -> str:
    """Return the integers of a mapping as text: `seen 3, placed 2`."""
    return ", ".join(f"{name} {count}" for name, count in counts.items() if isinstance(count, int))
