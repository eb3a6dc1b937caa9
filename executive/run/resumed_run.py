"""Resumption of an interrupted run: replay of its recorded inputs, then execution on its inner cell."""

from __future__ import annotations

import time

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Cell
from executive.errors import Fault
from executive.events import Observer, RunEnded, RunResumed
from executive.replay.input_log import Interruption
from executive.replay.replayed_cell import ReplayedCell
from executive.run.lookahead_planner import LookaheadPlanner
from executive.run.run import Run
from executive.run.run_context import RunContext, brake_arm
from executive.run.run_control import RunControl
from executive.run.versions import list_versions
from executive.tree.tree_node import SkillLeaf, TreeNode, halt


class ResumedRun(Run):
    """Run that replays an interrupted run, and then may continue on the inner cell.

    The replay includes earlier resumptions of the run. Observers receive all events; recorders receive only
    the events after the replay.

    Args:
        is_realtime: True to execute the run on the inner cell at the speed of the wall clock.

    Attributes:
        replayed_cell: Work cell of `context`, which replays the recorded run.
    """

    def __init__(
        self,
        context: RunContext,
        replayed_cell: ReplayedCell,
        root: TreeNode,
        control: RunControl,
        mission: str,
        *,
        is_realtime: bool = False,
    ) -> None:
        super().__init__(context, root, control, mission)
        self.replayed_cell = replayed_cell
        self._is_realtime_after_replay = is_realtime
        self._recorders: list[Observer] = []
        self._planner = LookaheadPlanner(replayed_cell.inner.cell)
        context.add_observer(self._planner.on_event)
        control.call_between_ticks(self._stop_or_resume)

    def add_recorder(self, recorder: Observer) -> None:
        """Register a recorder, which receives each event after the replay, before the observers."""
        self._recorders.append(recorder)

    def _execute_tree(self) -> RunEnded:
        """Execute the tree, and again after each resumption of an INCOMPLETE run; return the last end."""
        run_end = super()._execute_tree()
        while run_end.status == "INCOMPLETE" and self.replayed_cell.is_resumed_from_incomplete:
            self._context.advance()
            run_end = super()._execute_tree()
        return run_end

    def _stop_or_resume(self) -> None:
        """Stop or resume the run in the same control step as the recorded run; called between two ticks."""
        cell = self.replayed_cell
        while not cell.is_live and not cell.has_run_ended and cell.pending_interruption is not None:
            self._resume(cell.pending_interruption)
        if not cell.is_live and cell.has_run_ended:
            self.control.stop()

    def _resume(self, interruption: Interruption) -> None:
        """Continue after an interruption: halt the skills, brake the arm, and update the ledger.

        Raises:
            Fault: The arm did not come to rest.
        """
        context = self._context
        cell = self.replayed_cell
        cell.resume()
        if cell.is_live:
            self._begin_on_inner_cell(interruption)
        else:
            context.begin_step(cell.steps)
        halt_running_skills(self.root)
        brake_arm(context.cell, context.advance)
        if interruption.restarts_tree:
            cell.accounts.discard_rejected_and_skipped()
        reconcile_ledger(context.cell, interruption.last_action)

    def _begin_on_inner_cell(self, interruption: Interruption) -> None:
        """Brake the arm, then emit `RunResumed`. A kill before this event leaves the journal unchanged."""
        context = self._context
        inner = self.replayed_cell.inner
        brake_arm(inner.cell, inner.advance)
        for recorder in self._recorders:
            context.add_observer(recorder, is_first=True)
        context.planner = self._planner
        self._is_realtime = self._is_realtime_after_replay
        context.begin_step(inner.steps)
        self._wall_start = time.monotonic() - context.now
        versions = dict(list_versions())
        context.emit(RunResumed(interruption.kept_step_count, interruption.last_action, versions))


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
    held_item, is_holding = cell.ledger.find_held_item(), cell.tool.holding
    if held_item is None and is_holding:
        # The interruption came after the tool gripped an object and before the ledger recorded the grasp.
        cell.tool.open()
    elif held_item is not None and not is_holding and last_action == "close":
        cell.tool.open()
        cell.ledger.record_drop(held_item)
    # After the action `open`, the item stays held: the skill starts again and records the release.
    cell.ledger.invalidate_positions()
