"""What a fault script does to the simulated tool and arm."""

from __future__ import annotations

import pytest
from rig import Rig

from executive.cell.arm import Goal, Task
from executive.cell.layout import build_object_class
from executive.cell.objects import Load

CUBE = (0.5, 0.1)
OVER = Goal((*CUBE, 0.15))
ONTO = Goal((*CUBE, 0.04), guarded_length=0.015, guarded_speed=0.035)


@pytest.fixture
def held(rig: Rig) -> int:
    """A cube that hangs at the tool, in the air."""
    body = rig.add("cube", *CUBE)
    rig.step(60)
    rig.touch_down(ONTO)
    rig.tool.close()
    assert rig.tool.held_body == body
    rig.go(
        OVER,
        Task(load=Load(build_object_class("cube", rig.config.objects["cube"]), rig.tool.holding_force)),
    )
    return body


def height(rig: Rig, body: int) -> float:
    return float(rig.world.get_object_pose(body).position[2])


def test_a_seal_gives_way_and_the_object_falls(rig: Rig, held: int) -> None:
    rig.tool.leaks = True
    rig.step(24)
    assert rig.tool.held_body == held, "a leak takes nothing that is held"
    rig.tool.leaks = False
    assert height(rig, held) > 0.1
    rig.tool.break_seal()
    assert not rig.tool.holding
    rig.step(120)
    assert height(rig, held) == pytest.approx(0.025, abs=0.002)
    assert not rig.tool.holding, "the vacuum is on and nothing is near"
    rig.tool.break_seal()
    assert not rig.tool.holding, "where there is no seal none gives way"


def test_an_arm_that_runs_into_something_brakes_and_says_what(rig: Rig) -> None:
    rig.arm.start(rig.planned(OVER))
    rig.step(60)
    rig.arm.stop_after_collision("a hand")
    assert not rig.arm.at_rest
    assert rig.run() <= 400
    assert rig.arm.collision == "a hand"
    rig.go("home")
    assert rig.arm.collision is None
    rig.arm.stop_after_collision("a hand")
    assert (rig.arm.collision, rig.arm.at_rest) == (None, True), "at rest or braking it runs into nothing"
    rig.arm.start(rig.planned(OVER))
    rig.step(60)
    rig.arm.stop()
    rig.arm.stop_after_collision("a hand")
    rig.run()
    assert rig.arm.collision is None
