"""Something in the way, and no way at all: on the fake cell."""

from __future__ import annotations

from executive.arm import Goal
from executive.events import ignore
from executive.testing.disturbances import DisturbedCell, after, arm_runs_into, during, no_way
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import run_mission
from executive.testing.run_skill import run_skill
from skills.move_to_scan import MoveToScan


def test_an_approach_that_runs_into_something_is_blocked_and_tried_again() -> None:
    result = run_mission("sort_overhead", disturbances=[during("*/Approach", arm_runs_into("a hand"), nth=2)])
    failed = next(e for e in result.events if e.data.get("reason") == "blocked")
    assert failed.data["message"] == "the arm ran into a hand"
    assert [told["what"] for told in result.disturbances()] == ["arm_runs_into"]
    assert (result.status, result.items["rejected"]) == ("SUCCESS", 0)
    assert result.agrees


def test_a_carry_that_runs_into_something_keeps_what_it_holds() -> None:
    script = [during("*/Transit", arm_runs_into(), nth=(1, 2, 3))]
    result = run_mission("sort_overhead", disturbances=script)
    assert result.reasons("*/Transit") == ["blocked"] * 3
    assert len(result.entered("*/PutDown")) == 1
    assert (result.status, result.items["rejected"]) == ("SUCCESS", 1)
    assert result.agrees


def test_it_runs_into_something_so_far_on_its_way() -> None:
    for share in (0.25, 0.75):
        fake = FakeCell()
        cell = DisturbedCell(fake, [after(0.0, arm_runs_into(share=share))], ignore)
        result = run_skill(MoveToScan, cell, inputs={"pose": "aside"})
        assert (result.reason, result.message) == ("blocked", "the arm ran into something")
        here, there = fake.arm.tool_pose.position, fake.arm.poses["aside"].position
        start = fake.arm.poses["home"].position
        assert abs(((here - start) @ (there - start)) / ((there - start) @ (there - start)) - share) < 0.02


def test_a_way_that_is_not_found_is_unreachable_and_nothing_moves() -> None:
    fake = FakeCell()
    cell = DisturbedCell(fake, [after(0.0, no_way())], ignore)
    result = run_skill(MoveToScan, cell, inputs={"pose": "aside"})
    assert result.reason == "unreachable"
    assert result.message == "the planner finds no way, as the test wants it"
    assert result.ticks > 1, "planning takes its time all the same"
    assert fake.arm.commanded == []


def test_a_mission_gives_up_what_it_finds_no_way_to() -> None:
    result = run_mission("sort_overhead", disturbances=[during("*/Approach", no_way(), nth=2)])
    assert (result.status, result.reasons("*/Approach")) == ("SUCCESS", ["unreachable"])
    assert (result.items["rejected"], result.agrees) == (1, True)


def test_the_arm_is_what_it_was_for_whatever_is_not_disturbed() -> None:
    fake = FakeCell()
    cell = DisturbedCell(fake, [after(0.0, no_way())], ignore).cell
    cell.arm.plan_ahead(Goal((0.5, 0.0, 0.1)))
    assert cell.arm.at_rest
    assert cell.arm.q is not None
    assert cell.arm.tool_pose is fake.arm.tool_pose
