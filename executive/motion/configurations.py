"""Joint configurations at goals and on straight lines, and straight motions of the tool between them.

The joint path `q(s)` of a straight motion is a polynomial through inverse-kinematics solutions; its parameter
`s` is the distance that the tool has moved. `q_s`, `q_ss` and `q_sss` are the derivatives of `q` with respect
to `s`. With speed `v`, acceleration `a` and jerk `j` of the tool, the chain rule gives those of the joints:

    q' = q_s v,  q'' = q_s a + q_ss v²,  q''' = q_s j + 3 q_ss v a + q_sss v³.

The limits of `v`, `a` and `j` keep every joint within its limits on the whole line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from ruckig import InputParameter, Ruckig
from ruckig import Trajectory as Profile

from executive.cell.arm import Goal, JointState
from executive.errors import Unreachable
from executive.geometry import Array, Pose, make_tool_down_pose
from executive.motion.joints import BranchKey, JointLimits, JointRange, Kinematics, wrap_angles

PREFERRED_LIMIT_DISTANCE = math.radians(1.0)
"""Preferred minimum distance of joint positions from their limits [rad]."""
LIMIT_DISTANCE_OF_YAWS = math.radians(25.0)
"""Preferred minimum distance of the last joint from its limits [rad] if yaws are given: the joint may move
towards its limit in the straight departure, and must then stop."""
COARSE_ANGLE_STEP = math.radians(5.0)
"""Distance between the redundancy angles in the first search for configurations [rad]."""
FINE_ANGLE_STEP = math.radians(0.25)
"""Distance between the redundancy angles in the second search, if the first search finds nothing [rad]."""
WAYPOINT_COUNT = 4
"""Number of waypoints on a straight line."""
UP = (0.0, 0.0, 1.0)
"""Unit vector of a vertical line upwards."""
MIN_COSINE_ON_LINE = 0.9998
"""Minimum cosine between the tool axis and straight down at the start of a vertical line."""
_MAX_SOLUTION_ERROR = 1e-6  # [rad]
MIN_JOINT_DIFFERENCE = 0.2
"""Minimum difference between two candidates in the joint that differs most [rad]."""
MAX_CURVATURE_FRACTION = 0.5
"""Maximum fraction of a joint's acceleration and jerk limits that the terms with q_ss and q_sss may use."""
MAX_VELOCITY_FRACTION = 0.99
"""Maximum fraction of a joint's velocity limit on a line: the free part before or after it accelerates there,
and must not exceed the limit."""
_CHECKED_FRACTIONS = np.linspace(0.0, 1.0, 33)  # fractions of the length at which joint limits are evaluated
_MIN_DIVISOR = 1e-9  # [rad/m], [rad/m²], [rad/m³]: avoids a division by 0 for a joint that does not move


@dataclass(frozen=True, eq=False)
class ConfigurationPairs:
    """`N` pairs of joint configurations at the two ends of a straight line of the tool.

    Attributes:
        upper_qs, lower_qs: Joint positions at the start (the upper end of a descent) and at the goal,
            `(N, n)` each [rad].
        branches: Branch of the inverse kinematics of each pair.
    """

    upper_qs: Array
    lower_qs: Array
    branches: tuple[BranchKey, ...]


def find_configuration_pairs(
    kinematics: Kinematics, goal: Goal, length: float, q_start: Array
) -> ConfigurationPairs:
    """Return all pairs of configurations in the joint range at a goal and `length` [m] before the goal.

    There is a pair for each permitted yaw of the goal. If every yaw is permitted, the last joint turns as
    little as possible from `q_start` `(n,)` [rad].

    Raises:
        Unreachable: No pair is in the joint range; the message states the position and the cause.
    """
    poses = [make_tool_down_pose(goal.compute_line_start(length)), make_tool_down_pose(goal.position)]
    direction = _find_turn_direction(kinematics, q_start)
    yaws: list[float | None] = [direction * yaw for yaw in goal.yaws] or [None]
    preferred = np.full(len(q_start), PREFERRED_LIMIT_DISTANCE)
    searches = [(COARSE_ANGLE_STEP, preferred), (FINE_ANGLE_STEP, 0.0 * preferred)]
    if goal.yaws:
        searches.insert(0, (COARSE_ANGLE_STEP, np.append(preferred[:-1], LIMIT_DISTANCE_OF_YAWS)))
    for angle_step, margin in searches:
        (upper_qs, lower_qs), branches = kinematics.solve_all(poses, q_start, angle_step)
        joint_range = kinematics.joint_range.shrink(margin)
        pairs_by_yaw = [
            _turn_last_joint(upper_qs, lower_qs, joint_range, yaw, float(q_start[-1])) for yaw in yaws
        ]
        upper_qs, lower_qs = map(np.concatenate, zip(*pairs_by_yaw, strict=True))
        is_inside = joint_range.contains(upper_qs) & joint_range.contains(lower_qs)
        if is_inside.any():
            inside_branches = tuple(branches[index % len(branches)] for index in np.flatnonzero(is_inside))
            return ConfigurationPairs(upper_qs[is_inside], lower_qs[is_inside], inside_branches)
    raise _make_unreachable_error(kinematics, poses, (upper_qs, lower_qs))


