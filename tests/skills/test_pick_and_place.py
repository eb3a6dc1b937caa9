from __future__ import annotations

from collections.abc import Callable

import at_hand
import numpy as np
import pytest
from at_hand import intercept

from executive.cell.frame import BinAppearance
from executive.cell.objects import Target
from executive.drivers.fake import FakeTool
from executive.manipulation.tool_goals import choose_bin
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.approach import Approach
from skills.detect import Detect
from skills.grasp import Grasp
from skills.items import MIN_DROPS_OF_HEAVY_OBJECT, RejectTarget
from skills.move_to_scan import MoveToScan
from skills.release import Release
from skills.transit import Transit

Look = Callable[..., list[Target]]


def carry(fake: FakeCell, item: str) -> None:
    """Bring what is held into the red bin."""
    run_skill(Transit(held=item, bin="red_bin"), fake)
    run_skill(Release(held=item, bin="red_bin"), fake)


@pytest.mark.parametrize(("lower", "height", "reason"), [(0.0, 0.05, ""), (0.01, 0.04, "contradicted")])
def test_approach_ends_on_the_surface_that_it_feels(
    fake: FakeCell, target: Target, lower: float, height: float, reason: str
) -> None:
    fake.world.objects[0].position[2] -= lower
    assert run_skill(Approach(target=target), fake).reason == reason
    assert fake.tool.touching
    assert fake.arm.tool_pose.position[2] == pytest.approx(height, abs=0.002)


def nothing_there(fake: FakeCell) -> None:
    fake.world.objects.clear()


def something_higher(fake: FakeCell) -> None:
    fake.world.objects[0].position[2] += 0.04


def a_lamp(fake: FakeCell) -> None:
    fake.arm.next_obstacle = "link 4 ran into the lamp"


@pytest.mark.parametrize(
    ("change", "reason", "message"),
    [
        (nothing_there, "no_contact", "no contact down to 35 mm, cube-1 was expected at 50 mm"),
        (something_higher, "blocked", "the tool touched something at 90 mm"),
        (a_lamp, "blocked", "link 4 ran into the lamp"),
    ],
)
def test_an_approach_that_meets_something_else_says_what(
    fake: FakeCell, target: Target, change: Callable[[FakeCell], None], reason: str, message: str
) -> None:
    change(fake)
    result = run_skill(Approach(target=target), fake)
    assert (result.reason, result.message[: len(message)]) == (reason, message)
    assert fake.ledger.describe("cube-1").attempts == (1 if reason == "no_contact" else 0)
    assert not fake.ledger.is_fresh(target)


def test_what_the_tool_still_touches_from_before_is_no_contact_with_the_target(
    fake: FakeCell, look: Look
) -> None:
    fake.world.put("cube", 0.5, 0.0)
    fake.world.put("duck", 0.5, 0.15)
    cube, duck = look()
    run_skill(Approach(target=cube), fake)
    assert fake.tool.touching
    assert run_skill(Approach(target=duck), fake).status == "SUCCESS"
    assert np.allclose(fake.arm.tool_pose.position[:2], duck.position[:2], atol=1e-4)


def test_what_fell_before_it_was_let_go_is_not_placed(fake: FakeCell, held: str) -> None:
    fake.tool.open()
    fake.ledger.record_drop(held)
    result = run_skill(Release(held=held, bin="red_bin"), fake)
    assert (result.reason, result.message) == ("dropped", f"{held} is not in the tool any more")
    assert fake.ledger.count_objects_in("red_bin") == 0


def test_a_grasp_without_a_seal_is_missed_and_lets_go(fake: FakeCell, target: Target) -> None:
    fake.tool.can_hold = lambda: False
    run_skill(Approach(target=target), fake)
    result = run_skill(Grasp(target=target), fake)
    assert (result.reason, result.message) == ("missed", "no seal on cube-1 0.10 s after contact")
    assert not fake.ledger.is_fresh(target)
    assert run_skill(Approach(target=target), fake).reason == "stale"


def test_a_halted_grasp_leaves_nothing_in_the_tool_that_the_ledger_does_not_know_of(
    fake: FakeCell, target: Target
) -> None:
    run_skill(Approach(target=target), fake)
    assert run_skill(Grasp(target=target), fake, halt_at=10).status == "HALTED"
    assert (fake.tool.holding, fake.ledger.describe("cube-1").state) == (False, "open")


def test_items_hang_over_one_slot_after_the_other_and_are_placed(
    fake: FakeCell, held: str, look: Look
) -> None:
    slots = fake.cell.bins["red_bin"].slots
    assert run_skill(Transit(held=held, bin="red_bin"), fake).status == "SUCCESS"
    assert fake.arm.tool_pose.position == pytest.approx([*slots[0], 0.065])
    assert run_skill(Release(held=held, bin="red_bin"), fake).outputs == {"placed": "cube-1"}
    assert (fake.ledger.count_states()["placed"], fake.ledger.count_objects_in("red_bin")) == (1, 1)
    fake.world.put("cube", 0.5, 0.1)
    carry(fake, at_hand.pick(fake, look()[0]))
    assert np.allclose(fake.arm.tool_pose.position[:2], slots[1])


