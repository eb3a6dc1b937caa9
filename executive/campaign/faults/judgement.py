"""Checks of a run with injected faults."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.campaign.faults.fault import InjectedError, PlannedFault
from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.frame import Frame, FrameCaptured
from executive.events import FaultInjected, FrameSearched, ItemChanged, RunEnded, TimedEvent
from executive.ledger.item import State
from executive.ledger.outcomes import is_balanced
from executive.mission.flow.endings import Ending
from executive.testing.faults.world_access import TrueObject

DISPLACING_EFFECTS = frozenset({"object_removed", "object_moved", "seal_breaks"})
"""Names of the effects that may put an object out of reach."""
MIN_BORDER_DISTANCE = 30.0
"""Distance of an object's centre from the border of an image from which the object is visible [pixel]."""


class HiddenCounts(NamedTuple):
    """Numbers of objects at places that no image shows, `outside` and `inside` of bins."""

    outside: int
    inside: int


NOTHING_HIDDEN = HiddenCounts(0, 0)


def check_end(
    outcome: RunEnded, faults: Sequence[PlannedFault], endings: Sequence[Ending], raised: bool
) -> Iterator[str]:
    """Yield the problems with the end of a run; `raised` is True if an injected bug was raised."""
    if outcome.status == "FAULT":
        nodes = [fault.affected for fault in faults if fault.ends_run]
        if not raised or InjectedError.__name__ not in outcome.message:
            yield f"it ended as FAULT at {outcome.node or 'no node'}: {outcome.message}"
        elif not any(node == outcome.node or outcome.message.startswith(f"{node}: ") for node in nodes):
            yield f"the bug was in {' or '.join(nodes)}, but the run names {outcome.node}: {outcome.message}"
    elif raised:
        yield f"a bug was raised, but the run ended as {outcome.status} {outcome.reason}"
    if outcome.status == "FAILURE" and outcome.reason != "lost":
        known = {(ending.node, f"{ending.source}.{ending.reason}") for ending in endings}
        if (outcome.node, outcome.reason) not in known:
            yield f"it ended with {outcome.reason} at {outcome.node}, which the mission checker excludes"


def check_tree(root: Behaviour) -> Iterator[str]:
    """Yield a problem for each node that is still running."""
    for node in root.iterate():
        if node.status is Status.RUNNING:
            yield f"{getattr(node, 'path', node.name)} is still running"


def count_hidden(
    objects: Sequence[TrueObject], bins: Collection[Bin], events: Sequence[TimedEvent]
) -> HiddenCounts:
    """Return the numbers of objects at places that no image has shown since the last drop."""
    changes = [(timed.tick, timed.event) for timed in events if isinstance(timed.event, ItemChanged)]
    drop_ticks = [tick for tick, change in changes if change.state == State.DROPPED.value]
    if not drop_ticks:
        return NOTHING_HIDDEN
    later = (timed.event for timed in events if timed.tick > drop_ticks[-1])
    frames = [event.frame for event in later if isinstance(event, FrameCaptured)]
    hidden = [true for true in objects if not any(_is_shown(true, frame) for frame in frames)]
    inside = sum(any(bin.contains(true.position, BIN_THICKNESS) for bin in bins) for true in hidden)
    return HiddenCounts(len(hidden) - inside, inside)


def check_ledger(
    outcome: RunEnded,
    items: Mapping[str, Any],
    audit: Mapping[str, int] | None,
    taken: int = 0,
    hidden: HiddenCounts = NOTHING_HIDDEN,
) -> Iterator[str]:
    """Yield a problem if the ledger does not balance, an object is misplaced, or the audit disagrees.

    If the run ended early, unseen objects are missing in the ledger, and an object that has just fallen is
    lost at any place. So is an object that fell at a hidden place. The run need not notice a removal of the
    `taken` objects.
    """
    ledger_text = f"the ledger says {format_counts(items)}"
    if not is_balanced(items):
        yield f"the ledger does not balance: {ledger_text}"
    if audit is None:
        return
    if audit["wrong_bin"]:
        yield f"{audit['wrong_bin']} misplaced; {ledger_text}; the audit {format_counts(audit)}"
    unnoticed = min(max(audit["elsewhere"] - items["lost"], 0), taken)
    left = audit["left"] + unnoticed
    not_placed = items["rejected"] + items["skipped"]
    if outcome.status == "FAULT" or outcome.node:
        agrees = items["placed"] <= audit["right"] and not_placed <= left
    else:
        agrees = any(
            items["placed"] == audit["right"] + audit["wrong_bin"] - inside
            and not_placed <= left - outside <= not_placed + audit["unseen"]
            and items["lost"] == audit["elsewhere"] - unnoticed + outside + inside
            for outside in range(hidden.outside + 1)
            for inside in range(hidden.inside + 1)
        )
    if not agrees:
        yield f"{ledger_text}; the audit {format_counts(audit)}"


def check_success(
    outcome: RunEnded, audit: Mapping[str, int] | None, events: Sequence[TimedEvent]
) -> Iterator[str]:
    """Yield a problem if a run with at least one look succeeded although objects were never seen."""
    has_looked = any(isinstance(timed.event, FrameSearched) for timed in events)
    completed = outcome.status in ("SUCCESS", "INCOMPLETE")
    if has_looked and completed and audit is not None and audit["unseen"]:
        yield f"success, and {audit['unseen']} objects were never seen; the audit {format_counts(audit)}"


def check_losses(audit: Mapping[str, int] | None, events: Sequence[TimedEvent]) -> Iterator[str]:
    """Yield a problem if more objects are out of reach than the faults displaced."""
    displaced = sum(count_faults(events, name) for name in DISPLACING_EFFECTS)
    if audit is not None and audit["elsewhere"] > displaced:
        yield f"{audit['elsewhere']} objects are out of reach, but the faults displaced {displaced}"


def _is_shown(true: TrueObject, frame: Frame) -> bool:
    height, width = frame.visible.shape
    place = true.position[None]
    is_inside = frame.is_in_area(place, (0, 0, width, height), MIN_BORDER_DISTANCE)
    return bool((is_inside & frame.is_unoccluded(place))[0])


def count_faults(events: Sequence[TimedEvent], name: str) -> int:
    """Return the number of injected faults with this name."""
    return sum(isinstance(timed.event, FaultInjected) and timed.event.name == name for timed in events)


def describe_other_reason(outcome: RunEnded, faults: Sequence[PlannedFault]) -> str:
    """Return a sentence if the run failed for another reason than those of the faults, or ""."""
    if outcome.status != "FAILURE" or outcome.reason == "lost":
        return ""
    reasons = [fault.what if fault.is_reason else fault.leads_to for fault in faults]
    intended = [reason for reason in reasons if reason]
    if outcome.reason.rpartition(".")[2] in intended:
        return ""
    intention = f", not of {' and '.join(intended)}" if intended else ""
    return f"failed because of {outcome.reason}{intention}"


def format_counts(counts: Mapping[str, Any]) -> str:
    """Return counts by name as text: `seen 3, placed 2`."""
    return ", ".join(f"{name} {count}" for name, count in counts.items() if isinstance(count, int))
