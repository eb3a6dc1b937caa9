"""Run one skill by itself, without a tree."""

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
_NOTED = COMMANDS | {
    "camera.capture", "camera.next_pose", "operator.ask", "ledger.observe", "ledger.record_touch",
    "ledger.record_miss", "ledger.record_grasp", "ledger.record_drop", "ledger.record_placement",
    "ledger.record_put_down", "ledger.reject", "ledger.invalidate_positions",
}  # fmt: skip


@dataclass(frozen=True)
class SkillResult:
    """How a skill ended.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `HALTED`, or `RUNNING` if it was still running after `ticks`.
        reason: The declared reason of a failure, or "".
        message: Its sentence, or "".
        outputs: Values of the output ports, on success.
        ticks: Control steps it took.
        commanded: What it commanded of the cell, in order and in words (`written_down`).
        braking: Control steps from a halt until the arm was at rest; None if it still moved after
            `MAX_BRAKING_TIME`.
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

    After a halt the arm is given time to come to rest. Exceptions that are no declared failure come out as
    they are: in a mission they would be faults.

    Args:
        skill: The skill, or its class.
        workcell: Where it runs.
        inputs: Params and inputs of the class by name, for those without a default.
        ticks: Control steps after which nobody waits any longer.
        halt_at: Control step before which the skill is taken away; None: it is left to its end.

    Raises:
        InputError: An input is missing or unknown.
        Fault: The skill broke its own declarations: it succeeded without setting an output, failed with a
            reason that it does not declare, yielded something, or raised while it was halted.
    """
    commanded: list[str] = []
    run = SkillRun(_instance(skill, inputs), written_down(workcell.cell, commanded))
    for tick in range(ticks):
        if tick == halt_at:
            run.halt()
            return SkillResult("HALTED", ticks=tick, commanded=commanded, braking=_braking(workcell))
        try:
            has_succeeded = run.step()
        except SkillFailed as failure:
            return SkillResult("FAILURE", failure.reason, failure.message, ticks=tick, commanded=commanded)
        if has_succeeded:
            return SkillResult("SUCCESS", outputs=run.read_outputs(), ticks=tick, commanded=commanded)
        workcell.advance()
    return SkillResult("RUNNING", ticks=ticks, commanded=commanded)


def _instance(skill: Skill | type[Skill], inputs: Mapping[str, Any] | None) -> Skill:
    if isinstance(skill, type):
        return skill(**(inputs or {}))
    if inputs is not None:
        name = type(skill).__name__
        raise InputError(f"this {name} has its inputs already; pass the class {name} with them, or none")
    return skill


def _braking(workcell: Workcell) -> int | None:
    """Let the arm come to rest and return after how many control steps it was."""
    arm, clock = workcell.cell.arm, workcell.cell.clock
    steps, deadline = 0, clock.now + MAX_BRAKING_TIME
    while not arm.at_rest:
        if clock.now >= deadline:
            return None
        workcell.advance()
        steps += 1
    return steps


def written_down(cell: Cell, commands: list[str]) -> Cell:
    """Return the cell with every command to one of its parts noted in `commands`, in order.

    A command is its part, its name and those of its arguments that have a short text: `arm.plan home`,
    `arm.plan (0.5, 0.0, 0.035)`, `tool.close`, `embedded.request table`, `ledger.reject cube-1`.
    Questions are no commands.
    """

    def note(command: str, *arguments: Any) -> None:
        commands.append(" ".join([command, *filter(None, map(short_text, arguments))]))

    def ask(access: Access) -> Any:
        if access.name in _NOTED:
            note(f"{access.detector or access.role}.{access.member}", *access.all_arguments)
        return access.proceed()

    def decided(target: Target, bin: str) -> None:
        note("decided", target, bin)
        cell.decided(target, bin)

    return replace(intercept(cell, ask, _ROLES), decided=decided)


def short_text(argument: object) -> str:
    """Return the short text of an argument of a command, or "" for one that has none."""
    if isinstance(argument, str):
        return argument
    if isinstance(argument, Goal):
        # Adding 0.0 makes a negative zero a plain one.
        return str(tuple(round(float(value), 4) + 0.0 for value in argument.position))
    if isinstance(argument, Target):
        return argument.item
    if isinstance(argument, Frame):
        return f"frame {argument.id}"
    if isinstance(argument, Detections):
        return f"{len(argument.found)} found in frame {argument.frame.id}"
    return ""
