"""Creation of a diagnosis from timeline, mission and end of a run: failure path, cause and advice."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath

from executive.errors import Interrupted, RecordLost, describe_error
from executive.events import RunEnded
from executive.mission.load import LoadedMission
from executive.record.picture_recorder import find_picture
from executive.record.result import Diagnosis, FailureNode, is_resumable
from executive.record.run_directory import RunDirectory
from executive.record.timeline import Look, Timeline, get_skill_name
from executive.tree.node import ControlNode, PropagatedFailure, load_control_nodes
from executive.tree.specification import Node, Reason, SkillNode, SubtreeNode

CAMERA_ADVICE = "mount camera and bins as the cell file says, or measure the pose again"
"""Advice about a displaced camera, which no change of the mission corrects."""

_TRACEBACK_LINE = re.compile(r'File "([^"]+)", line (\d+), in (\S+)')
"""Pattern of a call in a Python traceback: file, line and function."""


def diagnose(
    timeline: Timeline, end: RunEnded, loaded: LoadedMission, run_folder: Path, is_at_rest: Callable[[], bool]
) -> Diagnosis | None:
    """Return the diagnosis of a run; None if its tree succeeded and no item was lost.

    Args:
        timeline: Timeline of the run.
        end: End of the run.
        loaded: Mission of the run.
        run_folder: Run directory with all pictures of the run.
        is_at_rest: Function that returns True if the arm is at rest; called only after a fault.
    """
    if end.status in ("SUCCESS", "INCOMPLETE"):
        return None
    run = _FailedRun(loaded, timeline, end)
    arm_state = _describe_arm(is_at_rest) if end.status == "FAULT" else "at rest"
    node = run.deciding_node
    is_skill = isinstance(node, SkillNode)
    node_name = run.format_skill_name(end.node) if is_skill else node.path_name if node else ""
    items = timeline.items.find_items_in_states("seen", "dropped", "held")
    # The last line of a traceback is `module.RecordLost: message`.
    is_record_lost = f".{RecordLost.__name__}: " in timeline.traceback
    return Diagnosis(
        status=end.status,
        reason=end.reason,
        clock=end.robot_time,
        mission=loaded.tree.span.source.path,
        verdict=run.describe_cause(),
        node=FailureNode(node.path, node_name, _format_source_location(node)) if node else None,
        item=run.item,
        passed_nodes=[
            FailureNode(entry.node.path, entry.name, _format_source_location(entry.node), entry.explanation)
            for entry in run.failure_path
            if entry.explanation or entry is run.failure_path[-1]
        ],
        last_look=run.find_last_look(),
        lost_items=[timeline.items.histories[name] for name in run.lost_items],
        halted_skills=[run.format_skill_name(path) for path in run.halted_skills],
        unsorted_items=[
            name for name, last in items.items() if name not in run.lost_items and last.label in loaded.routes
        ],
        arm_state=arm_state,
        held_item=end.held_item,
        raised_at=_find_exception_location(timeline.traceback),
        is_recorded=not is_record_lost,
        can_resume=is_resumable(end.status),
        picture=run.find_picture_file(run_folder),
        advice=list(_list_advice(run, arm_state, is_record_lost)),
    )


@dataclass
class _FailurePathNode:
    """Node from which a failure propagated to its parent.

    Attributes:
        node: Node of the mission.
        name: Name of the node with its subtree: `look: retry`.
        explanation: Reason why a control node did not handle the failure; "" for other nodes.
        attempt: Number of the failed attempt and maximum number of attempts; None without attempts.
        changes: Changes of the node after which the failure would not end the run.
        is_handler: True if the changes let the node handle the failure, for instance a `try`.
    """

    node: Node
    name: str
    explanation: str = ""
    attempt: tuple[int, int] | None = None
    changes: Sequence[tuple[str, Node]] = ()
    is_handler: bool = False


class _FailedRun:
    """Mission, timeline and end of a run that did not succeed.

    Attributes:
        failure_path: Nodes from the root to the origin of the failure; empty if no node of the tree failed.
        lost_items: Last changes of the items whose loss made the run fail, by name of the item.
        deciding_activation: Last activation of the node that determined the status, or None.
        deciding_node: Node of the mission that determined the status, or None.
        halted_skills: Paths of the skills that the end of the run or `deciding_node` halted.
        item: Name of the item of `deciding_node`, else of a halted skill, else of the first lost item, or "".
    """

    def __init__(self, loaded: LoadedMission, timeline: Timeline, end: RunEnded) -> None:
        self.loaded = loaded
        self.timeline = timeline
        self.end = end
        is_failure = end.status == "FAILURE"
        nodes = _find_nodes_on_path(loaded.tree, end.node)
        self.failure_path = _trace_failure(nodes, timeline, end) if is_failure else []
        # Lost items make a run fail after its tree has succeeded; then no node determined the status.
        self.lost_items = {
            name: last
            for name, last in timeline.items.changes.items()
            if is_failure and not end.node and last.state == "lost"
        }
        self.deciding_activation = timeline.activation_by_path.get(end.node)
        self.deciding_node = nodes[-1] if nodes else None
        self.halted_skills = timeline.halted_skills
        if is_failure:
            self.halted_skills = self.deciding_activation.halted_skills if self.deciding_activation else ()
        activations = [self.deciding_activation, *map(timeline.activation_by_path.get, self.halted_skills)]
        items = [activation.item for activation in activations if activation is not None and activation.item]
        self.item = next(iter([*items, *self.lost_items]), "")

    def format_skill_name(self, path: str) -> str:
        """Return the name of a skill with the item of its last activation: `Grasp of cube-1`."""
        last = self.timeline.activation_by_path.get(path)
        return get_skill_name(path) + (f" of {last.item}" if last is not None and last.item else "")

    def describe_cause(self) -> str:
        """Return a sentence with the cause of the end: lost items, or skill, attempt and message."""
        end = self.end
        skills = " and ".join(map(self.format_skill_name, self.halted_skills))
        skills_text = f" during {skills}" if skills else ""
        if end.status == "HALTED":
            return end.message + (" while the operator was asked" if self.timeline.question else skills_text)
        if names := list(self.lost_items):
            subject = "object was" if len(names) == 1 else "objects were"
            return f"{len(names)} {subject} lost: {', '.join(names)}"
        if not self.failure_path:
            return end.message
        attempts = (entry.attempt for entry in reversed(self.failure_path) if entry.attempt)
        attempt, max_attempts = next(attempts, (1, 1))
        attempt_text = f" on attempt {attempt} of {max_attempts}" if attempt > 1 else ""
        if attempt == max_attempts > 1:
            attempt_text = f" on the last of {max_attempts} attempts"
        if isinstance(self.deciding_node, SkillNode):
            reason = end.reason.rpartition(".")[2]
            return f"{self.format_skill_name(end.node)} failed ({reason}){attempt_text}: {end.message}"
        return f"{self.failure_path[-1].name}{attempt_text}: {end.message}{skills_text}"

    def find_last_look(self) -> Look | None:
        """Return the last look in which `item` was detected; without such a look, the last look."""
        items = self.timeline.items
        history = items.histories.get(self.item)
        if history is None or history.look is None:
            return items.look
        return replace(history.look, attempts=items.changes[self.item].attempts)

    def find_picture_file(self, run_folder: Path) -> str:
        """Return the path in `run_folder` of the picture of the failure or of the last selection, or ""."""
        failed = self.timeline.failures.get(self.item) if self.lost_items else self.deciding_activation
        folder = RunDirectory(run_folder).pictures
        file = find_picture(folder, self.item, failed.reason if failed is not None else "")
        file = file or find_picture(folder, self.item, "")
        return f"{folder.name}/{file.name}" if file else ""


def _find_nodes_on_path(tree: Node, path: str) -> list[Node]:
    """Return the nodes from the root to the node at `path`, or [] if no node has this path.

    If a subtree and its body have this path, both are returned, the body last.
    """
    for child in tree.children:
        if nodes := _find_nodes_on_path(child, path):
            return [tree, *nodes]
    return [tree] if tree.path == path else []


def _trace_failure(nodes: Sequence[Node], timeline: Timeline, end: RunEnded) -> list[_FailurePathNode]:
    """Return the path of the failure through the nodes from the root to the origin at `end.node`."""
    skill_or_label, _, reason = end.reason.rpartition(".")
    # For the ancestors of a node with a label, the failure may also have the name `label.reason`.
    reasons = {Reason(skill_or_label, reason)}
    failure_path: list[_FailurePathNode] = []
    for index, node in reversed(list(enumerate(nodes))):
        subtrees = [ancestor.name for ancestor in nodes[:index] if isinstance(ancestor, SubtreeNode)]
        entry = _FailurePathNode(node, f"{subtrees[-1]}: {node.path_name}" if subtrees else node.path_name)
        activation = timeline.activation_by_path.get(node.path)
        if isinstance(node, ControlNode) and activation is not None:
            failed_node = failure_path[-1].node if failure_path else None
            failure = PropagatedFailure(
                child=failed_node if failed_node in node.children else None,
                name=activation.reason, reasons=frozenset(reasons),
                handled_counts=activation.handled_counts, last_messages=activation.message_by_reason,
                last_handled_name=activation.last_handled_reason, last_choice=activation.choice,
                duration=activation.end - activation.start,
            )  # fmt: skip
            entry.explanation = node.explain(failure) if failure.child else ""
            entry.attempt = node.count_attempts(failure)
            entry.changes = list(node.advise(failure))
            entry.is_handler = bool(node.remedy)
        failure_path.append(entry)
        reasons |= {Reason(node.label, reason)} if node.label else set()
    return failure_path[::-1]


def _format_source_location(node: Node) -> str:
    """Return file and line of a node: `missions/sort.yaml:12`."""
    return f"{node.span.source.path}:{node.span.line}"


def _describe_arm(is_at_rest: Callable[[], bool]) -> str:
    try:
        return "at rest" if is_at_rest() else "it is not at rest after the command to brake"
    except Interrupted:
        raise
    except BaseException as error:
        # A broken arm may raise an exception.
        return f"the state of the arm cannot be read ({describe_error(error)})"


def _find_exception_location(traceback: str) -> str:
    """Return the source location of the first exception: `skills/grasp.py:45, in run`; "" if unknown."""
    cause = traceback.partition("\nThe above exception was the direct cause")[0]
    # The caller of `Skill.failure`, or the line that a signal interrupts, is more informative.
    omitted_files = ("executive/skill.py", "executive/run/operator.py")
    calls = [call for call in _TRACEBACK_LINE.findall(cause) if not call[0].endswith(omitted_files)]
    if not calls:
        return ""
    file, line, function = calls[-1]
    return f"{'/'.join(PurePath(file).parts[-2:])}:{line}, in {function}"


def _list_advice(run: _FailedRun, arm_state: str, is_record_lost: bool) -> Iterator[str]:
    """Yield sentences with advice, the most urgent first."""
    end = run.end
    if arm_state != "at rest":
        yield f"keep away from the arm until you have seen it stand still: {arm_state}"
    if end.held_item:
        object_name = "the object" if end.held_item == "something" else end.held_item
        can_resume = end.status != "FAILURE"
        resume_advice = f"to resume this run, leave {object_name} in the tool; " if can_resume else ""
        yield f"{resume_advice}take {object_name} out of the tool before a new run"
    else:
        for name in run.timeline.items.find_items_in_states("held"):
            yield f"find {name} in the cell: the tool released it at the end of the run"
    if is_record_lost:
        yield "free some space on the disk of the run directory, or name another folder with --runs DIR"
    elif end.status == "FAULT":
        yield "repair the code or the cell: a fault is never retried"
    if end.reason.endswith(".camera_moved"):
        yield CAMERA_ADVICE
    elif run.failure_path:
        yield f"to let the mission continue after {end.reason}: {', or '.join(_list_changes(run))}"
    for name, last in run.lost_items.items():
        place = "around ({:.2f}, {:.2f}) m".format(*last.position)
        history = run.timeline.items.histories[name]
        dropped_at = history.dropped_at
        if dropped_at is not None and (history.look is None or history.look.clock < dropped_at):
            place = "below the place where it was dropped"
        yield f"look for {name} by hand, {place}"


def _list_changes(run: _FailedRun) -> Iterator[str]:
    """Yield changes of the mission after which the failure would not end the run."""
    entries = reversed(run.failure_path)
    changes = [(entry, *change) for entry in entries for change in entry.changes]
    texts = [(entry, f"{text} at {_format_location(run, node)}") for entry, text, node in changes]
    remedies = (node.remedy for node in load_control_nodes().values() if node.remedy)
    new_handler = f"{next(remedies)} {_format_location(run, run.failure_path[-1].node)}"
    yield next((text for entry, text in texts if entry.is_handler), new_handler)
    for entry, text in texts:
        if not entry.is_handler:
            yield text
            # Changes of ancestors are omitted: the innermost node with attempts should be changed first.
            if entry.attempt:
                return


def _format_location(run: _FailedRun, node: Node) -> str:
    """Return the location of a node: the line number, and the file name if it is not the mission file."""
    return node.span.describe_place(run.loaded.tree.span.source)
