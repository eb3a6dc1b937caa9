"""One run of a mission: its tree is ticked once in every control step of a work cell."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from dataclasses import replace

from py_trees.common import Status

from executive.cell.workcell import Workcell
from executive.errors import ExecutiveError, Fault, Stopped
from executive.events import FaultRaised, Observer, RunEnded, RunHalted, RunStarted
from executive.mission.build import TreeNode
from executive.run.outcome import (
    HALTED,
    LoopEnd,
    close_accounts,
    collect_problems,
    end_of_tree,
    judge_items,
)
from executive.run.run_context import RunContext
from executive.run.run_control import RunControl
from executive.run.signals import stopped_by_signals
from executive.tree.halting import halt


class Run:
    """One execution of a tree on a work cell.

    Args:
        context: Cell and events of the run.
        root: The tree, which uses the cell and the events of `context`.
        control: Stops, pauses and steps the run.
        mission: Name of the mission.
        start: The first event; None if the run continues an earlier one.
        realtime: True to pace the run by the wall clock.

    Attributes:
        root: The tree.
        control: Stops, pauses and steps the run, from any thread.
        mission: Name of the mission.
    """

    def __init__(
        self,
        context: RunContext,
        root: TreeNode,
        control: RunControl,
        mission: str,
        *,
        start: RunStarted | None = None,
        realtime: bool = False,
    ) -> None:
        self.root, self.control, self.mission = root, control, mission
        self._context = context
        self._start = start
        self._realtime = realtime
        self._wall_start = 0.0
        """Wall time at time 0 of the run's clock, if the run is paced [s]."""
        self._held_item, self._is_empty = "", False

    @property
    def tick(self) -> int:
        """Number of control steps so far."""
        return self._context.tick

    @property
    def now(self) -> float:
        """Time on the run's clock [s]."""
        return self._context.now

    @property
    def workcell(self) -> Workcell:
        """The work cell that the run drives."""
        return self._context.workcell

    def observe(self, observer: Observer) -> None:
        """Call `observer` with every event from now on."""
        self._context.observe(observer)

    def record(self, recorder: Observer) -> None:
        """Call `recorder` with every event from now on, before the observers."""
        self._context.observe(recorder, first=True)

    def execute(self) -> RunEnded:
        """Tick the tree to its end and return the outcome; the arm is then at rest.

        Ctrl-C halts the tree and brakes the arm; a second one ends the process at once.
        """
        outcome = self._execute_tree()
        if problems := collect_problems(lambda: self._context.emit(outcome)):
            outcome = replace(outcome, status="FAULT", reason="fault", message=problems[0], node="")
        return outcome

    def items(self) -> dict[str, int]:
        """Return the counts of the items by final state; see `Accounts.count_states`."""
        return self.workcell.accounts.count_states()

    def audit(self) -> Mapping[str, int] | None:
        """Return the true final counts of the objects, or None if they are unknown; only after `execute`."""
        return self.workcell.audit()

    def close(self) -> None:
        """Release the work cell."""
        self.workcell.close()

    def _execute_tree(self) -> RunEnded:
        """Tick the tree to its end, let the arm come to rest, close the ledger and return the outcome."""
        context = self._context
        with stopped_by_signals(self.control):
            ending = self._tick_to_end()
            problems = [*halt(self.root), *filter(None, [context.come_to_rest()])]
        if ending.traceback:
            # The arm brakes first: a full disk must not prevent the braking.
            problems += collect_problems(lambda: context.emit(FaultRaised(ending.traceback)))
        succeeded = ending.status == "SUCCESS"
        problems += collect_problems(self._note_held_item)
        problems += collect_problems(self._note_empty_table)
        problems += collect_problems(lambda: close_accounts(self.workcell.accounts, completed=succeeded))
        if problems and ending.status == "FAULT":
            ending = replace(ending, message="; ".join([ending.message, *problems]))
        elif problems:
            ending = LoopEnd("FAULT", "fault", "; ".join(problems))
        return self._outcome(ending)

    def _tick_to_end(self) -> LoopEnd:
        """Tick the tree once in every control step until it ends, or until the run is stopped."""
        context, control, is_tree_ticked = self._context, self.control, False
        try:
            if self._start is not None:
                context.emit(self._start)
            context.begin_step(context.tick)
            self._wall_start = time.monotonic() - context.now
            control.wait()
            while not control.stopped:
                is_tree_ticked = True
                self.root.tick_once()
                if control.stopped:
                    break
                if self.root.status is not Status.RUNNING:
                    return end_of_tree(self.root.failure)
                context.plan_ahead()
                context.advance()
                is_tree_ticked = False
                if self._realtime:
                    time.sleep(max(0.0, self._wall_start + context.now - time.monotonic()))
                control.wait()
            ending = HALTED
        except Stopped:
            ending = HALTED
        except Exception as error:
            message = str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"
            node = error.node if isinstance(error, Fault) else ""
            ending = LoopEnd("FAULT", "fault", message, node, traceback.format_exc())
        problems = collect_problems(lambda: context.emit(RunHalted(is_tree_ticked)))
        if problems and ending.status != "FAULT":
            ending = LoopEnd("FAULT", "fault", problems[0])
        return ending

    def _note_held_item(self) -> None:
        """Store the name of the item in the tool: `something` if the ledger knows no such item."""
        cell = self._context.cell
        if cell.tool.holding:
            self._held_item = cell.ledger.find_held_item() or "something"

    def _note_empty_table(self) -> None:
        """Store whether the ledger believes that the table is empty."""
        ledger = self._context.cell.ledger
        self._is_empty = ledger.is_table_empty() and not ledger.unknown

    def _outcome(self, ending: LoopEnd) -> RunEnded:
        if ending.status == "SUCCESS":
            ending = judge_items(self.workcell.accounts)
        end = (self._is_empty, self._held_item, self.tick, round(self.now, 6))
        return RunEnded(ending.status, ending.reason, ending.message, ending.node, *end)
