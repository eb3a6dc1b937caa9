"""Changing the world of a run that was cut off, before it is taken up again."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from executive.drivers.fake import FakeDriver
from executive.drivers.sim.driver import SimDriver
from executive.events import discard_event
from executive.mission.load import LoadedMission
from executive.station.station import CellOptions, SilentOperator, Station
from executive.testing.oracle import WorldAccess

SETTLING_STEPS = 240
"""Control steps until the arm and the objects of a simulated world are at rest."""


def meanwhile(
    log: Path,
    loaded: LoadedMission,
    seed: int,
    act: Callable[[WorldAccess], None],
    kind: Callable[..., Station],
) -> None:
    """Rebuild the world of a cut-off run, let `act` change it, and leave it so for whoever takes the run up.

    Args:
        log: The log of its world; what is done goes there.
        loaded: The run's mission.
        seed: The run's.
        act: Changes the world; the arm is at rest before, and what was moved comes to rest after.
        kind: Makes the station, with a fake or a simulated world.
    """
    with closing(rebuild(log, loaded, seed, kind)) as cell:
        world = WorldAccess(cell)
        settle(cell)
        act(world)
        settle(cell)


def rebuild(log: Path, loaded: LoadedMission, seed: int, kind: Callable[..., Station]) -> Station:
    """Return the station of a run that was cut off, its world as the log says."""
    options = CellOptions(SilentOperator(), cell_folder=loaded.cell_path.parent, world_log=log)
    return kind(loaded.cell_config, seed=seed, routes=loaded.routes, emit=discard_event, options=options)


def settle(cell: Station) -> None:
    """Let the arm and the objects come to rest, in steps that belong to no run."""
    if isinstance(cell.driver, FakeDriver):
        cell.driver.log_state()
        return
    assert isinstance(cell.driver, SimDriver)
    cell.driver.world.is_idle = True
    for _ in range(SETTLING_STEPS):
        cell.advance()
    cell.driver.world.is_idle = False
