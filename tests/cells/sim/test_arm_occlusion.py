"""What the arm and its load hide from the camera."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from executive.cell.config import CellConfig
from executive.cells.sim.arm_occlusion import ArmOcclusion
from executive.cells.sim.camera import get_camera_pose
from executive.cells.sim.world import World
from executive.motion.arms import build_planner
from executive.perception.camera_model import compute_calibration, project

Build = Callable[[CellConfig], World]


def test_what_the_tool_holds_hides_what_lies_under_it(build: Build, overhead: CellConfig) -> None:
    world, planner, holds = build(overhead), build_planner(overhead), False
    occlusion = ArmOcclusion(world, planner.kinematics, overhead, lambda: holds)
    camera = overhead.cameras["overhead"]
    matrix, X_WC = compute_calibration(camera)[0], get_camera_pose(world, camera)
    x, y, z = world.get_tool_pose().position
    column, row = project(matrix, X_WC, np.array((x, y - 0.045, z - 0.03))).astype(int)
    empty = occlusion.compute_visibility_mask(matrix, X_WC, (camera.width, camera.height))
    holds = True
    loaded = occlusion.compute_visibility_mask(matrix, X_WC, (camera.width, camera.height))
    assert empty[row, column]
    assert not loaded[row, column], "the load is as large as the largest object, off centre as far as it gets"
    assert loaded.sum() < empty.sum()