@pytest.mark.parametrize(("attribute", "value"), [("open", lambda tool: None), ("touching", True)])
def test_what_does_not_come_off_is_stuck_and_not_placed(
    fake: FakeCell, held: str, monkeypatch: pytest.MonkeyPatch, attribute: str, value: object
) -> None:
    run_skill(Transit(held=held, bin="red_bin"), fake)
    monkeypatch.setattr(FakeTool, attribute, value)
    result = run_skill(Release(held=held, bin="red_bin", settle=0.2), fake)
    assert (result.reason, result.message) == ("stuck", "cube-1 hangs on the tool 0.20 s after release")
    assert result.ticks == pytest.approx(0.2 * 240, abs=1)
    assert (fake.ledger.find_held_item(), fake.ledger.count_states()["placed"]) == (held, 0)


def test_a_seal_that_is_felt_before_the_tool_closes_is_not_believed(fake: FakeCell, target: Target) -> None:
    run_skill(Approach(target=target), fake)
    intercept(fake, "tool.holding", lambda: True)
    assert run_skill(Grasp(target=target), fake).reason == "sensor_implausible"
    assert fake.ledger.find_held_item() is None


def test_an_item_that_weighs_nothing_is_not_held_and_three_in_a_row_discredit_the_sensor(
    fake: FakeCell, held: str, look: Look
) -> None:
    fake.tool.load_error = -fake.cell.get_weight("cube")
    for number in range(3):
        assert run_skill(Transit(held=held, bin="red_bin"), fake).reason == "dropped"
        assert (fake.tool.holding, fake.ledger.describe(held).attempts) == (False, number + 1)
        fake.ledger.record_grasp(held)
        fake.world.held_object = fake.world.objects[0]
    fake.tool.open()
    result = run_skill(Grasp(target=fake.ledger._records.find(held).target), fake)
    assert (result.reason, "3 times in a row" in result.message) == ("sensor_implausible", True)


def test_a_sensor_that_reports_an_object_in_free_air_is_named(fake: FakeCell, held: str) -> None:
    fake.world.objects.clear()
    fake.world.held_object = None
    intercept(fake, "tool.holding", lambda: True)
    assert run_skill(Transit(held=held, bin="red_bin"), fake).reason == "sensor_implausible"
    assert fake.ledger.describe(held).state == "lost"


def test_a_load_cell_without_noise_is_no_evidence(fake: FakeCell, held: str) -> None:
    intercept(fake, "tool.load", lambda: fake.ledger.empty_load)
    assert run_skill(Transit(held=held, bin="red_bin"), fake).status == "SUCCESS"


def test_what_the_load_cell_still_feels_after_the_release_is_stuck(fake: FakeCell, held: str) -> None:
    run_skill(Transit(held=held, bin="red_bin"), fake)
    fake.tool.load_error = fake.cell.get_weight("cube")
    assert run_skill(Release(held=held, bin="red_bin"), fake).reason == "stuck"


def test_an_item_is_given_up_with_its_reason_after_the_failures_the_mission_grants(
    fake: FakeCell, target: Target
) -> None:
    for state in ("open", "rejected"):
        fake.ledger.record_failed_pick("cube-1")
        run_skill(RejectTarget(item="cube-1", after=2), fake)
        assert fake.ledger.describe("cube-1").state == state
    assert fake.ledger.list_items()[0].reason == "could not be picked (2 failed attempts)"


def test_the_reason_of_an_item_that_the_tool_drops_again_and_again_is_its_weight(
    fake: FakeCell, target: Target
) -> None:
    for _ in range(MIN_DROPS_OF_HEAVY_OBJECT):
        fake.ledger.record_grasp("cube-1")
        fake.ledger.record_drop("cube-1")
    run_skill(RejectTarget(item="cube-1"), fake)
    assert "too heavy" in fake.ledger.list_items()[0].reason


def test_move_to_scan_goes_to_the_cameras_first_pose_only_if_the_table_is_out_of_view(fake: FakeCell) -> None:
    assert (run_skill(MoveToScan(), fake).ticks, fake.arm.commands) == (0, [])
    run_skill(MoveToScan(pose="aside"), fake)
    intercept(fake, "camera.sees_table", lambda: False)
    assert run_skill(MoveToScan(), fake).status == "SUCCESS"
    assert np.allclose(fake.arm.q, np.radians(fake.config.arm.poses_deg["home"]))


def test_taken_away_while_it_lets_go_it_has_placed_what_fell(fake: FakeCell, held: str) -> None:
    result = run_skill(Release(held=held, bin="red_bin"), fake, halt_at=3)
    assert (result.status, fake.tool.holding) == ("HALTED", False)
    assert (fake.ledger.find_held_item(), fake.ledger.count_objects_in("red_bin")) == (None, 1)
    # Started again it has nothing more to do.
    again = run_skill(Release(held=held, bin="red_bin"), fake)
    assert (again.status, again.outputs, again.ticks) == ("SUCCESS", {"placed": held}, 0)
    assert fake.ledger.count_objects_in("red_bin") == 1


def test_a_contradicted_bin_is_named_and_gets_no_item_until_an_image_confirms_it(
    fake: FakeCell, held: str, look: Look
) -> None:
    intercept(fake, "camera.inspect_bins", lambda frame: {"red_bin": BinAppearance("red_bin is gone")})
    run_skill(Detect(view="full"), fake)
    result = run_skill(Transit(held=held, bin="red_bin"), fake)
    assert (result.reason, result.message) == ("bin_missing", "red_bin is gone")
    assert choose_bin(fake.cell, held) == ""
    assert [event.text for event in fake.ledger.unexplained.events] == ["red_bin is gone"]
    intercept(fake, "camera.inspect_bins", lambda frame: {"red_bin": BinAppearance("")})
    run_skill(Detect(view="full"), fake)
    assert (choose_bin(fake.cell, held), fake.ledger.unexplained.events) == ("red_bin", [])