def find_vertical_waypoints(kinematics: Kinematics, q: Array, length: float) -> Array | None:
    """Return evenly spaced waypoints `(WAYPOINT_COUNT, n)` [rad] on a vertical line of the tool, or None.

    The line leads from the tool at `q` `(n,)` [rad] upwards, is `length` [m] long, and stays in the branch of
    `q`. The result is None if the tool does not point down, or if a joint would leave its range.
    """
    X_WT = kinematics.compute_tool_pose(q)
    if -X_WT.rotation[2, 2] < MIN_COSINE_ON_LINE:
        return None
    try:
        waypoints = _solve_waypoints(kinematics, X_WT, length, kinematics.find_branch(q))
    except Unreachable:
        return None
    is_inside = kinematics.joint_range.contains(waypoints).all()
    return waypoints if is_inside and np.max(np.abs(waypoints[0] - q)) < _MAX_SOLUTION_ERROR else None


def solve_straight_waypoints(
    kinematics: Kinematics, q: Array, length: float, branch: BranchKey, direction: Sequence[float] = UP
) -> Array:
    """Return evenly spaced waypoints `(WAYPOINT_COUNT, n)` [rad] on a straight line, in one branch.

    The line of `length` [m] leads from `q` `(n,)` [rad] along the unit vector `direction`. Tool axis and
    joint range are not checked.

    Raises:
        Unreachable: A point of the line is too far from the arm or too near to the arm.
    """
    waypoints = _solve_waypoints(kinematics, kinematics.compute_tool_pose(q), length, branch, direction)
    # The waypoints may be whole turns away from `q`.
    turns = np.round((q - waypoints[0]) / math.tau)
    return waypoints + wrap_angles(q - waypoints[0]) + math.tau * turns


def _solve_waypoints(
    kinematics: Kinematics, X_WT: Pose, length: float, branch: BranchKey, direction: Sequence[float] = UP
) -> Array:
    """Return continuous waypoints `(WAYPOINT_COUNT, n)` [rad] on a line from `X_WT` along a unit vector."""
    positions = X_WT.position + np.outer(np.linspace(0.0, length, WAYPOINT_COUNT), np.array(direction))
    waypoints = kinematics.solve([Pose(X_WT.rotation, position) for position in positions], branch)
    waypoints[1:] = waypoints[0] + wrap_angles(waypoints[1:] - waypoints[0])
    return waypoints


def _find_turn_direction(kinematics: Kinematics, q: Array) -> float:
    """Return 1.0 if the last joint turns in the direction of the tool about the tool axis, otherwise -1.0."""
    X_WT = kinematics.compute_tool_pose(q)
    X_WT_turned = kinematics.compute_tool_pose(np.append(q[:-1], q[-1] + 0.1))
    return float(np.sign((X_WT.inverse() @ X_WT_turned).rotation[1, 0]))


def _turn_last_joint(
    upper_qs: Array, lower_qs: Array, joint_range: JointRange, yaw: float | None, last_joint_start: float
) -> tuple[Array, Array]:
    """Return pairs `(N, n)` [rad] with the last joint turned from the yaw 0 of the tool to `yaw` [rad].

    The last joint gets the position in its range nearest to `last_joint_start` [rad].
    """
    upper_qs = upper_qs.copy()
    lower_qs = lower_qs.copy()
    change = wrap_angles(upper_qs[:, -1] - lower_qs[:, -1])
    if yaw is not None:
        last = wrap_angles(lower_qs[:, -1] - yaw)
        turned = last + math.tau * np.round((last_joint_start - last) / math.tau)
        is_inside = (joint_range.lower[-1] <= turned) & (turned <= joint_range.upper[-1])
        lower_qs[:, -1] = np.where(is_inside, turned, last)
    else:
        # Both ends of the line must be in the range.
        smallest = joint_range.lower[-1] - np.minimum(change, 0.0)
        largest = joint_range.upper[-1] - np.maximum(change, 0.0)
        lower_qs[:, -1] = np.clip(last_joint_start, smallest, largest)
    upper_qs[:, -1] = lower_qs[:, -1] + change
    return upper_qs, lower_qs


