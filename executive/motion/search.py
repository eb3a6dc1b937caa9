"""Search for motions, the best first: direct motions, optimized detours, motions that stop at via points."""

from __future__ import annotations

import contextlib
import functools
import math
from collections.abc import Iterator, Sequence
from itertools import islice
from operator import itemgetter

import numpy as np

from executive.cell.arm import Goal, JointState, Task
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.errors import Unreachable
from executive.geometry import Array, make_tool_down_pose
from executive.motion.clearance_model import ClearanceModel, make_tool_discs
from executive.motion.configurations import (
    Candidate,
    CartesianLine,
    find_candidates,
    find_vertical_waypoints,
    solve_straight_waypoints,
)
from executive.motion.joints import BranchKey, JointLimits, Kinematics
from executive.motion.optimizer import MotionProblem, Optimizer, PayloadLimit
from executive.motion.trajectory import Connector, JointLimitError, MotionPiece, Trajectory, sample_pieces
from executive.motion.transcription import SAMPLE_FRACTIONS

MAX_CANDIDATES = 4
"""Maximum number of candidates for the end of a motion."""
COMPARED_CANDIDATES = 2
"""Number of candidates in a group: their motions are compared; if all are blocked, the next group follows."""
INITIAL_STEP_COUNT = 4
"""Number of optimization steps for the detour to each candidate."""
REFINEMENT_STEP_COUNT = 8
"""Number of further optimization steps for a detour before it is returned."""
EXTRA_HEIGHTS = (0.0, 0.05, 0.10)
"""Heights of the via points above the travel height, in the order of the attempts [m]."""
MAX_DURATION_FACTOR = 1.1
"""A motion is yielded if its duration is at most this multiple of the cost of the next detour. Else the next
detour is refined first, because it may be faster."""
LIFT_OFF_DISTANCE = 5e-4
"""Length of the straight motion upwards that separates a load from the surface below [m]."""
MIN_RISE_COSINE = 0.99
"""Minimum cosine between the tool axis and straight down for a motion that begins with a rise."""


