"""Run of a mission: ticks its tree once in every control step, and plans the next motion ahead."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace

from py_trees.common import Status
from py_trees.trees import BehaviourTree

from executive import events
from executive.cell.devices import sleep_on
from executive.cell.objects import Item
from executive.cell.protocols import Cell, Steps
from executive.errors import Blocked, Fault, Finished, Interrupted, Stopped, describe_error
from executive.events import Event, Observer, RunEnded, RunStarted, TimedEvent
from executive.ledger.final_states import is_balanced
from executive.ledger.tracker import Tracker
from executive.manipulation.grasps import choose_grasp, make_bin_goal, measure_held_pose
from executive.manipulation.motions import make_transport_task
from executive.manipulation.tool_goals import sort_by_tour, sort_pickable_targets
from executive.processes import shorten_collections
from executive.run.operator import RunControl, halt_on_signals, limit_tick_time
from executive.station.station import Station
from executive.tree.tree_node import TreeNode, halt

MAX_BRAKING_TIME = 2.0
"""Maximum time from the command to brake until the arm is at rest [s]."""
MAX_BRAKING_ATTEMPTS = 4
"""Maximum number of commands to brake; a command may fail, because an observer may raise an exception."""


@dataclass(frozen=True)
class _LoopEnd:
    """End of the tick loop of a run.

    Attributes:
        status: Status of the run, before the check of its items.
        reason: Reason of the failure, for instance `Transit.dropped`; "" on success.
        message: Sentence that explains the status, or "".
        node: Path of the node that determined the status, or "".
        traceback: Traceback of the exception that caused a fault, or "".
        skip_reason: Reason why the mission finished with open items, or "".
    """

    status: str
    reason: str = ""
    message: str = ""
    node: str = ""
    traceback: str = ""
    skip_reason: str = ""


_HALTED = _LoopEnd("HALTED", "halted", "halted by the user")
"""End of a tick loop that was halted by a person or by a signal."""


@dataclass(eq=False)
class RunClock:
    """Clock of a run as skills see it, which shows the start of the tick; implements `Clock`.

    Attributes:
        step: Time between two ticks [s].
        offset: Time of the clock of the devices minus the time of all ticks [s]; 0 in simulation.
        tick: Number of the current tick.
    """

    step: float
    offset: float = 0.0
    tick: int = 0

    @property
    def now(self) -> float:
        """Time since the start of the run [s]."""
        return self.tick * self.step + self.offset

    def sleep(self, duration: float) -> Steps:
        """Yield until the time has advanced by `duration` [s]."""
        return sleep_on(self, duration)


class Run:
    """One execution of a mission on a work cell: its events, its tick loop and its end.

    A run is created before its station, which emits events during its creation. Then `connect` sets the
    station, and `set_tree` the tree, whose skills use `cell`.

    Args:
        mission: Name of the mission.
        observers: Observers of the events; each event is passed to the observers in this order.
        is_realtime: True to execute the run at the speed of the wall clock.

    Attributes:
        mission: Name of the mission.
        control: Control with which other threads stop, pause and step the run.
        start_event: First event of the run; None for a run that continues an interrupted run.
        station: Station of the run.
        cell: Cell for the skills; its clock shows the start of the tick.
        clock: Clock of the cell.
        root: Root of the tree.
        behaviour_tree: The tree for py_trees; visitors and handlers that are added to it before `execute`
            are called at every tick.
    """

    station: Station
    cell: Cell
    root: TreeNode
    behaviour_tree: BehaviourTree

    def __init__(
        self, mission: str, observers: Sequence[Observer] = (), *, is_realtime: bool = False
    ) -> None:
        self.mission = mission
        self.control = RunControl()
        self.clock = RunClock(0.0)
        self.start_event: RunStarted | None = None
        self._observers = list(observers)
        self._is_realtime = is_realtime
        self._wall_start = 0.0
        """Wall time at time 0 of the run's clock [s]."""
        # State of tool and table after the run; the initial values remain if a sensor fails.
        self._held_item = ""
        self._is_table_empty = False

    def connect(self, station: Station, control_period: float) -> None:
        """Set the station of the run, and the time between two ticks [s]."""
        self.station = station
        self._planner = LookaheadPlanner(station.unrecorded_cell)
        self.add_observer(self._planner.on_event)
        self.clock = RunClock(control_period)
        self.control.hold_time = self._hold_time
        self.cell = replace(station.cell, clock=self.clock)

    def set_tree(self, root: TreeNode) -> None:
        """Set the tree, which uses `cell` and `emit` of this run."""
        self.root = root
        self.behaviour_tree = BehaviourTree(root)

    @property
    def tick(self) -> int:
        """Number of the current tick."""
        return self.clock.tick

    @property
    def now(self) -> float:
        """Time on the run's clock at the start of the current tick [s]."""
        return self.clock.now

    def add_observer(self, observer: Observer) -> None:
        """Call `observer` with every later event, after all other observers."""
        self._observers.append(observer)

    def add_recorder(self, recorder: Observer) -> None:
        """Call `recorder` with every later event, before the observers."""
        self._observers.insert(0, recorder)

    def emit(self, event: Event) -> None:
        """Pass an event with its control step and time to all observers."""
        timed = TimedEvent(self.clock.tick, round(self.clock.now, 6), event)
        for observer in self._observers:
            observer(timed)

    def begin_step(self, tick: int) -> None:
        """Begin the tick number `tick`, and record the time of the clock of the devices."""
        clock = self.clock
        clock.tick = tick
        border = self.station.border
        border.tick = tick
        if border.is_live and self.station.driver.clock.is_simulated:
            return
        clock.offset = border.read("clock", lambda: self.station.driver.clock.now - tick * clock.step)

    @contextmanager
    def _hold_time(self) -> Iterator[None]:
        """Let the clock of the devices continue after the `with` block at its time before the block."""
        if not self.station.border.is_live:
            yield
            return
        clock = self.station.driver.clock
        now = clock.now
        wall_time = time.monotonic()
        self.control.is_time_held = True
        try:
            yield
        finally:
            self.control.is_time_held = False
        clock.begin(now)
        self._wall_start += time.monotonic() - wall_time

    def plan_ahead(self) -> None:
        """Let the planner plan the probable next motion."""
        self._planner.plan_next_motion(self.clock.tick)

    def advance(self) -> None:
        """Wait for the next tick of the devices, and begin it."""
        self.station.advance()
        self.begin_step(self.clock.tick + 1)

    def execute(self) -> RunEnded:
        """Tick the tree until it ends, brake the arm, and return the end of the run.

        The first Ctrl-C halts the tree and brakes the arm; a second Ctrl-C ends the process at once.
        """
        run_end = self._execute_tree()
        if problems := _catch_problems(lambda: self.emit(run_end)):
            run_end = replace(run_end, status="FAULT", reason="fault", message=problems[0], node="")
        return run_end

    def close(self) -> None:
        """Release the station.

        Raises:
            Fault: A device or a detector could not be released.
        """
        if problems := _catch_problems(self.station.close):
            raise Fault(f"the run has ended, but its cell could not be released: {problems[0]}")

    def _execute_tree(self) -> RunEnded:
        """Tick the tree until it ends, brake the arm, finalize the items, and return the end of the run.

        If the tree succeeds, the final states of the items determine the status of the run.
        """
        limit = limit_tick_time(self.control, lambda: self.tick)
        with halt_on_signals(self.control), limit, shorten_collections():
            loop_end = self._tick_until_end()
            problems = halt(self.root) + _catch_problems(lambda: brake_arm(self.cell, self.advance))
        if loop_end.traceback:
            # The arm brakes before this event is emitted, because a full disk must not prevent the braking.
            problems += _catch_problems(lambda: self.emit(events.FaultRaised(loop_end.traceback)))
        has_succeeded = loop_end.status == "SUCCESS"
        problems += _catch_problems(self._store_final_state)
        skip_reason = loop_end.skip_reason
        problems += _catch_problems(lambda: _finalize_items(self.station.ledger, has_succeeded, skip_reason))
        if problems and loop_end.status == "FAULT":
            loop_end = replace(loop_end, message="; ".join([loop_end.message, *problems]))
        elif problems:
            loop_end = _LoopEnd("FAULT", "fault", "; ".join(problems))
        elif has_succeeded:
            loop_end = _check_items(self.station.ledger)
        cause = (loop_end.status, loop_end.reason, loop_end.message, loop_end.node)
        return RunEnded(*cause, self._is_table_empty, self._held_item, self.tick, round(self.now, 6))

    def _tick_until_end(self) -> _LoopEnd:
        """Tick the tree once in every control step until it ends, or until the run is stopped."""
        control = self.control
        tree = self.behaviour_tree
        is_tree_ticked = False
        has_callbacks = tree.visitors or tree.pre_tick_handlers or tree.post_tick_handlers
        tick_tree = tree.tick if has_callbacks else self.root.tick_once
        try:
            if self.start_event is not None:
                self.station.driver.clock.begin(0.0)
                self.emit(self.start_event)
            self.begin_step(self.clock.tick)
            self._wall_start = time.monotonic() - self.now
            control.wait_while_paused()
            while not control.is_stopped:
                is_tree_ticked = True
                tick_tree()
                if control.is_stopped:
                    break
                if self.root.status is not Status.RUNNING:
                    failure = self.root.failure
                    if failure is None:
                        return _LoopEnd("SUCCESS")
                    return _LoopEnd("FAILURE", str(failure), failure.message, failure.path)
                # A halt discards a control step only up to here; the objects disappear in the next step.
                for bins in self.station.border.read("bins_emptied", control.take_emptied_bins):
                    self.station.empty_bins(bins)
                self.plan_ahead()
                self.advance()
                is_tree_ticked = False
                if self._is_realtime:
                    time.sleep(max(0.0, self._wall_start + self.now - time.monotonic()))
                if not control.is_idle:
                    control.wait_while_paused()
            loop_end = _HALTED
        except Finished as end:
            return _LoopEnd("SUCCESS", skip_reason=str(end))
        except Stopped:
            loop_end = _HALTED
        except Interrupted:
            raise
        except BaseException as error:
            node = error.node if isinstance(error, Fault) else ""
            loop_end = _LoopEnd("FAULT", "fault", describe_error(error), node, traceback.format_exc())
        problems = _catch_problems(lambda: self.emit(events.RunHalted(is_tree_ticked)))
        if problems and loop_end.status != "FAULT":
            loop_end = _LoopEnd("FAULT", "fault", problems[0])
        return loop_end

    def _store_final_state(self) -> None:
        """Store the state of the table from the ledger, then the state of the tool, whose sensor may fail."""
        ledger = self.cell.ledger
        has_unknown = ledger.unknown_labels or self.station.ledger.unexplained.events
        self._is_table_empty = ledger.is_table_empty() and not has_unknown
        if self.cell.tool.holding:
            self._held_item = ledger.find_held_item() or "something"


