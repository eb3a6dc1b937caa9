"""A mission on the fake cell, and everything that can go wrong in it."""

from __future__ import annotations

import pytest

from executive.campaign.faults.campaign import Campaign
from executive.campaign.mission_under_test import MissionUnderTest
from executive.campaign.pool import JobOptions
from executive.cells.fake.cell import FakeCell
from executive.mission.load import load_mission
from executive.plugins import load_skills


def subject_of(mission: str, seed: int = 0, **overrides: str) -> MissionUnderTest:
    return MissionUnderTest(load_mission(mission, load_skills(), overrides), FakeCell, "fake", seed)


@pytest.fixture(scope="session")
def campaign() -> Campaign:
    return Campaign(subject_of("sort_overhead"), JobOptions(workers=1))
