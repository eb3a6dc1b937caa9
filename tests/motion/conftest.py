"""The arm of the shipped overhead cell, without a simulator."""

from __future__ import annotations

import numpy as np
import pytest
from joint_states import ARM, CONFIG

from executive.cell.config import CellConfig
from executive.geometry import Array
from executive.motion.joints import JointLimits, Kinematics
from executive.motion.planner import Planner
from executive.motion.trajectory import Connector


@pytest.fixture(scope="session")
def config() -> CellConfig:
    return CONFIG


@pytest.fixture(scope="session")
def limits(config: CellConfig) -> JointLimits:
    return JointLimits.from_config(config.arm.limits)


@pytest.fixture(scope="session")
def kinematics() -> Kinematics:
    return ARM


@pytest.fixture(scope="session")
def connector(limits: JointLimits) -> Connector:
    return Connector(limits)


@pytest.fixture(scope="session")
def planner(config: CellConfig) -> Planner:
    return Planner(config)


@pytest.fixture(scope="session")
def home(config: CellConfig) -> Array:
    return np.radians(config.arm.poses_deg["home"])
