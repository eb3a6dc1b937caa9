"""List of all single faults of a mission, made from its tree and the declarations of its skills."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from executive.campaign.faults.fault import PlannedFault, SkillFault, When
from executive.campaign.faults.rehearsal import Rehearsal
from executive.campaign.subject import Subject
from executive.cell.config import TableConfig
from executive.cell.objects import Target
from executive.mission.model import nodes
from executive.skill import HOLDING, Skill
from executive.testing import faults as effects
from executive.testing.conformance.situations import list_input_ports
from executive.testing.faults.effect import Effect
from executive.testing.faults.script import ScheduledFault, after, between, during

SHORT, LONG = 0.5, 5.0
"""Durations of detector faults [s]; the longer one is the deadline of requests."""
QUARTER_SHARES: tuple[tuple[When, float], ...] = (("first", 0.25), ("middle", 0.5), ("late", 0.75))
"""Fractions of a run without a fault, or of a motion, at which faults of objects occur."""
LASTING = tuple(range(1, 21))
"""Numbers of the activations with a lasting fault that no real cause would repeat for ever."""
TRANSPORT_SHARES: tuple[tuple[When, float], ...] = (
    ("first", 0.1), ("first", 0.3), ("middle", 0.5), ("late", 0.7), ("late", 0.9),
)  # fmt: skip
"""Fractions of a transport at which the seal breaks."""


@dataclass(frozen=True)
class Cause:
    """A fault of the cell that makes skills fail with a reason.

    Attributes:
        effect: Effect of the fault.
        description: Description of the effect.
        needs: Property of the skills that it affects: `moves`, `senses`, or the name of a part that they use;
            "" for all skills.
        lasts: True if it may last until the end; False: a campaign limits the number of activations.
    """

    effect: Effect
    description: str
    needs: str = ""
    lasts: bool = True

    def is_affecting(self, skill: type[Skill]) -> bool:
        """Return True if the fault affects a skill."""
        properties = {"": True, "moves": skill.moves, "senses": skill.senses}
        return properties.get(self.needs, self.needs in skill.uses)


def list_causes(table: TableConfig) -> Mapping[str, Cause]:
    """Return the known causes of failures by the name of the reason."""
    aside = effects.object_bumped(table.x, table.y)
    return {
        "missed": Cause(effects.seal_fails(), "nothing seals", "tool"),
        "dropped": Cause(effects.seal_breaks(), "the seal breaks half-way", "moves"),
        "no_contact": Cause(aside, "the object is bumped aside", "moves"),
        "blocked": Cause(effects.arm_collides(), "the arm runs into something", "moves"),
        "unreachable": Cause(effects.no_path(), "the planner finds no way", "moves"),
        "stuck": Cause(effects.tool_sticks(), "the tool does not let go", "tool"),
        "unavailable": Cause(effects.detector_dead(), "the detector is dead", "camera"),
        "unsure": Cause(effects.detector_unsure(), "the detector is sure of nothing", "camera"),
        "hidden": Cause(effects.workspace_occluded(), "the arm hides the workspace", "camera"),
        "stale": Cause(effects.table_bumped(), "something bumps the table", lasts=False),
        "no_depth": Cause(effects.no_depth(), "no detection can be localized"),
        "quit": Cause(effects.operator_quits(), "the operator quits", "senses"),
        "rescan": Cause(effects.operator_asks_rescan(), "the operator wants a look", "senses", lasts=False),
    }


def list_faults(subject: Subject, rehearsal: Rehearsal) -> tuple[PlannedFault, ...]:
    """Return all single faults of a mission; the number of a fault is its position, from 1.

    The faults are the reasons of each node and the errors of its code, in the order of the tree, and then the
    faults of detectors, objects and tool.
    """
    listing = _Listing(subject, rehearsal)
    faults = [
        *(fault for node in listing.nodes for fault in listing.list_failures(node)),
        *(fault for node in listing.nodes for fault in listing.list_errors(node)),
        *listing.list_detector_faults(),
        *listing.list_object_faults(),
        *listing.list_tool_faults(),
    ]
    # A fault that replaces another one follows it.
    return tuple(
        replace(fault, replaced=number) if fault.replaced else fault for number, fault in enumerate(faults)
    )


class _Listing:
    """The faults of one mission."""

    def __init__(self, subject: Subject, rehearsal: Rehearsal) -> None:
        self._skills, self._rehearsal = subject.skills, rehearsal
        self._table = subject.loaded.cell_config.table
        self._causes = list_causes(self._table)
        self.nodes = skill_nodes(subject)

    def list_failures(self, node: nodes.SkillNode) -> Iterator[PlannedFault]:
        """Yield for every reason of a node a fault of the cell, if one exists, and a failure of the skill."""
        skill = self._skills[node.skill]
        count = len(self._rehearsal.activations.get(node.path, ()))
        starts: list[tuple[When, tuple[int, ...]]] = [("first", (1,)), ("lasting", ())]
        if count >= 3:
            starts.insert(1, ("middle", (1 + count // 2,)))
        for reason in skill.reasons:
            cause = self._causes.get(reason)
            for when, nth in starts:
                base = self._plan(node, reason, when, is_reason=True)
                skill_fault = SkillFault(node.path, "fails", reason, nth or LASTING)
                failure = replace(base, cause="the skill fails by itself", skill_faults=(skill_fault,))
                if cause is not None and cause.is_affecting(skill):
                    cell_fault = during(node.path, cause.effect, nth=nth or (() if cause.lasts else LASTING))
                    yield replace(base, cause=cause.description, cell_faults=(cell_fault,))
                    failure = replace(failure, replaced=-1)
                yield failure

    def list_errors(self, node: nodes.SkillNode) -> Iterator[PlannedFault]:
        """Yield errors that the code of a skill raises: at its start, later, and when it is halted."""
        ticks = self._rehearsal.activations.get(node.path, ())
        start, longest = max(enumerate(ticks, 1), key=lambda one: one[1], default=(1, 0))
        half = longest // 2
        first = SkillFault(node.path, "raises", starts=(1,))
        cause = "its code raises an error at the start"
        yield self._plan(node, "raises", "first", cause=cause, skill_faults=(first,))
        if longest >= 2:
            later = replace(first, starts=(start,), after=half)
            cause = f"its code raises an error after {half} ticks"
            yield self._plan(node, "raises", "middle", cause=cause, skill_faults=(later,))
        if longest >= 2 or not ticks:
            halted = SkillFault(node.path, "raises when halted", starts=(start,), after=half)
            cause = f"its code raises an error at a halt after {half} ticks"
            yield self._plan(node, "halted", "middle", cause=cause, skill_faults=(halted,))

    def list_detector_faults(self) -> Iterator[PlannedFault]:
        """Yield slow, hanging, unsure and dead detectors, from the start and from half of the run on."""
        starts: tuple[tuple[When, float], ...] = (("first", 0.0), ("middle", self._rehearsal.robot_time / 2))
        dead, unsure = effects.detector_dead(), effects.detector_unsure()
        for when, start in starts:
            found = [(f"slow by {by:g} s", after(start, effects.detector_slow(by))) for by in (SHORT, LONG)]
            for duration in (SHORT, LONG):
                for name, effect in (("hangs", effects.detector_hangs()), ("unsure", unsure), ("dead", dead)):
                    found.append((f"{name} for {duration:g} s", between(start, start + duration, effect)))
            found.append(("hangs for ever", after(start, effects.detector_times_out(LONG))))
            found += [("dead for ever", after(start, dead)), ("unsure for ever", after(start, unsure))]
            for what, cell_fault in found:
                leads_to = "unsure" if what.startswith("unsure") else "unavailable"
                yield replace(_plan_global("detector", what, when, cell_fault), leads_to=leads_to)

    def list_object_faults(self) -> Iterator[PlannedFault]:
        """Yield removals and bumps of objects on the table and during an approach."""
        x, y = self._table.x, self._table.y
        for when, share in QUARTER_SHARES:
            start = share * self._rehearsal.robot_time
            yield _plan_global("object", "taken", when, after(start, effects.object_removed("nearest")))
            yield _plan_global("object", "bumped", when, after(start, effects.object_bumped(x, y, "nearest")))
        for node in self.nodes:
            if not _is_moving_to_target(self._skills[node.skill]) or not self._has_run(node):
                continue
            nth = 1 + len(self._rehearsal.activations[node.path]) // 2
            for when, share in QUARTER_SHARES:
                taken = effects.object_removed("node", share)
                bumped = effects.object_bumped(x, y, "node", share)
                for what, effect in (("target taken", taken), ("target bumped", bumped)):
                    cell_fault = during(node.path, effect, nth=nth)
                    yield self._plan(node, what, when, cause=f"at {share:g}", cell_faults=(cell_fault,))

    def list_tool_faults(self) -> Iterator[PlannedFault]:
        """Yield seals that break during a transport, and seals that fail."""
        for node in self.nodes:
            skill = self._skills[node.skill]
            if not (skill.moves and skill.tool_state[0] is HOLDING and self._has_run(node)):
                continue
            for when, share in TRANSPORT_SHARES:
                cell_fault = during(node.path, effects.seal_breaks(share), nth=1)
                yield self._plan(node, "lets go", when, cause=f"at {share:g}", cell_faults=(cell_fault,))
            over, what = during(node.path, effects.seal_breaks_over_wrong_bin()), "lets go over another bin"
            yield self._plan(node, what, "lasting", cause="every time", cell_faults=(over,))
        half = self._rehearsal.robot_time / 2
        for duration in (SHORT, LONG):
            fails = between(half, half + duration, effects.seal_fails())
            yield _plan_global("tool", f"no seal for {duration:g} s", "middle", fails)
        for number in (1, 2):
            refuses = after(0.0, effects.object_unsealable(number))
            yield _plan_global("tool", f"no seal on object {number}", "lasting", refuses)

    def _plan(self, node: nodes.SkillNode, what: str, when: When, **more: object) -> PlannedFault:
        place = f"{node.mark.source.path}:{node.mark.line}"
        fault = PlannedFault(
            node.path, node.label or node.skill, place, what, when, "", is_conditional=not self._has_run(node)
        )
        return replace(fault, **more)  # type: ignore[arg-type]

    def _has_run(self, node: nodes.SkillNode) -> bool:
        return node.path in self._rehearsal.activations


def skill_nodes(subject: Subject) -> list[nodes.SkillNode]:
    """Return the skill nodes of a mission, in the order of the tree."""
    return [node for node in subject.loaded.tree.walk() if isinstance(node, nodes.SkillNode)]


def _plan_global(part: str, what: str, when: When, cell_fault: ScheduledFault) -> PlannedFault:
    """Return a fault of a part of the cell, which belongs to no node."""
    start = getattr(cell_fault.time, "start", 0.0)
    return PlannedFault(part, part, "", what, when, f"from {start:.2f} s on", cell_faults=(cell_fault,))


def _is_moving_to_target(skill: type[Skill]) -> bool:
    return skill.moves and any(port.type is Target for port in list_input_ports(skill))
