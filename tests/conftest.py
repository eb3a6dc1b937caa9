"""Fixtures that many tests share."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest
from at_hand import look
from hypothesis import settings

from executive.cell.config import CellConfig
from executive.cell.objects import Target
from executive.mission.cell_file import load_cell
from executive.testing.fake_cell import FakeCell

# Every run of the tests draws the same examples, so that a red test is red again when it is repeated.
settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")

# Modules are collected by the hundred and then stay: searching them for garbage would find none.
gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


@pytest.fixture
def fake() -> FakeCell:
    """A fake cell with an empty table."""
    return FakeCell()


@pytest.fixture
def target(fake: FakeCell) -> Target:
    """A cube in the middle of the fake table, seen once."""
    fake.world.put("cube", 0.5, 0.0)
    return look(fake)[0]


@pytest.fixture
def targets(fake: FakeCell) -> list[Target]:
    """A cube and a duck on the fake table, seen once."""
    fake.world.put("cube", 0.5, 0.0)
    fake.world.put("duck", 0.6, 0.15)
    return look(fake)


@pytest.fixture(scope="session")
def missions() -> Path:
    """The folder of shipped missions."""
    return Path(__file__).parent.parent / "missions"


@pytest.fixture(scope="session")
def overhead(missions: Path) -> CellConfig:
    """The shipped cell with a fixed camera."""
    return load_cell(missions / "cells" / "overhead.yaml")


@pytest.fixture(scope="session")
def wrist(missions: Path) -> CellConfig:
    """The shipped cell with a camera on the wrist."""
    return load_cell(missions / "cells" / "wrist.yaml")
