"""Search for motions, the best first: direct motions, optimized detours, and motions with corners."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice

import numpy as np

from executive.cell.arm import Goal, Task
from executive.cell.config import CellConfig
from executive.cell.layout import compute_travel_height
from executive.errors import Unreachable
from executive.geometry import Array, tool_down
from executive.motion.arm_model import Configuration, Kinematics
from executive.motion.candidates import Candidate, find_candidates
from executive.motion.cartesian_line import CHAIN_LENGTH, CartesianLine
from executive.motion.clearance_model import ClearanceModel, discs_below_flange
from executive.motion.limits import JointLimits
from executive.motion.optimizer import Optimizer, Problem
from executive.motion.payload import PayloadLimit
from executive.motion.point_to_point import Connector, NoProfile
from executive.motion.postures import find_vertical_line, solve_vertical_line
from executive.motion.state import JointState, Piece
from executive.motion.trajectory import Trajectory, sample_pieces
from executive.motion.transcription import SAMPLE_SHARES

MAX_CANDIDATES = 3
"""Maximum number of candidates for the end of a motion."""
FIRST_STEPS, FURTHER_STEPS = 4, 8
"""Optimization steps for the detour to each candidate, and for each detour before it is checked."""
EXTRA_HEIGHTS = (0.0, 0.05, 0.10)
"""Heights above the travel height of a motion with corners, in the order of the attempts [m]."""
LIFT_OFF_DISTANCE = 5e-4
"""Length of the straight motion upwards that separates a load from the surface below [m]."""
MIN_COSINE_DOWN = 0.99
"""Minimum cosine between the tool axis and straight down for a motion that first rises."""


class Search:
    """Search for the motion of one query.

    Args:
        config: Content of the cell file.
        kinematics: Kinematics of the arm.
        limits: Joint limits of the arm.
        start: Joint positions at the start `(n,)` [rad].
        end: A goal, or joint positions at the end `(n,)` [rad].
        task: Load and obstacles; `around` includes the target.
    """

    def __init__(
        self,
        config: CellConfig,
        kinematics: Kinematics,
        limits: JointLimits,
        start: Array,
        end: Goal | Array,
        task: Task,
    ) -> None:
        self._kinematics = kinematics
        self._limits = limits
        self._connector = Connector(limits)
        self._travel_height = compute_travel_height(config)
        self._end = end
        self._straight = config.motion.straight
        self._discs = discs_below_flange(config, task.load)
        if not isinstance(end, Goal) and task.load is None:
            # The arm must be able to return to a named pose from any posture.
            self._discs = self._discs._replace(min_cosine=-1.0)
        self._payload = PayloadLimit(task.load, kinematics) if task.load else None
        tips, axes = map(np.concatenate, zip(kinematics.tips(start[None]), self._free_end(), strict=True))
        self._clearance = ClearanceModel(config, task.around, tips[:, :2])
        self._clearance.relax(tips, axes, self._discs)
        self._rises: dict[tuple[float, bool], tuple[list[Piece], JointState]] = {}
        self._departure = self._plan_departure(start, float(tips[0, 2]))
        self._start = (
            self._departure.at(self._departure.duration) if self._departure else JointState.rest(start)
        )

    def list_motions(self) -> Iterator[Trajectory]:
        """Yield motions, the best first: direct and optimized ones, then those that stop at corners."""
        candidates = list(islice(self._list_candidates(), MAX_CANDIDATES))
        yield from self._list_direct_and_optimized(candidates)
        for extra_height in EXTRA_HEIGHTS:
            for candidate in candidates:
                with contextlib.suppress(Unreachable, NoProfile):
                    corners = self._connect_with_corners(candidate, extra_height, is_straight=True)
                    yield self._build_motion(candidate, *corners)

    def require_clear(self, qs: Array) -> None:
        """Raise an error if a state `(N, n)` [rad] is too near to known or undetected objects.

        Raises:
            Blocked: A state is too near to an object.
        """
        self._clearance.require_clear(*self._kinematics.tips(qs), self._discs)

    def _free_end(self) -> tuple[Array, Array]:
        """Return tool centre point [m] and tool axis, `(1, 3)` each, at the end of the free part."""
        if not isinstance(self._end, Goal):
            return self._kinematics.tips(self._end[None])
        x, y, z = self._end.position
        return np.array([[x, y, z + self._end.guarded]]), np.array([[0.0, 0.0, -1.0]])

    def _list_candidates(self) -> Iterator[Candidate]:
        if not isinstance(self._end, Goal):
            yield Candidate(0.0, JointState.rest(self._end), None, None)
            return
        length = self._end.guarded or self._straight
        yield from find_candidates(self._kinematics, self._limits, self._start, self._end, length)

    def _list_direct_and_optimized(self, candidates: Sequence[Candidate]) -> Iterator[Trajectory]:
        """Yield direct motions without collision, and optimized detours."""
        direct, optimizers = self._evaluate(candidates)
        for candidate, optimizer in optimizers:
            optimizer.improve(FURTHER_STEPS)
            while direct and direct[0][0] <= _total_cost(candidate, optimizer):
                yield direct.pop(0)[1]
            yield from self._sort_optimized(candidate, optimizer)
        yield from (motion for _, motion in direct)

    def _sort_optimized(self, candidate: Candidate, optimizer: Optimizer) -> Iterable[Trajectory]:
        """Return the motions on an optimized course; with a load, the fastest with a safe seal first."""
        motions, payload = self._list_optimized(candidate, optimizer), self._payload
        if payload is None:
            return motions
        return sorted(motions, key=lambda motion: payload.slow_down(motion).duration)

    def _list_optimized(self, candidate: Candidate, optimizer: Optimizer) -> Iterator[Trajectory]:
        for exactly in (False, True):
            with contextlib.suppress(NoProfile):
                yield self._build_motion(candidate, *optimizer.connect_states(exactly))

    def _evaluate(
        self, candidates: Sequence[Candidate]
    ) -> tuple[list[tuple[float, Trajectory]], list[tuple[Candidate, Optimizer]]]:
        """Return the direct motions without collision, and the optimizers of detours to other candidates.

        Both lists begin with the fastest motion. A direct motion is in a pair with its duration [s].
        """
        direct: list[tuple[float, Trajectory]] = []
        optimizers: list[tuple[Candidate, Optimizer]] = []
        for candidate in candidates:
            costs = [duration for duration, _ in direct] + [_total_cost(*pair) for pair in optimizers]
            if min(costs, default=math.inf) <= candidate.min_duration + candidate.arrival_duration:
                break
            problem = Problem(
                self._start, candidate.entry, self._connector, self._kinematics, self._clearance,
                self._discs, self._payload,
            )  # fmt: skip
            with contextlib.suppress(NoProfile, Unreachable):
                free = self._connector.connect(self._start, candidate.entry)
                if problem.slack(free.over(SAMPLE_SHARES * free.duration).q).min() >= 0:
                    motion = self._build_motion(candidate, free)
                    direct.append((free.duration + candidate.arrival_duration, motion))
                    continue
                corners = self._connect_with_corners(candidate, EXTRA_HEIGHTS[0], is_straight=False)
                duration = sum(piece.duration for piece in corners)
                optimizer = Optimizer(problem, sample_pieces(corners, SAMPLE_SHARES * duration).q, duration)
                optimizer.improve(FIRST_STEPS)
                optimizers.append((candidate, optimizer))
        direct.sort(key=lambda pair: pair[0])
        optimizers.sort(key=lambda pair: _total_cost(*pair))
        return direct, optimizers

    def _build_motion(self, candidate: Candidate, *free: Piece) -> Trajectory:
        """Return the motion of a straight departure, the free part, and a straight arrival."""
        pieces = (self._departure, *free) if self._departure else free
        guarded = math.inf
        if isinstance(self._end, Goal) and self._end.guarded > 0:
            guarded = sum(piece.duration for piece in pieces)
        return Trajectory((*pieces, candidate.arrival) if candidate.arrival else pieces, guarded)

    def _connect_with_corners(
        self, candidate: Candidate, extra_height: float, *, is_straight: bool
    ) -> list[Piece]:
        """Return a free part that stops above the start and above the goal.

        Args:
            candidate: The end of the motion.
            extra_height: Height of the corners above the travel height [m].
            is_straight: True for vertical motions of the tool if possible, which need more computation.

        Raises:
            Unreachable: A corner is out of reach in the configuration of the candidate.
            NoProfile: No motion connects two of the states.
        """
        connect, height = self._connector.connect, self._travel_height + extra_height
        if (height, is_straight) not in self._rises:
            self._rises[height, is_straight] = self._plan_rise(height, is_straight)
        rise, corner = self._rises[height, is_straight]
        (x, y, z), _ = self._find_tip(candidate.entry.q)
        if candidate.configuration is None or z >= height:
            return [*rise, connect(corner, candidate.entry)]
        if is_straight and candidate.arrival is None:
            chain = solve_vertical_line(
                self._kinematics, candidate.entry.q, height - z, CHAIN_LENGTH, candidate.configuration
            )
            line = CartesianLine(chain[::-1], height - z, self._limits)
            return [*rise, connect(corner, JointState.rest(chain[-1])), line]
        above = self._solve_corner((x, y, height), candidate.configuration, candidate.entry.q)
        return [*rise, connect(corner, above), connect(above, candidate.entry)]

    def _plan_rise(self, height: float, is_straight: bool) -> tuple[list[Piece], JointState]:
        """Return the motion from the start up to a height [m], and the state at its end."""
        q, ((x, y, z), points_down) = self._start.q, self._find_tip(self._start.q)
        if not points_down or z >= height:
            return [], self._start
        if is_straight and self._departure is None:
            chain = find_vertical_line(self._kinematics, q, height - z, CHAIN_LENGTH)
            if chain is not None:
                return [CartesianLine(chain, height - z, self._limits)], JointState.rest(chain[-1])
        above = self._solve_corner((x, y, height), self._kinematics.configuration(q), q)
        return [self._connector.connect(self._start, above)], above

    def _find_tip(self, q: Array) -> tuple[Array, bool]:
        """Return the tool centre point `(3,)` [m], and True if the tool points down."""
        tips, axes = self._kinematics.tips(q[None])
        return tips[0], bool(-axes[0, 2] > MIN_COSINE_DOWN)

    def _solve_corner(
        self, position: tuple[float, float, float], configuration: Configuration, q_near: Array
    ) -> JointState:
        """Return the state of rest at a position [m], with the last joint as in `q_near` `(n,)` [rad]."""
        q = self._kinematics.solve(tool_down(position), configuration)
        q[-1] = q_near[-1]
        return JointState.rest(q)

    def _plan_departure(self, start: Array, height: float) -> CartesianLine | None:
        """Return the straight motion upwards from the start, or None.

        The cell file may require a straight departure. A load also departs straight if the seal limits the
        acceleration: a load that is pressed on the surface below, or dragged over the surface, tears off.
        """
        length = self._straight or (LIFT_OFF_DISTANCE if self._payload else 0.0)
        if not length or height + length > self._travel_height:
            return None
        chain = find_vertical_line(self._kinematics, start, length, CHAIN_LENGTH)
        if chain is None:
            return None
        max_lift = self._payload.lift if self._payload else math.inf
        line = CartesianLine(chain, length, self._limits, acceleration=max_lift, ends_in_motion=True)
        return line if self._straight or line.acceleration >= max_lift else None


def _total_cost(candidate: Candidate, optimizer: Optimizer) -> float:
    """Return the cost of a detour and its arrival [s]."""
    return optimizer.cost + candidate.arrival_duration
