"""List of all single faults of a mission, derived from its tree and the declarations of its skills."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from executive.campaign.jobs import MissionUnderTest
from executive.cell.objects import Target
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import detect_and_record_drop
from executive.record.timeline import Activation
from executive.skill import EMPTY, HOLDING, Skill
from executive.testing import faults as effects
from executive.testing.faults import after, between, during
from executive.testing.faulty_cell import Effect, ObjectChoice, ScheduledFault
from executive.testing.run_mission import make_raising, make_substitute
from executive.tree.specification import SkillNode

FAULT_DURATIONS = (0.5, 5.0)
"""Durations of short faults of detectors and tool [s]."""
OCCASIONS: Mapping[str, float] = {"first": 0.25, "middle": 0.5, "late": 0.75}
"""Fractions of a run, or of a motion, after which faults of objects and of the grip occur, by occasion."""
REPEATED_ACTIVATIONS = tuple(range(1, 21))
"""Numbers of the activations with a repeated fault, if the fault must end before the end of the run."""
ENDLESS_REASONS = ("stale", "rescan")
"""Reasons after which missions try again without a limit, so that a fault that causes them must end."""
INJECTED_MESSAGE = "injected by the campaign"
"""Message of a failure without a cause in the cell, and of an error that simulates a bug of a skill."""


@dataclass(frozen=True)
class SkillFault:
    """A failure or bug of a skill without a cause in the cell.

    Attributes:
        skill: Name of the skill.
        reason: Reason of the failure; "" for a bug, an error that the code of the skill raises.
        activations: Numbers of the affected activations of the node, from 1.
        delay_steps: Number of control steps from the start of the skill to the error.
    """

    skill: str
    reason: str
    activations: tuple[int, ...]
    delay_steps: int = 0

    def make_skill(self, skill: type[Skill]) -> type[Skill]:
        """Return a subclass of a skill with this fault."""
        if self.reason:
            faulty_skill = _make_failing(skill, self.reason)
        else:
            faulty_skill = make_raising(skill, RuntimeError(INJECTED_MESSAGE), delay_steps=self.delay_steps)
        return make_substitute(skill, "Faulty", faulty_skill.run, self.activations)

    def __str__(self) -> str:
        """Return a description of the fault."""
        return "without a cause" if self.reason else f"a bug after {self.delay_steps} control steps"


def _make_failing(skill: type[Skill], reason: str) -> type[Skill]:
    """Return a skill that fails at the start with this reason.

    If the declared state of the tool after the failure is EMPTY, the skill drops the held object. If the
    object sticks to the tool, the original skill runs instead.
    """

    def run(self: Skill, cell: Cell) -> Steps:
        if skill.tool_state_after_failure.get(reason) is EMPTY:
            cell.tool.open()
            if cell.tool.holding:
                yield from skill.run(self, cell) or ()
                return
            if (item := cell.ledger.find_held_item()) is not None:
                detect_and_record_drop(cell, item)
        raise self.failure(reason, INJECTED_MESSAGE)

    return make_substitute(skill, "Failing", run)


@dataclass(frozen=True)
class PlannedFault:
    """A fault that a campaign injects into a run of a mission; can be pickled.

    Attributes:
        location: Path of the affected node, or affected part of the cell: `detector`, `object`, `tool`.
        name: Label or skill of the node, with its file and line; name of the part.
        kind: Failure reason of the node, or kind of the fault, for instance `target removed`.
        occasion: Occasion of the fault in a run or motion: `first`, `middle`, `late` or `lasting`.
        injected: Fault of the cell or of a skill that is injected.
        is_failure_reason: True if `kind` is a failure reason: the fault must let the node fail with it.
        is_conditional: True if the node runs only after another fault.
        replaces_previous: True if the fault is injected only if the previous fault caused no failure.
    """

    location: str
    name: str
    kind: str
    occasion: str
    injected: ScheduledFault | SkillFault
    is_failure_reason: bool = False
    is_conditional: bool = False
    replaces_previous: bool = False

    @property
    def is_bug(self) -> bool:
        """True if the fault simulates a bug, after which the run must end with the status FAULT."""
        return self.kind == "raises"

    def is_cause_of(self, activation: Activation) -> bool:
        """Return True if an activation ended with the injected error, or with the reason of the fault."""
        has_message = isinstance(self.injected, ScheduledFault) or INJECTED_MESSAGE in activation.message
        return has_message and (self.is_bug or activation.reason == self.kind)

    def __str__(self) -> str:
        """Return a description of the fault."""
        return f"{self.location} {self.kind}, {self.occasion}: {self.injected}"


class FaultLister:
    """Lists all single faults of a mission.

    Args:
        mission: The mission.
        steps_by_path: Control steps of each activation in a run without faults, by path of the node.
        duration: Duration of a run without faults [s].
    """

    def __init__(
        self, mission: MissionUnderTest, steps_by_path: Mapping[str, Sequence[int]], duration: float
    ) -> None:
        self._nodes = [node for node in mission.loaded.tree.walk() if isinstance(node, SkillNode)]
        self._skills = mission.loaded.skills
        self._steps_by_path = steps_by_path
        self._duration = duration
        self._table = mission.loaded.cell_config.table
        # Effects on the cell that cause failures of skills, by reason.
        self._causes = {
            "missed": effects.grip_fails(),
            "dropped": effects.grip_lost(),
            "no_contact": effects.object_bumped(self._table.x, self._table.y),
            "blocked": effects.arm_collides(),
            "unreachable": effects.no_path(),
            "stuck": effects.tool_does_not_release(),
            "unavailable": effects.detector_dead(),
            "unsure": effects.detector_unsure(),
            "hidden": effects.workspace_occluded(),
            "stale": effects.table_bumped(),
            "no_depth": effects.no_depth(),
            "quit": effects.operator_quits(),
            "rescan": effects.operator_asks_rescan(),
        }

    def list_faults(self) -> Iterator[PlannedFault]:
        """Yield all faults; the number of a fault is its position, from 1.

        The order is: failures of all nodes in the order of the tree, bugs of all skills in the order of the
        tree, faults of detectors, faults of objects, faults of the tool.
        """
        for node in self._nodes:
            yield from self._list_failures(node)
        yield from map(self._make_bug, self._nodes)
        yield from self._list_detector_faults()
        yield from self._list_object_faults()
        yield from self._list_tool_faults()

    def _list_failures(self, node: SkillNode) -> Iterator[PlannedFault]:
        """Yield the failures of a node: each reason on each occasion, caused by the cell and by the skill."""
        activation_count = len(self._steps_by_path.get(node.path, ()))
        occasions: dict[str, tuple[int, ...]] = {"first": (1,), "lasting": ()}
        if activation_count >= 3:
            occasions["middle"] = (1 + activation_count // 2,)
        for reason in self._skills[node.skill].reasons:
            cause = self._causes.get(reason)
            for occasion, activations in occasions.items():
                if cause is not None:
                    numbers = activations or (REPEATED_ACTIVATIONS if reason in ENDLESS_REASONS else ())
                    fault = during(node.path, cause, activations=numbers)
                    yield self._plan(node, reason, occasion, fault, is_failure_reason=True)
                skill_fault = SkillFault(node.skill, reason, activations or REPEATED_ACTIVATIONS)
                flags = {"is_failure_reason": True, "replaces_previous": cause is not None}
                yield self._plan(node, reason, occasion, skill_fault, **flags)

    def _make_bug(self, node: SkillNode) -> PlannedFault:
        """Return an error that the code of a skill raises half-way in its longest activation."""
        step_counts = self._steps_by_path.get(node.path, (0,))
        longest_activation = 1 + step_counts.index(max(step_counts))
        bug = SkillFault(node.skill, "", (longest_activation,), max(step_counts) // 2)
        return self._plan(node, "raises", "middle", bug)

    def _list_detector_faults(self) -> Iterator[PlannedFault]:
        """Yield hanging, unsure and dead detectors, from the start and from the middle of the run."""
        for occasion, start in (("first", 0.0), ("middle", self._duration / 2)):
            for duration in (*FAULT_DURATIONS, self._duration):
                for effect in (effects.detector_hangs(), effects.detector_unsure(), effects.detector_dead()):
                    kind = f"{effect.name.removeprefix('detector_')} for {duration:.3g} s"
                    fault = between(start, start + duration, effect)
                    yield PlannedFault("detector", "detector", kind, occasion, fault)

    def _list_object_faults(self) -> Iterator[PlannedFault]:
        """Yield removed and bumped objects: the object nearest to the tool, and the target of an approach."""
        for occasion, fraction in OCCASIONS.items():
            start = fraction * self._duration
            for effect in self._list_object_effects("nearest", None):
                yield PlannedFault("object", "object", effect.name, occasion, after(start, effect))
        for node in self._list_moving_nodes():
            if any(port.type is Target for port in self._skills[node.skill].ports.values()):
                middle = 1 + len(self._steps_by_path[node.path]) // 2
                for occasion, fraction in OCCASIONS.items():
                    for effect in self._list_object_effects("node", fraction):
                        fault = during(node.path, effect, activations=middle)
                        yield self._plan(node, f"target: {effect.name}", occasion, fault)

    def _list_tool_faults(self) -> Iterator[PlannedFault]:
        """Yield losses of the object during a transport, and times in which the tool cannot grip."""
        for node in self._list_moving_nodes():
            if self._skills[node.skill].tool_state[0] is HOLDING:
                for occasion, fraction in OCCASIONS.items():
                    fault = during(node.path, effects.grip_lost(fraction), activations=1)
                    yield self._plan(node, "grip lost", occasion, fault)
        start = self._duration / 2
        for duration in FAULT_DURATIONS:
            fault = between(start, start + duration, effects.grip_fails())
            yield PlannedFault("tool", "tool", f"no grip for {duration:g} s", "middle", fault)
        ungrippable = after(0.0, effects.object_ungrippable(1))
        yield PlannedFault("tool", "tool", "no grip on an object", "lasting", ungrippable)

    def _list_object_effects(self, choice: ObjectChoice, fraction: float | None) -> list[Effect]:
        bumped = effects.object_bumped(self._table.x, self._table.y, choice, fraction)
        return [effects.object_removed(choice, fraction), bumped]

    def _list_moving_nodes(self) -> list[SkillNode]:
        """Return the nodes that move the arm in a run without faults."""
        nodes_with_run = [node for node in self._nodes if node.path in self._steps_by_path]
        return [node for node in nodes_with_run if self._skills[node.skill].moves]

    def _plan(
        self, node: SkillNode, kind: str, occasion: str, fault: ScheduledFault | SkillFault, **flags: bool
    ) -> PlannedFault:
        """Return a planned fault that affects a node; `flags` are further attributes of the fault."""
        name = f"{node.label or node.skill} {node.span.source.path}:{node.span.line}"
        flags["is_conditional"] = node.path not in self._steps_by_path
        return PlannedFault(node.path, name, kind, occasion, fault, **flags)
