from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from unittest.mock import Mock

import pytest
from at_hand import intercept

from executive.cell.objects import Target
from executive.errors import NoDepth
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import SkillResult, run_skill
from skills.look_at import LookAt
from skills.release import Release
from skills.transit import Transit


@pytest.fixture
def placed(fake: FakeCell, held: str) -> str:
    """The cube, in the red bin, with the arm beside it."""
    run_skill(Transit(held=held, bin="red_bin"), fake)
    run_skill(Release(held=held, bin="red_bin"), fake)
    return held


def look_at(fake: FakeCell, **settings: object) -> SkillResult:
    return run_skill(LookAt(**settings), fake)


@pytest.mark.parametrize("settings", [{"item": "cube-1"}, {"bin": "red_bin"}])
def test_a_placed_item_is_there(fake: FakeCell, placed: str, settings: dict[str, str]) -> None:
    result = look_at(fake, **settings)
    assert (result.status, result.commands.count("camera.capture")) == ("SUCCESS", 1)


@pytest.mark.parametrize("settings", [{"item": "cube-1"}, {"bin": "red_bin"}])
def test_a_placed_item_that_someone_takes_away_is_gone(
    fake: FakeCell, placed: str, look: Callable[..., list[Target]], settings: dict[str, str]
) -> None:
    fake.world.objects[0].position[:2] = 0.6, 0.1
    result = look_at(fake, **settings)
    assert (result.reason, result.message) == ("gone", "not at its place any more: cube-1")
    assert result.commands.count("camera.capture") == 2, "one miss is no proof"
    assert fake.ledger.describe("cube-1").state == "lost"
    (target,) = look()
    assert (target.item, target.position[:2].tolist()) == ("cube-1", pytest.approx([0.6, 0.1], abs=1e-3))


def test_a_bin_behind_the_arm_is_hidden(fake: FakeCell, placed: str) -> None:
    fake.camera.occluded_regions = [(0, 0, 640, 480)]
    result = look_at(fake, bin="red_bin")
    assert (result.reason, result.message) == ("hidden", "the camera does not see the place of cube-1")


def test_an_item_in_the_tool_is_at_no_place(fake: FakeCell, held: str) -> None:
    result = look_at(fake, item=held)
    assert (result.reason, result.message) == ("hidden", "cube-1 is in the tool")


def test_a_doubtful_detection_beside_the_slot_is_no_answer(fake: FakeCell, placed: str) -> None:
    fake.world.objects[0].position[1] += 0.1
    fake.detector.make_answer = lambda look, true: [replace(one, confidence=0.4) for one in true]
    result = look_at(fake, bin="red_bin", looks=3)
    assert (result.reason, result.commands.count("camera.capture")) == ("hidden", 3)
    assert result.message.startswith("3 images are not enough")


def test_a_look_without_depth_is_no_answer(fake: FakeCell, placed: str) -> None:
    intercept(fake, "localizer.localize", Mock(side_effect=NoDepth("no depth")))
    assert look_at(fake, item=placed, looks=2).reason == "hidden"
