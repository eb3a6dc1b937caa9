"""Story of a run that did not succeed: why, with what numbers, and what can be done now."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.cell.plain import plain
from executive.events import RunEnded, TimedEvent
from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.mission.model.paths import name_of
from executive.record.diagnosis.advice import advice
from executive.record.diagnosis.case import Case, verdict
from executive.record.diagnosis.chain import why
from executive.record.diagnosis.course import Course, Sense
from executive.record.diagnosis.items import ItemCourse
from executive.record.entry import old_event
from executive.record.frames import picture_of
from executive.record.result import ENDED
from executive.record.run_directory import RunDirectory

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission
    from executive.skill import Skill

DECIDING: Mapping[str, tuple[str, ...]] = {
    "arm": ("arm.met",),
    "tool": ("tool.holding", "tool.touching", "tool.bears"),
    "camera": ("camera.sees_table",),
}
"""What a skill that `uses` a part reads to find out whether it has succeeded."""


class Story:
    """Follows a run, and tells in the end why it did not succeed; an observer.

    Args:
        loaded: The mission.
        skills: Installed skills by name.
    """

    def __init__(self, loaded: LoadedMission, skills: Mapping[str, type[Skill]]) -> None:
        self._loaded = loaded
        self._skills = skills
        self._course = Course()

    def __call__(self, timed: TimedEvent) -> None:
        """Take an event."""
        self._course(old_event(timed))

    def tell(self, outcome: RunEnded, run: Path, at_rest: Callable[[], bool]) -> dict[str, Any] | None:
        """Return the story as plain values, or None for a run whose tree succeeded and that lost nothing.

        Args:
            outcome: How the run ended.
            run: Its directory, with all its pictures.
            at_rest: Asks the arm whether it is; called only after a fault, for else it is known to be.

        Returns:
            * `status`, `reason`, `clock` [s], `mission`, its file, and `verdict`, one sentence that says it.
            * `node`: the one that decided, as `path`, `name` and `place` in the mission; None where none did.
            * `item`: what it was about, or "".
            * `chain`: the nodes that passed a failure on, from the root, as `node` and with `why`.
            * `reads`: what the cell had answered to the skill that failed, the latest first, as `name`,
              `value`, `raised` (name of the exception whose text is the value), `tick` and `clock` [s].
            * `look`: how the item was seen last, and as `attempts` how often it was missed or dropped; or the
              last look at all, with the number of boxes `found`; None before the first.
            * `lost`: what is known of every lost item: `item`, how it was seen last as `look`, the number of
              looks since then as `unseen`, when it was `held` and `dropped` [s], and what `failed` with it.
            * `running`: the skills that were halted, in words. `left`: items that were not dealt with.
            * `arm`: `at rest`, or in words what is not known. `holds`: what is in the tool, or "".
            * `raised_at`: file, line and function where the exception behind a fault was raised, or "".
            * `recorded`: whether the journal has everything, and `resumes`: whether it can be taken up again.
            * `picture`: a file below `run`, or "".
            * `next`: what can be done now, in sentences.
        """
        if outcome.status in ("SUCCESS", "INCOMPLETE"):
            return None
        case = Case(self._loaded, self._course, outcome)
        arm = _arm(at_rest) if outcome.status == "FAULT" else "at rest"
        reads = list(self._reads(case))
        recorded, journal = not case.course.unrecorded, RunDirectory(run).journal
        begun = journal.exists() and journal.stat().st_size > 0
        told = {
            "status": outcome.status,
            "reason": outcome.reason,
            "clock": outcome.robot_time,
            "mission": self._loaded.tree.mark.source.path,
            "verdict": verdict(case),
            "node": _node(case),
            "item": case.item,
            "chain": [
                {"path": link.node.path, "name": link.name, "place": _place(link.node), "why": why(link)}
                for link in case.links
                if not isinstance(link.node, nodes.UseNode | nodes.SequenceNode)
            ],
            "reads": [asdict(sense) for sense in reads],
            "look": _look(case),
            "lost": [_lost(name, item) for name, item in case.lost.items()],
            "running": [case.named(path) for path in case.running],
            "left": [name for name in case.course.items.open(self._loaded.routes) if name not in case.lost],
            "arm": arm,
            "holds": outcome.holds,
            "raised_at": case.course.raised_at,
            "recorded": recorded,
            "resumes": outcome.status not in ENDED and (recorded or begun),
            "picture": _picture(case, run),
            "next": list(advice(case, arm, reads)),
        }
        return {key: plain(value) for key, value in told.items()}

    def _reads(self, case: Case) -> Iterator[Sense]:
        """Yield what the cell refused the deciding skill, or else what it may have read, the latest first."""
        node, ran = case.node, case.decided
        if ran is None or not isinstance(node, nodes.SkillNode):
            return
        refused = [sense for sense in ran.senses if sense.raised and sense.tick == ran.tick]
        names = [name for part in self._skills[node.skill].uses for name in DECIDING.get(part, ())]
        read = [sense for sense in ran.senses if sense.name in names and not sense.raised]
        yield from reversed(refused or read)


def _node(case: Case) -> dict[str, str] | None:
    node = case.node
    if node is None:
        return None
    name = case.named(node.path) if isinstance(node, nodes.SkillNode) else name_of(node)
    return {"path": node.path, "name": name, "place": _place(node)}


def _place(node: Node) -> str:
    return f"{node.mark.source.path}:{node.mark.line}"


def _look(case: Case) -> dict[str, Any] | None:
    item = case.course.items.items.get(case.item)
    if item is None or item.look is None:
        return case.course.items.last_look
    return {"item": case.item, "attempts": item.row.get("attempts", 0), **item.look}


def _lost(name: str, item: ItemCourse) -> dict[str, Any]:
    what, message, clock = item.failed or ("", "", 0.0)
    failed = {"what": what, "message": message, "clock": clock} if what else None
    known = {key: getattr(item, key) for key in ("look", "unseen", "held", "dropped")}
    return {"item": name, **known, "failed": failed}


def _picture(case: Case, run: Path) -> str:
    """Return the picture of the failure, or else of what was decided on the item last."""
    reason = case.outcome.reason if case.outcome.status == "FAILURE" else ""
    item = case.course.items.items.get(case.item)
    if case.lost and item is not None and item.failed is not None:
        reason = item.failed[0]
    for about in dict.fromkeys([(case.item, reason.rpartition(".")[2]), (case.item, "")]):
        file = picture_of(run / "frames", *about)
        if file is not None:
            return file.relative_to(run).as_posix()
    return ""


def _arm(at_rest: Callable[[], bool]) -> str:
    try:
        return "at rest" if at_rest() else "it was told to brake and is not at rest"
    except Exception as error:
        # The arm may be what is broken.
        return f"it does not say whether it is at rest ({type(error).__name__}: {error})"
