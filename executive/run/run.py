"""Run of a mission: ticks its tree once in every control step of a work cell."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from py_trees.common import Status
from py_trees.trees import BehaviourTree

from executive.cell.workcell import Accounts, Workcell
from executive.errors import ExecutiveError, Fault, Stopped
from executive.events import FaultRaised, Observer, RunEnded, RunHalted, RunStarted
from executive.ledger.outcomes import is_balanced
from executive.run.garbage_collection import shorten_collections
from executive.run.run_context import RunContext, brake_arm
from executive.run.run_control import RunControl
from executive.run.signals import halt_on_signals
from executive.tree.tree_node import TreeNode, halt


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
    """One execution of a tree on a work cell.

    Args:
        context: Cell and events of the run.
        start_event: First event of the run; None for a run that continues an interrupted run.
        is_realtime: True to execute the run at the speed of the wall clock.

    Attributes:
        root: Root of the tree, which uses the cell and the events of `context`.
        behaviour_tree: The tree for py_trees; visitors and handlers that are added to it before `execute`
            are called at every tick.
        control: Control with which other threads stop, pause and step the run.
        mission: Name of the mission.
    """

    def __init__(
        self,
        context: RunContext,
        root: TreeNode,
        control: RunControl,
        mission: str,
        *,
        start_event: RunStarted | None = None,
        is_realtime: bool = False,
    ) -> None:
        self.root, self.control, self.mission = root, control, mission
        self.behaviour_tree = BehaviourTree(root)
        self._context = context
        self._start_event = start_event
        self._is_realtime = is_realtime
        self._wall_start = 0.0
        """Wall time at time 0 of the run's clock [s]."""
        # State of tool and table after the run; the initial values remain if a sensor fails.
        self._held_item = ""
        self._is_table_empty = False

    @property
    def tick(self) -> int:
        """Number of executed control steps."""
        return self._context.tick

    @property
    def now(self) -> float:
        """Time on the run's clock [s]."""
        return self._context.now

    @property
    def workcell(self) -> Workcell:
        """The work cell of the run."""
        return self._context.workcell

    def add_observer(self, observer: Observer) -> None:
        """Call `observer` with every later event."""
        self._context.add_observer(observer)

    def add_recorder(self, recorder: Observer) -> None:
        """Call `recorder` with every later event, before the observers."""
        self._context.add_observer(recorder, is_first=True)

    def execute(self) -> RunEnded:
        """Tick the tree until it ends, brake the arm, and return the end of the run.

        The first Ctrl-C halts the tree and brakes the arm; a second Ctrl-C ends the process at once.
        """
        run_end = self._execute_tree()
        if problems := _catch_problems(lambda: self._context.emit(run_end)):
            run_end = replace(run_end, status="FAULT", reason="fault", message=problems[0], node="")
        return run_end

    def count_items(self) -> dict[str, int]:
        """Return the number of items by final state; `seen` is the number of all items except phantoms."""
        return self.workcell.accounts.count_states()

    def count_ground_truth(self) -> Mapping[str, int] | None:
        """Return the true object counts (`AUDIT_KEYS`) after `execute`, or None if they are unknown."""
        return self.workcell.audit()

    def close(self) -> None:
        """Release the work cell."""
        self.workcell.close()

    def _execute_tree(self) -> RunEnded:
        """Tick the tree until it ends, brake the arm, finalize the items, and return the end of the run.

        If the tree succeeds, the final states of the items determine the status of the run.
        """
        context = self._context
        with halt_on_signals(self.control), shorten_collections():
            loop_end = self._tick_until_end()
            problems = halt(self.root) + _catch_problems(lambda: brake_arm(context.cell, context.advance))
        if loop_end.traceback:
            # The arm brakes before this event is emitted, because a full disk must not prevent the braking.
            problems += _catch_problems(lambda: context.emit(FaultRaised(loop_end.traceback)))
        has_succeeded = loop_end.status == "SUCCESS"
        problems += _catch_problems(self._store_held_item)
        problems += _catch_problems(self._store_table_state)
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
        context, control, is_tree_ticked = self._context, self.control, False
        tree = self.behaviour_tree
        has_callbacks = tree.visitors or tree.pre_tick_handlers or tree.post_tick_handlers
        tick_tree = tree.tick if has_callbacks else self.root.tick_once
        try:
            if self._start_event is not None:
                context.emit(self._start_event)
            context.begin_step(context.tick)
            self._wall_start = time.monotonic() - context.now
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
                context.plan_ahead()
                context.advance()
                is_tree_ticked = False
                if self._is_realtime:
                    time.sleep(max(0.0, self._wall_start + context.now - time.monotonic()))
                control.wait_while_paused()
            loop_end = _HALTED
        except Stopped:
            loop_end = _HALTED
        except Exception as error:
            message = str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"
            node = error.node if isinstance(error, Fault) else ""
            loop_end = _LoopEnd("FAULT", "fault", message, node, traceback.format_exc())
        problems = _catch_problems(lambda: context.emit(RunHalted(is_tree_ticked)))
        if problems and loop_end.status != "FAULT":
            loop_end = _LoopEnd("FAULT", "fault", problems[0])
        return loop_end

    def _store_held_item(self) -> None:
        """Store the name of the item in the tool, or `something` if the ledger does not know the item."""
        cell = self._context.cell
        if cell.tool.holding:
            self._held_item = cell.ledger.find_held_item() or "something"

    def _store_table_state(self) -> None:
        """Store whether the ledger contains neither an object to sort nor an undeclared label."""
        ledger = self._context.cell.ledger
        self._is_table_empty = ledger.is_table_empty() and not ledger.unknown_labels


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
