"""Resumption of an interrupted run: replay of its recorded inputs, then execution on its inner cell.

If the journal lacks the last actions of the tool, `recover_scene` finds out where the objects are.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Generator

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.arm import Goal, Task
from executive.cell.detection import Detections
from executive.cell.frame import Frame
from executive.cell.objects import Load
from executive.cell.protocols import Cell, Steps
from executive.errors import Blocked, Fault, NoDepth, Unavailable, Unreachable
from executive.events import Observer, RunEnded, RunResumed
from executive.manipulation.tool_goals import DROP_HEIGHT, list_obstacles, make_put_down_goal
from executive.replay.input_log import UNKNOWN_ACTION, Interruption
from executive.replay.replayed_cell import ReplayedCell
from executive.run.lookahead_planner import LookaheadPlanner
from executive.run.run import Run
from executive.run.run_context import RunContext, brake_arm
from executive.run.run_control import RunControl
from executive.run.versions import list_versions
from executive.tree.halting import halt
from executive.tree.skill_leaf import SkillLeaf
from executive.tree.tree_node import TreeNode

LOOKS_PER_POSE = 3
"""Number of looks from each camera pose; a look is one image with its detections."""
MIN_LOOKS = 5
"""Minimum number of looks from all scan poses together."""
VACUUM_DECAY_TIME = 0.1
"""Time for the vacuum to decay after the tool opened [s]."""


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
        self._is_scene_known = True
        """False from an interruption with unrecorded commands until the scene has been observed again."""
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
        self._is_scene_known &= interruption.last_action != UNKNOWN_ACTION
        if self._is_scene_known:
            halt_running_skills(self.root)
        else:
            # A halted skill must not open the tool, because the journal may lack the last motions of the arm.
            with cell.suppress_commands(), contextlib.suppress(Fault):
                halt_running_skills(self.root)
        brake_arm(context.cell, context.advance)
        if interruption.restarts_tree:
            cell.accounts.discard_rejected_and_skipped()
        if self._is_scene_known:
            reconcile_ledger(context.cell, interruption.last_action)
            return
        for _ in recover_scene(context.cell):
            context.advance()
            has_replay_ended = cell.has_run_ended or cell.pending_interruption is not None
            if self.control.is_stopped or (not cell.is_live and has_replay_ended):
                return  # The scene stays unknown.
        self._is_scene_known = True

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


def recover_scene(cell: Cell) -> Steps:
    """Empty the tool, and observe the table and the bins.

    A camera on the arm also observes each bin from above. The ledger then knows the place of each detected
    item; the mission searches for the other items.

    Raises:
        Fault: The tool holds an object that cannot be put down.
    """
    cell.ledger.record_interruption()
    if cell.tool.holding:
        yield from _put_down(cell)
    cell.tool.open()
    yield from cell.clock.sleep(VACUUM_DECAY_TIME)
    poses = cell.camera.scan_poses
    camera_positions = [cell.camera.capture().X_WC.position]
    max_tool_height = 0.0
    for look_index in range(max(MIN_LOOKS, LOOKS_PER_POSE * len(poses))):
        frame = yield from _look(cell, poses[look_index % len(poses)])
        camera_positions.append(frame.X_WC.position)
        max_tool_height = max(max_tool_height, float(cell.arm.tool_pose.position[2]))
    if not np.allclose(camera_positions, camera_positions[0]):
        for bin in cell.bins.values():
            x, y, _ = map(float, bin.position)
            for _ in range(LOOKS_PER_POSE):
                yield from _look(cell, Goal((x, y, max_tool_height)))
    cell.ledger.record_bin_contents()


def _put_down(cell: Cell) -> Steps:
    """Transport the object in the tool, whose class is unknown, to a free position on the table."""
    tallest_class = max(cell.classes.values(), key=lambda object_class: object_class.height)
    goal = make_put_down_goal(cell, tallest_class, DROP_HEIGHT, None)
    problems = []
    # The tallest load may collide at the start although the real load does not; the second plan has no load.
    for load in (Load(tallest_class, cell.tool.holding_force), None):
        try:
            yield from _move(cell, goal, Task(load, list_obstacles(cell)))
        except (Unreachable, Blocked) as error:
            problems.append(str(error))
        else:
            return
    raise Fault(
        f"the tool holds an object that cannot be put down: {problems[0]}; take it out of the tool and "
        "resume the run again"
    )


def _look(cell: Cell, goal: Goal | str) -> Generator[None, None, Frame]:
    """Move to a goal if possible, update the ledger from the whole camera image, and return the frame."""
    with contextlib.suppress(Unreachable, Blocked):
        yield from _move(cell, goal, Task(obstacles=list_obstacles(cell)))
    frame = cell.camera.capture()
    request = next(iter(cell.detectors.values())).request(frame, "full")
    while not request.ready:
        yield
    # A look of a displaced camera is ignored; a skill of the mission reports the displacement later.
    with contextlib.suppress(Unavailable, NoDepth):
        area = cell.camera.get_view_box("full")
        detections = Detections(**vars(request.result()), frame=frame, view="full", area=area)
        observations = cell.localizer.localize(detections)
        if not cell.camera.describe_displacement(frame):
            cell.ledger.observe(detections, observations)
    return frame


def _move(cell: Cell, goal: Goal | str, task: Task) -> Steps:
    """Move the arm to a goal, and yield until the arm is at rest, at the goal or after a collision.

    Raises:
        Unreachable, Blocked: The planner found no motion.
    """
    planning = cell.arm.plan(goal, task)
    while not planning.ready:
        yield
    cell.arm.start(planning.result())
    while not cell.arm.at_rest:
        yield
    if cell.arm.collision is not None:
        cell.ledger.record_collision(cell.arm.contact_point)
