"""Fixtures of the simulation's tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rig import Rig

from executive.cell.config import CellConfig
from executive.drivers.sim.world import World
from executive.mission.cell_file import load_cell


def shipped_cell(name: str) -> CellConfig:
    """Return the shipped cell file of that name."""
    path = Path(__file__).parents[3] / "missions" / "cells" / f"{name}.yaml"
    return load_cell(path)


@pytest.fixture(scope="session")
def overhead() -> CellConfig:
    """The shipped cell with a fixed camera."""
    return shipped_cell("overhead")


@pytest.fixture(scope="session")
def wrist() -> CellConfig:
    """The shipped cell with a camera on the wrist."""
    return shipped_cell("wrist")


@pytest.fixture
def build() -> Iterator[Callable[[CellConfig], World]]:
    """Build worlds that are closed after the test."""
    worlds: list[World] = []

    def open_world(config: CellConfig) -> World:
        worlds.append(World(config))
        return worlds[-1]

    yield open_world
    for world in worlds:
        world.close()


@pytest.fixture
def rig(overhead: CellConfig) -> Iterator[Rig]:
    """The arm of the cell with a fixed camera, over an empty table."""
    rig = Rig(overhead)
    yield rig
    rig.close()
