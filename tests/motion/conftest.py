"""The iiwa of the shipped overhead cell, without a simulator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from executive.cell.config import CellConfig
from executive.geometry import Array
from executive.motion.arms import build_kinematics
from executive.motion.joints import JointLimits, Kinematics
from executive.motion.planner import Planner
from executive.motion.trajectory import Connector


@pytest.fixture(scope="session")
def config(missions: Path) -> CellConfig:
    return CellConfig(**yaml.safe_load((missions / "cells" / "overhead.yaml").read_text(encoding="utf-8")))


@pytest.fixture(scope="session")
def limits(config: CellConfig) -> JointLimits:
    return JointLimits.from_config(config.arm.limits)


@pytest.fixture(scope="session")
def kinematics(config: CellConfig, limits: JointLimits) -> Kinematics:
    return build_kinematics(config)


@pytest.fixture(scope="session")
def connector(limits: JointLimits) -> Connector:
    return Connector(limits)


@pytest.fixture(scope="session")
def planner(config: CellConfig) -> Planner:
    return Planner(config)


@pytest.fixture(scope="session")
def home(config: CellConfig) -> Array:
    return np.radians(config.arm.poses_deg["home"])
