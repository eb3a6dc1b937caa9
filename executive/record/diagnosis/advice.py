"""Advice to a person after a run that did not succeed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from executive.errors import Unavailable
from executive.mission.model.instance import get_mission_node
from executive.mission.model.nodes import InnerNode
from executive.mission.model.values import Literal
from executive.record.diagnosis.failed_run import FailedRun, FailurePathNode
from executive.record.timeline.activation import Reading
from executive.record.timeline.items import ItemHistory
from executive.tree.inspection import Advice
from executive.tree.node_registry import load_control_nodes

REMEDY_BY_REASON: Mapping[str, str] = {
    "camera_moved": "mount camera and bins as the cell file says, or measure the pose again"
}
"""Advice about failures that no change of the mission prevents, by reason of the failure."""


def list_advice(run: FailedRun, arm_state: str, readings: Sequence[Reading]) -> Iterator[str]:
    """Yield sentences with advice, the most urgent first.

    `arm_state` is `at rest` or a text about the arm; `readings` are the inputs that the failed skill read.
    """
    if arm_state != "at rest":
        yield f"keep away from the arm until you have seen it stand still: {arm_state}"
    if run.end.held_item:
        object_name = "the object" if run.end.held_item == "something" else run.end.held_item
        can_resume = run.end.status != "FAILURE"
        resume_advice = f"to resume this run, leave {object_name} in the tool; " if can_resume else ""
        yield f"{resume_advice}take {object_name} out of the tool before a new run"
    else:
        for name in run.timeline.items.find_items_in_states("held"):
            yield f"find {name} in the cell: the tool released it at the end of the run"
    for reading in readings:
        if reading.raised == Unavailable.__name__:
            yield f"make sure that {reading.name} answers again"
        elif reading.name == "arm.met":  # Recorded name of `arm.collision`.
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
    """Return the probable place of a lost item as text."""
    if item.drop_time is not None and (item.sighting is None or item.sighting.clock < item.drop_time):
        return "below the place where it was dropped"
    return "around ({:.2f}, {:.2f}) m".format(*item.last_change.position)


def _list_changes(run: FailedRun) -> Iterator[str]:
    """Yield changes of the mission after which the failure would not end the run."""
    if not run.failure_path:
        return
    # Only control nodes that can handle a failure have a `remedy`, for instance `try`.
    changes = [
        (bool(entry.control_node.remedy), entry, advice)
        for entry in reversed(run.failure_path)
        if entry.control_node
        for advice in entry.control_node.advise(entry.failure)
    ]
    handler_change = next(((entry, advice) for is_handler, entry, advice in changes if is_handler), None)
    if handler_change:
        yield _format_advice(run, *handler_change)
    else:
        remedy = next(node.remedy for node in load_control_nodes().values() if node.remedy)
        yield f"{remedy} {run.format_location(run.failure_path[-1].node)}"
    for is_handler, entry, advice in changes:
        if not is_handler:
            yield _format_advice(run, entry, advice)
            # Changes of ancestors are omitted: the innermost node with attempts should be changed first.
            if entry.attempt:
                return


def _format_advice(run: FailedRun, entry: FailurePathNode, advice: Advice) -> str:
    """Return advice with the place of the change: option `--set` for a param, else the line of the node."""
    changed_node = get_mission_node(advice.child) if advice.child else entry.node
    value = entry.node.values.get(advice.key) if isinstance(entry.node, InnerNode) else None
    params = run.loaded.mission.params.items() if isinstance(value, Literal) else ()
    # If a value comes from a param, its span is the span of the value of the param.
    name = next((name for name, param in params if param.value.span == getattr(value, "span", None)), "")
    return f"{advice.text} {f'with --set {name}=...' if name else f'at {run.format_location(changed_node)}'}"