def _make_unreachable_error(
    kinematics: Kinematics, poses: list[Pose], qs_by_pose: Sequence[Array]
) -> Unreachable:
    """Return the error for the first pose whose solutions all exceed the joint range.

    If each pose has a solution, the error states that no branch contains solutions of both poses.
    """
    for pose, qs in zip(poses, qs_by_pose, strict=True):
        x, y, z = pose.position
        if not np.any(kinematics.joint_range.contains(qs)):
            # A solver returns one of the equivalent positions of each joint.
            turned_qs = qs[~np.isnan(qs).any(axis=1)] + math.tau * np.array([-1, 0, 1])[:, None, None]
            excess = kinematics.joint_range.compute_excess(turned_qs).min(axis=0)
            if not len(excess):
                continue  # No branch leads from the other pose to this pose.
            min_excess = excess[np.argmin(np.max(excess, axis=1))]
            joint = int(np.argmax(min_excess))
            return Unreachable(
                f"the tool cannot reach ({x:.3f}, {y:.3f}, {z:.3f}) m: no configuration of the arm keeps "
                f"every joint inside its limits; the best configuration leaves joint {joint + 1} "
                f"{math.degrees(min_excess[joint]):.1f}° outside {kinematics.joint_range.describe(joint)}"
            )
    top = poses[0].position[2]
    return Unreachable(
        f"the tool can reach the heights {top:.3f} and {z:.3f} m above ({x:.3f}, {y:.3f}) m, but not without "
        f"a change of the configuration of the arm in between"
    )


class CartesianLine:
    """A straight motion of the tool; implements `executive.motion.trajectory.MotionPiece`.

    At an end where the tool moves, its speed is the highest from which the tool could stop on the line, or
    to which it can accelerate from rest on the line.

    Args:
        waypoints: Joint positions `(N, n)` [rad] at `N` evenly spaced points of the line; the degree of the
            polynomial is `N` - 1.
        length: Length of the line [m].
        limits: Joint limits.
        max_speed: Maximum speed of the tool [m/s].
        max_acceleration: Maximum acceleration of the tool [m/s²].
        starts_in_motion: True if the tool moves at the start; excludes `ends_in_motion`.
        ends_in_motion: True if the tool moves at the end; excludes `starts_in_motion`.

    Attributes:
        max_acceleration: Maximum acceleration of the tool [m/s²], also limited by the joints.
    """

    def __init__(
        self,
        waypoints: Array,
        length: float,
        limits: JointLimits,
        max_speed: float = math.inf,
        max_acceleration: float = math.inf,
        *,
        starts_in_motion: bool = False,
        ends_in_motion: bool = False,
    ) -> None:
        distances = np.linspace(0.0, length, len(waypoints))
        coefficients = np.linalg.solve(np.vander(distances, increasing=True), waypoints)
        self._coefficients = [coefficients]
        """Coefficients `(N - k, n)` of the `k`-th derivative of the joint path, those of low powers first."""
        for _ in range(3):
            coefficients = coefficients[1:] * np.arange(1, len(coefficients))[:, None]
            self._coefficients.append(coefficients)
        speed, acceleration, jerk = self._compute_tool_limits(limits, max_speed, length)
        self.max_acceleration = acceleration = min(max_acceleration, acceleration)
        end_speed = _find_max_end_speed(length, speed, acceleration, jerk)
        inputs = InputParameter(1)
        inputs.current_position = [0.0]
        inputs.target_position = [length]
        inputs.current_velocity = [end_speed if starts_in_motion else 0.0]
        inputs.target_velocity = [end_speed if ends_in_motion else 0.0]
        inputs.max_velocity = [speed]
        inputs.max_acceleration = [acceleration]
        inputs.max_jerk = [jerk]
        self._profile = Profile(1)
        Ruckig(1).calculate(inputs, self._profile)
        self.duration: float = self._profile.duration

    def state_at(self, time: float) -> JointState:
        """Return the state at `time`."""
        (distance,), (speed,), (acceleration,) = self._profile.at_time(time)
        return self._compute_state(distance, speed, acceleration)

    def sample(self, times: Array) -> JointState:
        """Return the states at `times`."""
        samples = np.array([self._profile.at_time(time) for time in times.tolist()])[:, :, 0].T
        return self._compute_state(samples[0], *samples[1:, :, None])

    def _compute_state(
        self, distance: Array | float, speed: Array | float, acceleration: Array | float
    ) -> JointState:
        """Apply the chain rule in the module docstring."""
        q, q_s, q_ss = (self._compute_derivatives(distance, order) for order in range(3))
        return JointState(q, q_s * speed, q_s * acceleration + q_ss * speed**2)

    def _compute_derivatives(self, distances: Array | float, order: int) -> Array:
        """Return a derivative of the joint path, of order 0 to 3, at `(M,)` distances [m] as `(M, n)`."""
        coefficients = self._coefficients[order]
        return np.asarray(distances)[..., None] ** np.arange(len(coefficients)) @ coefficients

    def _compute_tool_limits(
        self, limits: JointLimits, max_speed: float, length: float
    ) -> tuple[float, float, float]:
        """Return the maximum speed [m/s], acceleration [m/s²] and jerk [m/s³] of the tool on the line.

        The chain rule in the module docstring is solved for `v`, then for `a`, then for `j`.
        """
        distances = _CHECKED_FRACTIONS * length
        derivatives = [self._compute_derivatives(distances, order) for order in (1, 2, 3)]
        q_s, q_ss, q_sss = (np.abs(values).max(axis=0) for values in derivatives)
        max_speeds = (
            MAX_VELOCITY_FRACTION * limits.velocity / (q_s + _MIN_DIVISOR),
            # Speed that the tool reaches with its maximum acceleration on the whole line.
            math.sqrt(2 * length * np.min(limits.acceleration / (q_s + _MIN_DIVISOR))),
            np.sqrt(MAX_CURVATURE_FRACTION * limits.acceleration / (q_ss + _MIN_DIVISOR)),
            np.cbrt(MAX_CURVATURE_FRACTION / 2 * limits.jerk / (q_sss + _MIN_DIVISOR)),
        )
        speed = min(max_speed, *(float(np.min(values)) for values in max_speeds))
        max_accelerations = (
            (limits.acceleration - q_ss * speed**2) / (q_s + _MIN_DIVISOR),
            MAX_CURVATURE_FRACTION / 2 * limits.jerk / (3 * q_ss * speed + _MIN_DIVISOR),
        )
        acceleration = float(np.min(max_accelerations))
        remaining_jerks = limits.jerk - 3 * q_ss * speed * acceleration - q_sss * speed**3
        return speed, acceleration, float(np.min(remaining_jerks / (q_s + _MIN_DIVISOR)))