def _catch_problems(action: Callable[[], None]) -> list[str]:
    """Call `action`; return a list with the message of its exception, or an empty list."""
    try:
        action()
    except Interrupted:
        raise
    except BaseException as error:
        return [describe_error(error)]
    return []


def _check_items(ledger: Tracker) -> _LoopEnd:
    """Return the end of a run whose tree succeeded, from the states of its items.

    The status is FAILURE if items were lost, else INCOMPLETE if items were rejected or if no item explains
    what images or sensors show, else SUCCESS.
    """
    items = ledger.list_items()
    if lost := [item.item for item in items if item.state == "lost"]:
        message = f"{len(lost)} object(s) were lost and not found again: {', '.join(lost)}"
        return _LoopEnd("FAILURE", "lost", message)
    if rejected := [f"{item.item} ({item.reason})" for item in items if item.state == "rejected"]:
        message = f"{len(rejected)} object(s) were not sorted: {', '.join(rejected)}"
        return _LoopEnd("INCOMPLETE", "rejected", message)
    if texts := [event.text for event in ledger.unexplained.events]:
        return _LoopEnd("INCOMPLETE", "unexplained", f"{len(texts)} unexplained: {'; '.join(texts)}")
    return _LoopEnd("SUCCESS")


def _finalize_items(ledger: Tracker, has_tree_succeeded: bool, skip_reason: str) -> None:
    """Let the ledger set the final state of each item, and check the sum of the counts.

    Open items are skipped with `skip_reason`, if the node `finish` gave one.

    Raises:
        Fault: The number of seen items is not the sum of the placed, rejected, skipped and lost items.
    """
    ledger.set_final_states(completed=has_tree_succeeded, finish_reason=skip_reason)
    counts = ledger.count_states()
    if not is_balanced(counts):
        text = ", ".join(f"{count} {state}" for state, count in counts.items())
        raise Fault(
            f"the item counts are inconsistent: {text}; seen must be placed + rejected + skipped + lost"
        )


