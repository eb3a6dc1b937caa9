"""List of all single faults of a mission, derived from its tree and the declarations of its skills."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from executive.campaign.faults.nominal_run import NominalRun
from executive.campaign.faults.planned_fault import Occasion, PlannedFault, SkillFault
from executive.campaign.mission_under_test import MissionUnderTest
from executive.cell.config import TableConfig
from executive.cell.objects import Target
from executive.mission.model.nodes import SkillNode
from executive.skill import HOLDING, Skill
from executive.testing import faults as effects
from executive.testing.conformance import list_input_ports
from executive.testing.faults.effect import Effect
from executive.testing.faults.script import ScheduledFault, TimeSpan, after, between, during

FAULT_DURATIONS = (0.5, 5.0)
"""Durations of faults of detectors and tool [s]; the longer one is also the timeout of hanging requests."""
QUARTER_FRACTIONS: tuple[tuple[Occasion, float], ...] = (("first", 0.25), ("middle", 0.5), ("late", 0.75))
"""Fractions of the nominal run, or of a motion, after which faults of objects occur, by occasion."""
REPEATED_ACTIVATIONS = tuple(range(1, 21))
"""Numbers of the activations with a repeated fault, if the fault must end before the end of the run."""
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
        required_property: Property of the affected skills: `moves`, `senses`, or an element of `uses`; "" if
            all skills are affected.
        lasting_activations: Numbers of the activations with a lasting fault; empty: all activations.
    """

    effect: Effect
    description: str
    required_property: str = ""
    lasting_activations: tuple[int, ...] = ()

    def can_affect(self, skill: type[Skill]) -> bool:
        """Return True if a skill has the required property."""
        properties = {"": True, "moves": skill.moves, "senses": skill.senses}
        return properties.get(self.required_property, self.required_property in skill.uses)


def list_causes(table: TableConfig) -> Mapping[str, Cause]:
    """Return the known causes of failures in the cell, by reason."""
    bumped, rescan = effects.object_bumped(table.x, table.y), effects.operator_asks_rescan()
    return {
        "missed": Cause(effects.seal_fails(), "the suction cup cannot seal", "tool"),
        "dropped": Cause(effects.seal_breaks(), "the seal breaks half-way", "moves"),
        "no_contact": Cause(bumped, "the object is bumped aside", "moves"),
        "blocked": Cause(effects.arm_collides(), "the arm collides", "moves"),
        "unreachable": Cause(effects.no_path(), "the planner finds no path", "moves"),
        "stuck": Cause(effects.tool_does_not_release(), "the object sticks to the tool", "tool"),
        "unavailable": Cause(effects.detector_dead(), "the detector is dead", "camera"),
        "unsure": Cause(effects.detector_unsure(), "all confidences are low", "camera"),
        "hidden": Cause(effects.workspace_occluded(), "the arm occludes the workspace", "camera"),
        "stale": Cause(effects.table_bumped(), "the table is bumped", "", REPEATED_ACTIVATIONS),
        "no_depth": Cause(effects.no_depth(), "no detection can be localized"),
        "quit": Cause(effects.operator_quits(), "the operator quits", "senses"),
        "rescan": Cause(rescan, "the operator asks for a scan", "senses", REPEATED_ACTIVATIONS),
    }


def list_faults(mission: MissionUnderTest, nominal_run: NominalRun) -> tuple[PlannedFault, ...]:
    """Return all single faults of a mission; the number of a fault is its position in the list, from 1.

    The order is: failures of all nodes in the order of the tree, bugs of all skills in the order of the tree,
    faults of detectors, faults of objects, faults of the tool.
    """
    lister = _FaultLister(mission, nominal_run)
    return (
        *(fault for node in lister.nodes for fault in lister.list_failures(node)),
        *(fault for node in lister.nodes for fault in lister.list_bugs(node)),
        *lister.list_detector_faults(),
        *lister.list_object_faults(),
        *lister.list_tool_faults(),
    )


