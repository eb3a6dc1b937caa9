"""Planner service of a cell, and the arm as skills see it.

The service plans motions in a worker thread, and keeps one motion that was planned ahead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from types import GeneratorType

import numpy as np

from executive.cell.arm import Goal, Motion, MotionGuard, Planning, Task
from executive.cell.devices import ArmDevice, DeviceClock
from executive.errors import Fault, Unreachable
from executive.events import Emit, MotionPlanned
from executive.geometry import Array, Pose
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import Kinematics
from executive.processes import shut_down, wait_until_done

MAX_STORED_ANSWERS = 1000
"""Number of stored answers about goals above which all are removed."""
DIFFERENTIATION_STEP = 1e-4
"""Time step of the numerical derivative of the tool position [s]."""

PlanMotion = Callable[[Array, Goal | Array, Task], Motion]
"""Function that plans a motion from rest at joint positions to a goal or to other joint positions, each of
shape `(n,)` [rad]; it raises Unreachable or Blocked if there is none."""


@dataclass(eq=False)
class Plan:
    """Planning of a motion, in progress or finished; implements `executive.cell.arm.Planning`.

    Attributes:
        query: Bytes of the joint positions at the start, goal and task of the motion.
        clock: Clock of the devices.
        ready_time: Time before which the plan is not ready [s].
        future: Planned motion, or exception of the planner, from the worker thread.
        report: Function that is called once when the plan is ready.
    """

    query: tuple[bytes, Goal | bytes, Task]
    clock: DeviceClock
    ready_time: float
    future: Future[Motion]
    report: Callable[[], None] = lambda: None

    @property
    def ready(self) -> bool:
        """True if the time `ready_time` has come, and on a wall clock if the worker has finished.

        In simulation, this property waits for the worker at `ready_time`, so that the time at which a motion
        becomes available does not depend on the speed of the computer.
        """
        if self.clock.now < self.ready_time - self.clock.step / 2:
            return False
        if self.clock.is_simulated:
            wait_until_done(self.future)
        elif not self.future.done():
            return False
        report = self.report
        self.report = lambda: None
        report()
        return True

    def result(self) -> Motion:
        """Return the motion, or raise the error of the planner."""
        return self.future.result()


@dataclass(eq=False)
class PlannerService:
    """Plans motions of one arm in a worker thread, and keeps one plan for a later request.

    Attributes:
        plan_motion: Function that plans a motion; called in the worker thread.
        clock: Clock of the devices.
        planning_time: Time from a request until its plan is ready [s].
        emit: Function that receives an event for each requested plan when the plan is ready.
        release: Function that releases the resources of the planner.
    """

    plan_motion: PlanMotion
    clock: DeviceClock
    planning_time: float
    emit: Emit
    release: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        self._worker = ThreadPoolExecutor(1, "planner")
        self._stored_plan: Plan | None = None

    def plan(self, start: Array, goal: Goal | Array, task: Task) -> Plan:
        """Begin to plan a motion, or continue a plan that `plan_ahead` began."""
        stored_plan = self._stored_plan
        plan = self.plan_ahead(start, goal, task)
        self._stored_plan = None
        request_time = self.clock.now

        def report() -> None:
            duration = 0.0 if plan.future.exception() else plan.future.result().duration
            delay = self.clock.now - request_time
            self.emit(MotionPlanned(plan is stored_plan, round(delay, 4), round(duration, 4)))

        plan.report = report
        return plan

    def plan_ahead(self, start: Array, goal: Goal | Array, task: Task) -> Plan:
        """Return the stored plan of a motion; begin and store it if there is none."""
        query = (start.tobytes(), goal if isinstance(goal, Goal) else goal.tobytes(), task)
        plan = self._stored_plan
        if plan is not None and plan.query == query:
            return plan
        if plan is not None:
            # A plan that the worker has already started cannot be cancelled, but nobody reads its result.
            plan.future.cancel()
        future = self._worker.submit(self.plan_motion, start, goal, task)
        self._stored_plan = Plan(query, self.clock, self.clock.now + self.planning_time, future)
        return self._stored_plan

    def close(self) -> None:
        """Cancel the plans that have not started, and end the planning thread, unless a plan does not end."""
        if shut_down(self._worker):
            self.release()


class PlannedArm:
    """An arm that plans with a planner service and follows motions on its device; implements `Arm` of a cell.

    Args:
        device: The arm of the driver.
        planner: The planner service.
        kinematics: Kinematics of the arm with its tool.
        poses: Joint positions `(n,)` [rad] of each named pose of the cell file.
    """

    def __init__(
        self, device: ArmDevice, planner: PlannerService, kinematics: Kinematics, poses: Mapping[str, Array]
    ) -> None:
        self._device = device
        self._planner = planner
        self._kinematics = kinematics
        self._poses = poses
        self._reach_problems: dict[Goal, str] = {}

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world."""
        return self._kinematics.compute_tool_pose(self._device.q)

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s]."""
        q = self._device.q
        compute_pose = self._kinematics.compute_tool_pose
        moved_position = compute_pose(q + self._device.qd * DIFFERENTIATION_STEP).position
        return np.asarray((moved_position - compute_pose(q).position) / DIFFERENTIATION_STEP)

    @property
    def destination(self) -> Array:
        """Position of the tool `(3,)` [m] at the end of the running motion, or now if the arm is at rest."""
        return self._kinematics.compute_tool_pose(self._device.end_q).position

    @property
    def at_rest(self) -> bool:
        """True while the arm neither follows a motion nor brakes."""
        return self._device.at_rest

    @property
    def collision(self) -> str | None:
        """Description of the collision that ended the last motion, or None."""
        return self._device.collision

    @property
    def contact_point(self) -> Sequence[float] | None:
        """Point of the collision in the world `(x, y, z)` [m]; None: unknown, or no collision."""
        return self._device.contact_point

    def describe_unreachable(self, goal: Goal) -> str:
        """Return a sentence if no configuration reaches a goal and the start of its descent, else ""."""
        # The answer is computed once per goal, because a `guard` of the tree may ask in every tick.
        if goal not in self._reach_problems:
            if len(self._reach_problems) > MAX_STORED_ANSWERS:
                self._reach_problems.clear()
            try:
                q_start = np.zeros_like(self._kinematics.joint_range.lower)
                find_configuration_pairs(self._kinematics, goal, goal.guarded_length, q_start)
                self._reach_problems[goal] = ""
            except Unreachable as error:
                self._reach_problems[goal] = str(error)
        return self._reach_problems[goal]

    def plan(self, goal: Goal | str, task: Task = Task()) -> Planning:
        """Begin to plan a motion.

        Raises:
            Fault: The arm is moving, or the cell file has no such pose.
        """
        self._require_rest("plan a motion")
        return self._planner.plan(self._device.end_q, self._find_end(goal), task)

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Begin to plan the next motion; raise Fault if the cell file has no such pose."""
        self._planner.plan_ahead(self._device.end_q, self._find_end(goal), task)

    def start(self, motion: Motion, guard: MotionGuard = MotionGuard()) -> None:
        """Begin to follow a motion.

        Raises:
            Fault: The arm is moving, was not sent to the start, or `motion` is no planned motion.
        """
        self._require_rest("start a motion")
        if isinstance(motion, GeneratorType):
            raise Fault(
                f"the generator {motion.__name__}(...) was passed to the arm where a motion is expected: "
                f'"yield from" is missing. Write "motion = yield from {motion.__name__}(...)"'
            )
        if not hasattr(motion, "duration"):
            raise Fault(f"the arm follows planned motions, not a {type(motion).__name__}")
        self._device.execute(motion, guard)

    def stop(self) -> None:
        """Start to brake along the path of the current motion, if any; return at once."""
        self._device.stop()

    def _find_end(self, goal: Goal | str) -> Goal | Array:
        """Return a goal, or the joint positions `(n,)` [rad] of a named pose."""
        if isinstance(goal, str) and goal not in self._poses:
            raise Fault(f'the cell file has no arm pose "{goal}"; it has {", ".join(sorted(self._poses))}')
        return self._poses[goal] if isinstance(goal, str) else goal

    def _require_rest(self, action: str) -> None:
        if not self._device.at_rest:
            raise Fault(f"the arm cannot {action} while moving; wait for `at_rest`")
