"""Cell whose questions and commands go through a tape: the cell that the tree of a run sees."""

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


class Question(NamedTuple):
    """Form of a question and its answer in the record.

    Attributes:
        name: Its name there, with `{key}` for the detector and `{0}` for the first argument.
        codec: Codec of the answer.
    """

    name: str
    codec: Codec = PLAIN


QUESTIONS: Mapping[str, Question] = {
    "arm.q": Question("arm.q", ARRAY),
    "arm.tool_pose": Question("arm.tool_pose", POSE),
    "arm.tool_velocity": Question("arm.tool_velocity", ARRAY),
    "arm.destination": Question("arm.destination", ARRAY),
    "arm.at_rest": Question("arm.at_rest"),
    "arm.met": Question("arm.met"),
    "plan.ready": Question("plan.ready"),
    "plan.result": Question("plan", MOTION),
    "tool.touching": Question("tool.touching"),
    "tool.holding": Question("tool.holding"),
    "tool.bears": Question("tool.bears"),
    "camera.name": Question("camera.name"),
    "camera.scan_poses": Question("camera.scan_poses", TEXTS),
    "camera.next_pose": Question("camera.next_pose"),
    "camera.area": Question("camera.area.{0}", BOX),
    "camera.sees_table": Question("camera.sees_table"),
    "camera.capture": Question("camera.frame", FRAME),
    "request.ready": Question("detector.{key}.ready"),
    "request.result": Question("detector.{key}", ANSWER),
    "operator.ask": Question("operator"),
    "localizer.locate": Question("localizer", ARRAY),
}
"""Every access that is recorded with its answer."""

COMMANDS = frozenset(
    {"arm.plan", "arm.plan_ahead", "arm.start", "arm.stop", "tool.close", "tool.open", "detector.request"}
)
"""Every access that is not made while a tape plays."""

RECORDED_ROLES = ("arm", "tool", "camera", "detector", "operator", "localizer")
"""Parts whose answers are recorded; the ledger belongs to the run, bins and classes to the cell file."""


def recorded(cell: Cell, tape: Tape, emit: Emit) -> Cell:
    """Return the cell with the tape between it and whoever asks it, and with the tape's clock.

    Every action of the tool is emitted as an `intent` before it is done.
    """

    def ask(access: Access) -> Any:
        if access.name in COMMANDS:
            if access.role == "tool":
                emit("intent", action=access.member)
            return tape.command(access.proceed)
        name, codec = QUESTIONS[access.name]
        if "{" in name:
            name = name.format(*access.values, key=access.key)
        return tape.sense(name, access.proceed, codec)

    return replace(intercept(cell, ask, RECORDED_ROLES), clock=StepClock(tape.clock, tape.step))
