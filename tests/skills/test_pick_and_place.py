from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.messages import Target
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.grasp import Grasp
from skills.move_to_scan import MoveToScan
from skills.put_down import PutDown
from skills.reject_target import RejectTarget
from skills.release import Release
from skills.transit import Transit


@pytest.fixture
def target(fake: FakeCell, look) -> Target:
    """A cube in the middle of the fake table, seen once."""
    fake.world.put("cube", 0.5, 0.0)
    return look()[0]


@pytest.fixture
def held(fake: FakeCell, target: Target) -> str:
    """The cube, in the tool."""
    run_skill(Approach(target=target), fake)
    return run_skill(Grasp(target=target), fake).outputs["held"]


def test_approach_ends_on_the_surface_it_expected(fake: FakeCell, target: Target) -> None:
    assert run_skill(Approach(target=target), fake).status == "SUCCESS"
    assert fake.tool.touching
    assert fake.arm.tool_pose.position[2] == pytest.approx(0.05, abs=0.002)


def test_approach_feels_for_a_surface_lower_than_expected(fake: FakeCell, target: Target) -> None:
    fake.world.objects[0].position[2] -= 0.01
    assert run_skill(Approach(target=target), fake).status == "SUCCESS"
    assert fake.arm.tool_pose.position[2] == pytest.approx(0.04, abs=0.002)


def test_approach_to_nothing_is_no_contact_and_counts_as_an_attempt(fake: FakeCell, target: Target) -> None:
    fake.world.objects.clear()
    result = run_skill(Approach(target=target), fake)
    assert result.reason == "no_contact"
    assert result.message == "nothing felt down to 35 mm, cube-1 was expected at 50 mm"
    assert fake.ledger.attempts("cube-1") == 1


def test_it_does_not_go_where_something_may_have_moved_since(fake: FakeCell, target: Target) -> None:
    fake.ledger.bumped()
    result = run_skill(Approach(target=target), fake)
    assert (result.status, result.reason, fake.arm.commanded) == ("FAILURE", "stale", [])
    assert result.message == (
        "cube-1 was seen at 0.00 s, and what happened since may have moved it; look again"
    )


def test_every_further_attempt_comes_down_elsewhere(
    fake: FakeCell, target: Target, look: Callable[..., list[Target]]
) -> None:
    places = []
    for _ in range(4):
        (target,) = look()
        run_skill(Approach(target=target), fake)
        places.append(fake.arm.tool_pose.position[:2].copy())
        fake.ledger.missed("cube-1")
    assert all(np.linalg.norm(a - b) > 0.002 for i, a in enumerate(places) for b in places[:i])


def test_a_target_out_of_reach_is_unreachable_and_nothing_moves(fake: FakeCell, look) -> None:
    fake.world.put("cube", 0.80, 0.30)
    result = run_skill(Approach(target=look("full")[0]), fake)
    assert result.reason == "unreachable"
    assert "more than the arm's 0.85 m" in result.message
    assert fake.arm.commanded == []


def test_a_contact_high_above_the_target_is_something_in_the_way(fake: FakeCell, target: Target) -> None:
    fake.world.objects[0].position[2] += 0.04
    result = run_skill(Approach(target=target), fake)
    assert result.reason == "blocked"
    assert result.message == (
        "the tool met something at 91 mm, on its way to cube-1, which was expected at 50 mm"
    )
    assert not fake.ledger.is_fresh(target)


def test_what_the_tool_still_touches_from_before_is_no_contact_with_the_target(fake: FakeCell, look) -> None:
    fake.world.put("cube", 0.5, 0.0)
    fake.world.put("duck", 0.5, 0.15)
    cube, duck = look()
    run_skill(Approach(target=cube), fake)
    assert fake.tool.touching
    assert run_skill(Approach(target=duck), fake).status == "SUCCESS"
    assert np.allclose(fake.arm.tool_pose.position[:2], duck.position[:2], atol=1e-6)


def test_an_approach_that_runs_into_something_is_blocked(fake: FakeCell, target: Target) -> None:
    fake.arm.runs_into = "link 4 ran into the lamp"
    result = run_skill(Approach(target=target), fake)
    assert (result.reason, result.message) == ("blocked", "link 4 ran into the lamp")
    assert fake.ledger.attempts("cube-1") == 0


def test_what_fell_before_it_was_let_go_is_not_placed(fake: FakeCell, held: str) -> None:
    fake.tool.open()
    fake.ledger.dropped(held)
    result = run_skill(Release(held=held, bin="red_bin"), fake)
    assert (result.status, result.reason) == ("FAILURE", "dropped")
    assert result.message == f"{held} is not in the tool any more"
    assert fake.ledger.objects_in("red_bin") == 0


def test_grasp_holds_and_tells_the_ledger(fake: FakeCell, held: str) -> None:
    assert held == "cube-1"
    assert fake.tool.holding
    assert not fake.ledger.is_open("cube-1")


def test_a_grasp_without_a_seal_is_missed_and_lets_go(fake: FakeCell, target: Target) -> None:
    fake.tool.seals = lambda: False
    run_skill(Approach(target=target), fake)
    result = run_skill(Grasp(target=target), fake)
    assert result.reason == "missed"
    assert result.message == "no seal on cube-1 0.10 s after contact"
    assert not fake.ledger.is_fresh(target)


def test_a_halted_grasp_leaves_nothing_in_the_tool_that_the_ledger_does_not_know_of(
    fake: FakeCell, target: Target
) -> None:
    run_skill(Approach(target=target), fake)
    assert run_skill(Grasp(target=target), fake, halt_at=10).status == "HALTED"
    assert not fake.tool.holding
    assert fake.ledger.is_open("cube-1")


