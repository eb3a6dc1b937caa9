"""Run of a mission: ticks its tree once in every control step, and plans the next motion ahead."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from py_trees.common import Status
from py_trees.trees import BehaviourTree

from executive import events
from executive.cell.objects import Item
from executive.cell.protocols import Cell, StepClock
from executive.cell.workcell import Accounts, Workcell
from executive.errors import ExecutiveError, Fault, Stopped
from executive.events import (
    Event,
    Observer,
    RunEnded,
    RunStarted,
    TimedEvent,
)
from executive.ledger.certainty import is_balanced
from executive.manipulation.motions import make_transport_task
from executive.manipulation.tool_goals import (
    choose_grasp,
    make_bin_goal,
    sort_by_tour,
    sort_pickable_targets,
)
from executive.processes import shorten_collections
from executive.replay.recording_cell import InputRecorder, make_recording_cell
from executive.run.run_control import RunControl, halt_on_signals
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
    """

    status: str
    reason: str = ""
    message: str = ""
    node: str = ""
    traceback: str = ""


_HALTED = _LoopEnd("HALTED", "halted", "halted by the user")
"""End of a tick loop that was halted by a person or by a signal."""


class Run:
    """One execution of a mission on a work cell: its events, its tick loop and its end.

    A run is created before its work cell, which emits events during its creation. Then `connect` sets the
    work cell, and `set_tree` the tree, whose skills use `cell`.

    Args:
        mission: Name of the mission.
        observers: Observers of the events; each event is passed to the observers in this order.
        is_realtime: True to execute the run at the speed of the wall clock.

    Attributes:
        mission: Name of the mission.
        control: Control with which other threads stop, pause and step the run.
        tick: Number of the current control step.
        start_event: First event of the run; None for a run that continues an interrupted run.
        workcell: Work cell of the run.
        cell: Cell for the skills, which records each value that a skill reads; its clock shows the start of
            the control step.
        root: Root of the tree.
        behaviour_tree: The tree for py_trees; visitors and handlers that are added to it before `execute`
            are called at every tick.
    """

    workcell: Workcell
    cell: Cell
    root: TreeNode
    behaviour_tree: BehaviourTree

    def __init__(
        self, mission: str, observers: Sequence[Observer] = (), *, is_realtime: bool = False
    ) -> None:
        self.mission = mission
        self.control = RunControl()
        self.tick = 0
        self.start_event: RunStarted | None = None
        self._observers = list(observers)
        self._is_realtime = is_realtime
        self._recorder = InputRecorder(self.emit)
        self._control_period = 0.0
        """Duration of a control step [s]."""
        self._clock_offset = 0.0
        """Time of the cell's clock minus the time of all control steps [s]; 0 in simulation."""
        self._wall_start = 0.0
        """Wall time at time 0 of the run's clock [s]."""
        # State of tool and table after the run; the initial values remain if a sensor fails.
        self._held_item = ""
        self._is_table_empty = False

    def connect(self, workcell: Workcell, planner: LookaheadPlanner) -> None:
        """Set the work cell of the run, and the planner of its probable next motion."""
        self.workcell = workcell
        self._planner = planner
        self.add_observer(planner.on_event)
        self._control_period = workcell.cell.clock.step
        clock = StepClock(lambda: self.now, self._control_period)
        self.cell = make_recording_cell(workcell.cell, self._recorder, clock, self.emit)

    def set_tree(self, root: TreeNode) -> None:
        """Set the tree, which uses `cell` and `emit` of this run."""
        self.root = root
        self.behaviour_tree = BehaviourTree(root)

    @property
    def now(self) -> float:
        """Time on the run's clock at the start of the current control step [s]."""
        return self.tick * self._control_period + self._clock_offset

    def add_observer(self, observer: Observer) -> None:
        """Call `observer` with every later event, after all other observers."""
        self._observers.append(observer)

    def add_recorder(self, recorder: Observer) -> None:
        """Call `recorder` with every later event, before the observers."""
        self._observers.insert(0, recorder)

    def emit(self, event: Event) -> None:
        """Pass an event with its control step and time to all observers."""
        timed = TimedEvent(self.tick, round(self.now, 6), event)
        for observer in self._observers:
            observer(timed)

    def begin_step(self, tick: int) -> None:
        """Begin the control step number `tick`, and record the time of the cell's clock."""
        self.tick = tick
        self._recorder.begin_step()
        clock = self.workcell.cell.clock
        step_time = tick * self._control_period
        self._clock_offset = self._recorder.read("clock", lambda: clock.now - step_time)

    def plan_ahead(self) -> None:
        """Let the planner plan the probable next motion."""
        self._planner.plan_next_motion(self.tick)

    def advance(self) -> None:
        """Execute one control step of the work cell, and begin the next control step."""
        self.workcell.advance()
        self.begin_step(self.tick + 1)

    def execute(self) -> RunEnded:
        """Tick the tree until it ends, brake the arm, and return the end of the run.

        The first Ctrl-C halts the tree and brakes the arm; a second Ctrl-C ends the process at once.
        """
        run_end = self._execute_tree()
        if problems := _catch_problems(lambda: self.emit(run_end)):
            run_end = replace(run_end, status="FAULT", reason="fault", message=problems[0], node="")
        return run_end

    def close(self) -> None:
        """Release the work cell."""
        self.workcell.close()

    def _execute_tree(self) -> RunEnded:
        """Tick the tree until it ends, brake the arm, finalize the items, and return the end of the run.

        If the tree succeeds, the final states of the items determine the status of the run.
        """
        with halt_on_signals(self.control), shorten_collections():
            loop_end = self._tick_until_end()
            problems = halt(self.root) + _catch_problems(lambda: brake_arm(self.cell, self.advance))
        if loop_end.traceback:
            # The arm brakes before this event is emitted, because a full disk must not prevent the braking.
            problems += _catch_problems(lambda: self.emit(events.FaultRaised(loop_end.traceback)))
        has_succeeded = loop_end.status == "SUCCESS"
        problems += _catch_problems(self._store_final_state)
        problems += _catch_problems(lambda: _finalize_items(self.workcell.accounts, has_succeeded))
        if problems and loop_end.status == "FAULT":
            loop_end = replace(loop_end, message="; ".join([loop_end.message, *problems]))
        elif problems:
            loop_end = _LoopEnd("FAULT", "fault", "; ".join(problems))
        elif has_succeeded:
            loop_end = _check_items(self.workcell.accounts)
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
                self.emit(self.start_event)
            self.begin_step(self.tick)
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
                self.plan_ahead()
                self.advance()
                is_tree_ticked = False
                if self._is_realtime:
                    time.sleep(max(0.0, self._wall_start + self.now - time.monotonic()))
                control.wait_while_paused()
            loop_end = _HALTED
        except Stopped:
            loop_end = _HALTED
        except Exception as error:
            message = str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"
            node = error.node if isinstance(error, Fault) else ""
            loop_end = _LoopEnd("FAULT", "fault", message, node, traceback.format_exc())
        problems = _catch_problems(lambda: self.emit(events.RunHalted(is_tree_ticked)))
        if problems and loop_end.status != "FAULT":
            loop_end = _LoopEnd("FAULT", "fault", problems[0])
        return loop_end

    def _store_final_state(self) -> None:
        """Store the state of the table from the ledger, then the state of the tool, whose sensor may fail."""
        ledger = self.cell.ledger
        self._is_table_empty = ledger.is_table_empty() and not ledger.unknown_labels
        if self.cell.tool.holding:
            self._held_item = ledger.find_held_item() or "something"


