"""Execution of one skill in a test, without a tree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from executive.cell.arm import Goal
from executive.cell.detection import Detections
from executive.cell.frame import Frame
from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.cell.workcell import Workcell
from executive.errors import InputError
from executive.replay.recorded_cell import COMMANDS
from executive.run.run_context import MAX_BRAKING_TIME
from executive.skill import Skill, SkillFailed
from executive.tree.skill_run import SkillRun

_ROLES = ("arm", "tool", "camera", "detector", "ledger", "operator")
_COMMANDS = COMMANDS | {
    "camera.capture", "camera.next_pose", "operator.ask", "ledger.observe", "ledger.record_touch",
    "ledger.record_miss", "ledger.record_grasp", "ledger.record_drop", "ledger.record_placement",
    "ledger.record_put_down", "ledger.reject", "ledger.invalidate_positions",
}  # fmt: skip


@dataclass(frozen=True)
class SkillResult:
    """End of a skill, and its commands.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `HALTED`, or `RUNNING` if it was still running after `ticks`.
        reason: The declared reason of a failure, or "".
        message: Message of the failure, or "".
        outputs: Values of the output ports, on success.
        ticks: Number of control steps.
        commanded: Commands to the cell, in order, as texts (`note_commands`).
        braking: Number of control steps from a halt until the arm was at rest; None if the arm still moved
            after `MAX_BRAKING_TIME`.
    """

    status: str
    reason: str = ""
    message: str = ""
    outputs: dict[str, Any] = field(default_factory=dict)
    ticks: int = 0
    commanded: list[str] = field(default_factory=list)
    braking: int | None = 0


def run_skill(
    skill: Skill | type[Skill],
    workcell: Workcell,
    *,
    inputs: Mapping[str, Any] | None = None,
    ticks: int = 20_000,
    halt_at: int | None = None,
) -> SkillResult:
    """Tick a skill on `workcell` until it ends, is halted at tick `halt_at`, or `ticks` have passed.

    After a halt the function waits until the arm is at rest. An exception that is no declared failure is
    raised unchanged; in a mission it would be a fault.

    Args:
        skill: The skill, or its class.
        workcell: Cell in which the skill runs.
        inputs: Params and inputs of the class by name, at least those without a default.
        ticks: Maximum number of control steps.
        halt_at: Control step before which the skill is halted; None: no halt.

    Raises:
        InputError: An input is missing or unknown.
        Fault: The skill violated its declarations: it succeeded without setting an output, failed with an
            undeclared reason, yielded a value, or raised an exception while it was halted.
    """
    commanded: list[str] = []
    run = SkillRun(_instantiate(skill, inputs), note_commands(workcell.cell, commanded))
    for tick in range(ticks):
        if tick == halt_at:
            run.halt()
            return SkillResult(
                "HALTED", ticks=tick, commanded=commanded, braking=_count_braking_steps(workcell)
            )
        try:
            has_succeeded = run.step()
        except SkillFailed as failure:
            return SkillResult("FAILURE", failure.reason, failure.message, ticks=tick, commanded=commanded)
        if has_succeeded:
            return SkillResult("SUCCESS", outputs=run.read_outputs(), ticks=tick, commanded=commanded)
        workcell.advance()
    return SkillResult("RUNNING", ticks=ticks, commanded=commanded)


def _instantiate(skill: Skill | type[Skill], inputs: Mapping[str, Any] | None) -> Skill:
    if isinstance(skill, type):
        return skill(**(inputs or {}))
    if inputs is not None:
        name = type(skill).__name__
        raise InputError(f"this {name} has its inputs already; pass the class {name} with them, or none")
    return skill


def _count_braking_steps(workcell: Workcell) -> int | None:
    """Wait until the arm is at rest; return the number of control steps, or None at `MAX_BRAKING_TIME`."""
    arm, clock = workcell.cell.arm, workcell.cell.clock
    steps, deadline = 0, clock.now + MAX_BRAKING_TIME
    while not arm.at_rest:
        if clock.now >= deadline:
            return None
        workcell.advance()
        steps += 1
    return steps


def note_commands(cell: Cell, commands: list[str]) -> Cell:
    """Return a cell that appends the text of each command to its parts to `commands`.

    A text is the part, the method and the arguments with a short text: `arm.plan home`,
    `arm.plan (0.5, 0.0, 0.035)`, `tool.close`, `embedded.request table`, `ledger.reject cube-1`.
    """

    def note(command: str, *arguments: Any) -> None:
        commands.append(" ".join([command, *filter(None, map(short_text, arguments))]))

    def note_access(access: Access) -> Any:
        if access.name in _COMMANDS:
            note(f"{access.detector or access.role}.{access.member}", *access.all_arguments)
        return access.proceed()

    def note_decision(target: Target, bin: str) -> None:
        note("decided", target, bin)
        cell.decided(target, bin)

    return replace(intercept(cell, note_access, _ROLES), decided=note_decision)


def short_text(argument: object) -> str:
    """Return the short text of an argument of a command, or ""."""
    if isinstance(argument, str):
        return argument
    if isinstance(argument, Goal):
        # Adding 0.0 turns -0.0 into 0.0.
        return str(tuple(round(float(value), 4) + 0.0 for value in argument.position))
    if isinstance(argument, Target):
        return argument.item
    if isinstance(argument, Frame):
        return f"frame {argument.id}"
    if isinstance(argument, Detections):
        return f"{len(argument.found)} found in frame {argument.frame.id}"
    return ""