class _FaultLister:
    """Lists the faults of one mission."""

    def __init__(self, mission: MissionUnderTest, nominal_run: NominalRun) -> None:
        self._skills, self._nominal_run = mission.loaded.skills, nominal_run
        self._table = mission.loaded.cell_config.table
        self._causes = list_causes(self._table)
        self.nodes = list_skill_nodes(mission)

    def list_failures(self, node: SkillNode) -> Iterator[PlannedFault]:
        """Yield the failures of a node: each reason on each occasion, caused by the cell and by the skill."""
        skill = self._skills[node.skill]
        activation_count = len(self._nominal_run.steps_by_path.get(node.path, ()))
        occasions: list[tuple[Occasion, tuple[int, ...]]] = [("first", (1,)), ("lasting", ())]
        if activation_count >= 3:
            occasions.insert(1, ("middle", (1 + activation_count // 2,)))
        for reason in skill.reasons:
            cause = self._causes.get(reason)
            for occasion, activations in occasions:
                skill_fault = SkillFault(node.path, "fails", reason, activations or REPEATED_ACTIVATIONS)
                description = "the skill fails without a cause"
                fault = self._make_node_fault(node, reason, occasion, description, skill_fault)
                fault = replace(fault, is_failure_reason=True)
                if cause is not None and cause.can_affect(skill):
                    numbers = activations or cause.lasting_activations
                    cell_fault = during(node.path, cause.effect, activations=numbers)
                    yield replace(fault, cause=cause.description, injected=cell_fault)
                    fault = replace(fault, replaces_previous=True)
                yield fault

    def list_bugs(self, node: SkillNode) -> Iterator[PlannedFault]:
        """Yield errors that the code of a skill raises: at its start, half-way, and when it is halted."""
        step_counts = self._nominal_run.steps_by_path.get(node.path, ())
        max_steps = max(step_counts, default=0)
        longest_activation = 1 + step_counts.index(max_steps) if step_counts else 1
        half_steps = max_steps // 2
        bug = SkillFault(node.path, "raises", activations=(1,))
        yield self._make_node_fault(node, "raises", "first", "its code raises an error at the start", bug)
        if max_steps >= 2:
            bug = SkillFault(node.path, "raises", "", (longest_activation,), half_steps)
            cause = f"its code raises an error after {half_steps} ticks"
            yield self._make_node_fault(node, "raises", "middle", cause, bug)
        if max_steps >= 2 or not step_counts:
            bug = SkillFault(node.path, "raises when halted", "", (longest_activation,), half_steps)
            cause = f"its code raises an error at a halt after {half_steps} ticks"
            yield self._make_node_fault(node, "halted", "middle", cause, bug)

    def list_detector_faults(self) -> Iterator[PlannedFault]:
        """Yield slow, hanging, unsure and dead detectors, from the start and from the middle of the run."""
        starts: dict[Occasion, float] = {"first": 0.0, "middle": self._nominal_run.duration / 2}
        dead, unsure = effects.detector_dead(), effects.detector_unsure()
        endless_hang = effects.detector_times_out(FAULT_DURATIONS[-1])
        for occasion, start in starts.items():
            faults = [(f"slow by {d:g} s", after(start, effects.detector_slow(d))) for d in FAULT_DURATIONS]
            for duration in FAULT_DURATIONS:
                for kind, effect in (("hangs", effects.detector_hangs()), ("unsure", unsure), ("dead", dead)):
                    faults.append((f"{kind} for {duration:g} s", between(start, start + duration, effect)))
            for kind, effect in (("hangs", endless_hang), ("dead", dead), ("unsure", unsure)):
                faults.append((f"{kind} to the end", after(start, effect)))
            for kind, cell_fault in faults:
                reason = "unsure" if kind.startswith("unsure") else "unavailable"
                fault = _make_part_fault("detector", kind, occasion, cell_fault)
                yield replace(fault, expected_reason=reason)

    def list_object_faults(self) -> Iterator[PlannedFault]:
        """Yield removed and bumped objects: the object nearest to the tool, and the target of an approach."""
        x, y = self._table.x, self._table.y
        for occasion, fraction in QUARTER_FRACTIONS:
            start = fraction * self._nominal_run.duration
            removed, bumped = effects.object_removed("nearest"), effects.object_bumped(x, y, "nearest")
            yield _make_part_fault("object", "removed", occasion, after(start, removed))
            yield _make_part_fault("object", "bumped", occasion, after(start, bumped))
        for node in self.nodes:
            skill = self._skills[node.skill]
            has_target = any(port.type is Target for port in list_input_ports(skill))
            if not (skill.moves and has_target and self._has_run(node)):
                continue
            middle_activation = 1 + len(self._nominal_run.steps_by_path[node.path]) // 2
            for occasion, fraction in QUARTER_FRACTIONS:
                cause = f"after {fraction:.0%} of the motion"
                removed = effects.object_removed("node", fraction)
                bumped = effects.object_bumped(x, y, "node", fraction)
                for kind, effect in (("target removed", removed), ("target bumped", bumped)):
                    cell_fault = during(node.path, effect, activations=middle_activation)
                    yield self._make_node_fault(node, kind, occasion, cause, cell_fault)

    def list_tool_faults(self) -> Iterator[PlannedFault]:
        """Yield losses of the seal during a transport, and times in which the suction cup cannot seal."""
        for node in self.nodes:
            skill = self._skills[node.skill]
            if not (skill.moves and skill.tool_state[0] is HOLDING and self._has_run(node)):
                continue
            for occasion, fraction in TRANSPORT_FRACTIONS:
                cell_fault = during(node.path, effects.seal_breaks(fraction), activations=1)
                cause = f"after {fraction:.0%} of the motion"
                yield self._make_node_fault(node, "seal breaks", occasion, cause, cell_fault)
            kind, effect = "seal breaks over a wrong bin", effects.seal_breaks_over_wrong_bin()
            cell_fault = during(node.path, effect)
            yield self._make_node_fault(node, kind, "lasting", "in every motion", cell_fault)
        middle_time = self._nominal_run.duration / 2
        for duration in FAULT_DURATIONS:
            cell_fault = between(middle_time, middle_time + duration, effects.seal_fails())
            yield _make_part_fault("tool", f"no seal for {duration:g} s", "middle", cell_fault)
        for number in (1, 2):
            cell_fault = after(0.0, effects.object_unsealable(number))
            yield _make_part_fault("tool", f"no seal on object {number}", "lasting", cell_fault)

    def _make_node_fault(
        self, node: SkillNode, kind: str, occasion: Occasion, cause: str, fault: ScheduledFault | SkillFault
    ) -> PlannedFault:
        """Return a planned fault that affects a node."""
        return PlannedFault(
            node.path, node.label or node.skill, f"{node.span.source.path}:{node.span.line}",
            kind, occasion, cause, fault, is_conditional=not self._has_run(node),
        )  # fmt: skip

    def _has_run(self, node: SkillNode) -> bool:
        """Return True if the node runs in the nominal run."""
        return node.path in self._nominal_run.steps_by_path


def list_skill_nodes(mission: MissionUnderTest) -> list[SkillNode]:
    """Return the nodes of a mission that run skills, in the order of the tree."""
    return [node for node in mission.loaded.tree.walk() if isinstance(node, SkillNode)]


def _make_part_fault(part: str, kind: str, occasion: Occasion, cell_fault: ScheduledFault) -> PlannedFault:
    """Return a fault with a time span, which affects a part of the cell but no particular node."""
    assert isinstance(cell_fault.time, TimeSpan)
    cause = f"from {cell_fault.time.start:.2f} s on"
    return PlannedFault(part, part, "", kind, occasion, cause, cell_fault)