def compute_stopping_distance(speed: float, acceleration: float, jerk: float) -> float:
    """Return the distance [m] in which a tool stops.

    `speed` [m/s], `acceleration` [m/s²] and `jerk` [m/s³] are its first speed and its limits.
    """
    if speed >= acceleration**2 / jerk:
        stopping_time = speed / acceleration + acceleration / jerk
    else:  # The deceleration does not reach its maximum.
        stopping_time = 2 * math.sqrt(speed / jerk)
    return speed / 2 * stopping_time


def _find_max_end_speed(length: float, max_speed: float, acceleration: float, jerk: float) -> float:
    """Return the largest speed [m/s], up to `max_speed`, from which the tool can stop within `length` [m]."""
    if compute_stopping_distance(max_speed, acceleration, jerk) <= length:
        return max_speed
    lower = 0.0
    upper = max_speed
    for _ in range(40):
        middle = (lower + upper) / 2
        if compute_stopping_distance(middle, acceleration, jerk) <= length:
            lower = middle
        else:
            upper = middle
    return lower


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate for the end of a motion that consists of a free part and an optional straight arrival.

    Attributes:
        min_duration: Minimum duration of the free part [s].
        free_part_end: Joint state at the end of the free part.
        arrival: Straight motion of the tool from `free_part_end`, or None.
        branch: Branch of the inverse kinematics at the end, or None for given joint positions.
    """

    min_duration: float
    free_part_end: JointState
    arrival: CartesianLine | None
    branch: BranchKey | None

    @property
    def arrival_duration(self) -> float:
        """Duration of `arrival` [s]."""
        return self.arrival.duration if self.arrival else 0.0


def find_candidates(
    kinematics: Kinematics, limits: JointLimits, start: JointState, goal: Goal, length: float
) -> Iterator[Candidate]:
    """Yield candidates for motions from `start` to a goal, in the order of their minimum durations.

    The arrival is the last `length` [m] of each motion; 0: no arrival.

    Raises:
        Unreachable: No joint configuration reaches the goal.
    """
    pairs = find_configuration_pairs(kinematics, goal, length, start.q)
    durations = limits.compute_min_time(pairs.upper_qs - start.q)
    previous_qs: list[Array] = []
    for index in np.argsort(durations, kind="stable"):
        goal_q = pairs.lower_qs[index]
        branch = pairs.branches[index]
        if any(np.max(np.abs(goal_q - q)) <= MIN_JOINT_DIFFERENCE for q in previous_qs):
            continue
        previous_qs.append(goal_q)
        arrival = None
        free_part_end = JointState.at_rest(goal_q)
        if length > 0:
            back = [-part for part in goal.direction]
            waypoints = solve_straight_waypoints(kinematics, goal_q, length, branch, back)[::-1]
            arrival = CartesianLine(waypoints, length, limits, goal.guarded_speed, starts_in_motion=True)
            free_part_end = arrival.state_at(0.0)
        yield Candidate(float(durations[index]), free_part_end, arrival, branch)
