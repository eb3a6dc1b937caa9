from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.cell import Via
from executive.messages import ObjectClass
from executive.mission.parse.cell_file import load_cell
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.planner import SAG_LOADED, Planner


@pytest.fixture(scope="module")
def planner(missions: Path) -> Planner:
    config = load_cell(missions / "cells/overhead.yaml")
    limits = JointLimits.of(config.arm.limits)
    return Planner(Kinematics(config.tool.length, limits.position), limits)


def test_a_load_keeps_its_travel_height_all_the_way_to_a_bin(planner: Planner) -> None:
    """A straight line in joint space from here to there once sank by 5 cm and swept an object away."""
    high = 0.16
    rng = np.random.default_rng(3)
    for _ in range(25):
        place = rng.uniform((0.42, -0.22), (0.64, 0.22))
        slot = rng.uniform((0.16, 0.38), (0.30, 0.58)) * (1, rng.choice((-1, 1)))
        pick = planner.plan(np.zeros(7), [Via(np.array([*place, high])), Via(np.array([*place, 0.05]))]).end
        vias = [Via(np.array([*place, high])), Via(np.array([*slot, high])), Via(np.array([*slot, 0.07]))]
        motion = planner.plan(pick, vias, carrying=ObjectClass("cube", 0.05, 0.036))
        lift, arrive = motion.rests[1:3]
        times = np.linspace(lift, arrive, 60)
        heights = [planner.kinematics.forward(motion.at(time)[0]).position[2] for time in times]
        assert min(heights) > high - SAG_LOADED - 1e-3
