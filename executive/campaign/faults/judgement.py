"""What has to be true of a run in which something went wrong on purpose."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.campaign.faults.fault import InjectedError, PlannedFault
from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.frame import Frame, FrameTaken
from executive.events import FaultInjected, FrameSearched, ItemChanged, RunEnded, TimedEvent
from executive.ledger.accounts import is_balanced
from executive.ledger.item import State
from executive.mission.flow.endings import Ending
from executive.testing.faults.world_access import TrueObject

REACHES = frozenset({"object_removed", "object_moved", "seal_breaks"})
"""What a fault does to an object that may put it out of reach."""
EDGE = 30.0
"""How near the border of an image an object's middle lies where not enough of it is shown [pixel]."""


class Hidden(NamedTuple):
    """How many objects lie where nobody looked, `outside` and `inside` of bins."""

    outside: int
    inside: int


NOTHING_HIDDEN = Hidden(0, 0)


def check_end(
    outcome: RunEnded, faults: Sequence[PlannedFault], endings: Sequence[Ending], raised: bool
) -> Iterator[str]:
    """Yield how the run ended as it must not; `raised` tells whether a bug that was put in came up."""
    if outcome.status == "FAULT":
        nodes = [fault.about for fault in faults if fault.ends_run]
        if not raised or InjectedError.__name__ not in outcome.message:
            yield f"it ended as FAULT at {outcome.node or 'no node'}: {outcome.message}"
        elif not any(node == outcome.node or outcome.message.startswith(f"{node}: ") for node in nodes):
            yield f"the bug was in {' or '.join(nodes)}, and the run names {outcome.node}: {outcome.message}"
    elif raised:
        yield f"a bug came up, and the run ended as {outcome.status} {outcome.reason}"
    if outcome.status == "FAILURE" and outcome.reason != "lost":
        known = {(ending.node, f"{ending.source}.{ending.reason}") for ending in endings}
        if (outcome.node, outcome.reason) not in known:
            yield f"it ended with {outcome.reason} at {outcome.node}, which the checker says cannot end it"


def check_tree(root: Behaviour) -> Iterator[str]:
    """Yield every node that still says it is running."""
    for node in root.iterate():
        if node.status is Status.RUNNING:
            yield f"{getattr(node, 'path', node.name)} is still running"


def out_of_sight(things: Sequence[TrueObject], bins: Collection[Bin], events: Sequence[TimedEvent]) -> Hidden:
    """Return how many things lie where no look has shown a place since the tool last dropped anything."""
    changes = [(one.tick, one.event) for one in events if isinstance(one.event, ItemChanged)]
    dropped = [tick for tick, change in changes if change.state == State.DROPPED.value]
    if not dropped:
        return NOTHING_HIDDEN
    later = (one.event for one in events if one.tick > dropped[-1])
    looks = [event.frame for event in later if isinstance(event, FrameTaken)]
    hidden = [thing for thing in things if not any(_is_shown(thing, frame) for frame in looks)]
    inside = sum(any(bin.contains(thing.position, BIN_THICKNESS) for bin in bins) for thing in hidden)
    return Hidden(len(hidden) - inside, inside)


def check_books(
    outcome: RunEnded,
    items: Mapping[str, Any],
    audit: Mapping[str, int] | None,
    taken: int = 0,
    hidden: Hidden = NOTHING_HIDDEN,
) -> Iterator[str]:
    """Yield where the ledger does not balance, something was misplaced, or the audit found something else.

    What nobody had seen yet when a run ended early is on no book, and lies where it lay; what had just fallen
    then is lost to the robot, wherever it lies, and so is what fell where no look shows it. Of the `taken`
    objects some may have been taken where nobody had to look any more.
    """
    ledger_text = f"the ledger says {counts_text(items)}"
    if not is_balanced(items):
        yield f"the ledger does not balance: {ledger_text}"
    if audit is None:
        return
    if audit["wrong_bin"]:
        yield f"{audit['wrong_bin']} misplaced; {ledger_text}; the audit {counts_text(audit)}"
    unnoticed = min(max(audit["elsewhere"] - items["lost"], 0), taken)
    left = audit["left"] + unnoticed
    still = items["rejected"] + items["skipped"]
    if outcome.status == "FAULT" or outcome.node:
        agrees = items["placed"] <= audit["right"] and still <= left
    else:
        agrees = any(
            items["placed"] == audit["right"] + audit["wrong_bin"] - inside
            and still <= left - outside <= still + audit["unseen"]
            and items["lost"] == audit["elsewhere"] - unnoticed + outside + inside
            for outside in range(hidden.outside + 1)
            for inside in range(hidden.inside + 1)
        )
    if not agrees:
        yield f"{ledger_text}; the audit {counts_text(audit)}"


def check_success(
    outcome: RunEnded, audit: Mapping[str, int] | None, events: Sequence[TimedEvent]
) -> Iterator[str]:
    """Yield a sentence if the run looked, says success, and never saw what lies there."""
    looked = any(isinstance(one.event, FrameSearched) for one in events)
    completed = outcome.status in ("SUCCESS", "INCOMPLETE")
    if looked and completed and audit is not None and audit["unseen"]:
        yield f"success, and {audit['unseen']} objects were never seen; the audit {counts_text(audit)}"


def check_losses(audit: Mapping[str, int] | None, events: Sequence[TimedEvent]) -> Iterator[str]:
    """Yield a sentence if more objects are out of reach than the faults can have put there."""
    reached = sum(count_of(events, what) for what in REACHES)
    if audit is not None and audit["elsewhere"] > reached:
        yield f"{audit['elsewhere']} objects are out of reach, and the fault reached for {reached}"


def _is_shown(thing: TrueObject, frame: Frame) -> bool:
    height, width = frame.visible.shape
    place = thing.position[None]
    return bool((frame.is_in_area(place, (0, 0, width, height), EDGE) & frame.is_unobstructed(place))[0])


def count_of(events: Sequence[TimedEvent], what: str) -> int:
    """Return how often something happened to the cell."""
    return sum(isinstance(one.event, FaultInjected) and one.event.name == what for one in events)


def remark(outcome: RunEnded, faults: Sequence[PlannedFault]) -> str:
    """Return a sentence if the run failed for another reason than those that were brought about, or ""."""
    if outcome.status != "FAILURE" or outcome.reason == "lost":
        return ""
    reasons = [fault.what if fault.reason else fault.leads_to for fault in faults]
    meant = [reason for reason in reasons if reason]
    if outcome.reason.rpartition(".")[2] in meant:
        return ""
    return f"it says {outcome.reason}" + (f", and {' and '.join(meant)} was brought about" if meant else "")


def counts_text(counts: Mapping[str, Any]) -> str:
    """Return counts by name in words: `seen 3, placed 2`."""
    return ", ".join(f"{name} {count}" for name, count in counts.items() if isinstance(count, int))