def brake_arm(cell: Cell, advance: Callable[[], None]) -> None:
    """Brake the arm of a cell until it is at rest; `advance` executes one control step.

    Raises:
        Fault: The arm is not at rest, or a command to brake failed.
    """
    deadline = cell.clock.now + MAX_BRAKING_TIME
    problems: list[str] = []
    for _ in range(MAX_BRAKING_ATTEMPTS):
        try:
            cell.arm.stop()
            while not (is_at_rest := cell.arm.at_rest) and cell.clock.now <= deadline:
                advance()
        except Interrupted:
            raise
        except BaseException as error:
            problems.append(describe_error(error))
            continue
        if not is_at_rest:
            raise Fault(f"the arm is not at rest {MAX_BRAKING_TIME:.0f} s after the command to brake")
        if problems:
            raise Fault(problems[0])
        return
    raise Fault(f"the arm could not be braked: {problems[-1]}")


class LookaheadPlanner:
    """Lets the arm plan the motion that the mission will probably need next.

    When the tool holds an item, the planner plans the transit of the item to its bin. During a transit, the
    planner plans the approach to the first target of the shortest tour, which the skill `SelectTarget`
    prefers by default.

    The planner changes no decision, and its reads of the cell are not recorded: a replay needs no planner.

    Args:
        cell: The real cell, without the recorder of inputs.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._item_and_bin: tuple[Item, str] | None = None
        """Last selected target and its bin."""
        self._grip_tick: int | None = None
        """Control step of the last command to close the tool; None after the plan of the transit."""
        self._held_item: Item | None = None
        self._change_tick: int | None = None
        """Control step of the last detections or motion; None if the approach has been planned since then."""

    def on_event(self, timed: TimedEvent) -> None:
        """Update the expected motions from an event of the run."""
        event = timed.event
        if isinstance(event, events.TargetSelected):
            # The selection of an item or a bin that does not exist is ignored.
            items = {target.item for target in self._cell.ledger.find_targets()}
            exists = event.bin in self._cell.bins and event.item in items
            self._item_and_bin = (event.item, event.bin) if exists else None
        elif isinstance(event, events.ToolCommanded):
            self._grip_tick = timed.tick if event.action == "close" else None
        elif isinstance(event, events.ItemChanged):
            if event.state == "held" or event.item == self._held_item:
                self._held_item = self._cell.ledger.find_held_item()
        elif isinstance(event, events.FrameSearched | events.MotionPlanned):
            self._change_tick = timed.tick

    def plan_next_motion(self, tick: int) -> None:
        """Plan the next motion if the events of the run make it predictable; called after each tick.

        `tick` is the current control step. Nothing is planned in a control step with new detections, a new
        motion or a command to grip, because such a control step already has a high computational load.
        """
        cell = self._cell
        may_hold = self._grip_tick not in (None, tick) and self._held_item is None
        if may_hold and self._item_and_bin and cell.tool.holding:
            self._grip_tick = None
            item, bin = self._item_and_bin
            # `Transit` reports a yaw that is unknown or impossible.
            with suppress(Blocked):
                target = next((each for each in cell.ledger.find_targets() if each.item == item), None)
                held_pose = measure_held_pose(cell, target) if target else None
                goal = make_bin_goal(cell, bin, item, held_pose)
                cell.arm.plan_ahead(goal, make_transport_task(cell, item))
        elif self._change_tick not in (None, tick) and self._held_item and self._is_moving_to_bin():
            self._change_tick = None
            pickable_targets = sort_pickable_targets(cell, cell.ledger.find_targets())
            for target in sort_by_tour(cell, pickable_targets):
                with suppress(Blocked):
                    grasp, task = choose_grasp(cell, target)
                    cell.arm.plan_ahead(grasp.goal, task)
                    break

    def _is_moving_to_bin(self) -> bool:
        destination = self._cell.arm.destination
        return any(bin.contains(destination) for bin in self._cell.bins.values())
