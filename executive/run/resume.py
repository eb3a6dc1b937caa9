"""Resumption of an interrupted run: its recorded inputs are replayed, then the real cell takes over."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Cell
from executive.errors import Fault
from executive.events import Observer, RunEnded, RunResumed
from executive.mission.build import TreeNode
from executive.replay.input_log import UNKNOWN_ACTION, Interruption
from executive.replay.replayed_cell import ReplayedCell
from executive.run.planning_ahead import PlanningAhead
from executive.run.run import Run
from executive.run.run_context import RunContext, come_to_rest
from executive.run.run_control import RunControl
from executive.run.scene_recovery import recover_scene
from executive.run.versions import versions
from executive.tree.halting import halt
from executive.tree.skill_leaf import SkillLeaf


class ResumedRun(Run):
    """Run on a cell that replays an interrupted run, and may continue on the real cell.

    At each recorded interruption, the run repeats the actions of the earlier resumption. Observers get all
    events; recorders get only the events after the real cell has taken over.

    Args:
        context: Cell and events of the run.
        replayed: Work cell of `context`, which replays the recorded run.
        root: The tree.
        control: Stops, pauses and steps the run.
        mission: Name of the mission.
        realtime: True to pace the run by the wall clock after the real cell has taken over.

    Attributes:
        replayed: Work cell that replays the recorded run.
    """

    def __init__(
        self,
        context: RunContext,
        replayed: ReplayedCell,
        root: TreeNode,
        control: RunControl,
        mission: str,
        *,
        realtime: bool = False,
    ) -> None:
        super().__init__(context, root, control, mission)
        self.replayed = replayed
        self._paces_live_part = realtime
        self._recorders: list[Observer] = []
        self._is_scene_known = True
        self._planner = PlanningAhead(replayed.inner.cell)
        context.observe(self._planner.observe)
        control.between_ticks(self._follow_record)

    def record(self, recorder: Observer) -> None:
        """Call `recorder` with every event after the real cell has taken over."""
        self._recorders.append(recorder)

    def _execute_tree(self) -> RunEnded:
        """Execute the tree, again after each recorded resumption of an INCOMPLETE end; return its end."""
        outcome = super()._execute_tree()
        while outcome.status == "INCOMPLETE" and self.replayed.is_reopened:
            self._context.advance()
            outcome = super()._execute_tree()
        return outcome

    def _follow_record(self) -> None:
        """Stop or resume in the same control step as the recorded run; called between two ticks."""
        replayed = self.replayed
        while not replayed.is_live and not replayed.is_over and replayed.interruption is not None:
            self._resume(replayed.interruption)
        if not replayed.is_live and replayed.is_over:
            self.control.stop()

    def _resume(self, interruption: Interruption) -> None:
        """Continue after an interruption, during which nothing observed the cell.

        Raises:
            Fault: The arm did not come to rest.
        """
        context, replayed = self._context, self.replayed
        replayed.resume()
        if replayed.is_live:
            # The braking is not recorded: after an interruption, the run is resumed at the same control step.
            require_rest(lambda: come_to_rest(replayed.inner.cell, replayed.inner.advance))
            for recorder in self._recorders:
                context.observe(recorder, first=True)
            context.planner, self._realtime = self._planner, self._paces_live_part
        context.begin_step(replayed.steps)
        if replayed.is_live:
            self._wall_start = time.monotonic() - context.now
            ticked, intent = interruption.complete_steps, interruption.last_action
            context.emit(RunResumed(ticked, intent, dict(versions())))
        self._is_scene_known &= interruption.last_action != UNKNOWN_ACTION
        if self._is_scene_known:
            restart_skills(self.root)
        else:
            # The arm may be elsewhere than the journal says: a halted skill must not open the tool there.
            with replayed.mute(), contextlib.suppress(Fault):
                restart_skills(self.root)
        require_rest(context.come_to_rest)
        if interruption.reopens:
            replayed.accounts.reopen()
        if self._is_scene_known:
            reconcile(context.cell, interruption.last_action)
        else:
            self._recover_scene()

    def _recover_scene(self) -> None:
        """Observe the scene; the scene stays unknown if the run is interrupted or stopped meanwhile."""
        for _ in recover_scene(self._context.cell):
            self._context.advance()
            replayed = self.replayed
            is_over = not replayed.is_live and (replayed.is_over or replayed.interruption is not None)
            if self.control.stopped or is_over:
                return
        self._is_scene_known = True


def require_rest(brake: Callable[[], str]) -> None:
    """Let an arm come to rest.

    Raises:
        Fault: `brake` returns a problem.
    """
    if problem := brake():
        raise Fault(problem)


def restart_skills(root: Behaviour) -> None:
    """Halt every running skill, so that it starts again at the next tick.

    Control nodes keep their state: the count of attempts continues, and variables keep their values.

    Raises:
        Fault: The clean-up of a skill failed; all other skills were halted nevertheless.
    """
    running = [
        node for node in root.iterate() if isinstance(node, SkillLeaf) and node.status is Status.RUNNING
    ]
    if problems := [problem for node in running for problem in halt(node)]:
        raise Fault("; ".join(problems))


def reconcile(cell: Cell, last_action: str) -> None:
    """Correct the ledger by the sensor of the tool, and invalidate every position on the table.

    Nothing observed the cell during the interruption: objects may have been moved, and the tool may have lost
    its item.

    Args:
        cell: The cell, with its arm at rest.
        last_action: Last action of the tool, `open` or `close`; "" if there was none.
    """
    believed, holding = cell.ledger.find_held_item(), cell.tool.holding
    if believed is None and holding:
        # The run was interrupted between the seal and its record in the ledger, before the lift.
        cell.tool.open()
    elif believed is not None and not holding and last_action == "close":
        cell.tool.open()
        cell.ledger.record_drop(believed)
    # After `open`, the restarted skill records where it released the item.
    cell.ledger.invalidate_positions()