class MotionSearch:
    """Search for a motion between two joint configurations, or from a joint configuration to a goal.

    A motion consists of an optional straight departure upwards, a free part (joint motion), and an optional
    straight approach downwards.

    Args:
        config: Content of the cell file.
        kinematics: Kinematics of the arm.
        start: Joint positions at the start `(n,)` [rad].
        end: A goal, or joint positions at the end `(n,)` [rad].
        task: Load and obstacles of the free part; `task.obstacles` includes the target.

    Attributes:
        problem: Start and constraints of the free part.
    """

    def __init__(
        self, config: CellConfig, kinematics: Kinematics, start: Array, end: Goal | Array, task: Task
    ) -> None:
        self._kinematics = kinematics
        self._limits = JointLimits.from_config(config.arm.limits)
        self._travel_height = config.travel_height
        self._end = end
        self._straight_part_length = config.motion.straight
        discs = make_tool_discs(config, task.load, task.opening)
        start_tcp_and_axis = kinematics.compute_tcps_and_axes(start[None])
        if isinstance(end, Goal):
            line_start = end.compute_line_start(end.slow_length)
            end_tcp_and_axis = (np.array([line_start]), np.array([[0.0, 0.0, -1.0]]))
        else:
            end_tcp_and_axis = kinematics.compute_tcps_and_axes(end[None])
            if task.load is None:
                # A motion to joint positions, i.e. to a named pose, must be possible from any configuration.
                discs = discs._replace(min_cosine=-1.0)
        tcps, axes = map(np.concatenate, zip(start_tcp_and_axis, end_tcp_and_axis, strict=True))
        clearance = ClearanceModel(config, task.obstacles, tcps[:, :2], discs)
        clearance.relax_end_margins(tcps, axes)
        payload = None
        if task.load is not None:
            payload = PayloadLimit(task.load, task.holding_force, config.tool, kinematics)
        # Upper layers in a bin are higher than its walls, and open fingers leave them straight, too.
        has_fingers_in_bin = task.opening > 0 and any(
            bin.contains(tcps[0]) for bin in config.build_bins().values()
        )
        max_height = math.inf if has_fingers_in_bin else self._travel_height
        self._departure = departure = self._plan_departure(start, max_height - float(tcps[0, 2]), payload)
        free_start = departure.state_at(departure.duration) if departure else JointState.at_rest(start)
        self.problem = MotionProblem(free_start, Connector(self._limits), kinematics, clearance, payload)
        # The motion up to a via point is the same for all candidates, and is planned once per height.
        self._get_rise = functools.cache(self._plan_rise)

    def plan_motions(self) -> Iterator[Trajectory]:
        """Plan and yield motions, the best first; motions that stop at via points are last."""
        if isinstance(self._end, Goal):
            length = self._end.slow_length or self._straight_part_length
            start = self.problem.start
            all_candidates = find_candidates(self._kinematics, self._limits, start, self._end, length)
        else:
            all_candidates = iter([Candidate(0.0, JointState.at_rest(self._end), None, None)])
        remaining_candidates = islice(all_candidates, MAX_CANDIDATES)
        candidates: list[Candidate] = []
        while group := list(islice(remaining_candidates, COMPARED_CANDIDATES)):
            yield from self._plan_direct_motions_and_detours(group)
            candidates += group
        for extra_height in EXTRA_HEIGHTS:
            for candidate in candidates:
                with contextlib.suppress(Unreachable, JointLimitError):
                    free_part = self._connect_by_via_points(candidate, extra_height, prefers_lines=True)
                    yield self._build_motion(candidate, *free_part)

    def _plan_direct_motions_and_detours(self, candidates: Sequence[Candidate]) -> Iterator[Trajectory]:
        """Plan and yield refined detours and collision-free direct motions, the fastest first."""
        motions, optimizers = self._evaluate_candidates(candidates)
        next_costs = [*map(self._compute_total_cost, optimizers), math.inf][1:]
        deferred_optimizers: list[Optimizer] = []
        for optimizer, next_cost in zip(optimizers, next_costs, strict=True):
            optimizer.improve(REFINEMENT_STEP_COUNT)
            cost = self._compute_total_cost(optimizer)
            while motions and motions[0][0] <= cost:
                yield motions.pop(0)[1]
            detours = list(self._build_detour(optimizer, keeps_timing=False))
            if not detours or detours[0][0] > cost:
                detours += self._build_detour(optimizer, keeps_timing=True)
            else:
                deferred_optimizers.append(optimizer)
            motions = sorted([*motions, *detours], key=itemgetter(0))
            # A detour may take longer than estimated by its optimizer; then the next detour is refined first.
            while motions and motions[0][0] <= MAX_DURATION_FACTOR * next_cost:
                yield motions.pop(0)[1]
        yield from (motion for _, motion in motions)
        for optimizer in deferred_optimizers:
            yield from (motion for _, motion in self._build_detour(optimizer, keeps_timing=True))

    def _evaluate_candidates(
        self, candidates: Sequence[Candidate]
    ) -> tuple[list[tuple[float, Trajectory]], list[Optimizer]]:
        """Return pairs `(duration [s], direct motion)` without collision, and optimizers for the others.

        Both lists begin with the fastest motion.
        """
        direct_motions: list[tuple[float, Trajectory]] = []
        optimizers: list[Optimizer] = []
        for candidate in candidates:
            costs = [duration for duration, _ in direct_motions]
            costs += map(self._compute_total_cost, optimizers)
            min_duration = self._compute_straight_duration(candidate) + candidate.min_duration
            if min(costs, default=math.inf) <= min_duration:
                break
            with contextlib.suppress(JointLimitError, Unreachable):
                free_part = self.problem.connector.connect(self.problem.start, candidate.free_part_end)
                qs = free_part.sample(SAMPLE_FRACTIONS * free_part.duration).q
                if self.problem.find_nearest_pairs(qs, math.inf).slack.min() >= 0:
                    motion = self._build_motion(candidate, free_part)
                    direct_motions.append((motion.duration, motion))
                    continue
                initial_guess = self._connect_by_via_points(candidate, EXTRA_HEIGHTS[0], prefers_lines=False)
                duration = sum(piece.duration for piece in initial_guess)
                qs = sample_pieces(initial_guess, SAMPLE_FRACTIONS * duration).q
                optimizer = Optimizer(self.problem, candidate, qs, duration)
                optimizer.improve(INITIAL_STEP_COUNT)
                optimizers.append(optimizer)
        direct_motions.sort(key=itemgetter(0))
        optimizers.sort(key=self._compute_total_cost)
        return direct_motions, optimizers

    def _build_detour(
        self, optimizer: Optimizer, *, keeps_timing: bool
    ) -> Iterator[tuple[float, Trajectory]]:
        """Yield a detour as a pair `(duration [s], motion)`, unless it exceeds a joint limit.

        The detour connects the states of the best motion of the optimizer: at the times of this motion if
        `keeps_timing` is True, in minimum time if `keeps_timing` is False. The returned duration is that of
        the motion after its slowdown for the load; the returned motion is not slowed down yet.
        """
        with contextlib.suppress(JointLimitError):
            free_part = optimizer.connect_states(keeps_timing=keeps_timing)
            motion = self._build_motion(optimizer.candidate, *free_part)
            payload = self.problem.payload
            yield (payload.make_safe_motion(motion) if payload else motion).duration, motion

    def _compute_total_cost(self, optimizer: Optimizer) -> float:
        """Return the cost of a detour plus the duration of departure and arrival [s]."""
        return optimizer.cost + self._compute_straight_duration(optimizer.candidate)

    def _compute_straight_duration(self, candidate: Candidate) -> float:
        """Return the duration of departure and arrival [s]."""
        return (self._departure.duration if self._departure else 0.0) + candidate.arrival_duration

    def _build_motion(self, candidate: Candidate, *free_part: MotionPiece) -> Trajectory:
        """Return the motion of departure, free part and arrival, with the start time of the guarded part."""
        motion = Trajectory([piece for piece in (self._departure, *free_part, candidate.arrival) if piece])
        if not isinstance(self._end, Goal) or self._end.guarded_length == 0:
            return motion
        if self._end.fast_length:
            tcps, _ = self._kinematics.compute_tcps_and_axes(motion.samples.q)
            is_above = tcps[:, 2] > self._end.position[2] + self._end.guarded_length
            motion.guarded_start_time = STEP * float(np.flatnonzero(is_above).max(initial=0))
        else:
            motion.guarded_start_time = motion.duration - candidate.arrival_duration
        return motion

    def _connect_by_via_points(
        self, candidate: Candidate, extra_height: float, *, prefers_lines: bool
    ) -> list[MotionPiece]:
        """Return a free part that stops at two via points, above the start and above the goal.

        Args:
            candidate: The end of the motion.
            extra_height: Height of the via points above the travel height [m].
            prefers_lines: True if the tool rises and descends on vertical lines where this is possible.

        Raises:
            Unreachable: A via point is out of reach in the branch of the candidate.
            JointLimitError: No motion connects two of the states.
        """
        height = self._travel_height + extra_height
        end = candidate.free_part_end
        connect = self.problem.connector.connect
        rise, start_via_point = self._get_rise(height, prefers_lines)
        (x, y, z), _ = self._locate_tool(end.q)
        if candidate.branch is None or z >= height:
            return [*rise, connect(start_via_point, end)]
        if prefers_lines and candidate.arrival is None:
            waypoints = solve_straight_waypoints(self._kinematics, end.q, height - z, candidate.branch)
            descent = CartesianLine(waypoints[::-1], height - z, self._limits)
            return [*rise, connect(start_via_point, JointState.at_rest(waypoints[-1])), descent]
        goal_via_point = self._solve_via_point((x, y, height), candidate.branch, end.q)
        return [*rise, connect(start_via_point, goal_via_point), connect(goal_via_point, end)]

    def _plan_rise(self, height: float, prefers_lines: bool) -> tuple[list[MotionPiece], JointState]:
        """Return the motion from the start up to a via point at a height [m], and the state there.

        If the tool starts above `height` or does not point down, the via point is the start itself.
        """
        q = self.problem.start.q
        (x, y, z), is_pointing_down = self._locate_tool(q)
        if not is_pointing_down or z >= height:
            return [], self.problem.start
        if prefers_lines and self._departure is None:
            waypoints = find_vertical_waypoints(self._kinematics, q, height - z)
            if waypoints is not None:
                line = CartesianLine(waypoints, height - z, self._limits)
                return [line], JointState.at_rest(waypoints[-1])
        via_point = self._solve_via_point((x, y, height), self._kinematics.find_branch(q), q)
        return [self.problem.connector.connect(self.problem.start, via_point)], via_point

    def _locate_tool(self, q: Array) -> tuple[Array, bool]:
        """Return the tool centre point `(3,)` [m] at `q` `(n,)` [rad], and True if the tool points down."""
        tcps, axes = self._kinematics.compute_tcps_and_axes(q[None])
        return tcps[0], bool(-axes[0, 2] > MIN_RISE_COSINE)

    def _solve_via_point(
        self, position: tuple[float, float, float], branch: BranchKey, q_seed: Array
    ) -> JointState:
        """Return the state of rest at a via point [m], with the last joint as in `q_seed` `(n,)` [rad]."""
        (q,) = self._kinematics.solve([make_tool_down_pose(position)], branch)
        q[-1] = q_seed[-1]
        return JointState.at_rest(q)

    def _plan_departure(
        self, start: Array, max_length: float, payload: PayloadLimit | None
    ) -> CartesianLine | None:
        """Return the straight motion upwards from the start, or None if the free part begins at the start.

        The cell file may require a straight departure. If the grip of a load permits less acceleration than
        the joints, the load also departs straight, because contact with the support could break the grip.
        There is none if it would be longer than `max_length` [m].
        """
        length = self._straight_part_length or (LIFT_OFF_DISTANCE if payload else 0.0)
        if not length or length > max_length:
            return None
        waypoints = find_vertical_waypoints(self._kinematics, start, length)
        if waypoints is None:
            return None
        acceleration = payload.max_lift_acceleration if payload else math.inf
        line = CartesianLine(
            waypoints, length, self._limits, max_acceleration=acceleration, ends_in_motion=True
        )
        return line if self._straight_part_length or line.max_acceleration >= acceleration else None
