"""Advice to a person after a run that did not succeed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from executive.errors import Unavailable
from executive.mission.model.instance import get_mission_node
from executive.mission.model.nodes import InnerNode
from executive.mission.model.values import Literal
from executive.record.diagnosis.failed_run import FailedRun
from executive.record.diagnosis.failure_path import FailurePathNode
from executive.record.timeline.activation import Reading
from executive.record.timeline.items import ItemHistory
from executive.tree.inspection import Advice
from executive.tree.node_registry import load_control_nodes

REMEDY_BY_REASON: Mapping[str, str] = {
    "camera_moved": "mount camera and bins as the cell file says, or measure the pose again"
}
"""Advice by the reason of a failure that makes all positions from the camera wrong."""


def list_advice(run: FailedRun, arm: str, reads: Sequence[Reading]) -> Iterator[str]:
    """Yield advice in sentences, the most urgent first.

    Args:
        run: The run.
        arm: State of the arm as text, `at rest` if it is at rest.
        reads: Inputs that the failed skill read from the cell.
    """
    if arm != "at rest":
        yield f"keep away from the arm until you have seen it stand still: {arm}"
    if run.end.held_item:
        content = "the object" if run.end.held_item == "something" else run.end.held_item
        can_resume = run.end.status != "FAILURE"
        resumption = f"to resume this run, leave {content} in the tool; " if can_resume else ""
        yield f"{resumption}take {content} out of the tool before a new run"
    else:
        for name in run.timeline.items.find_items_in_states("held"):
            yield f"find {name} in the cell: the tool released it at the end of the run"
    for reading in reads:
        if reading.raised == Unavailable.__name__:
            yield f"make sure that {reading.name} answers again"
        elif reading.name == "arm.met":
            yield f"find what the arm collided with: {reading.value}"
    if run.is_record_lost:
        yield "free some space on the disk of the run directory, or name another folder with --runs DIR"
    elif run.end.status == "FAULT":
        yield "repair the code or the cell: a fault is never retried"
    if remedy := REMEDY_BY_REASON.get(run.end.reason.rpartition(".")[2]):
        yield remedy
    elif changes := list(_list_changes(run)):
        yield f"to let the mission continue after {run.end.reason}: {', or '.join(changes)}"
    for name, item in run.lost_items.items():
        yield f"look for {name} by hand, {_describe_position(item)}"


def _describe_position(item: ItemHistory) -> str:
    if item.drop_time is not None and (item.sighting is None or item.sighting.clock < item.drop_time):
        return "below the place where it was dropped"
    return "around ({:.2f}, {:.2f}) m".format(*item.last_change.position)


def _list_changes(run: FailedRun) -> Iterator[str]:
    """Yield changes of the mission after which the failure would not end the run."""
    if not run.failure_path:
        return
    advice = [
        (entry, change)
        for entry in reversed(run.failure_path)
        if entry.model
        for change in entry.model.advise(entry.failure)
    ]
    handlers = [(entry, change) for entry, change in advice if entry.model and entry.model.remedy]
    if handlers:
        yield _format_advice(run, *handlers[0])
    else:
        remedy = next(kind.remedy for kind in load_control_nodes().values() if kind.remedy)
        yield f"{remedy} {run.format_place(run.failure_path[-1].node)}"
    for entry, change in advice:
        if (entry, change) not in handlers:
            yield _format_advice(run, entry, change)
            if entry.attempt:
                return


def _format_advice(run: FailedRun, entry: FailurePathNode, advice: Advice) -> str:
    """Return advice with the place of the change: option `--set` for a param, else the line of the node."""
    changed_node = get_mission_node(advice.child) if advice.child else entry.node
    value = entry.node.values.get(advice.key) if isinstance(entry.node, InnerNode) else None
    params = run.loaded.mission.params.items() if isinstance(value, Literal) else ()
    name = next((name for name, param in params if param.value.span == getattr(value, "span", None)), "")
    return f"{advice.text} {f'with --set {name}=...' if name else f'at {run.format_place(changed_node)}'}"
