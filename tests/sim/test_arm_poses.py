"""Named poses as goals: the camera's can be reached from wherever a sort leaves the arm."""

from __future__ import annotations

import numpy as np
import pytest

from executive.arm import Goal
from executive.cell_config import CellConfig
from executive.layout import as_bin
from executive.motion.planner import Planner
from executive.sim.clearance import PathClearance


@pytest.mark.parametrize("name", ["overhead", "wrist"])
def test_every_scan_pose_can_be_reached_from_every_slot_however_the_arm_came_there(
    name: str, request: pytest.FixtureRequest
) -> None:
    """A contorted arm over a bin once found no way to its scan pose that did not sag."""
    config: CellConfig = request.getfixturevalue(name)
    clearance = PathClearance(config)
    planner = Planner(config, clearance.check)
    poses = next(iter(config.cameras.values())).scan_poses
    rng = np.random.default_rng(0)
    home = np.radians(config.arm.poses_deg["home"])
    for bin_name, section in config.bins.items():
        for slot in as_bin(bin_name, section).slots:
            x, y = rng.uniform(*config.table.x), rng.uniform(*config.table.y)
            picked = planner.plan(home, Goal((x, y, 0.05))).end
            start = planner.plan(picked, Goal((*slot, 0.07), yaw=rng.uniform(-np.pi / 2, np.pi / 2))).end
            for pose in poses:
                goal = np.radians(config.arm.poses_deg[pose])
                assert np.allclose(planner.plan(start, goal).end, goal), (bin_name, pose)
    clearance.close()
