"""Faults that a campaign injects into runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from executive.cell.protocols import Cell, Steps
from executive.manipulation.drops import detect_and_record_drop
from executive.skill import EMPTY, Skill
from executive.testing.faults.script import ScheduledFault
from executive.testing.substitutes import make_raising, make_raising_when_halted, make_substitute

Occasion = Literal["first", "middle", "late", "lasting"]
"""Occasion of a fault: first activation or start of the run, middle, near the end, or repeatedly."""
INJECTED_MESSAGE = "failure injected by the campaign"
"""Message of a skill that the campaign lets fail without a cause in the cell."""


class InjectedError(Exception):
    """The error that a campaign raises in a skill to simulate a bug."""


@dataclass(frozen=True)
class SkillFault:
    """A misbehaviour of a skill without a cause in the cell.

    Attributes:
        node: Path of the node that runs the skill.
        kind: The skill fails, raises an error, or raises an error when it is halted.
        reason: Reason of the failure; "" for an error.
        start_numbers: Numbers of the activations in which the skill misbehaves, from 1; empty: all.
        delay_steps: Number of control steps from the start of the skill to the error.
    """

    node: str
    kind: Literal["fails", "raises", "raises when halted"]
    reason: str = ""
    start_numbers: tuple[int, ...] = ()
    delay_steps: int = 0


@dataclass(frozen=True)
class PlannedFault:
    """A fault of a mission that a campaign injects into a run; can be pickled.

    Attributes:
        location: Path of the affected node, or affected part of the cell: `detector`, `object`, `tool`.
        name: Label or skill of the node; name of the part.
        place: File and line of the node in the mission; "" for a part.
        kind: Reason with which the node must fail, or kind of the fault: `target removed`.
        occasion: Occasion of the fault in the run.
        cause: Cause of the fault, a few words.
        cell_faults: Faults of the cell that cause the fault.
        skill_faults: Misbehaviours of skills that cause the fault.
        is_failure_reason: True if `kind` is a reason of the node.
        expected_reason: Reason with which skills should fail because of a fault of a part; "": no reason.
        is_conditional: True if the node runs only after another fault.
        replaced_number: Number of another fault, from 1, which this fault replaces if the node did not fail
            with its reason; 0: no fault.
    """

    location: str
    name: str
    place: str
    kind: str
    occasion: Occasion
    cause: str
    cell_faults: tuple[ScheduledFault, ...] = ()
    skill_faults: tuple[SkillFault, ...] = ()
    is_failure_reason: bool = False
    expected_reason: str = ""
    is_conditional: bool = False
    replaced_number: int = 0

    @property
    def ends_run(self) -> bool:
        """True if the run must end with the status FAULT, as after any bug."""
        return any(skill_fault.kind != "fails" for skill_fault in self.skill_faults)

    def __str__(self) -> str:
        """Return a description of the fault."""
        return f"{self.location} {self.kind}, {self.occasion}: {self.cause}"


def make_substitutes(
    skill_faults: Iterable[SkillFault], skills: Mapping[str, type[Skill]]
) -> dict[str, type[Skill]]:
    """Return the substitutes of misbehaving skills by path of the node; `skills`: all skills by path."""
    substitutes: dict[str, type[Skill]] = {}
    for fault in skill_faults:
        skill = substitutes.get(fault.node, skills[fault.node])
        error = InjectedError("a bug that the campaign injected")
        if fault.kind == "fails":
            faulty = _make_failing(skill, fault.reason)
        elif fault.kind == "raises":
            faulty = make_raising(skill, error, delay_steps=fault.delay_steps)
        else:
            faulty = make_raising_when_halted(skill, error)
        substitutes[fault.node] = make_substitute(skill, "Faulty", faulty.run, fault.start_numbers or None)
    return substitutes


def _make_failing(skill: type[Skill], reason: str) -> type[Skill]:
    """Return a skill that fails at its start; it drops its object if `tool_left` is EMPTY for the reason.

    If the object sticks to the tool and cannot fall, the original skill runs instead.
    """
    is_dropping = skill.tool_left.get(reason) is EMPTY

    def run(self: Skill, cell: Cell) -> Steps:
        if is_dropping:
            cell.tool.open()
            if cell.tool.holding:
                yield from skill.run(self, cell) or ()
                return
            if (item := cell.ledger.find_held_item()) is not None:
                detect_and_record_drop(cell, item)
        raise self.failure(reason, INJECTED_MESSAGE)

    return make_substitute(skill, "Failing", run)
