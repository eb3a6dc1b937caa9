"""Fixtures of the simulation's tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from rig import Rig

from executive.cell.config import CellConfig
from executive.drivers.sim.world import World


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
