"""The cell that a tree sees: every question and command is recorded."""

from __future__ import annotations

from executive.cell.clock import StepClock
from executive.cell.protocols import Cell
from executive.cell.proxy import IS_METHOD
from executive.cells.fake.cell import FakeCell
from executive.events import Emit, Event, ToolCommanded, discard_event
from executive.replay.recording_cell import (
    COMMANDS,
    INPUT_FORMATS,
    RECORDED_ROLES,
    InputRecorder,
    make_recording_cell,
)


def recorded(fake: FakeCell, emit: Emit = discard_event) -> Cell:
    return make_recording_cell(fake.cell, InputRecorder(emit), StepClock(lambda: 0.0), emit)


def test_every_member_of_a_part_is_a_question_or_a_command() -> None:
    roles = (*RECORDED_ROLES, "plan", "request")
    members = {f"{role}.{member}" for role in roles for member in IS_METHOD[role]}
    assert members == INPUT_FORMATS.keys() | COMMANDS
    assert not INPUT_FORMATS.keys() & COMMANDS


def test_every_part_that_can_answer_is_recorded() -> None:
    fake = FakeCell()
    cell = recorded(fake)
    same = {name for name in vars(cell) if getattr(cell, name) is getattr(fake.cell, name)}
    # The content of a file, and the knowledge of the run itself.
    assert same == {
        "ledger", "bins", "classes", "routes", "quotas", "safe_place", "descent", "slow_descent",
        "descent_speed", "report_selection",
    }  # fmt: skip


def test_an_intent_is_emitted_before_the_tool_acts() -> None:
    fake = FakeCell()
    intents: list[tuple[str, bool]] = []

    def emit(event: Event) -> None:
        if isinstance(event, ToolCommanded):
            intents.append((event.action, fake.tool.holding))

    tool = recorded(fake, emit).tool
    tip = fake.arm.tool_pose.position
    fake.world.put("cube", *tip[:2]).position[2] = tip[2] - 0.025
    tool.close()
    assert tool.holding
    tool.open()
    assert not tool.holding
    assert intents == [("close", False), ("open", True)]
