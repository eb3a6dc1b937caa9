"""Pytest fixtures of the test kit, available in every test where the executive is installed.

The fixtures import lazily, so that other tests start without delay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from executive.testing.fake_cell import FakeCell
    from executive.testing.run_mission import MissionResult
    from executive.testing.run_skill import SkillResult


@pytest.fixture
def fake_cell() -> FakeCell:
    """A fake cell with an empty table."""
    from executive.testing.fake_cell import FakeCell

    return FakeCell()


@pytest.fixture
def run_skill() -> Callable[..., SkillResult]:
    """The function `executive.testing.run_skill.run_skill`, which runs one skill."""
    from executive.testing.run_skill import run_skill

    return run_skill


@pytest.fixture
def run_mission() -> Callable[..., MissionResult]:
    """The function `executive.testing.run_mission.run_mission`, which runs a whole mission."""
    from executive.testing.run_mission import run_mission

    return run_mission
