"""The cell that a tree sees: every question and command goes through the tape."""

from __future__ import annotations

from executive.cell.proxy import IS_METHOD
from executive.cells.fake.cell import FakeCell
from executive.replay.input_recorder import Tape
from executive.replay.recorded_cell import COMMANDS, INPUT_FORMATS, RECORDED_ROLES, cell_on_tape


def test_every_member_of_a_part_is_a_question_or_a_command() -> None:
    roles = (*RECORDED_ROLES, "plan", "request")
    members = {f"{role}.{member}" for role in roles for member in IS_METHOD[role]}
    assert members == INPUT_FORMATS.keys() | COMMANDS
    assert not INPUT_FORMATS.keys() & COMMANDS


def test_every_part_that_can_answer_is_recorded() -> None:
    fake = FakeCell()
    tape = Tape(lambda kind, **data: None, 1 / 240, lambda: 0.0)
    behind = cell_on_tape(fake.cell, tape, lambda kind, **data: None)
    same = {name for name in vars(behind) if getattr(behind, name) is getattr(fake.cell, name)}
    # The content of a file, and the knowledge of the run itself.
    assert same == {
        "ledger", "bins", "classes", "routes", "safe_place", "descent", "descent_speed", "decided",
    }  # fmt: skip


def test_an_intent_is_emitted_before_the_tool_acts() -> None:
    fake = FakeCell()
    intents: list[tuple[str, bool]] = []

    def emit(kind: str, **data: object) -> None:
        if kind == "intent":
            intents.append((str(data["action"]), fake.tool.holding))

    tool = cell_on_tape(fake.cell, Tape(emit, 1 / 240, lambda: 0.0), emit).tool
    tip = fake.arm.tool_pose.position
    fake.world.put("cube", *tip[:2]).position[2] = tip[2] - 0.025
    tool.close()
    assert tool.holding
    tool.open()
    assert not tool.holding
    assert intents == [("close", False), ("open", True)]
