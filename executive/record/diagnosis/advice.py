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
from executive.tree.registry import load_control_nodes

REMEDIES: Mapping[str, str] = {
    "camera_moved": "mount camera and bins as the cell file says, or measure the pose again"
}
"""Advice by the reason of a failure after which all looks mislead, so that no mission can continue."""


def give_advice(case: FailedRun, arm: str, reads: Sequence[Reading]) -> Iterator[str]:
    """Yield advice for a person, the most urgent first.

    Args:
        case: The run.
        arm: State of the arm in words.
        reads: Answers of the cell to the failed skill.
    """
    if arm != "at rest":
        yield f"keep away from the arm until you have seen it stand still: {arm}"
    if case.end.holds:
        content = "what is in it" if case.end.holds == "something" else case.end.holds
        can_resume = case.end.status != "FAILURE"
        resumption = f"to go on with this run leave {content} in the tool; " if can_resume else ""
        yield f"{resumption}take {content} out of the tool before another run"
    else:
        for name in case.timeline.items.find_in_states("held"):
            yield f"find {name} in the cell: the tool released it at the end of the run"
    for reading in reads:
        if reading.raised == Unavailable.__name__:
            yield f"make sure that {reading.name} answers again"
        elif reading.name == "arm.met":
            yield f"find what the arm collided with: {reading.value}"
    if case.is_unrecorded:
        yield "free some space on the disk of the run directory, or name another place with --runs DIR"
    elif case.end.status == "FAULT":
        yield "repair the code or the cell: a fault is never retried"
    if remedy := REMEDIES.get(case.end.reason.rpartition(".")[2]):
        yield remedy
    elif changes := list(_suggest_changes(case)):
        yield f"to let the mission go on after {case.end.reason}: {', or '.join(changes)}"
    for name, item in case.lost.items():
        yield f"look for {name} by hand, {_describe_position(item)}"


def _describe_position(item: ItemTimeline) -> str:
    if item.drop_time is not None and (item.sighting is None or item.sighting.clock < item.drop_time):
        return "below where it was dropped"
    return "around ({:.2f}, {:.2f}) m".format(*item.last_change.position)


def _suggest_changes(case: FailedRun) -> Iterator[str]:
    """Yield changes of the mission with which the failure would not end the run."""
    if not case.links:
        return
    advice = [
        (link, change)
        for link in reversed(case.links)
        if link.model
        for change in link.model.advise(link.failure)
    ]
    handlers = [(link, change) for link, change in advice if link.model and link.model.remedy]
    if handlers:
        yield _add_place(case, *handlers[0])
    else:
        remedy = next(kind.remedy for kind in load_control_nodes().values() if kind.remedy)
        yield f"{remedy} {case.locate(case.links[-1].node)}"
    for link, change in advice:
        if (link, change) not in handlers:
            yield _add_place(case, link, change)
            if link.attempt:
                return


def _add_place(case: FailedRun, link: Link, advice: Advice) -> str:
    """Return advice with the place of the change: option `--set` for a param, else the line of the node."""
    at = node_of(advice.child) if advice.child else link.node
    value = link.node.values.get(advice.key) if isinstance(link.node, InnerNode) else None
    params = case.loaded.mission.params.items() if isinstance(value, Literal) else ()
    name = next((name for name, param in params if param.value.mark == getattr(value, "mark", None)), "")
    return f"{advice.text} {f'with --set {name}=...' if name else f'at {case.locate(at)}'}"
