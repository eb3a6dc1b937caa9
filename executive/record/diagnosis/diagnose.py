"""Creation of a diagnosis from timeline, mission and end of a run."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path, PurePath

from executive.events import RunEnded
from executive.mission.load import LoadedMission
from executive.mission.model.nodes import Node, SkillNode
from executive.record.diagnosis.advice import list_advice
from executive.record.diagnosis.diagnosis import DecidingNode, Diagnosis, FailureNode, ItemFailure, LostItem
from executive.record.diagnosis.failed_run import FailedRun, describe_cause
from executive.record.picture_recorder import find_picture
from executive.record.result import is_resumable
from executive.record.run_directory import RunDirectory
from executive.record.timeline.activation import Reading, get_skill_name
from executive.record.timeline.items import ItemHistory, Look, Sighting
from executive.record.timeline.timeline import Timeline
from executive.skill import Skill

DECIDING_INPUTS: Mapping[str, tuple[str, ...]] = {
    "arm": ("arm.met",),  # Recorded name of `arm.collision`.
    "tool": ("tool.holding", "tool.touching", "tool.bears"),  # `bears` is the name of `holding_force`.
    "camera": ("camera.sees_table",),
}
"""Inputs that decide whether a skill succeeds, by the part of the cell that the skill `uses`."""

_TRACEBACK_LINE = re.compile(r'File "(?P<file>[^"]+)", line (?P<line>\d+), in (?P<function>\S+)')
"""Pattern of the source location of a function call in a Python traceback."""

_SKILL_MODULE = "executive/skill.py"
"""End of the path of the module that defines `Skill`."""

_CAUSE_SEPARATOR = "\nThe above exception was the direct cause"
"""Text that Python prints between an exception and the exception that it caused."""


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
    run = FailedRun(loaded, timeline, end)
    arm_state = _describe_arm(is_at_rest) if end.status == "FAULT" else "at rest"
    readings = list(_list_deciding_readings(run, loaded.skills))
    journal = RunDirectory(run_folder).journal
    has_journal = journal.exists() and journal.stat().st_size > 0
    items = timeline.items.find_items_in_states("seen", "dropped", "held")
    labels = {name: item.last_change.label for name, item in items.items() if name not in run.lost_items}
    return Diagnosis(
        status=end.status,
        reason=end.reason,
        clock=end.robot_time,
        mission=loaded.tree.span.source.path,
        verdict=describe_cause(run),
        node=_make_deciding_node(run),
        item=run.item,
        passed_nodes=[
            FailureNode(entry.node.path, entry.name, _format_source_location(entry.node), entry.explanation)
            for entry in run.failure_path
            if entry.explanation or entry is run.failure_path[-1]
        ],
        readings=readings,
        last_look=_find_last_look(run),
        lost_items=[_make_lost_item(name, item) for name, item in run.lost_items.items()],
        halted_skills=[run.format_skill_name(path) for path in run.halted_skills],
        unsorted_items=[name for name, label in labels.items() if label in loaded.routes],
        arm_state=arm_state,
        held_item=end.held_item,
        raised_at=_find_exception_location(timeline.traceback),
        is_recorded=not run.is_record_lost,
        can_resume=is_resumable(end.status) and (not run.is_record_lost or has_journal),
        picture=_find_picture_file(run, run_folder),
        advice=list(list_advice(run, arm_state, readings)),
    )


def _list_deciding_readings(run: FailedRun, skills: Mapping[str, type[Skill]]) -> Iterator[Reading]:
    """Yield the inputs that explain the failure of a skill, the latest first.

    If inputs raised exceptions in the last control step of the skill, only these inputs are yielded.
    """
    node, activation = run.deciding_node, run.deciding_activation
    if activation is None or not isinstance(node, SkillNode):
        return
    exceptions = [each for each in activation.readings if each.raised and each.tick == activation.end_tick]
    names = [name for part in skills[node.skill].uses for name in DECIDING_INPUTS.get(part, ())]
    values = [each for each in activation.readings if each.name in names and not each.raised]
    yield from reversed(exceptions or values)


def _make_deciding_node(run: FailedRun) -> DecidingNode | None:
    node = run.deciding_node
    if node is None:
        return None
    name = run.format_skill_name(node.path) if isinstance(node, SkillNode) else node.path_name
    return DecidingNode(node.path, name, _format_source_location(node))


def _format_source_location(node: Node) -> str:
    """Return file and line of a node: `missions/sort.yaml:12`."""
    return f"{node.span.source.path}:{node.span.line}"


def _find_last_look(run: FailedRun) -> Sighting | Look | None:
    """Return the last look in which `run.item` was detected; without such a look, the last look."""
    item = run.timeline.items.by_name.get(run.item)
    if item is None or item.sighting is None:
        return run.timeline.items.look
    return replace(item.sighting, attempts=item.last_change.attempts)


def _make_lost_item(name: str, item: ItemHistory) -> LostItem:
    activation, failure = item.failure, None
    if activation is not None:
        failure_name = f"{get_skill_name(activation.node)}.{activation.reason}"
        failure = ItemFailure(failure_name, activation.message, activation.end)
    return LostItem(name, item.sighting, item.unseen_look_count, item.pick_time, item.drop_time, failure)


def _find_picture_file(run: FailedRun, run_folder: Path) -> str:
    """Return the path of the picture of the failure, else of the last selection of the item, else ""."""
    reason = run.end.reason.rpartition(".")[2] if run.end.status == "FAILURE" else ""
    item = run.timeline.items.by_name.get(run.item)
    if run.lost_items and item is not None and item.failure is not None:
        reason = item.failure.reason
    folder = RunDirectory(run_folder).pictures
    file = find_picture(folder, run.item, reason) or find_picture(folder, run.item, "")
    return file.relative_to(run_folder).as_posix() if file else ""


def _describe_arm(is_at_rest: Callable[[], bool]) -> str:
    try:
        return "at rest" if is_at_rest() else "it is not at rest after the command to brake"
    except Exception as error:
        # A broken arm may raise an exception.
        return f"the state of the arm cannot be read ({type(error).__name__}: {error})"


def _find_exception_location(traceback: str) -> str:
    """Return the source location of the first exception: `skills/grasp.py:45, in run`; "" if unknown."""
    cause = traceback.rpartition(_CAUSE_SEPARATOR)[0] or traceback
    calls = [match.group("file", "line", "function") for match in _TRACEBACK_LINE.finditer(cause)]
    if len(calls) > 1 and calls[-1][0].endswith(_SKILL_MODULE) and calls[-1][2] == Skill.failure.__name__:
        calls.pop()  # The caller of `Skill.failure` is more informative.
    if not calls:
        return ""
    file, line, function = calls[-1]
    return f"{'/'.join(PurePath(file).parts[-2:])}:{line}, in {function}"
