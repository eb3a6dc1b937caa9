"""What a skill commands of its cell, written down."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial, singledispatch
from typing import Any

from executive.arm import Goal
from executive.cell import Cell
from executive.messages import Detections, Frame, Target
from executive.testing.interception import Intercepted

ARM = ("plan", "plan_ahead", "start", "stop")
TOOL = ("close", "open")
CAMERA = ("capture", "next_pose")
LEDGER = (
    "observe", "touched", "missed", "held", "dropped", "placed", "returned", "rejected", "bumped",
)  # fmt: skip


def written_down(cell: Cell, commands: list[str]) -> Cell:
    """Return the cell with every command to one of its parts noted in `commands`, in order.

    A command is its part, its name and what can be said in a word of what it was given: `arm.plan home`,
    `arm.plan (0.5, 0.0, 0.035)`, `tool.close`, `embedded.request table`, `ledger.held cube-1`. Questions are
    no commands.
    """

    def note(command: str, call: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        words = map(said, (*arguments, *named.values()))
        commands.append(" ".join([command, *filter(None, words)]))
        return call(*arguments, **named)

    def noted(part: Any, name: str, methods: Iterable[str]) -> Any:
        return Intercepted(part, {method: partial(note, f"{name}.{method}") for method in methods})

    return replace(
        cell,
        arm=noted(cell.arm, "arm", ARM),
        tool=noted(cell.tool, "tool", TOOL),
        camera=noted(cell.camera, "camera", CAMERA),
        detectors={name: noted(one, name, ("request",)) for name, one in cell.detectors.items()},
        ledger=noted(cell.ledger, "ledger", LEDGER),
        operator=noted(cell.operator, "operator", ("ask",)),
        decided=partial(note, "decided", cell.decided),
    )


@singledispatch
def said(argument: object) -> str:
    """Return an argument of a command in a word, or "" for one that no word can tell."""
    del argument
    return ""


@said.register
def _(argument: str) -> str:
    return argument


@said.register
def _(argument: Goal) -> str:
    # Adding 0.0 makes a negative zero a plain one.
    return str(tuple(round(float(value), 4) + 0.0 for value in argument.position))


@said.register
def _(argument: Target) -> str:
    return argument.item


@said.register
def _(argument: Frame) -> str:
    return f"frame {argument.id}"


@said.register
def _(argument: Detections) -> str:
    return f"{len(argument.found)} found in frame {argument.frame.id}"