def test_transit_hangs_the_item_over_a_slot_of_the_bin(fake: FakeCell, held: str) -> None:
    assert run_skill(Transit(held=held, bin="red_bin"), fake).status == "SUCCESS"
    tip = fake.arm.tool_pose.position
    assert np.allclose(tip[:2], fake.cell.bins["red_bin"].slots[0])
    assert tip[2] == pytest.approx(0.065)


def test_a_seal_that_breaks_on_the_way_is_dropped_and_the_arm_stops(fake: FakeCell, held: str) -> None:
    skill = Transit(held=held, bin="red_bin")
    steps = skill.run(fake.cell)
    for _ in range(60):
        next(steps)
        fake.advance()
    fake.tool.open()
    with pytest.raises(Exception, match="the seal on cube-1 broke on the way to red_bin, near"):
        for _ in range(600):
            next(steps)
            fake.advance()
    assert fake.arm.at_rest
    assert fake.ledger.is_open("cube-1"), "a dropped item is looked for again"


def test_release_places_the_item(fake: FakeCell, held: str) -> None:
    run_skill(Transit(held=held, bin="red_bin"), fake)
    assert run_skill(Release(held=held, bin="red_bin"), fake).outputs["placed"] == "cube-1"
    assert fake.ledger.balance()["placed"] == 1
    assert fake.ledger.objects_in("red_bin") == 1


def test_the_next_item_goes_to_the_next_slot(fake: FakeCell, held: str, look) -> None:
    run_skill(Transit(held=held, bin="red_bin"), fake)
    run_skill(Release(held=held, bin="red_bin"), fake)
    fake.world.put("cube", 0.5, 0.1)
    target = look()[0]
    run_skill(Approach(target=target), fake)
    run_skill(Grasp(target=target), fake)
    run_skill(Transit(held=target.item, bin="red_bin"), fake)
    assert np.allclose(fake.arm.tool_pose.position[:2], fake.cell.bins["red_bin"].slots[1])


def test_what_does_not_come_off_is_stuck_and_not_placed(
    fake: FakeCell, held: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_skill(Transit(held=held, bin="red_bin"), fake)
    monkeypatch.setattr(fake.tool, "open", lambda: None)
    result = run_skill(Release(held=held, bin="red_bin", settle=0.2), fake)
    assert (result.reason, result.message) == ("stuck", "cube-1 hangs on the tool 0.20 s after release")
    assert result.ticks == pytest.approx(0.2 * 240, abs=1)
    assert fake.ledger.in_tool() == held
    assert fake.ledger.balance()["placed"] == 0


def test_a_rejected_item_keeps_its_reason(fake: FakeCell, target: Target) -> None:
    fake.ledger.missed("cube-1")
    run_skill(RejectTarget(item="cube-1"), fake)
    assert fake.ledger.rows()[0]["why"] == "could not be picked (1 failed attempts)"


def test_move_to_scan_stays_where_the_table_is_in_view(fake: FakeCell) -> None:
    assert run_skill(MoveToScan(), fake).ticks == 0
    assert fake.arm.commanded == []


def test_move_to_scan_goes_to_the_cameras_first_pose(fake: FakeCell) -> None:
    run_skill(MoveToScan(pose="aside"), fake)
    fake.camera.sees = lambda: False
    assert run_skill(MoveToScan(), fake).status == "SUCCESS"
    assert np.allclose(fake.arm.tool_pose.position, fake.arm.poses["home"].position)


def test_an_item_is_given_up_only_after_the_failures_the_mission_grants(
    fake: FakeCell, target: Target
) -> None:
    fake.ledger.missed("cube-1")
    run_skill(RejectTarget(item="cube-1", after=2), fake)
    assert fake.ledger.is_open("cube-1")
    fake.ledger.missed("cube-1")
    run_skill(RejectTarget(item="cube-1", after=2), fake)
    assert not fake.ledger.is_open("cube-1")


def test_taken_away_while_it_lets_go_it_has_placed_what_fell(fake: FakeCell, held: str) -> None:
    result = run_skill(Release(held=held, bin="red_bin"), fake, halt_at=3)
    assert (result.status, fake.tool.holding) == ("HALTED", False)
    assert (fake.ledger.in_tool(), fake.ledger.objects_in("red_bin")) == (None, 1)
    # Begun anew it has nothing more to do.
    again = run_skill(Release(held=held, bin="red_bin"), fake)
    assert (again.status, again.outputs, again.ticks) == ("SUCCESS", {"placed": held}, 0)
    assert fake.ledger.objects_in("red_bin") == 1


def test_taken_away_while_it_puts_down_it_has_returned_what_lies_there(fake: FakeCell, held: str) -> None:
    steps = PutDown(held=held).run(fake.cell)
    while fake.tool.holding:
        next(steps)
        fake.advance()
    steps.close()
    (row,) = fake.ledger.rows()
    assert (fake.ledger.in_tool(), row["state"]) == (None, "seen")
    assert row["position"][:2] == list(fake.cell.safe_place[:2])


def test_while_an_arm_brakes_after_a_drop_the_ledger_knows_of_it(fake: FakeCell, held: str) -> None:
    steps = Transit(held=held, bin="red_bin").run(fake.cell)
    for _ in range(60):
        next(steps)
        fake.advance()
    fake.tool.open()
    # An arm that needs a while to stop.
    fake.arm.stop = lambda: None  # type: ignore[method-assign]
    next(steps)
    (row,) = fake.ledger.rows()
    assert (fake.arm.at_rest, row["state"], row["attempts"]) == (False, "dropped", 1)
