"""No seal, a seal that breaks, an object that sticks: on the fake cell."""

from __future__ import annotations

import numpy as np
import pytest

from executive.testing.disturbances import (
    DisturbedCell,
    after,
    between,
    during,
    seal_breaks,
    seal_fails,
    tool_sticks,
)
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import run_mission


def test_a_grasp_that_slips_is_tried_again() -> None:
    result = run_mission("sort_overhead", disturbances=[during("*/Grasp", seal_fails(), nth=2)])
    assert (result.status, result.reasons("*/Grasp")) == ("SUCCESS", ["missed"])
    assert result.agrees


def test_what_hangs_at_the_tool_stays_there_when_nothing_new_can_be_sealed() -> None:
    result = run_mission("sort_overhead", disturbances=[during("*/Transit", seal_fails())])
    assert (result.status, result.disturbances()) == ("SUCCESS", [])


@pytest.mark.parametrize("share", [0.2, 0.8])
def test_a_seal_breaks_so_far_on_the_way_and_what_hung_there_falls(share: float) -> None:
    fake, told = FakeCell(), []
    fake.world.held = fake.world.put("cube", 0.5, 0.0)
    script = [after(0.0, seal_breaks(share))]
    cell = DisturbedCell(fake, script, lambda kind, **data: told.append(data["position"]))
    arm = cell.cell.arm
    start, end = arm.tool_pose.position, fake.arm.poses["aside"].position
    planning = arm.plan("aside")
    while not planning.ready:
        cell.advance()
    arm.start(planning.result())
    while fake.tool.holding:
        cell.advance()
    way = float(np.linalg.norm(arm.tool_pose.position - start) / np.linalg.norm(end - start))
    assert way == pytest.approx(share, abs=0.02)
    assert not arm.at_rest
    assert told[0][2] > 0.1, "it hung in the air"
    assert fake.world.objects[0].position[2] == pytest.approx(0.025)


def test_what_falls_is_picked_up_again() -> None:
    result = run_mission("sort_overhead", disturbances=[during("*/Transit", seal_breaks(), nth=1)])
    assert (result.status, result.reasons("*/Transit")) == ("SUCCESS", ["dropped"])
    assert result.agrees


def test_a_seal_breaks_only_while_something_is_carried() -> None:
    result = run_mission("sort_overhead", disturbances=[between(0.0, 100.0, seal_breaks())])
    (told,) = result.disturbances()
    assert told["node"] == ""
    assert result.reasons("*/Transit") == ["dropped"]


def test_what_sticks_is_in_the_tool_when_the_mission_gives_up() -> None:
    sticks = during("*/Release", tool_sticks(), nth=(2, 3, 4))
    result = run_mission("sort_overhead", disturbances=[sticks])
    assert (result.status, result.reason) == ("FAILURE", "Release.stuck")
    assert [told["item"] for told in result.disturbances()] == [result.holds] * 3
    assert result.cell.tool.holding
    assert result.agrees


def test_what_sticks_comes_off_when_the_tool_is_opened_once_more() -> None:
    fake = FakeCell()
    fake.world.held = fake.world.put("cube", 0.5, 0.0)
    cell = DisturbedCell(fake, [between(0.0, 0.1, tool_sticks())])
    cell.cell.tool.open()
    assert fake.tool.holding
    while cell.cell.clock.now < 0.1:
        cell.advance()
    assert fake.tool.holding
    cell.cell.tool.open()
    assert not fake.tool.holding
