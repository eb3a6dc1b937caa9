"""What the arm and its load hide from the camera."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from executive.cell_config import CellConfig
from executive.clock import STEP
from executive.motion.planner import Planner
from executive.sim.arm import SimArm
from executive.sim.clock import SimClock
from executive.sim.view import ArmShadow
from executive.sim.world import World
from executive.vision.camera_model import calibrated, project


class Stage:
    """A world with nothing in it but an arm that may hold something, seen from above."""

    def __init__(self, config: CellConfig) -> None:
        self.world = World(config, visuals=False)
        self.holds = False
        planner = Planner(config)
        arm = SimArm(self.world, planner, config, SimClock(self.world, STEP))
        self.shadow = ArmShadow(arm, planner.kinematics, config, lambda: self.holds)
        camera = config.cameras["overhead"]
        self.matrix, self.X_WC = calibrated(camera)
        self.size = camera.width, camera.height

    def shows(self, point: tuple[float, float, float]) -> bool:
        visible = self.shadow.visible(self.matrix, self.X_WC, self.size)
        column, row = project(self.matrix, self.X_WC, np.array(point)).astype(int)
        return bool(visible[row, column])

    def hidden(self) -> int:
        return int((~self.shadow.visible(self.matrix, self.X_WC, self.size)).sum())


@pytest.fixture
def stage(overhead: CellConfig) -> Iterator[Stage]:
    made = Stage(overhead)
    yield made
    made.world.close()


def test_what_the_tool_holds_hides_what_lies_under_it(stage: Stage) -> None:
    x, y, z = stage.world.tool_pose().position
    beside = (x, y - 0.045, z - 0.03)
    empty = stage.hidden()
    assert stage.shows(beside)
    stage.holds = True
    assert not stage.shows(beside), "the load is as large as the largest object, off centre as far as it gets"
    assert stage.hidden() > empty
