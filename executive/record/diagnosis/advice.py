"""Advice after a run that did not succeed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from executive.errors import Unavailable
from executive.mission.model.instance import node_of
from executive.mission.model.nodes import InnerNode
from executive.mission.model.values import Literal
from executive.record.diagnosis.case import FailedRun
from executive.record.diagnosis.chain import Link
from executive.record.timeline.activation import Reading
from executive.record.timeline.items import ItemTimeline
from executive.tree.inspection import Advice
from executive.tree.registry import control_nodes

REMEDIES: Mapping[str, str] = {
    "camera_moved": "mount camera and bins as the cell file says, or measure the pose again"
}
"""Advice by the reason of a failure after which no mission can go on: every further look would mislead it."""


def advice(case: FailedRun, arm: str, reads: Sequence[Reading]) -> Iterator[str]:
    """Yield advice for a person, the most pressing first.

    Args:
        case: The run.
        arm: The state of the arm in words.
        reads: Answers of the cell that the failed skill had.
    """
    if arm != "at rest":
        yield f"keep away from the arm until you have seen it stand still: {arm}"
    if case.end.holds:
        what = "what is in it" if case.end.holds == "something" else case.end.holds
        ended = case.end.status == "FAILURE"
        to_go_on = "" if ended else f"to go on with this run leave {what} in the tool; "
        yield f"{to_go_on}take {what} out of the tool before another run"
    else:
        for name in case.timeline.items.unfinished("held"):
            yield f"see where {name} lies: it was let go as the run ended"
    for reading in reads:
        if reading.raised == Unavailable.__name__:
            yield f"see to it that {reading.name} answers again"
        elif reading.name == "arm.met":
            yield f"see what is in the arm's way: {reading.value}"
    if case.is_unrecorded:
        yield "free some space on the disk of the run directory, or name another place with --runs DIR"
    elif case.end.status == "FAULT":
        yield "mend what is broken, in the code or in the cell: a fault is never tried again"
    if remedy := REMEDIES.get(case.end.reason.rpartition(".")[2]):
        yield remedy
    elif ways := list(_ways_on(case)):
        yield f"to let the mission go on after {case.end.reason}: {', or '.join(ways)}"
    for name, item in case.lost.items():
        yield f"look for {name} by hand, {_whereabouts(item)}"


def _whereabouts(item: ItemTimeline) -> str:
    if item.dropped is not None and (item.sighting is None or item.sighting.clock < item.dropped):
        return "below where it was dropped"
    return "around ({:.2f}, {:.2f}) m".format(*item.now.position)


def _ways_on(case: FailedRun) -> Iterator[str]:
    """Yield what the mission would have to say for this failure not to end it."""
    if not case.links:
        return
    advice = [(link, one) for link in reversed(case.links) if link.model for one in _advice_of(link)]
    handlers = [(link, one) for link, one in advice if link.model and link.model.remedy]
    if handlers:
        yield _located(case, *handlers[0])
    else:
        remedy = next(kind.remedy for kind in control_nodes().values() if kind.remedy)
        yield f"{remedy} {case.place(case.links[-1].node)}"
    for link, one in advice:
        if (link, one) not in handlers:
            yield _located(case, link, one)
            if link.attempt:
                return


def _advice_of(link: Link) -> Iterator[Advice]:
    if link.model:
        yield from link.model.advise(link.failure)


def _located(case: FailedRun, link: Link, advice: Advice) -> str:
    """Return an advice with the place to change: the command line if the value is a param, else the file."""
    at = node_of(advice.child) if advice.child else link.node
    value = link.node.values.get(advice.key) if isinstance(link.node, InnerNode) else None
    params = case.loaded.mission.params.items() if isinstance(value, Literal) else ()
    name = next((name for name, param in params if param.value.mark == getattr(value, "mark", None)), "")
    return f"{advice.text} {f'with --set {name}=...' if name else f'at {case.place(at)}'}"