def _catch_problems(action: Callable[[], None]) -> list[str]:
    """Call `action`; return a list with the message of its exception, or an empty list."""
    try:
        action()
    except Exception as error:
        return [str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"]
    return []


def _check_items(accounts: Accounts) -> _LoopEnd:
    """Return the end of a run whose tree succeeded, from the states of its items.

    The status is FAILURE if items were lost, else INCOMPLETE if items were rejected, else SUCCESS.
    """
    items = accounts.list_items()
    if lost := [item.item for item in items if item.state == "lost"]:
        message = f"{len(lost)} object(s) were lost and not found again: {', '.join(lost)}"
        return _LoopEnd("FAILURE", "lost", message)
    if rejected := [f"{item.item} ({item.reason})" for item in items if item.state == "rejected"]:
        message = f"{len(rejected)} object(s) were not sorted: {', '.join(rejected)}"
        return _LoopEnd("INCOMPLETE", "rejected", message)
    return _LoopEnd("SUCCESS")


def _finalize_items(accounts: Accounts, has_tree_succeeded: bool) -> None:
    """Let the ledger set the final state of each item, and check the sum of the counts.

    Raises:
        Fault: The number of seen items is not the sum of the placed, rejected, skipped and lost items.
    """
    accounts.set_final_states(completed=has_tree_succeeded)
    counts = accounts.count_states()
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
        except Exception as error:
            problems.append(str(error))
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
        elif isinstance(event, events.FrameSearched | events.MotionPlanned):
            self._change_tick = timed.tick

    def plan_next_motion(self, tick: int) -> None:
        """Plan the next motion if the events of the run make it predictable; called after each tick.

        `tick` is the current control step. Nothing is planned in a control step with new detections, a new
        motion or a command to grip, because such a control step already has a high computational load.
        """
        cell = self._cell
        held_item = cell.ledger.find_held_item()
        may_hold = self._grip_tick not in (None, tick) and held_item is None
        if may_hold and self._item_and_bin and cell.tool.holding:
            self._grip_tick = None
            item, bin = self._item_and_bin
            cell.arm.plan_ahead(make_bin_goal(cell, bin, item), make_transport_task(cell, item))
        elif self._change_tick not in (None, tick) and held_item is not None and self._is_moving_to_bin():
            self._change_tick = None
            pickable_targets = sort_pickable_targets(cell, cell.ledger.find_targets())
            if targets := sort_by_tour(cell, pickable_targets):
                grasp, task = choose_grasp(cell, targets[0])
                cell.arm.plan_ahead(grasp.goal, task)

    def _is_moving_to_bin(self) -> bool:
        destination = self._cell.arm.destination
        return any(bin.contains(destination) for bin in self._cell.bins.values())
