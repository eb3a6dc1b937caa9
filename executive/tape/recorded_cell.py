"""Cell that the tree of a run uses: its tape records each input from the real cell, or replays inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from executive.cell import Cell
from executive.cell_proxy import Access, intercept
from executive.clock import StepClock
from executive.events import Emit
from executive.tape.codec import ANSWER, ARRAY, BOX, FRAME, MOTION, PLAIN, POSE, TEXTS, Codec
from executive.tape.tape import Tape


class RecordedInput(NamedTuple):
    """Form of one kind of input in the record.

    Attributes:
        name: Name of the input in the record; `{detector}` stands for the name of the detector, `{0}` for
            the first argument.
        codec: Codec of the value.
    """

    name: str
    codec: Codec = PLAIN


RECORDED_INPUTS: Mapping[str, RecordedInput] = {
    "arm.q": RecordedInput("arm.q", ARRAY),
    "arm.tool_pose": RecordedInput("arm.tool_pose", POSE),
    "arm.tool_velocity": RecordedInput("arm.tool_velocity", ARRAY),
    "arm.destination": RecordedInput("arm.destination", ARRAY),
    "arm.at_rest": RecordedInput("arm.at_rest"),
    "arm.met": RecordedInput("arm.met"),
    "plan.ready": RecordedInput("plan.ready"),
    "plan.result": RecordedInput("plan", MOTION),
    "tool.touching": RecordedInput("tool.touching"),
    "tool.holding": RecordedInput("tool.holding"),
    "tool.bears": RecordedInput("tool.bears"),
    "camera.name": RecordedInput("camera.name"),
    "camera.scan_poses": RecordedInput("camera.scan_poses", TEXTS),
    "camera.next_pose": RecordedInput("camera.next_pose"),
    "camera.area": RecordedInput("camera.area.{0}", BOX),
    "camera.sees_table": RecordedInput("camera.sees_table"),
    "camera.capture": RecordedInput("camera.frame", FRAME),
    "request.ready": RecordedInput("detector.{detector}.ready"),
    "request.result": RecordedInput("detector.{detector}", ANSWER),
    "operator.ask": RecordedInput("operator"),
    "localizer.locate": RecordedInput("localizer", ARRAY),
}
"""Form of the recorded input of every access that has one."""

COMMANDS = frozenset(
    {"arm.plan", "arm.plan_ahead", "arm.start", "arm.stop", "tool.close", "tool.open", "detector.request"}
)
"""Accesses that command the cell; a replay skips them."""

RECORDED_ROLES = ("arm", "tool", "camera", "detector", "operator", "localizer")
"""Roles whose answers are recorded. A replay builds its own ledger, and reads the cell file for the rest."""


def connect_tape(cell: Cell, tape: Tape, emit: Emit) -> Cell:
    """Return a copy of the cell that uses the tape's clock, and whose answers the tape records or replays.

    Each action of the tool is emitted as an `intent` before the action.
    """

    def answer(access: Access) -> Any:
        if access.name in COMMANDS:
            if access.role == "tool":
                emit("intent", action=access.member)
            return tape.command(access.proceed)
        name, codec = RECORDED_INPUTS[access.name]
        if "{" in name:
            name = name.format(*access.all_arguments, detector=access.detector)
        return tape.sense(name, access.proceed, codec)

    return replace(intercept(cell, answer, RECORDED_ROLES), clock=StepClock(tape.clock, tape.step))
