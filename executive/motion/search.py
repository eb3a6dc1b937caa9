"""The motions worth checking, best first: direct, over what is in between, or corner by corner."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice

import numpy as np

from executive.cell.arm import Goal, Task
from executive.cell.config import CellConfig
from executive.cell.layout import travel_height
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
"""Ends of a motion that are tried."""
FIRST_STEPS, FURTHER_STEPS = 4, 8
"""Steps by which the detour to each of them is improved, and one after that before it is flown."""
EXTRA_HEIGHTS = (0.0, 0.05, 0.10)
"""Heights above travel height at which a motion that stops at every corner is tried [m]."""
LIFT_OFF_DISTANCE = 5e-4
"""Way straight up by which a load comes loose from what it lies on [m]."""
MIN_COSINE_DOWN = 0.99
"""Least cosine between the tool's axis and straight down at which a motion may rise before it goes across."""


class Search:
    """One question to the planner: what is known for all ways, and the ways.

    Args:
        config: The cell file.
        kinematics: The arm's.
        limits: Its joints'.
        start: Where it rests `(n,)` [rad].
        end: Where it goes: a goal, or joint positions `(n,)` [rad].
        task: What it has to heed; what is to be touched in the end is in `around`.
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
        self._height = travel_height(config)
        self._end = end
        self._straight = config.motion.straight
        self._discs = discs_below_flange(config, task.load)
        if not isinstance(end, Goal) and task.load is None:
            self._discs = self._discs._replace(upright=-1.0)  # from any posture the arm must find home
        self._payload = PayloadLimit(task.load, kinematics) if task.load else None
        tips, axes = map(np.concatenate, zip(kinematics.tips(start[None]), self._arrival(), strict=True))
        self._clearance = ClearanceModel(config, task.around, tips[:, :2])
        self._clearance.relax(tips, axes, self._discs)
        self._rises: dict[tuple[float, bool], tuple[list[Piece], JointState]] = {}
        self._departure = self._depart(start, float(tips[0, 2]))
        self._start = (
            self._departure.at(self._departure.duration) if self._departure else JointState.rest(start)
        )

    def candidates(self) -> Iterator[Trajectory]:
        """Yield motions, best first: direct ones and detours, then such as stop at every corner."""
        candidates = list(islice(self._list_ends(), MAX_CANDIDATES))
        yield from self._list_direct_and_optimized(candidates)
        for lift in EXTRA_HEIGHTS:
            for candidate in candidates:
                with contextlib.suppress(Unreachable, NoProfile):
                    yield self._motion(candidate, *self._corners(candidate, lift, straight=True))

    def require_clear(self, qs: Array) -> None:
        """Make sure that states `(N, n)` [rad] keep away from things, and from where things may be.

        Raises:
            Blocked: One does not.
        """
        self._clearance.require_clear(*self._kinematics.tips(qs), self._discs)

    def _arrival(self) -> tuple[Array, Array]:
        """Return the tool centre point and the tool's axis, `(1, 3)` each, where the free part ends [m]."""
        if not isinstance(self._end, Goal):
            return self._kinematics.tips(self._end[None])
        x, y, z = self._end.position
        return np.array([[x, y, z + self._end.guarded]]), np.array([[0.0, 0.0, -1.0]])

    def _list_ends(self) -> Iterator[Candidate]:
        if not isinstance(self._end, Goal):
            yield Candidate(0.0, JointState.rest(self._end), None, None)
            return
        length = self._end.guarded or self._straight
        yield from find_candidates(self._kinematics, self._limits, self._start, self._end, length)

    def _list_direct_and_optimized(self, candidates: Sequence[Candidate]) -> Iterator[Trajectory]:
        """Yield direct motions where they are clear, and detours over what is in between elsewhere."""
        direct, optimizers = self._divide(candidates)
        for candidate, optimizer in optimizers:
            optimizer.improve(FURTHER_STEPS)
            while direct and direct[0][0] <= optimizer.cost + candidate.tail:
                yield direct.pop(0)[1]
            yield from self._sort_flights(candidate, optimizer)
        yield from (motion for _, motion in direct)

    def _sort_flights(self, candidate: Candidate, optimizer: Optimizer) -> Iterable[Trajectory]:
        """Return the motions over a detour, first the one that takes less time, as gently as a seal asks."""
        flights, payload = self._list_flights(candidate, optimizer), self._payload
        if payload is None:
            return flights
        return sorted(flights, key=lambda flight: payload.gentle(flight).duration)

    def _list_flights(self, candidate: Candidate, optimizer: Optimizer) -> Iterator[Trajectory]:
        for exactly in (False, True):
            with contextlib.suppress(NoProfile):
                yield self._motion(candidate, *optimizer.fly(exactly))

    def _divide(
        self, candidates: Sequence[Candidate]
    ) -> tuple[list[tuple[float, Trajectory]], list[tuple[Candidate, Optimizer]]]:
        """Return the direct motions that are clear, with their times [s], and detours a few steps on.

        Both begin with the fastest.
        """
        direct: list[tuple[float, Trajectory]] = []
        optimizers: list[tuple[Candidate, Optimizer]] = []
        for candidate in candidates:
            least = [time for time, _ in direct] + [d.cost + w.tail for w, d in optimizers]
            if min(least, default=math.inf) <= candidate.estimate + candidate.tail:
                break
            problem = Problem(
                self._start, candidate.entry, self._connector, self._kinematics, self._clearance,
                self._discs, self._payload,
            )  # fmt: skip
            with contextlib.suppress(NoProfile, Unreachable):
                free = self._connector.connect(self._start, candidate.entry)
                if problem.slack(free.over(SAMPLE_SHARES * free.duration).q).min() >= 0:
                    direct.append((free.duration + candidate.tail, self._motion(candidate, free)))
                    continue
                corners = self._corners(candidate, EXTRA_HEIGHTS[0], straight=False)
                duration = sum(piece.duration for piece in corners)
                optimizer = Optimizer(problem, sample_pieces(corners, SAMPLE_SHARES * duration).q, duration)
                optimizer.improve(FIRST_STEPS)
                optimizers.append((candidate, optimizer))
        direct.sort(key=lambda pair: pair[0])
        optimizers.sort(key=lambda pair: pair[1].cost + pair[0].tail)
        return direct, optimizers

    def _motion(self, candidate: Candidate, *free: Piece) -> Trajectory:
        """Return a motion whose free part is `free`, the straight ends put to it."""
        pieces = (self._departure, *free) if self._departure else free
        guarded = math.inf
        if isinstance(self._end, Goal) and self._end.guarded > 0:
            guarded = sum(piece.duration for piece in pieces)
        return Trajectory((*pieces, candidate.arrival) if candidate.arrival else pieces, guarded)

    def _corners(self, candidate: Candidate, lift: float, *, straight: bool) -> list[Piece]:
        """Return motions that stop above their start and above their goal: slow, and clear if any are.

        `straight`: they go straight up and down, as far as they can, which takes more work to find.

        Raises:
            Unreachable: The tool does not get so high in its posture.
            NoProfile: It cannot be flown.
        """
        connect, high = self._connector.connect, self._height + lift
        if (high, straight) not in self._rises:
            self._rises[high, straight] = self._rise(high, straight)
        up, here = self._rises[high, straight]
        (x, y, z), _ = self._tip(candidate.entry.q)
        if candidate.configuration is None or z >= high:
            return [*up, connect(here, candidate.entry)]
        if straight and candidate.arrival is None:
            chain = solve_vertical_line(
                self._kinematics, candidate.entry.q, high - z, CHAIN_LENGTH, candidate.configuration
            )
            line = CartesianLine(chain[::-1], high - z, self._limits)
            return [*up, connect(here, JointState.rest(chain[-1])), line]
        above = self._above((x, y, high), candidate.configuration, candidate.entry.q)
        return [*up, connect(here, above), connect(above, candidate.entry)]

    def _rise(self, high: float, straight: bool) -> tuple[list[Piece], JointState]:
        """Return the way up from the start, and the state of rest in which it ends."""
        q, ((x, y, z), upright) = self._start.q, self._tip(self._start.q)
        if not upright or z >= high:
            return [], self._start
        if straight and self._departure is None:
            chain = find_vertical_line(self._kinematics, q, high - z, CHAIN_LENGTH)
            if chain is not None:
                return [CartesianLine(chain, high - z, self._limits)], JointState.rest(chain[-1])
        above = self._above((x, y, high), self._kinematics.configuration(q), q)
        return [self._connector.connect(self._start, above)], above

    def _tip(self, q: Array) -> tuple[Array, bool]:
        tips, axes = self._kinematics.tips(q[None])
        return tips[0], bool(-axes[0, 2] > MIN_COSINE_DOWN)

    def _above(
        self, place: tuple[float, float, float], configuration: Configuration, near: Array
    ) -> JointState:
        """Return the state of rest at a place, with the last joint as at `near` `(n,)` [rad]."""
        q = self._kinematics.solve(tool_down(place), configuration)
        q[-1] = near[-1]
        return JointState.rest(q)

    def _depart(self, start: Array, height: float) -> CartesianLine | None:
        """Return the straight way up with which a motion begins, or None.

        The cell may ask for one. A load goes straight up, too, where its seal and not the arm limits how fast
        it is lifted: pressed on what it lies on or dragged over it, by micrometres only, it would tear off.
        """
        length = self._straight or (LIFT_OFF_DISTANCE if self._payload else 0.0)
        if not length or height + length > self._height:
            return None
        chain = find_vertical_line(self._kinematics, start, length, CHAIN_LENGTH)
        if chain is None:
            return None
        borne = self._payload.lift if self._payload else math.inf
        line = CartesianLine(chain, length, self._limits, acceleration=borne, leaves=True)
        return line if self._straight or line.acceleration >= borne else None
