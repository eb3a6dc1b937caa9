"""The iiwa of the shipped overhead cell, without a simulator."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from executive.cell_config import CellConfig
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner


@pytest.fixture(scope="session")
def config(missions: Path) -> CellConfig:
    return CellConfig(**yaml.safe_load((missions / "cells" / "overhead.yaml").read_text(encoding="utf-8")))


@pytest.fixture(scope="session")
def limits(config: CellConfig) -> JointLimits:
    return JointLimits.of(config.arm.limits)


@pytest.fixture(scope="session")
def kinematics(config: CellConfig, limits: JointLimits) -> Kinematics:
    return Kinematics(config.tool.length, limits.position)


@pytest.fixture(scope="session")
def planner(kinematics: Kinematics, limits: JointLimits) -> Planner:
    return Planner(kinematics, limits)
