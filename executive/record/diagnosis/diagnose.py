"""Diagnosis of a run from its timeline, its mission and its end."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from executive.events import RunEnded
from executive.mission.model.nodes import Node, SkillNode
from executive.mission.model.paths import name_of
from executive.record.diagnosis.advice import give_advice
from executive.record.diagnosis.case import FailedRun, verdict
from executive.record.diagnosis.diagnosis import DecidingNode, Diagnosis, ItemFailure, LostItem, PassedNode
from executive.record.picture_recorder import find_picture
from executive.record.result import FINAL_STATUSES
from executive.record.run_directory import RunDirectory
from executive.record.timeline.activation import Reading, to_skill_name
from executive.record.timeline.items import ItemTimeline, Look, Sighting
from executive.record.timeline.timeline import Timeline
from executive.skill import Skill

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission

DECIDING_INPUTS: Mapping[str, tuple[str, ...]] = {
    "arm": ("arm.met",),
    "tool": ("tool.holding", "tool.touching", "tool.bears"),
    "camera": ("camera.sees_table",),
}
"""Inputs from which a skill that `uses` a part concludes whether it has succeeded."""

_PLACE = re.compile(r'File "(?P<file>[^"]+)", line (?P<line>\d+), in (?P<function>\S+)')
_SKILL = "executive/skill.py"
_CAUSED = "\nThe above exception was the direct cause"


def diagnose(
    timeline: Timeline,
    end: RunEnded,
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    run: Path,
    is_at_rest: Callable[[], bool],
) -> Diagnosis | None:
    """Return the diagnosis of a run; None if its tree succeeded and no item was lost.

    Args:
        timeline: Timeline of the run.
        end: End of the run.
        loaded: The mission.
        skills: Installed skills by name.
        run: The run directory with all its pictures.
        is_at_rest: Function that reads the state of the arm; called only after a fault, because after any
            other end the arm is at rest.
    """
    if end.status in ("SUCCESS", "INCOMPLETE"):
        return None
    case = FailedRun(loaded, timeline, end)
    arm = _state_of_arm(is_at_rest) if end.status == "FAULT" else "at rest"
    reads = list(_deciding_reads(case, skills))
    journal = RunDirectory(run).journal
    has_begun = journal.exists() and journal.stat().st_size > 0
    unfinished = timeline.items.find_in_states("seen", "dropped", "held")
    left = {name: item for name, item in unfinished.items() if name not in case.lost}
    return Diagnosis(
        status=end.status,
        reason=end.reason,
        clock=end.robot_time,
        mission=loaded.tree.mark.source.path,
        verdict=verdict(case),
        node=_deciding_node(case),
        item=case.item,
        chain=[
            PassedNode(link.node.path, link.name, _place(link.node), link.why)
            for link in case.links
            if link.why or link is case.links[-1]
        ],
        reads=reads,
        look=_last_look(case),
        lost=[_lost_item(name, item) for name, item in case.lost.items()],
        running=[case.name_skill(path) for path in case.running],
        left=[name for name, item in left.items() if item.last_change.label in loaded.routes],
        arm=arm,
        holds=end.holds,
        raised_at=_place_of_exception(timeline.traceback),
        recorded=not case.is_unrecorded,
        resumes=end.status not in FINAL_STATUSES and (not case.is_unrecorded or has_begun),
        picture=_picture(case, run),
        next=list(give_advice(case, arm, reads)),
    )


def _deciding_reads(case: FailedRun, skills: Mapping[str, type[Skill]]) -> Iterator[Reading]:
    """Yield exceptions of the cell in the failed skill, or else its deciding inputs, the latest first."""
    node, ran = case.node, case.decided
    if ran is None or not isinstance(node, SkillNode):
        return
    raised = [reading for reading in ran.readings if reading.raised and reading.tick == ran.end_tick]
    names = [name for part in skills[node.skill].uses for name in DECIDING_INPUTS.get(part, ())]
    read = [reading for reading in ran.readings if reading.name in names and not reading.raised]
    yield from reversed(raised or read)


def _deciding_node(case: FailedRun) -> DecidingNode | None:
    node = case.node
    if node is None:
        return None
    name = case.name_skill(node.path) if isinstance(node, SkillNode) else name_of(node)
    return DecidingNode(node.path, name, _place(node))


def _place(node: Node) -> str:
    return f"{node.mark.source.path}:{node.mark.line}"


def _last_look(case: FailedRun) -> Sighting | Look | None:
    item = case.timeline.items.by_name.get(case.item)
    if item is None or item.sighting is None:
        return case.timeline.items.look
    return replace(item.sighting, attempts=item.last_change.attempts)


def _lost_item(name: str, item: ItemTimeline) -> LostItem:
    failure, failed = item.failure, None
    if failure is not None:
        failed = ItemFailure(f"{to_skill_name(failure.node)}.{failure.reason}", failure.message, failure.end)
    return LostItem(name, item.sighting, item.unseen_look_count, item.pick_time, item.drop_time, failed)


def _picture(case: FailedRun, run: Path) -> str:
    """Return the file of the picture of the failure, or else of the last selection of the item."""
    reason = case.end.reason.rpartition(".")[2] if case.end.status == "FAILURE" else ""
    item = case.timeline.items.by_name.get(case.item)
    if case.lost and item is not None and item.failure is not None:
        reason = item.failure.reason
    for picture_reason in dict.fromkeys([reason, ""]):
        file = find_picture(run / "frames", case.item, picture_reason)
        if file is not None:
            return file.relative_to(run).as_posix()
    return ""


def _state_of_arm(is_at_rest: Callable[[], bool]) -> str:
    try:
        return "at rest" if is_at_rest() else "it was commanded to brake and is not at rest"
    except Exception as error:
        # A broken arm may raise an exception.
        return f"it does not say whether it is at rest ({type(error).__name__}: {error})"


def _place_of_exception(traceback: str) -> str:
    """Return the place at which the first exception was raised: `skills/grasp.py:45, in run`; "" if none."""
    cause, _, last_part = traceback.rpartition(_CAUSED)
    places = [place.group("file", "line", "function") for place in _PLACE.finditer(cause or last_part)]
    if len(places) > 1 and places[-1][0].endswith(_SKILL) and places[-1][2] == Skill.failure.__name__:
        places.pop()  # The caller in the skill is more informative.
    if not places:
        return ""
    file, line, function = places[-1]
    return f"{'/'.join(PurePath(file).parts[-2:])}:{line}, in {function}"
