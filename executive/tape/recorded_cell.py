"""Cell behind a tape, which records its answers or plays recorded ones; the tree of a run uses only it."""

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
        name: Name of the question in the record; `{detector}` stands for the name of the detector, `{0}` for
            the first argument.
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
    "request.ready": Question("detector.{detector}.ready"),
    "request.result": Question("detector.{detector}", ANSWER),
    "operator.ask": Question("operator"),
    "localizer.locate": Question("localizer", ARRAY),
}
"""Every access that is recorded with its answer."""

COMMANDS = frozenset(
    {"arm.plan", "arm.plan_ahead", "arm.start", "arm.stop", "tool.close", "tool.open", "detector.request"}
)
"""Every access that is not made while a tape plays."""

RECORDED_ROLES = ("arm", "tool", "camera", "detector", "operator", "localizer")
"""Roles whose answers are recorded; a replay has its own ledger, and reads bins and classes from the file."""


def record_answers(cell: Cell, tape: Tape, emit: Emit) -> Cell:
    """Return the cell with its accesses recorded or answered by the tape, and with the tape's clock.

    Every action of the tool is emitted as an `intent` before it is done.
    """

    def answer(access: Access) -> Any:
        if access.name in COMMANDS:
            if access.role == "tool":
                emit("intent", action=access.member)
            return tape.command(access.proceed)
        name, codec = QUESTIONS[access.name]
        if "{" in name:
            name = name.format(*access.all_arguments, detector=access.detector)
        return tape.sense(name, access.proceed, codec)

    return replace(intercept(cell, answer, RECORDED_ROLES), clock=StepClock(tape.clock, tape.step))
