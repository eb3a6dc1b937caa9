"""Runs of a loaded mission: assembly of new, resumed and replayed runs, and the resumption of a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.devices import Rebuildable, check_driver_options
from executive.cell.protocols import Cell, Operator
from executive.errors import Fault, InputError
from executive.events import Observer, RequestGiven, RunEnded, RunResumed, RunStarted
from executive.mission.load import LoadedMission, build_tree
from executive.plugins import list_versions
from executive.run.operator import ScriptedOperator, TerminalOperator
from executive.run.replay import InputLog, Interruption, Replay
from executive.run.run import Run, brake_arm
from executive.skill import Skill
from executive.station.station import CellOptions, Station
from executive.tree.blackboard import Blackboard
from executive.tree.tree_node import SkillLeaf, halt


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
    station = _build_station(loaded, options, run)
    _complete(run, loaded, options, station, station.driver.clock.step)
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


def assemble_resumed(
    loaded: LoadedMission,
    options: RunOptions,
    log: InputLog,
    world_log: Path,
    *,
    is_complete: bool = True,
    has_ended: bool = False,
) -> ResumedRun:
    """Return a run that replays a recorded run and, if that run was interrupted, continues on a cell.

    Args:
        loaded: The mission and its cell.
        options: Options of the interrupted run.
        log: The recorded inputs.
        world_log: File from which a simulated cell reconstructs its world.
        is_complete: True if the log contains all events of its last control step.
        has_ended: True if the recorded run has ended and is therefore only replayed.

    Raises:
        InputError: The kind of the cell is not installed, its world cannot be reconstructed, or the log lacks
            commands to arm or tool.
    """
    run = ResumedRun(loaded.mission.name, is_realtime=options.is_realtime)
    request_count = sum(isinstance(timed.event, RequestGiven) for timed in log.events)
    station = _build_station(loaded, options, run, world_log, request_count)
    if not isinstance(station.driver, Rebuildable):
        station.tick_count = log.last_tick + 1
    # A killed run loses no command: before the devices execute a command, the journal contains an event of
    # the same tick, which is `ToolCommanded` or `MotionPlanned`.
    elif station.driver.last_command_tick > log.last_tick:
        station.close()
        text = f"the journal ends in control step {log.last_tick}, and lacks later commands to arm or tool"
        raise InputError(f"{text}; somebody changed it, or a disk lost its end; run the mission again")
    interruption = log.make_final_interruption(station.tick_count, is_complete=is_complete)
    run.replay = Replay(station, log, None if has_ended else interruption)
    _complete(run, loaded, options, station, log.control_period)
    return run


def assemble_replay(
    loaded: LoadedMission, log: InputLog, seed: int, observers: Sequence[Observer] = ()
) -> ResumedRun:
    """Return a run that replays a recorded run without hardware or simulation."""
    options = RunOptions(seed, requests=())
    run = ResumedRun(loaded.mission.name, observers)
    station = _build_station(loaded, options, run, has_devices=False)
    run.replay = Replay(station, log)
    _complete(run, loaded, options, station, log.control_period)
    return run


def _build_station(
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


def _complete(
    run: Run, loaded: LoadedMission, options: RunOptions, station: Station, control_period: float
) -> None:
    """Give a run its station and its tree."""
    run.connect(station, control_period)
    run.set_tree(build_tree(loaded, loaded.skills, run.cell, Blackboard(), run.emit, options.substitutes))


class ResumedRun(Run):
    """Run that replays an interrupted run, and then may continue on the devices.

    The replay includes earlier resumptions of the run. Observers receive all events; recorders receive only
    the events after the replay, during which the speed of the wall clock has no effect either.
    """

    replay: Replay

    def __init__(
        self, mission: str, observers: Sequence[Observer] = (), *, is_realtime: bool = False
    ) -> None:
        super().__init__(mission, observers)
        self._is_realtime_after_replay = is_realtime
        self._recorders: list[Observer] = []
        self.control.call_between_ticks(self._stop_or_resume)

    def add_recorder(self, recorder: Observer) -> None:
        """Register a recorder, which receives each event after the replay, before the observers."""
        self._recorders.append(recorder)

    def plan_ahead(self) -> None:
        """Plan the probable next motion, except during the replay."""
        if self.replay.is_live:
            super().plan_ahead()

    def advance(self) -> None:
        """Wait for the next tick of the devices, or continue with the next tick of the record."""
        if self.replay.is_live:
            super().advance()
        else:
            self.replay.advance()
            self.begin_step(self.replay.tick)

    def _execute_tree(self) -> RunEnded:
        """Execute the tree, and again after each resumption of an INCOMPLETE run; return the last end."""
        run_end = super()._execute_tree()
        while run_end.status == "INCOMPLETE" and self.replay.is_resumed_from_incomplete:
            self.advance()
            run_end = super()._execute_tree()
        return run_end

    def _stop_or_resume(self) -> None:
        """Stop or resume the run in the same control step as the recorded run; called between two ticks."""
        replay = self.replay
        while not replay.is_live and not replay.has_run_ended and replay.pending_interruption is not None:
            self._resume(replay.pending_interruption)
        if not replay.is_live and replay.has_run_ended:
            self.control.stop()

    def _resume(self, interruption: Interruption) -> None:
        """Continue after an interruption: halt the skills, brake the arm, and update the ledger.

        Raises:
            Fault: The arm did not come to rest.
        """
        self.replay.resume()
        if self.replay.is_live:
            self._begin_on_devices(interruption)
        else:
            self.begin_step(self.replay.tick)
        halt_running_skills(self.root)
        brake_arm(self.cell, self.advance)
        if interruption.restarts_tree:
            self.station.ledger.discard_rejected_and_skipped()
        reconcile_ledger(self.cell, interruption.last_action)

    def _begin_on_devices(self, interruption: Interruption) -> None:
        """Brake the arm, then emit `RunResumed`. A kill before this event leaves the journal unchanged."""
        station = self.station
        brake_arm(station.unrecorded_cell, station.advance)
        for recorder in self._recorders:
            super().add_recorder(recorder)
        self._is_realtime = self._is_realtime_after_replay
        self.begin_step(station.tick_count)
        self._wall_start = time.monotonic() - self.now
        versions = dict(list_versions())
        self.emit(RunResumed(interruption.kept_step_count, interruption.last_action, versions))


def halt_running_skills(root: Behaviour) -> None:
    """Halt every running skill, so that the next tick starts the skill again; control nodes keep their state.

    Raises:
        Fault: The clean-up of a skill failed; nevertheless all running skills are halted.
    """
    nodes = [node for node in root.iterate() if isinstance(node, SkillLeaf) and node.status is Status.RUNNING]
    if problems := [problem for node in nodes for problem in halt(node)]:
        raise Fault("; ".join(problems))


def reconcile_ledger(cell: Cell, last_action: str) -> None:
    """Correct the ledger with the sensor of the tool, and mark the positions of all items as invalid.

    During the interruption, a person may have moved objects, and the tool may have dropped its item.

    Args:
        cell: Cell with its arm at rest.
        last_action: Last action of the tool, `open` or `close`; "" without an action.
    """
    held_item = cell.ledger.find_held_item()
    is_holding = cell.tool.holding
    if held_item is None and is_holding:
        # The interruption came after the tool gripped an object and before the ledger recorded the grasp.
        cell.tool.open()
    elif held_item is not None and not is_holding and last_action == "close":
        cell.tool.open()
        cell.ledger.record_drop(held_item)
    # After the action `open`, the item stays held: the skill starts again and records the release.
    cell.ledger.invalidate_positions()
