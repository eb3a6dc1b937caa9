"""List of all single faults of a mission, derived from its tree and the declarations of its skills."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from executive.campaign.faults.nominal_run import NominalRun
from executive.campaign.faults.planned_fault import Occasion, PlannedFault, SkillFault
from executive.campaign.mission_under_test import MissionUnderTest
from executive.cell.config import TableConfig
from executive.cell.objects import Target
from executive.mission.model import nodes
from executive.skill import HOLDING, Skill
from executive.testing import faults as effects
from executive.testing.conformance.situations import list_input_ports
from executive.testing.faults.effect import Effect
from executive.testing.faults.script import ScheduledFault, after, between, during

DURATIONS = (0.5, 5.0)
"""Short and long duration of faults of detectors and tool [s]; after the long one, a request fails."""
QUARTER_FRACTIONS: tuple[tuple[Occasion, float], ...] = (("first", 0.25), ("middle", 0.5), ("late", 0.75))
"""Fractions of the nominal run, or of a motion, after which faults of objects occur, by occasion."""
LASTING_STARTS = tuple(range(1, 21))
"""Numbers of the activations with a lasting fault, for faults that would not last until the end."""
TRANSPORT_FRACTIONS: tuple[tuple[Occasion, float], ...] = (
    ("first", 0.1), ("first", 0.3), ("middle", 0.5), ("late", 0.7), ("late", 0.9),
)  # fmt: skip
"""Fractions of a transport after which the seal breaks, by occasion."""


@dataclass(frozen=True)
class Cause:
    """A fault of the cell that causes failures of skills with a certain reason.

    Attributes:
        effect: Effect of the fault.
        description: Description of the effect, for the list of faults.
        required_property: Property of the affected skills: `moves`, `senses`, or a used part; "": none.
        may_last: True if the fault may last until the end of the run; False: only in `LASTING_STARTS`.
    """

    effect: Effect
    description: str
    required_property: str = ""
    may_last: bool = True

    def is_affecting(self, skill: type[Skill]) -> bool:
        """Return True if the fault affects a skill."""
        properties = {"": True, "moves": skill.moves, "senses": skill.senses}
        return properties.get(self.required_property, self.required_property in skill.uses)


def list_causes(table: TableConfig) -> Mapping[str, Cause]:
    """Return the known causes of failures in the cell, by reason."""
    bumped = effects.object_bumped(table.x, table.y)
    return {
        "missed": Cause(effects.seal_fails(), "the suction cup cannot seal", "tool"),
        "dropped": Cause(effects.seal_breaks(), "the seal breaks half-way", "moves"),
        "no_contact": Cause(bumped, "the object is bumped aside", "moves"),
        "blocked": Cause(effects.arm_collides(), "the arm collides", "moves"),
        "unreachable": Cause(effects.no_path(), "the planner finds no path", "moves"),
        "stuck": Cause(effects.tool_sticks(), "the object sticks to the tool", "tool"),
        "unavailable": Cause(effects.detector_dead(), "the detector is dead", "camera"),
        "unsure": Cause(effects.detector_unsure(), "all confidences are low", "camera"),
        "hidden": Cause(effects.workspace_occluded(), "the arm occludes the workspace", "camera"),
        "stale": Cause(effects.table_bumped(), "the table is bumped", may_last=False),
        "no_depth": Cause(effects.no_depth(), "no detection can be localized"),
        "quit": Cause(effects.operator_quits(), "the operator quits", "senses"),
        "rescan": Cause(effects.operator_asks_rescan(), "the operator asks for a scan", "senses", False),
    }


def list_faults(mission: MissionUnderTest, nominal_run: NominalRun) -> tuple[PlannedFault, ...]:
    """Return all single faults of a mission; the number of a fault is its position in the list, from 1.

    First come the failures of all nodes in the order of the tree, then the errors of their code, then the
    faults of detectors, objects and tool.
    """
    lister = _FaultLister(mission, nominal_run)
    faults = [
        *(fault for node in lister.nodes for fault in lister.list_failures(node)),
        *(fault for node in lister.nodes for fault in lister.list_errors(node)),
        *lister.list_detector_faults(),
        *lister.list_object_faults(),
        *lister.list_tool_faults(),
    ]
    # A fault that replaces another fault directly follows it in the list.
    return tuple(
        replace(fault, replaced_number=index) if fault.replaced_number else fault
        for index, fault in enumerate(faults)
    )


class _FaultLister:
    """Lists the faults of one mission."""

    def __init__(self, mission: MissionUnderTest, nominal_run: NominalRun) -> None:
        self._skills, self._nominal_run = mission.skills, nominal_run
        self._table = mission.loaded.cell_config.table
        self._causes = list_causes(self._table)
        self.nodes = list_skill_nodes(mission)

    def list_failures(self, node: nodes.SkillNode) -> Iterator[PlannedFault]:
        """Yield for each reason of a node a fault of the cell, if known, and a failure of the skill."""
        skill = self._skills[node.skill]
        count = len(self._nominal_run.steps_by_path.get(node.path, ()))
        occasions: list[tuple[Occasion, tuple[int, ...]]] = [("first", (1,)), ("lasting", ())]
        if count >= 3:
            occasions.insert(1, ("middle", (1 + count // 2,)))
        for reason in skill.reasons:
            cause = self._causes.get(reason)
            for occasion, nth in occasions:
                base = self._make_fault(node, reason, occasion, is_failure_reason=True)
                skill_fault = SkillFault(node.path, "fails", reason, nth or LASTING_STARTS)
                failure = replace(base, cause="the skill fails without a cause", skill_faults=(skill_fault,))
                if cause is not None and cause.is_affecting(skill):
                    lasting = () if cause.may_last else LASTING_STARTS
                    cell_fault = during(node.path, cause.effect, nth=nth or lasting)
                    yield replace(base, cause=cause.description, cell_faults=(cell_fault,))
                    failure = replace(failure, replaced_number=-1)
                yield failure

    def list_errors(self, node: nodes.SkillNode) -> Iterator[PlannedFault]:
        """Yield errors that the code of a skill raises: at its start, half-way, and when it is halted."""
        durations = self._nominal_run.steps_by_path.get(node.path, ())
        number, longest = max(enumerate(durations, 1), key=lambda pair: pair[1], default=(1, 0))
        half = longest // 2
        at_start = SkillFault(node.path, "raises", start_numbers=(1,))
        cause = "its code raises an error at the start"
        yield self._make_fault(node, "raises", "first", cause=cause, skill_faults=(at_start,))
        if longest >= 2:
            half_way = replace(at_start, start_numbers=(number,), delay_steps=half)
            cause = f"its code raises an error after {half} ticks"
            yield self._make_fault(node, "raises", "middle", cause=cause, skill_faults=(half_way,))
        if longest >= 2 or not durations:
            at_halt = SkillFault(node.path, "raises when halted", start_numbers=(number,), delay_steps=half)
            cause = f"its code raises an error at a halt after {half} ticks"
            yield self._make_fault(node, "halted", "middle", cause=cause, skill_faults=(at_halt,))

    def list_detector_faults(self) -> Iterator[PlannedFault]:
        """Yield slow, hanging, unsure and dead detectors, from the start and from the middle of the run."""
        starts: dict[Occasion, float] = {"first": 0.0, "middle": self._nominal_run.robot_time / 2}
        dead, unsure = effects.detector_dead(), effects.detector_unsure()
        for occasion, start in starts.items():
            faults = [(f"slow by {lag:g} s", after(start, effects.detector_slow(lag))) for lag in DURATIONS]
            for duration in DURATIONS:
                for kind, effect in (("hangs", effects.detector_hangs()), ("unsure", unsure), ("dead", dead)):
                    faults.append((f"{kind} for {duration:g} s", between(start, start + duration, effect)))
            faults.append(("hangs to the end", after(start, effects.detector_times_out(DURATIONS[-1]))))
            faults += [("dead to the end", after(start, dead)), ("unsure to the end", after(start, unsure))]
            for kind, cell_fault in faults:
                reason = "unsure" if kind.startswith("unsure") else "unavailable"
                fault = _make_part_fault("detector", kind, occasion, cell_fault)
                yield replace(fault, expected_reason=reason)

    def list_object_faults(self) -> Iterator[PlannedFault]:
        """Yield objects that are removed or bumped: the nearest one, and the target of an approach."""
        x, y = self._table.x, self._table.y
        for occasion, fraction in QUARTER_FRACTIONS:
            start = fraction * self._nominal_run.robot_time
            removed, bumped = effects.object_removed("nearest"), effects.object_bumped(x, y, "nearest")
            yield _make_part_fault("object", "removed", occasion, after(start, removed))
            yield _make_part_fault("object", "bumped", occasion, after(start, bumped))
        for node in self.nodes:
            if not _is_moving_to_target(self._skills[node.skill]) or not self._has_run(node):
                continue
            nth = 1 + len(self._nominal_run.steps_by_path[node.path]) // 2
            for occasion, fraction in QUARTER_FRACTIONS:
                removed = effects.object_removed("node", fraction)
                bumped = effects.object_bumped(x, y, "node", fraction)
                for kind, effect in (("target removed", removed), ("target bumped", bumped)):
                    cell_fault, cause = during(node.path, effect, nth=nth), f"at {fraction:g}"
                    yield self._make_fault(node, kind, occasion, cause=cause, cell_faults=(cell_fault,))

    def list_tool_faults(self) -> Iterator[PlannedFault]:
        """Yield seals that break during a transport, and grasps that cannot seal."""
        for node in self.nodes:
            skill = self._skills[node.skill]
            if not (skill.moves and skill.tool_state[0] is HOLDING and self._has_run(node)):
                continue
            for occasion, fraction in TRANSPORT_FRACTIONS:
                cause, effect = f"at {fraction:g}", effects.seal_breaks(fraction)
                cell_fault = during(node.path, effect, nth=1)
                yield self._make_fault(node, "seal breaks", occasion, cause=cause, cell_faults=(cell_fault,))
            effect, kind = effects.seal_breaks_over_wrong_bin(), "seal breaks over a wrong bin"
            cell_fault = during(node.path, effect)
            yield self._make_fault(node, kind, "lasting", cause="every time", cell_faults=(cell_fault,))
        half = self._nominal_run.robot_time / 2
        for duration in DURATIONS:
            cell_fault = between(half, half + duration, effects.seal_fails())
            yield _make_part_fault("tool", f"no seal for {duration:g} s", "middle", cell_fault)
        for number in (1, 2):
            cell_fault = after(0.0, effects.object_unsealable(number))
            yield _make_part_fault("tool", f"no seal on object {number}", "lasting", cell_fault)

    def _make_fault(
        self, node: nodes.SkillNode, kind: str, occasion: Occasion, **fields: object
    ) -> PlannedFault:
        """Return a fault of a node; `fields` are further fields of `PlannedFault`."""
        place, name = f"{node.mark.source.path}:{node.mark.line}", node.label or node.skill
        is_conditional = not self._has_run(node)
        fault = PlannedFault(node.path, name, place, kind, occasion, "", is_conditional=is_conditional)
        return replace(fault, **fields)  # type: ignore[arg-type]

    def _has_run(self, node: nodes.SkillNode) -> bool:
        """Return True if the node runs in the nominal run."""
        return node.path in self._nominal_run.steps_by_path


def list_skill_nodes(mission: MissionUnderTest) -> list[nodes.SkillNode]:
    """Return the nodes of a mission that run skills, in the order of the tree."""
    return [node for node in mission.loaded.tree.walk() if isinstance(node, nodes.SkillNode)]


def _make_part_fault(part: str, kind: str, occasion: Occasion, cell_fault: ScheduledFault) -> PlannedFault:
    """Return a fault of a part of the cell, which affects no particular node."""
    start = getattr(cell_fault.time, "start", 0.0)
    return PlannedFault(part, part, "", kind, occasion, f"from {start:.2f} s on", cell_faults=(cell_fault,))


def _is_moving_to_target(skill: type[Skill]) -> bool:
    return skill.moves and any(port.type is Target for port in list_input_ports(skill))
