"""Resumption of an interrupted run: replay of its recorded inputs, then execution on the real cell."""

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
from executive.run.lookahead_planner import LookaheadPlanner
from executive.run.run import Run
from executive.run.run_context import RunContext, brake_arm
from executive.run.run_control import RunControl
from executive.run.scene_recovery import recover_scene
from executive.run.versions import list_versions
from executive.tree.halting import halt
from executive.tree.skill_leaf import SkillLeaf


class ResumedRun(Run):
    """Run that replays an interrupted run, and then may continue on the real cell.

    At each earlier interruption, the run repeats the actions of the earlier resumption. Observers get the
    events of the replay and of the real cell; recorders get only the events of the real cell.

    Args:
        context: Cell and events of the run.
        replayed_cell: Work cell of `context`, which replays the recorded run.
        root: The tree.
        control: Stops, pauses and steps the run.
        mission: Name of the mission.
        realtime: True to pace the run on the real cell by the wall clock.

    Attributes:
        replayed_cell: Work cell that replays the recorded run.
    """

    def __init__(
        self,
        context: RunContext,
        replayed_cell: ReplayedCell,
        root: TreeNode,
        control: RunControl,
        mission: str,
        *,
        realtime: bool = False,
    ) -> None:
        super().__init__(context, root, control, mission)
        self.replayed_cell = replayed_cell
        self._paces_live_part = realtime
        self._recorders: list[Observer] = []
        self._is_scene_known = True
        self._planner = LookaheadPlanner(replayed_cell.inner.cell)
        context.add_observer(self._planner.on_event)
        control.call_between_ticks(self._follow_record)

    def add_recorder(self, recorder: Observer) -> None:
        """Call `recorder` with every event of the real cell, before the observers."""
        self._recorders.append(recorder)

    def _execute_tree(self) -> RunEnded:
        """Execute the tree, and again if it ended as INCOMPLETE and was then resumed; return the last end."""
        outcome = super()._execute_tree()
        while outcome.status == "INCOMPLETE" and self.replayed_cell.is_tree_restarted:
            self._context.advance()
            outcome = super()._execute_tree()
        return outcome

    def _follow_record(self) -> None:
        """Stop or resume the run in the same control step as the recorded run; called between two ticks."""
        replayed = self.replayed_cell
        while not replayed.is_live and not replayed.has_ended and replayed.pending_interruption is not None:
            self._resume(replayed.pending_interruption)
        if not replayed.is_live and replayed.has_ended:
            self.control.stop()

    def _resume(self, interruption: Interruption) -> None:
        """Continue after an interruption: restart the skills, brake the arm, and update the ledger.

        Raises:
            Fault: The arm did not come to rest.
        """
        context, replayed = self._context, self.replayed_cell
        replayed.resume()
        if replayed.is_live:
            # No event is recorded here: if the braking is interrupted, the run resumes at the same step.
            brake_to_rest(lambda: brake_arm(replayed.inner.cell, replayed.inner.advance))
            for recorder in self._recorders:
                context.add_observer(recorder, first=True)
            context.planner, self._realtime = self._planner, self._paces_live_part
        context.begin_step(replayed.steps)
        if replayed.is_live:
            self._wall_start = time.monotonic() - context.now
            step_count, action = interruption.complete_step_count, interruption.last_action
            context.emit(RunResumed(step_count, action, dict(list_versions())))
        self._is_scene_known &= interruption.last_action != UNKNOWN_ACTION
        if self._is_scene_known:
            restart_skills(self.root)
        else:
            # A halted skill must not open the tool, because the journal may lack the last motions of the arm.
            with replayed.suppress_commands(), contextlib.suppress(Fault):
                restart_skills(self.root)
        brake_to_rest(context.brake_arm)
        if interruption.restarts_tree:
            replayed.accounts.reopen()
        if self._is_scene_known:
            reconcile_ledger(context.cell, interruption.last_action)
        else:
            self._recover_scene()

    def _recover_scene(self) -> None:
        """Observe the scene; the scene stays unknown if an interruption or a stop ends the recovery early."""
        for _ in recover_scene(self._context.cell):
            self._context.advance()
            cell = self.replayed_cell
            is_over = not cell.is_live and (cell.has_ended or cell.pending_interruption is not None)
            if self.control.is_stopped or is_over:
                return
        self._is_scene_known = True


def brake_to_rest(brake: Callable[[], str]) -> None:
    """Call `brake`, which brakes an arm and returns a message if that failed, else "".

    Raises:
        Fault: `brake` returned a message.
    """
    if problem := brake():
        raise Fault(problem)


def restart_skills(root: Behaviour) -> None:
    """Halt every running skill, so that the next tick starts the skill again.

    Control nodes keep their state, for instance the number of attempts; variables keep their values.

    Raises:
        Fault: The clean-up of a skill failed; nevertheless all other running skills were halted.
    """
    running = [
        node for node in root.iterate() if isinstance(node, SkillLeaf) and node.status is Status.RUNNING
    ]
    if problems := [problem for node in running for problem in halt(node)]:
        raise Fault("; ".join(problems))


def reconcile_ledger(cell: Cell, last_action: str) -> None:
    """Correct the ledger by the sensor of the tool, and mark the positions of all items as invalid.

    During the interruption nothing observed the cell: a person may have moved objects, and the tool may have
    dropped its item.

    Args:
        cell: The cell, with its arm at rest.
        last_action: Last action of the tool, `open` or `close`; "" if there was none.
    """
    held_item, is_holding = cell.ledger.find_held_item(), cell.tool.holding
    if held_item is None and is_holding:
        # The interruption came after the tool gripped an object and before the ledger recorded the grasp.
        cell.tool.open()
    elif held_item is not None and not is_holding and last_action == "close":
        cell.tool.open()
        cell.ledger.record_drop(held_item)
    # If the last action is `open`, the restarted skill records the released item.
    cell.ledger.invalidate_positions()
