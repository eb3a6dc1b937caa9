"""Motion planner: motions from rest to rest, as fast as the limits allow, without collision.

The planner chooses the branch of the inverse kinematics and, among the permitted ones, the final yaw.
The planner prefers the direct motion, and optimizes a detour if an obstacle blocks the direct motion. Each
motion is checked for collisions, optionally in a more exact model. The search has a maximum number of steps
instead of a timeout, so that equal queries have equal results. An arm has its motions planned in a thread,
and keeps one plan for a later request.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from types import GeneratorType
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from executive.cell.arm import Goal, Motion, Task
from executive.cell.config import CellConfig
from executive.cell.protocols import STEP, Clock
from executive.errors import Blocked, Fault, Unreachable
from executive.events import Emit, MotionPlanned
from executive.geometry import Array, Pose
from executive.motion.arms import build_planning_kinematics
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import JointLimits, Kinematics
from executive.motion.optimizer import MotionProblem
from executive.motion.search import MotionSearch
from executive.motion.trajectory import JointLimitError, Trajectory, downsample_path
from executive.processes import wait_until_done

CollisionCheck = Callable[[Array, Task], None]
"""Function that raises Blocked if the path `(N, n)` [rad] of a task collides."""

MAX_CHECK_SPACING = math.radians(1.0)
"""Maximum change of a joint between two neighbouring states that are checked for collisions [rad]."""


class Planner:
    """Plans motions of the arm of a cell file.

    Args:
        config: The cell file.
        check_collision: Additional collision check, or None.
        kinematics: Kinematics of the arm; None: those of `config.arm.urdf`.

    Attributes:
        kinematics: Kinematics of the arm.
        limits: Joint limits of the arm.
    """

    def __init__(
        self,
        config: CellConfig,
        check_collision: CollisionCheck | None = None,
        kinematics: Kinematics | None = None,
    ) -> None:
        self.limits = JointLimits.from_config(config.arm.limits)
        self.kinematics = kinematics or build_planning_kinematics(config)
        self._config = config
        self._check_collision = check_collision

    def plan(self, q_start: ArrayLike, goal: Goal | ArrayLike, task: Task = Task()) -> Trajectory:
        """Return a fast motion from rest at `q_start` `(n,)` [rad] to a goal or to joint positions `(n,)`.

        The motion is the first one of the search that passes all checks. With a load, it is then slowed down
        until the tool holds the load.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Each motion comes too close to an obstacle; the message describes the first one.
        """
        start = np.asarray(q_start, dtype=float)
        end = goal if isinstance(goal, Goal) else np.asarray(goal, dtype=float)
        task_before_contact = _treat_target_as_obstacle(task)
        search = MotionSearch(self._config, self.kinematics, self.limits, start, end, task_before_contact)
        errors: list[str] = []
        for motion in search.plan_motions():
            try:
                self._check_motion(motion, search.problem, task)
            except (Blocked, Unreachable, JointLimitError) as error:
                errors.append(str(error))
            else:
                payload = search.problem.payload
                return payload.make_safe_motion(motion) if payload else motion
        if not errors:
            raise Blocked("no motion inside the joint limits leads to the goal")
        summary = f"; all {len(errors)} motions that were tried are blocked" if len(errors) > 1 else ""
        raise Blocked(f"{errors[0]}{summary}")

    def _check_motion(self, motion: Trajectory, problem: MotionProblem, task: Task) -> None:
        """Check joint limits and collisions of a motion.

        Raises:
            Blocked: The motion comes too near to an obstacle.
            Unreachable, JointLimitError: The motion exceeds the range or another limit of a joint.
        """
        qs = motion.require_limits(self.limits).q
        has_guarded_part = motion.guarded_start_time < math.inf
        # The first state always belongs to the free part, which therefore is never empty.
        free_qs = qs[: max(1, math.ceil(motion.guarded_start_time / STEP))] if has_guarded_part else qs
        problem.clearance.require_clearance(*self.kinematics.compute_tcps_and_axes(free_qs))
        if self._check_collision is not None:
            free_path = downsample_path(free_qs, MAX_CHECK_SPACING)
            self._check_collision(free_path, _treat_target_as_obstacle(task))
            if has_guarded_part:
                self._check_collision(downsample_path(qs[len(free_qs) - 1 :], MAX_CHECK_SPACING), task)


def _treat_target_as_obstacle(task: Task) -> Task:
    """Return the task of the part before the guarded part, in which the target counts as an obstacle."""
    targets = () if task.target is None else (task.target,)
    return replace(task, obstacles=(*task.obstacles, *targets), target=None)


M = TypeVar("M", bound=Motion)
"""Type of the motions of an arm."""


@dataclass(eq=False)
class Plan(Generic[M]):
    """Planning of a motion, in progress or finished; implements `executive.cell.arm.Planning`.

    Attributes:
        clock: Clock of the run.
        query: Bytes of the joint positions at the start, goal and task of the motion.
        ready_time: Time before which the plan is not ready [s].
        future: Planned motion, or exception of the planner, from the worker thread.
        report: Function that is called once when the plan is ready.
    """

    query: tuple[bytes, Goal | str, Task]
    clock: Clock
    ready_time: float
    future: Future[M]
    report: Callable[[], None] = lambda: None

    @property
    def ready(self) -> bool:
        """True if the time `ready_time` has come.

        This property waits for the worker at `ready_time`, so that the time at which a motion becomes
        available does not depend on the speed of the computer.
        """
        if self.clock.now < self.ready_time - self.clock.step / 2:
            return False
        wait_until_done(self.future)
        report = self.report
        self.report = lambda: None
        report()
        return True

    def result(self) -> M:
        """Return the motion, or raise the error of the planner."""
        return self.future.result()


class PlanningArm(Generic[M]):
    """Base class of arms that plan motions in a worker thread and keep one plan for a later request.

    Args:
        config: The cell file.
        kinematics: Kinematics of the arm.
        plan_motion: Function that plans a motion from rest at joint positions to a goal or to other joint
            positions, `(n,)` each [rad]; called in the worker thread.
        clock: Clock of the run.
        emit: Function that receives an event for each requested plan when the plan is ready.

    Attributes:
        kinematics: Kinematics of the arm.
        poses: Joint positions `(n,)` [rad] of each named pose of the cell file.
        collision: Description of the collision that ended the last motion, or None.
        contact_point: Point of the collision in the world `(x, y, z)` [m]; None: unknown, or no collision.
    """

    def __init__(
        self,
        config: CellConfig,
        kinematics: Kinematics,
        plan_motion: Callable[[Array, Goal | Array, Task], M],
        clock: Clock,
        emit: Emit,
    ) -> None:
        self.kinematics = kinematics
        self.poses = {name: np.radians(pose) for name, pose in config.arm.poses_deg.items()}
        self.collision: str | None = None
        self.contact_point: Sequence[float] | None = None
        self._plan_motion = plan_motion
        self._clock = clock
        self._planning_time = config.motion.planning_time
        self._emit = emit
        self._reach_problems: dict[Goal, str] = {}
        self._worker = ThreadPoolExecutor(1, "planner")
        self._stored_plan: Plan[M] | None = None

    @property
    def q(self) -> Array:
        """Joint positions `(n,)` [rad]."""
        raise NotImplementedError

    @property
    def at_rest(self) -> bool:
        """True while the arm neither follows a motion nor brakes."""
        raise NotImplementedError

    @property
    def _end_q(self) -> Array:
        """Joint positions `(n,)` [rad] at the end of the running motion, or now if the arm is at rest."""
        raise NotImplementedError

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world."""
        return self.kinematics.compute_tool_pose(self.q)

    @property
    def destination(self) -> Array:
        """Position of the tool `(3,)` [m] at the end of the running motion, or now if the arm is at rest."""
        return self.kinematics.compute_tool_pose(self._end_q).position

    def describe_unreachable(self, goal: Goal) -> str:
        """Return a sentence if no configuration reaches a goal and the start of its descent, else ""."""
        # The answer is computed once per goal, because a `guard` of the tree may ask in every control step.
        if goal not in self._reach_problems:
            try:
                q_start = np.zeros_like(self.kinematics.joint_range.lower)
                find_configuration_pairs(self.kinematics, goal, goal.guarded_length, q_start)
                self._reach_problems[goal] = ""
            except Unreachable as error:
                self._reach_problems[goal] = str(error)
        return self._reach_problems[goal]

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[M]:
        """Begin to plan a motion, or continue a plan that `plan_ahead` began.

        Raises:
            Fault: The arm is moving, or the cell file has no such pose.
        """
        self._require_rest("plan a motion")
        stored_plan = self._stored_plan
        plan = self._store_plan(goal, task)
        self._stored_plan = None
        request_time = self._clock.now

        def report() -> None:
            duration = 0.0 if plan.future.exception() else plan.future.result().duration
            delay = self._clock.now - request_time
            self._emit(MotionPlanned(plan is stored_plan, round(delay, 4), round(duration, 4)))

        plan.report = report
        return plan

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Begin to plan the next motion; raise Fault if the cell file has no such pose."""
        self._store_plan(goal, task)

    def close(self) -> None:
        """Cancel the plans that have not started, wait for the running plan, and end the planning thread."""
        self._worker.shutdown(cancel_futures=True)

    def _store_plan(self, goal: Goal | str, task: Task) -> Plan[M]:
        """Return the stored plan from the end of the running motion; begin and store it if there is none."""
        if isinstance(goal, str) and goal not in self.poses:
            raise Fault(f'the cell file has no arm pose "{goal}"; it has {", ".join(sorted(self.poses))}')
        start = self._end_q.copy()
        query = (start.tobytes(), goal, task)
        plan = self._stored_plan
        if plan is not None and plan.query == query:
            return plan
        if plan is not None:
            # A plan that the worker has already started cannot be cancelled, but nobody reads its result.
            plan.future.cancel()
        end = self.poses[goal] if isinstance(goal, str) else goal
        future = self._worker.submit(self._plan_motion, start, end, task)
        self._stored_plan = Plan(query, self._clock, self._clock.now + self._planning_time, future)
        return self._stored_plan

    def _require_rest(self, action: str) -> None:
        if not self.at_rest:
            raise Fault(f"the arm cannot {action} while moving; wait for `at_rest`")

    def _require_own_motion(self, motion: Motion, kind: type[M]) -> M:
        """Return the motion.

        Raises:
            Fault: The arm is moving, or did not plan the motion.
        """
        self._require_rest("start a motion")
        if isinstance(motion, GeneratorType):
            raise Fault(
                f"the generator {motion.__name__}(...) was passed to the arm where a motion is expected: "
                f'"yield from" is missing. Write "motion = yield from {motion.__name__}(...)"'
            )
        if not isinstance(motion, kind):
            raise Fault(f"the arm follows its own planned motions, not a {type(motion).__name__}")
        return motion
