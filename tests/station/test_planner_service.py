"""The arm as skills see it: it takes its time to plan, unless it was asked before, and follows one motion."""

from __future__ import annotations

from typing import Any

import pytest
from at_hand import plan_motion

from executive.cell.arm import Goal
from executive.errors import Fault
from executive.events import Event, MotionPlanned
from executive.testing.fake_cell import FakeCell, load_empty_cell

LATENCY = load_empty_cell().motion.planning_time
BESIDE = Goal((0.5, 0.2, 0.03), guarded_length=0.02, guarded_speed=0.05)


def test_a_plan_takes_its_time_unless_it_was_asked_for_before() -> None:
    events = list[Event]()
    fake = FakeCell(emit=events.append)
    arm = fake.unrecorded_cell.arm
    motion = plan_motion(fake, "aside")
    arm.start(motion)
    arm.plan_ahead("home")  # replaced by the next plan
    arm.plan_ahead(BESIDE)
    destination = arm.destination
    while not arm.at_rest:
        fake.advance()
    assert destination == pytest.approx(arm.tool_pose.position)
    planning = arm.plan(BESIDE)
    assert planning.ready and planning.ready
    duration = round(planning.result().duration, 4)
    planned = [event for event in events if isinstance(event, MotionPlanned)]
    assert planned == [
        MotionPlanned(False, LATENCY, round(motion.duration, 4)),
        MotionPlanned(True, 0.0, duration),
    ]
    planning = arm.plan(BESIDE)
    assert not planning.ready, "a plan is used once"
    with pytest.raises(Fault, match='no arm pose "scan"; it has aside, home'):
        arm.plan("scan")


def test_it_follows_one_motion_at_a_time_and_only_planned_ones(fake: FakeCell) -> None:
    arm: Any = fake.cell.arm
    with pytest.raises(Fault, match="the arm follows planned motions, not a str"):
        arm.start("aside")
    motion = plan_motion(fake, "aside")
    arm.start(motion)
    with pytest.raises(Fault, match="start a motion while moving"):
        arm.start(motion)
    with pytest.raises(Fault, match="plan a motion while moving"):
        arm.plan("home")
    arm.stop()
    fake.arm.stop_after_collision("not while it rests")
    assert (fake.arm.commands, fake.arm.collision) == (["start", "stop"], None)
