"""Execution of one skill in a test, without a behaviour tree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from executive.cell.arm import Goal
from executive.cell.frame import Detections, Frame
from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.errors import InputError
from executive.events import discard_event
from executive.run.run import MAX_BRAKING_TIME
from executive.skill import Skill, SkillFailed
from executive.station.border import Access, Border
from executive.station.station import Station
from executive.tree.skill_leaf import SkillRun

_ROLES = ("arm", "tool", "camera", "ledger", "localizer", "operator")
"""Parts of a cell whose accesses tests observe, beside the detectors."""
_LOGGED_CALLS = frozenset({
    "arm.plan", "arm.plan_ahead", "arm.start", "arm.stop", "tool.close", "tool.open", "detector.request",
    "camera.capture", "camera.next_pose", "operator.ask", "ledger.observe", "ledger.record_measurement",
    "ledger.record_failed_pick", "ledger.record_grasp", "ledger.record_drop", "ledger.record_placement",
    "ledger.record_put_down", "ledger.reject", "ledger.defer", "ledger.invalidate_positions",
})  # fmt: skip


def observe_accesses(cell: Cell, on_access: Callable[[Access], None]) -> Cell:
    """Return a copy of a cell that calls `on_access` before each access to one of its parts."""

    def handle(access: Access) -> Any:
        on_access(access)
        return access.proceed()

    border = Border(discard_event)
    border.interceptor = handle
    parts: dict[str, Any] = {role: border.wrap(role, getattr(cell, role)) for role in _ROLES}
    detectors = {name: border.wrap("detector", each, name) for name, each in cell.detectors.items()}
    return replace(cell, detectors=detectors, **parts)


@dataclass(frozen=True)
class SkillResult:
    """Result of a run of a skill.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `HALTED`, or `RUNNING` if the skill did not end within `max_ticks`.
        reason: The declared reason of a failure, or "".
        message: Message of the failure, or "".
        outputs: Values of the output ports by name, on success.
        ticks: Number of control steps from the start to the end.
        commands: Commands to the cell, in order; `log_commands` defines the texts.
        braking_steps: Number of control steps from a halt to rest; None: no rest within `MAX_BRAKING_TIME`.
    """

    status: str
    reason: str = ""
    message: str = ""
    outputs: dict[str, Any] = field(default_factory=dict)
    ticks: int = 0
    commands: list[str] = field(default_factory=list)
    braking_steps: int | None = 0


def run_skill(
    skill: Skill | type[Skill],
    station: Station,
    *,
    inputs: Mapping[str, Any] | None = None,
    max_ticks: int = 20_000,
    halt_at: int | None = None,
) -> SkillResult:
    """Tick a skill until it ends, is halted, or has taken the maximum number of control steps.

    After a halt the function waits until the arm is at rest. An exception that is not a declared failure,
    which would be a fault in a mission, is raised unchanged.

    Args:
        skill: The skill, or the class of the skill.
        station: Station in whose cell the skill runs.
        inputs: Values of params and inputs by name, if `skill` is a class.
        max_ticks: Maximum number of control steps.
        halt_at: Control step before which the skill is halted; None: no halt.

    Raises:
        InputError: An input is missing or unknown, or `inputs` are given with an instance.
        Fault: The skill succeeded without setting an output, failed with an undeclared reason, yielded a
            value, or raised an exception while it was halted.
    """
    commands: list[str] = []
    if isinstance(skill, Skill) and inputs is not None:
        raise InputError(f"an instance of {type(skill).__name__} takes no `inputs`; pass its class")
    instance = skill(**(inputs or {})) if isinstance(skill, type) else skill
    run = SkillRun(instance, log_commands(station.cell, commands))
    for tick in range(max_ticks):
        if tick == halt_at:
            run.halt()
            braking_steps = _count_braking_steps(station)
            return SkillResult("HALTED", ticks=tick, commands=commands, braking_steps=braking_steps)
        try:
            has_succeeded = run.step()
        except SkillFailed as failure:
            return SkillResult("FAILURE", failure.reason, failure.message, ticks=tick, commands=commands)
        if has_succeeded:
            return SkillResult("SUCCESS", outputs=run.read_outputs(), ticks=tick, commands=commands)
        station.advance()
    return SkillResult("RUNNING", ticks=max_ticks, commands=commands)


def _count_braking_steps(station: Station) -> int | None:
    """Wait until the arm is at rest; return the number of control steps, or None after `MAX_BRAKING_TIME`."""
    arm = station.cell.arm
    clock = station.cell.clock
    first_step = station.tick_count
    deadline = clock.now + MAX_BRAKING_TIME
    while not arm.at_rest:
        if clock.now >= deadline:
            return None
        station.advance()
    return station.tick_count - first_step


def log_commands(cell: Cell, commands: list[str]) -> Cell:
    """Return a wrapper of the cell that appends a text to `commands` for every command.

    A text consists of the part, the method, and each argument for which `describe_argument` is not empty:
    `arm.plan home`, `arm.plan (0.5, 0.0, 0.035)`, `tool.close`, `embedded.request table`.
    """

    def log(command: str, *arguments: Any) -> None:
        commands.append(" ".join([command, *filter(None, map(describe_argument, arguments))]))

    def log_access(access: Access) -> None:
        if access.path in _LOGGED_CALLS:
            log(f"{access.name or access.role}.{access.member}", *access.arguments)

    def log_selection(target: Target, bin: str) -> None:
        log("decided", target, bin)
        cell.report_selection(target, bin)

    return replace(observe_accesses(cell, log_access), report_selection=log_selection)


def describe_argument(argument: object) -> str:
    """Return a short description of an argument of a command, or "" for an argument of another type."""
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
        return f"{len(argument.confident)} found in frame {argument.frame.id}"
    return ""
