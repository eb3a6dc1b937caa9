"""Advice after a run that did not succeed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from executive.errors import Unavailable
from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.mission.model.values import Value
from executive.record.diagnosis.case import Case
from executive.record.diagnosis.chain import attempts, constant
from executive.record.timeline.activation import Reading
from executive.record.timeline.items import ItemTimeline

REMEDIES: Mapping[str, str] = {
    "camera_moved": "mount camera and bins as the cell file says, or measure the pose again"
}
"""Advice by the reason of a failure after which no mission can go on: every further look would mislead it."""


def advice(case: Case, arm: str, reads: Sequence[Reading]) -> Iterator[str]:
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


def _ways_on(case: Case) -> Iterator[str]:
    """Yield what the mission would have to say for this failure not to end it."""
    if not case.links:
        return
    tries = [link for link in case.links if isinstance(link.node, nodes.TryNode)]
    passed_by = [link.node for link in tries if link.below is getattr(link.node, "do", None)]
    if passed_by:
        yield f"catch it in the try at {case.place(passed_by[-1])}"
    else:
        yield f"put a try with a catch for it around {case.place(case.links[-1].node)}"
    for link in reversed(case.links):
        node = link.node
        if isinstance(node, nodes.TimeoutNode) and link.below is None:
            yield f"allow more than {constant(node.seconds):g} s {_where(case, node, node.seconds)}"
        elif isinstance(node, nodes.RetryNode) and link.gave_up:
            assert node.recover is not None
            yield f"deal with {link.ran.last_handled} in the recovery at {case.place(node.recover)}"
            return
        elif isinstance(node, nodes.RetryNode) and (link.catches(node.on) or not node.on):
            attempt, most = attempts(link)
            if attempt == most:
                yield f"allow more than {most} attempt{'s' * (most > 1)} {_where(case, node, node.attempts)}"
            return


def _where(case: Case, node: Node, value: Value) -> str:
    """Return where a number can be changed: on the command line if it is a param, else in the file."""
    params = case.loaded.mission.params.items()
    name = next((name for name, param in params if param.value.mark == value.mark), "")
    return f"with --set {name}=..." if name else f"at {case.place(node)}"
