"""Runs of a loaded mission: assembly of new, resumed and replayed runs, and the resumption of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from executive.cell.devices import check_driver_options
from executive.cell.protocols import Operator
from executive.events import Observer, RunStarted
from executive.mission.load import LoadedMission, build_tree
from executive.plugins import list_versions
from executive.run.operator import ScriptedOperator, TerminalOperator
from executive.run.run import Run
from executive.skill import Skill
from executive.station.station import CellOptions, Station
from executive.tree.blackboard import Blackboard


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    Attributes:
        seed: Seed of all random numbers.
        requests: Requests of the operator, or None if a person gives requests at the terminal or in a view.
        has_keyboard: True if requests of the operator come from standard input.
        is_realtime: True to execute the run at the speed of the wall clock.
        make_cell: Factory of the station; by default `Station`.
        substitutes: Skill that replaces the skills of nodes, by a pattern for the node paths (`*/Grasp`).
        driver_options: Options of the driver by name; only the driver knows them.
    """

    seed: int
    requests: Sequence[str] | None = None
    has_keyboard: bool = True
    is_realtime: bool = False
    make_cell: Callable[..., Station] = Station
    substitutes: Mapping[str, type[Skill]] = field(default_factory=dict)
    driver_options: Mapping[str, str] = field(default_factory=dict)


def assemble(loaded: LoadedMission, options: RunOptions, observers: Sequence[Observer] = ()) -> Run:
    """Return a new run of a mission.

    Args:
        loaded: The mission and its cell.
        options: Options of the run.
        observers: Observers of the events; each event is passed to the observers in this order.

    Raises:
        InputError: The kind of the cell is not installed, or a request names no class of the mission.
    """
    run = Run(loaded.mission.name, observers, is_realtime=options.is_realtime)
    station = build_station(loaded, options, run)
    complete(run, loaded, options, station, station.driver.clock.step)
    run.start_event = RunStarted(
        mission=loaded.mission.name,
        file=str(loaded.path),
        seed=options.seed,
        params=loaded.params,
        overrides=loaded.overrides,
        requests=options.requests,
        base=str(loaded.cell_path.parent.resolve()),
        step=station.driver.clock.step,
        versions=dict(list_versions()),
        cell=loaded.replacing_cell,
    )
    return run


def build_station(
    loaded: LoadedMission,
    options: RunOptions,
    run: Run,
    world_log: Path | None = None,
    request_count: int = 0,
    *,
    has_devices: bool = True,
) -> Station:
    """Return the station of a run.

    For a resumed run, `world_log` is the log of its world, and `request_count` the number of requests that
    the operator had given before.
    """
    operator: Operator = TerminalOperator(run.emit, run.control, has_keyboard=options.has_keyboard)
    if options.requests is not None:
        operator = ScriptedOperator(options.requests, tuple(loaded.routes), run.emit, request_count)
    check_driver_options(loaded.cell_config.kind, options.driver_options)
    cell_options = CellOptions(
        operator, loaded.cell_path.parent, options.driver_options, world_log, has_devices, loaded.quotas
    )
    return options.make_cell(
        loaded.cell_config, seed=options.seed, routes=loaded.routes, emit=run.emit, options=cell_options
    )


def complete(
    run: Run, loaded: LoadedMission, options: RunOptions, station: Station, control_period: float
) -> None:
    """Give a run its station and its tree; after an exception, the station is closed."""
    run.connect(station, control_period)
    try:
        run.set_tree(build_tree(loaded, run.cell, Blackboard(), run.emit, options.substitutes))
    except BaseException:
        station.close()
        raise
