"""The test kit as pytest fixtures: installed with the executive, in reach of every test.

Whoever starts pytest for something else must not wait for it: nothing is imported before a test asks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from executive.cells.fake.cell import FakeCell
    from executive.testing.run_mission import MissionResult
    from executive.testing.run_skill import SkillResult


@pytest.fixture
def fake_cell() -> FakeCell:
    """A fake cell with an empty table."""
    from executive.cells.fake.cell import FakeCell

    return FakeCell()


@pytest.fixture
def run_skill() -> Callable[..., SkillResult]:
    """Runs one skill: `executive.testing.run_skill.run_skill`."""
    from executive.testing.run_skill import run_skill

    return run_skill


@pytest.fixture
def run_mission() -> Callable[..., MissionResult]:
    """Runs a whole mission: `executive.testing.run_mission.run_mission`."""
    from executive.testing.run_mission import run_mission

    return run_mission
