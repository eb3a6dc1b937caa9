"""Faults that a campaign injects into runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import detect_and_record_drop
from executive.record.timeline.activation import Activation
from executive.skill import EMPTY, Skill
from executive.testing.faults.script import ScheduledFault
from executive.testing.substitutes import make_raising, make_raising_when_halted, make_substitute

Occasion = Literal["first", "middle", "late", "lasting"]
"""Occasion of a fault in a run or in a motion: at the start, in the middle, near the end, or repeatedly."""
INJECTED_MESSAGE = "failure injected by the campaign"
"""Message of an injected failure for which the cell has no cause."""


class InjectedError(Exception):
    """Injected error that simulates a bug of a skill."""


@dataclass(frozen=True)
class SkillFault:
    """A failure or bug of a skill without a cause in the cell.

    Attributes:
        node: Path of the node that runs the skill.
        kind: `fails` for a failure; `raises` for an error; `raises when halted` for an error during a halt.
        reason: Reason of the failure; "" for an error.
        activations: Numbers of the affected activations of the node, from 1; empty: all.
        delay_steps: Number of control steps from the start of the skill to the error.
    """

    node: str
    kind: Literal["fails", "raises", "raises when halted"]
    reason: str = ""
    activations: tuple[int, ...] = ()
    delay_steps: int = 0


@dataclass(frozen=True)
class PlannedFault:
    """A fault that a campaign injects into a run of a mission; can be pickled.

    Attributes:
        location: Path of the affected node, or affected part of the cell: `detector`, `object`, `tool`.
        name: Label or skill of the node; name of the part.
        mission_line: File and line of the node in the mission; "" for a part.
        kind: Failure reason of the node, or kind of the fault, for instance `target removed`.
        occasion: Occasion of the fault in the run.
        cause: Cause of the fault, a few words.
        injected: Fault of the cell or of a skill that is injected.
        is_failure_reason: True if `kind` is a failure reason: the fault must let the node fail with it.
        expected_reason: Failure reason that a fault of a part causes in skills; "" if no reason is expected.
        is_conditional: True if the node runs only after another fault.
        replaces_previous: True if the fault is injected only if the previous fault caused no failure.
    """

    location: str
    name: str
    mission_line: str
    kind: str
    occasion: Occasion
    cause: str
    injected: ScheduledFault | SkillFault
    is_failure_reason: bool = False
    expected_reason: str = ""
    is_conditional: bool = False
    replaces_previous: bool = False

    @property
    def is_bug(self) -> bool:
        """True if the fault simulates a bug, after which the run must end with the status FAULT."""
        return isinstance(self.injected, SkillFault) and self.injected.kind != "fails"

    def is_cause_of(self, activation: Activation) -> bool:
        """Return True if an activation ended with the injected error, or with the reason of the fault."""
        if self.is_bug:
            return activation.status == "INVALID" and InjectedError.__name__ in activation.message
        is_failure = (activation.status, activation.reason) == ("FAILURE", self.kind)
        is_cell_fault = isinstance(self.injected, ScheduledFault)
        return is_failure and (is_cell_fault or activation.message == INJECTED_MESSAGE)

    def __str__(self) -> str:
        """Return a description of the fault."""
        return f"{self.location} {self.kind}, {self.occasion}: {self.cause}"


def make_substitutes(faults: list[SkillFault], skills: Mapping[str, type[Skill]]) -> dict[str, type[Skill]]:
    """Return substitutes of the faulty skills; the result and `skills` map the path of a node to a skill."""
    substitutes: dict[str, type[Skill]] = {}
    for fault in faults:
        skill = substitutes.get(fault.node, skills[fault.node])
        error = InjectedError("a bug that the campaign injected")
        if fault.kind == "fails":
            faulty_type = _make_failing(skill, fault.reason)
        elif fault.kind == "raises":
            faulty_type = make_raising(skill, error, delay_steps=fault.delay_steps)
        else:
            faulty_type = make_raising_when_halted(skill, error)
        substitutes[fault.node] = make_substitute(skill, "Faulty", faulty_type.run, fault.activations or None)
    return substitutes


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
