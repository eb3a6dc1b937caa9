"""The cell that a tree sees: everything it answers goes through the tape."""

from __future__ import annotations

import inspect

import pytest

from executive import arm, cell
from executive.tape import taped_cell
from executive.tape.tape import Tape
from executive.tape.taped_cell import taped
from executive.testing.fake_cell import FakeCell

PARTS = {
    cell.Clock: taped_cell.TapedClock,
    arm.Arm: taped_cell.TapedArm,
    arm.Planning: taped_cell.TapedPlanning,
    cell.Tool: taped_cell.TapedTool,
    cell.Camera: taped_cell.TapedCamera,
    cell.Detector: taped_cell.TapedDetector,
    cell.Request: taped_cell.TapedRequest,
    cell.Operator: taped_cell.TapedOperator,
    cell.Localizer: taped_cell.TapedLocalizer,
}


@pytest.mark.parametrize("protocol", PARTS, ids=lambda protocol: protocol.__name__)
def test_no_member_of_a_part_is_left_out(protocol: type) -> None:
    members = {name for name, _ in inspect.getmembers(protocol) if not name.startswith("_")}
    assert members
    assert members <= set(vars(PARTS[protocol]))


def test_every_part_that_can_answer_is_taped() -> None:
    fake = FakeCell()
    tape = Tape(lambda kind, **data: None, 1 / 240, lambda: 0.0)
    behind = taped(fake.cell, tape, lambda kind, **data: None)
    same = {name for name in vars(behind) if getattr(behind, name) is getattr(fake.cell, name)}
    # What stands in a file, and what the run itself knows.
    assert same == {
        "ledger", "bins", "classes", "routes", "safe_place", "descent", "descent_speed", "decided",
    }  # fmt: skip


def test_what_the_tool_is_about_to_do_is_told_before_it_does_it() -> None:
    fake = FakeCell()
    told: list[tuple[str, str, bool]] = []

    def emit(kind: str, **data: object) -> None:
        if kind == "intent":
            told.append((kind, str(data["action"]), fake.tool.holding))

    tape = Tape(lambda kind, **data: None, 1 / 240, lambda: 0.0)
    tool = taped(fake.cell, tape, emit).tool
    fake.world.put("cube", *fake.arm.tool_pose.position[:2]).position[2] = (
        fake.arm.tool_pose.position[2] - 0.025
    )
    tool.close()
    assert tool.holding
    tool.open()
    assert not tool.holding
    assert told == [("intent", "close", False), ("intent", "open", True)]
