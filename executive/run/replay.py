"""Replay of a recorded run, and its resumption on the devices."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.devices import Rebuildable
from executive.cell.protocols import Cell
from executive.errors import Fault, InputError, Stopped
from executive.events import (
    InputRead,
    Observer,
    RequestGiven,
    RunEnded,
    RunHalted,
    RunResumed,
    RunStarted,
    TimedEvent,
    ToolCommanded,
)
from executive.mission.load import LoadedMission
from executive.plugins import list_versions
from executive.run.assembly import RunOptions, build_station, complete
from executive.run.run import Run, brake_arm
from executive.station.border import RecordedInput
from executive.station.station import Station
from executive.tree.skill_leaf import SkillLeaf
from executive.tree.tree_node import halt


@dataclass(frozen=True)
class Interruption:
    """Interruption of a run between the end of one process and the resumption in another process.

    Attributes:
        kept_step_count: Number of control steps before the interruption that the resumed run keeps.
        last_action: Last action of the tool, `open` or `close`; "" without an action.
        restarts_tree: True if the run ended as INCOMPLETE; the resumption then restarts the tree.
        resume_tick: First control step after the resumption.
    """

    kept_step_count: int
    last_action: str
    restarts_tree: bool
    resume_tick: int


class Halt(NamedTuple):
    """Halt in step `tick`; `is_tree_ticked` is True if the tree was ticked in this step before the halt."""

    tick: int
    is_tree_ticked: bool


class InputLog:
    """Recorded inputs and interruptions of a run.

    Args:
        events: Events of a journal.

    Attributes:
        events: Events of the journal in order, without the control steps that a resumption discarded.
        inputs: Recorded values by name of the input, in order; equal consecutive values are recorded once.
        interruptions: Interruptions after which the run was resumed, by `kept_step_count`.
        halt: The last halt, or None.
        last_tick: Number of the last control step with an event.
        last_action: Last action of the tool, `open` or `close`; "" without an action.
    """

    def __init__(self, events: Iterable[TimedEvent]) -> None:
        self.events: list[TimedEvent] = []
        for timed in events:
            if isinstance(timed.event, RunResumed):
                self.events = _select_before(self.events, timed.event.valid_ticks)
            self.events.append(timed)
        self.inputs: dict[str, list[RecordedInput]] = defaultdict(list)
        self.interruptions: dict[int, Interruption] = {}
        self.halt: Halt | None = None
        self.last_tick = 0
        self.last_action = ""
        self._incomplete_end_ticks: set[int] = set()
        for timed in self.events:
            tick = timed.tick
            event = timed.event
            self.last_tick = max(self.last_tick, tick)
            match event:
                case RunResumed(count, action):
                    restarts_tree = count - 1 in self._incomplete_end_ticks
                    self.interruptions[count] = Interruption(count, action, restarts_tree, tick)
                case InputRead(name):
                    self.inputs[name].append(RecordedInput(tick, event))
                case RunHalted(is_tree_ticked):
                    self.halt = Halt(tick, is_tree_ticked)
                case ToolCommanded(action):
                    self.last_action = action
                case RunEnded(status="INCOMPLETE"):
                    self._incomplete_end_ticks.add(tick)

    @property
    def start_event(self) -> RunStarted | None:
        """First event of the run, or None if the run was interrupted before this event."""
        return next((timed.event for timed in self.events if isinstance(timed.event, RunStarted)), None)

    @property
    def control_period(self) -> float:
        """Time between two ticks [s]."""
        assert self.start_event is not None, "the journal of a replayed run contains its start"
        return self.start_event.step

    def find_lost_value(self) -> str:
        """Return a clause about the first output or present blackboard value that is not in the journal."""
        readings = (timed.event for timed in self.events if isinstance(timed.event, InputRead))
        values: list[Any] = [each.value for each in readings if each.name.startswith("behaviour.")]
        steps = [value["values"] for value in values if isinstance(value, dict)]
        for step in steps:
            for key, entry in step.items():
                # A step contains all values on the blackboard, whose keys begin with a slash.
                is_present = step is steps[-1] or not key.startswith("/")
                if is_present and isinstance(entry, str):
                    return f'JSON cannot restore the value of "{key}" ({entry})'
        return ""

    def make_final_interruption(self, step_count: int, *, is_complete: bool = True) -> Interruption:
        """Return the interruption between the end of the log and the next resumption.

        A run that ended as INCOMPLETE keeps all control steps. Otherwise, the kept steps are in the log and
        were executed by the cell. Steps in which the arm only braked are discarded: the steps after a halt,
        and the steps of a resumption that was interrupted before the tree was ticked again.

        Args:
            step_count: Number of control steps that the cell has executed.
            is_complete: True if the log contains all events of its last control step.
        """
        if self.last_tick in self._incomplete_end_ticks:
            return Interruption(self.last_tick + 1, self.last_action, True, self.last_tick + 1)
        logged_count = self.last_tick + 1 if is_complete else self.last_tick
        kept_count = min(step_count, logged_count if self.halt is None else self.halt.tick)
        for interruption in reversed(self.interruptions.values()):
            if interruption.resume_tick >= kept_count:
                kept_count = min(kept_count, interruption.kept_step_count)
        restarts_tree = kept_count - 1 in self._incomplete_end_ticks
        return Interruption(kept_count, self.last_action, restarts_tree, step_count)

    def has_ended_before_tick(self, tick: int) -> bool:
        """Return True if the recorded run ended before its tree was ticked in control step `tick`."""
        return tick > self.last_tick if self.halt is None else self.halt == (tick, False)

    def select_before(self, tick: int) -> InputLog:
        """Return the log of the events before control step `tick`, including the start of the run."""
        return InputLog(_select_before(self.events, tick))


def _select_before(events: Iterable[TimedEvent], tick: int) -> list[TimedEvent]:
    """Return the events before control step `tick`, including the start of the run."""
    return [timed for timed in events if timed.tick < tick or isinstance(timed.event, RunStarted)]


class Replay:
    """Progress of the replay of a recorded run, up to the last interruption of the run.

    Until then, the border of the station returns recorded values and executes no commands. After the last
    interruption, the run continues on the devices of the station.

    Args:
        station: Station of the replaying run.
        log: Recorded inputs.
        last_interruption: Interruption at the end of the log, or None if the run is only replayed.

    Attributes:
        log: Recorded inputs before the last interruption.
        tick: Number of the current tick.
        last_interruption: Interruption at the end of the log, or None if the run is only replayed.
        pending_interruption: Interruption at this tick; None after `resume`, or without interruption.
    """

    def __init__(
        self, station: Station, log: InputLog, last_interruption: Interruption | None = None
    ) -> None:
        kept_count = None if last_interruption is None else last_interruption.kept_step_count
        self.log = log if kept_count is None else log.select_before(kept_count)
        self.tick = 0
        self.last_interruption = last_interruption
        self._station = station
        self._has_raised_stop = False
        self.pending_interruption = self._find_interruption(0)
        station.border.replay(self.log.inputs)

    @property
    def is_live(self) -> bool:
        """True if the run continues on the devices."""
        return self._station.border.is_live

    @property
    def has_run_ended(self) -> bool:
        """True if the run is only replayed and was recorded to end before this tick."""
        return self.last_interruption is None and self.log.has_ended_before_tick(self.tick)

    @property
    def is_resumed_from_incomplete(self) -> bool:
        """True if the recorded run ended as INCOMPLETE in this tick, and was then resumed."""
        interruption = None if self.is_live else self._find_interruption(self.tick + 1)
        return interruption is not None and interruption.restarts_tree

    def resume(self) -> None:
        """Continue after the pending interruption; after the last interruption, continue on the devices.

        If the devices have executed fewer ticks than the log contains, they execute the rest first.
        """
        interruption = self.pending_interruption
        self.pending_interruption = None
        assert interruption is not None, "only an interrupted run can be resumed"
        if interruption is not self.last_interruption:
            self.tick = interruption.resume_tick
            return
        while self._station.tick_count < interruption.kept_step_count:
            self._station.advance()
        self._station.border.is_live = True

    def advance(self) -> None:
        """Continue with the next tick of the record.

        Raises:
            Stopped: The recorded run was halted in this tick; raised only once.
        """
        is_halted = self.last_interruption is None and self.log.halt == Halt(self.tick, is_tree_ticked=True)
        if is_halted and not self._has_raised_stop:
            self._has_raised_stop = True
            raise Stopped("the recorded run was halted in this control step")
        self.tick += 1
        self.pending_interruption = self._find_interruption(self.tick)

    def _find_interruption(self, tick_count: int) -> Interruption | None:
        """Return the interruption after `tick_count` ticks, or None."""
        if self.last_interruption is not None and tick_count == self.last_interruption.kept_step_count:
            return self.last_interruption
        return self.log.interruptions.get(tick_count)


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
    station = build_station(loaded, options, run, world_log, request_count)
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
    complete(run, loaded, options, station, log.control_period)
    return run


def assemble_replay(
    loaded: LoadedMission, log: InputLog, seed: int, observers: Sequence[Observer] = ()
) -> ResumedRun:
    """Return a run that replays a recorded run without hardware or simulation."""
    options = RunOptions(seed, requests=())
    run = ResumedRun(loaded.mission.name, observers)
    station = build_station(loaded, options, run, has_devices=False)
    run.replay = Replay(station, log)
    complete(run, loaded, options, station, log.control_period)
    return run


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
        station.driver.clock.begin(station.tick_count * self.clock.step + self.clock.offset)
        brake_arm(station.unrecorded_cell, station.advance)
        for recorder in self._recorders:
            super().add_recorder(recorder)
        self._is_realtime = self._is_realtime_after_replay
        self.clock.tick = station.tick_count
        versions = dict(list_versions())
        self.emit(RunResumed(interruption.kept_step_count, interruption.last_action, versions))
        # The time of the clock is recorded after `RunResumed`, which discards the later steps of the record.
        self.begin_step(station.tick_count)
        self._wall_start = time.monotonic() - self.now


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
