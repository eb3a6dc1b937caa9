from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.cell import Via
from executive.layout import as_bin, travel_height
from executive.mission.parse.cell_file import load_cell
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner
from executive.sim.arm import SimArm
from executive.sim.clearance import PathClearance
from executive.sim.world import World


@pytest.mark.parametrize("name", ["overhead", "wrist"])
def test_every_scan_pose_can_be_reached_from_every_slot_in_any_posture(missions: Path, name: str) -> None:
    """A contorted arm over a bin once found no way to its scan pose that did not sag."""
    config = load_cell(missions / f"cells/{name}.yaml")
    limits = JointLimits.of(config.arm.limits)
    planner = Planner(Kinematics(config.tool.length, limits.position), limits, PathClearance(config).check)
    world = World(config)
    poses = next(iter(config.cameras.values())).scan_poses
    rng = np.random.default_rng(0)
    for bin_name, section in config.bins.items():
        for slot in as_bin(bin_name, section).slots:
            low = Via(np.array([*slot, 0.07]))
            postures = [
                path[-1] for path in planner._joint_paths(np.radians(config.arm.poses_deg["home"]), [low])
            ]
            world.set_arm(postures[int(rng.integers(len(postures)))])
            arm = SimArm(world, planner, limits, config.arm, travel_height(config))
            for pose in poses:
                assert arm.plan_to_pose(pose).duration > 0
    world.close()
