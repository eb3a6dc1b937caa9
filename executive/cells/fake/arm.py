"""Arm of the fake cell, with attributes by which tests provoke failures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal, Motion, Task
from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.layout import compute_travel_height
from executive.cell.protocols import Clock
from executive.cells.fake.world import FakeWorld
from executive.errors import Blocked, Unreachable
from executive.events import Emit
from executive.geometry import Array
from executive.motion.arms import build_planner
from executive.motion.clearance_model import ClearanceModel, make_tool_discs
from executive.motion.configurations import (
    find_configuration_pairs,
    find_vertical_waypoints,
    solve_vertical_waypoints,
)
from executive.motion.planner import PlanningArm
from executive.motion.search import EXTRA_HEIGHTS

JOINT_SPEED = 1.5
"""Speed of the fastest joint of the fake arm outside of guarded motions [rad/s]."""


@dataclass(frozen=True, eq=False)
class FakeMotion:
    """A motion of the fake arm; `qs` are the joint positions after each control step `(N, n)` [rad]."""

    qs: Array

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return len(self.qs) * STEP


class FakeArm(PlanningArm[FakeMotion]):
    """An arm that moves on straight joint paths, stops without braking, and never hits an obstacle by itself.

    A motion rises to the travel height, crosses, and descends. It is blocked if tool or load would come
    nearer to an obstacle than the cell file permits. The links of the arm are not checked.

    Args:
        world: The world that contains the held object.
        config: The cell file.
        clock: Clock of the run.
        emit: Receives the events of the arm.

    Attributes:
        q: Joint positions `(n,)` [rad].
        poses: Joint positions `(n,)` [rad] of each named pose; a run begins at `home`.
        tool_velocity: Velocity zero `(3,)` [m/s]: a released object falls straight down.
        collision: Description of the obstacle that stopped the last motion, or None.
        contact_point: Position of the tool `(x, y, z)` [m] at the last `next_obstacle`, or None.
        next_obstacle: Name of an obstacle in the middle of the next motion, or None; set by tests.
        commands: Names of the executed commands, `start` or `stop`, in order, for tests.
    """

    q = np.zeros(0)

    def __init__(self, world: FakeWorld, config: CellConfig, clock: Clock, emit: Emit) -> None:
        super().__init__(config, build_planner(config), clock, emit)
        self.q = self.poses["home"]
        self.tool_velocity = np.zeros(3)
        self.next_obstacle: str | None = None
        self.commands: list[str] = []
        self._world = world
        self._config = config
        self._kinematics = self.planner.kinematics
        self._path: list[Array] = []
        self._half_length = 0

    @property
    def at_rest(self) -> bool:
        """True while no motion runs."""
        return not self._path

    @property
    def _end_q(self) -> Array:
        return self._path[-1] if self._path else self.q

    def start(self, motion: Motion) -> None:
        """Begin to follow a motion.

        Raises:
            Fault: The arm is moving, or did not plan the motion.
        """
        self._path = list(self._require_own_motion(motion, FakeMotion).qs)
        self._half_length = len(self._path) // 2
        self.commands.append("start")
        self._world.is_commanded = True
        self.collision = None
        self.contact_point = None

    def set_tool_position(self, position: Array) -> None:
        """Move the tool, which then points down, to a position `(3,)` [m] at once."""
        x, y, z = map(float, position)
        self.q = find_configuration_pairs(self._kinematics, Goal((x, y, z)), 0.0, self.q).lower_qs[0]
        self._path = []

    def stop(self) -> None:
        """End the running motion without braking."""
        if self._path:
            self.commands.append("stop")
        self._path = []

    def stop_after_collision(self, message: str) -> None:
        """Stop the running motion and set `collision` to a message; do nothing if the arm is at rest."""
        if self._path:
            self.collision = message
            self.stop()

    def advance(self) -> None:
        """Move arm and held object by one control step."""
        if not self._path:
            return
        self.q = self._path.pop(0)
        if (held := self._world.held_object) is not None:
            height = self._world.classes[held.label].height
            held.position = self.tool_pose.position - np.array([0.0, 0.0, height / 2])
        if self.next_obstacle is not None and len(self._path) <= self._half_length:
            self.collision = self.next_obstacle
            self.next_obstacle = None
            self.contact_point = self.tool_pose.position.tolist()
            self.stop()

    def _plan_motion(self, start: Array, goal: Goal | str, task: Task) -> FakeMotion:
        """Return a motion, or raise the error of the first attempt if there is none."""
        errors: list[Exception] = []
        travel_height = compute_travel_height(self._config)
        rise = max(0.0, travel_height - float(self._kinematics.compute_tool_pose(start).position[2]))
        attempts = [(rise + extra_height, travel_height + extra_height) for extra_height in EXTRA_HEIGHTS]
        for attempt in [(0.0, 0.0), *attempts] if isinstance(goal, str) else attempts:
            try:
                qs = self._find_path(start, goal, *attempt)
                self._require_clearance(np.vstack([start, qs]), task)
                return FakeMotion(qs)
            except (Blocked, Unreachable) as error:
                errors.append(error)
        raise errors[0]

    def _find_path(self, start: Array, goal: Goal | str, rise: float, height: float) -> Array:
        """Return joint positions `(N, n)` [rad] of a path up by `rise` [m], and down from `height` [m]."""
        waypoints = find_vertical_waypoints(self._kinematics, start, rise)
        corners = start[None] if waypoints is None else waypoints
        if isinstance(goal, str):
            return _interpolate(np.vstack([corners, self.poses[goal]]), 0.0)
        pairs = find_configuration_pairs(self._kinematics, goal, goal.guarded_length, start)
        # The largest change of a joint would be smaller with another norm, but the tool would sink more.
        nearest = np.argmin(np.linalg.norm(pairs.upper_qs - corners[-1], axis=1))
        length = max(0.0, height - goal.position[2] - goal.guarded_length)
        branch = pairs.branches[nearest]
        descent = solve_vertical_waypoints(self._kinematics, pairs.upper_qs[nearest], length, branch)
        corners = np.vstack([corners, descent[::-1], pairs.lower_qs[nearest]])
        return _interpolate(corners, goal.guarded_length / goal.guarded_speed)

    def _require_clearance(self, qs: Array, task: Task) -> None:
        """Raise Blocked if tool or load come too near to an obstacle at joint positions `(N, n)` [rad]."""
        tcps, axes = self._kinematics.compute_tcps_and_axes(qs)
        discs = make_tool_discs(self._config, task.load)._replace(min_cosine=-1.0)
        # Only other objects may be as near as they are at the ends: the goal may not be inside table or bins.
        for obstacles, min_margin in (((), 0.0), (task.obstacles, -math.inf)):
            clearance = ClearanceModel(self._config, obstacles, tcps[[0, -1], :2], discs)
            clearance.relax_end_margins(tcps[[0, -1]], axes[[0, -1]], min_margin)
            clearance.require_clearance(tcps, axes)


def _interpolate(corners: Array, min_last_time: float) -> Array:
    """Return the joint positions after each control step on straight lines between corners `(K, n)` [rad].

    The last line takes at least `min_last_time` [s].
    """
    times = np.abs(np.diff(corners, axis=0)).max(axis=1) / JOINT_SPEED
    times[-1] = max(times[-1], min_last_time)
    corner_times = np.cumsum([0.0, *times])
    step_times = np.append(np.arange(STEP, corner_times[-1], STEP), corner_times[-1])
    return np.column_stack([np.interp(step_times, corner_times, joint) for joint in corners.T])
