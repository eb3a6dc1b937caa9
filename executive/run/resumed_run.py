"""Resumption of an interrupted run: replay of its recorded inputs, then execution on the real cell."""

from __future__ import annotations

import contextlib
import time

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Cell
from executive.errors import Fault
from executive.events import Observer, RunEnded, RunResumed
from executive.replay.input_log import UNKNOWN_ACTION, Interruption
from executive.replay.replayed_cell import ReplayedCell
from executive.run.lookahead_planner import LookaheadPlanner
from executive.run.run import Run
from executive.run.run_context import RunContext, brake_arm
from executive.run.run_control import RunControl
from executive.run.scene_recovery import recover_scene
from executive.run.versions import list_versions
from executive.tree.halting import halt
from executive.tree.node import TreeNode
from executive.tree.skill_leaf import SkillLeaf


class ResumedRun(Run):
    """Run that replays an interrupted run, and then may continue on the real cell.

    The replay includes earlier resumptions of the run. Observers receive all events; recorders receive only
    the events after the replay.

    Args:
        is_realtime: True to execute the run on the real cell at the speed of the wall clock.

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
        self._is_realtime_on_cell = is_realtime
        self._recorders: list[Observer] = []
        self._is_scene_known = True
        """False from an interruption with unknown commands until the scene has been observed."""
        self._planner = LookaheadPlanner(replayed_cell.inner.cell)
        context.add_observer(self._planner.on_event)
        control.call_between_ticks(self._stop_or_resume)

    def add_recorder(self, recorder: Observer) -> None:
        """Call `recorder` with every event after the replay, before the observers."""
        self._recorders.append(recorder)

    def _execute_tree(self) -> RunEnded:
        """Execute the tree, also after each recorded resumption of an INCOMPLETE run; return the last end."""
        run_end = super()._execute_tree()
        while run_end.status == "INCOMPLETE" and self.replayed_cell.is_tree_restarted:
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
        """Continue after an interruption: restart the skills, brake the arm, and update the ledger.

        Raises:
            Fault: The arm did not come to rest.
        """
        context, replayed_cell = self._context, self.replayed_cell
        replayed_cell.resume()
        if replayed_cell.is_live:
            # The arm brakes before the first recorded event, so that a killed run can be resumed again.
            brake_arm(replayed_cell.inner.cell, replayed_cell.inner.advance)
            for recorder in self._recorders:
                context.add_observer(recorder, is_first=True)
            context.planner, self._is_realtime = self._planner, self._is_realtime_on_cell
        context.begin_step(replayed_cell.steps)
        if replayed_cell.is_live:
            self._wall_start = time.monotonic() - context.now
            step_count, versions = interruption.kept_step_count, dict(list_versions())
            context.emit(RunResumed(step_count, interruption.last_action, versions))
        self._is_scene_known &= interruption.last_action != UNKNOWN_ACTION
        if self._is_scene_known:
            restart_skills(self.root)
        else:
            # A halted skill must not open the tool, because the journal may lack the last motions of the arm.
            with replayed_cell.suppress_commands(), contextlib.suppress(Fault):
                restart_skills(self.root)
        brake_arm(context.cell, context.advance)
        if interruption.restarts_tree:
            replayed_cell.accounts.reopen()
        if self._is_scene_known:
            reconcile_ledger(context.cell, interruption.last_action)
        else:
            self._recover_scene()

    def _recover_scene(self) -> None:
        """Observe the scene; an interruption or a stop ends the recovery, and the scene stays unknown."""
        cell = self.replayed_cell
        for _ in recover_scene(self._context.cell):
            self._context.advance()
            has_replay_ended = cell.has_run_ended or cell.pending_interruption is not None
            if self.control.is_stopped or (not cell.is_live and has_replay_ended):
                return
        self._is_scene_known = True


def restart_skills(root: Behaviour) -> None:
    """Halt every running skill, so that the next tick starts the skill again; control nodes keep their state.

    Raises:
        Fault: The clean-up of a skill failed; nevertheless all running skills are halted.
    """
    leaves = [node for node in root.iterate() if isinstance(node, SkillLeaf)]
    running_skills = [leaf for leaf in leaves if leaf.status is Status.RUNNING]
    if problems := [problem for skill in running_skills for problem in halt(skill)]:
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
    # After the action `open`, the ledger still contains the grasp: the restarted skill records the release.
    cell.ledger.invalidate_positions()
