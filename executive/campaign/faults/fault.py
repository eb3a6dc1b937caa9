"""Faults that a campaign injects into runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from executive.cell.protocols import Cell, Steps
from executive.manipulation.drops import record_drop
from executive.skill import EMPTY, Skill
from executive.testing.faults.script import ScheduledFault
from executive.testing.substitutes import make_raising, make_raising_when_halted, make_substitute

When = Literal["first", "middle", "late", "lasting"]
"""Time of a fault in a run: the first activation, the middle, near the end, or repeatedly."""
INJECTED_FAILURE = "failure injected by the campaign"
"""Message of a skill that fails without a cause in the cell."""


class InjectedError(Exception):
    """The error that a campaign raises inside a skill to imitate a bug."""


@dataclass(frozen=True)
class SkillFault:
    """A skill that misbehaves without a cause in the cell.

    Attributes:
        node: Path of its node.
        kind: The skill fails, raises an error, or raises an error when it is halted.
        reason: Reason of the failure; "" for an error.
        starts: Activations in which it misbehaves, counted from 1; empty: all activations.
        after: Number of control steps of the skill before the error.
    """

    node: str
    kind: Literal["fails", "raises", "raises when halted"]
    reason: str = ""
    starts: tuple[int, ...] = ()
    after: int = 0


@dataclass(frozen=True)
class PlannedFault:
    """A fault that is injected into a run; a value that can be sent to another process.

    Attributes:
        affected: Path of the affected node, or the affected part: `detector`, `object`, `tool`.
        name: Label or skill of the node, or the same as `affected`.
        place: File and line of the node in the mission; "" for a part.
        what: Reason with which the node must fail, or a description of the fault.
        when: Time of the fault in the run.
        cause: Description of the cause.
        cell_faults: Faults of the cell that cause the fault.
        skill_faults: Misbehaviour of skills that causes the fault.
        is_reason: True if `what` is a reason of the node.
        leads_to: Reason with which skills fail because of a fault of a part; "" if there is none.
        is_conditional: True if the node runs only after another fault.
        replaced: Number of the fault that this one replaces if that one did not provoke its reason; 0: none.
    """

    affected: str
    name: str
    place: str
    what: str
    when: When
    cause: str
    cell_faults: tuple[ScheduledFault, ...] = ()
    skill_faults: tuple[SkillFault, ...] = ()
    is_reason: bool = False
    leads_to: str = ""
    is_conditional: bool = False
    replaced: int = 0

    @property
    def ends_run(self) -> bool:
        """True if the run ends with the status FAULT, as after any bug."""
        return any(skill_fault.kind != "fails" for skill_fault in self.skill_faults)

    def __str__(self) -> str:
        """Return a description of the fault."""
        return f"{self.affected} {self.what}, {self.when}: {self.cause}"


def make_substitutes(
    skill_faults: Iterable[SkillFault], skills: Mapping[str, type[Skill]]
) -> dict[str, type[Skill]]:
    """Return the substitute of each misbehaving skill; `skills` are the skills of the nodes by path."""
    substitutes: dict[str, type[Skill]] = {}
    for fault in skill_faults:
        skill = substitutes.get(fault.node, skills[fault.node])
        error = InjectedError("a bug that the campaign injected")
        if fault.kind == "fails":
            broken = _make_failing(skill, fault.reason)
        elif fault.kind == "raises":
            broken = make_raising(skill, error, delay_steps=fault.after)
        else:
            broken = make_raising_when_halted(skill, error)
        substitutes[fault.node] = make_substitute(skill, "Broken", broken.run, fault.starts or None)
    return substitutes


def _make_failing(skill: type[Skill], reason: str) -> type[Skill]:
    """Return a skill that fails at its start, and drops its object if the failure leaves the tool empty.

    If the tool sticks, the object cannot fall, and the skill does its work.
    """
    is_dropping = skill.tool_left.get(reason) is EMPTY

    def run(self: Skill, cell: Cell) -> Steps:
        if is_dropping:
            cell.tool.open()
            if cell.tool.holding:
                yield from skill.run(self, cell) or ()
                return
            if (item := cell.ledger.find_held_item()) is not None:
                record_drop(cell, item)
        raise self.failure(reason, INJECTED_FAILURE)

    return make_substitute(skill, "Failing", run)
