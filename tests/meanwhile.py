"""Changing the world of a run that was cut off, before it is taken up again."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from executive.cell.devices import ResumePoint, Workcell
from executive.events import discard_event
from executive.mission.load import LoadedMission
from executive.station.station import CellOptions, SilentOperator
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import WorldAccess

SETTLING_STEPS = 240
"""Control steps until the arm and the objects of a simulated world are at rest."""


def meanwhile(
    log: Path,
    loaded: LoadedMission,
    seed: int,
    act: Callable[[WorldAccess], None],
    kind: Callable[..., Workcell],
) -> None:
    """Rebuild the world of a cut-off run, let `act` change it, and leave it so for whoever takes the run up.

    Args:
        log: The log of its world; what is done goes there.
        loaded: The run's mission.
        seed: The run's.
        act: Changes the world; the arm is at rest before, and what was moved comes to rest after.
        kind: Makes the work cell, a fake or a simulated one.
    """
    options = CellOptions(SilentOperator(), cell_folder=loaded.cell_path.parent, resume=ResumePoint(log))
    cell = kind(loaded.cell_config, seed=seed, routes=loaded.routes, emit=discard_event, options=options)
    with closing(cell):
        world = WorldAccess(cell)
        settle(cell, world)
        act(world)
        settle(cell, world)


def settle(cell: Workcell, access: WorldAccess) -> None:
    """Let the arm and the objects come to rest, in steps that belong to no run."""
    if isinstance(cell, FakeCell):
        cell.log_state()
        return
    access.world.is_idle = True
    for _ in range(SETTLING_STEPS):
        cell.advance()
    access.world.is_idle = False
