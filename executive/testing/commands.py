"""Commands of a skill to its cell, as a list of short texts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from executive.cell.arm import Goal
from executive.cell.detection import Detections
from executive.cell.frame import Frame
from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.replay.recorded_cell import COMMANDS

_ROLES = ("arm", "tool", "camera", "detector", "ledger", "operator")
_NOTED = COMMANDS | {
    "camera.capture", "camera.next_pose", "operator.ask", "ledger.observe", "ledger.record_touch",
    "ledger.record_miss", "ledger.record_grasp", "ledger.record_drop", "ledger.record_placement",
    "ledger.record_put_down", "ledger.reject", "ledger.invalidate_positions",
}  # fmt: skip


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
