"""Choosing, among everything the arm could do, the fastest motion through the vias that is free.

With the tool pointing down the arm still has choices at every via: eight branches, the elbow's swivel
and, for a round cup, the tool's yaw. The planner searches them for the shortest time by dynamic
programming, then checks the motion and falls back on the next best where one is blocked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from executive.cell import Via
from executive.errors import Blocked, Fault
from executive.geometry import Array
from executive.messages import ObjectClass
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits
from executive.motion.postures import find_postures
from executive.motion.strokes import strokes
from executive.motion.timing import rest_to_rest
from executive.motion.trajectory import Trajectory

Clearance = Callable[[Array, "ObjectClass | None"], None]
"""Takes joint positions along a path `(N, 7)` [rad] and what is carried; raises Blocked."""

SPACING = math.radians(1.0)
"""Largest joint move between the states whose clearance is checked [rad]."""
UNLIKE = 0.25
"""Joint difference from which two joint paths are worth checking both [rad]."""
WIDTH = 60
"""Best partial joint paths that are kept from stroke to stroke."""
SAG, SAG_LOADED = 0.05, 0.01
"""How far the tool may sink between two waypoints below the lower of them, empty and with a load [m]."""
ATTEMPTS = 16
"""Joint paths that are checked before a motion counts as blocked."""


class Planner:
    """Plans motions of an arm; the same question always gets the same answer."""

    def __init__(
        self, kinematics: Kinematics, limits: JointLimits, clearance: Clearance | None = None
    ) -> None:
        self.kinematics = kinematics
        self.limits = limits
        self._clearance = clearance

    def plan(
        self, q_start: ArrayLike, vias: Sequence[Via], carrying: ObjectClass | None = None
    ) -> Trajectory:
        """Return the fastest free motion from rest at `q_start` `(7,)` [rad] through every via.

        Raises:
            Unreachable: A via has no joint solution inside the limits.
            Blocked: Every joint path tried comes too close to something; the text is the fastest one's.
        """
        if not vias:
            raise Fault("a motion was asked for without any via to go through")
        speeds = [via.speed for via in vias]
        return self._first_free(self._joint_paths(np.asarray(q_start, dtype=float), vias), speeds, carrying)

    def plan_joints(
        self,
        q_start: ArrayLike,
        q_goal: ArrayLike,
        carrying: ObjectClass | None = None,
        first: Sequence[Via] = (),
    ) -> Trajectory:
        """Return the motion from rest at `q_start` through the vias `first` and straight to `q_goal`.

        Both are joint positions `(7,)` [rad].

        Raises:
            Unreachable: A via has no joint solution inside the limits, or the goal is outside them.
            Blocked: It comes too close to something.
        """
        start, goal = np.asarray(q_start, dtype=float), np.asarray(q_goal, dtype=float)
        paths = self._joint_paths(start, first)
        speeds = [*(via.speed for via in first), None]
        return self._first_free((np.concatenate([path, goal[None]]) for path in paths), speeds, carrying)

    def require_reachable(self, vias: Sequence[Via]) -> None:
        """Make sure that the vias can be reached from somewhere, whatever is in the way.

        Raises:
            Unreachable: One cannot; the text says how far off it is.
        """
        for stroke in strokes(vias):
            find_postures(self.kinematics, stroke, np.zeros(7))

    def _first_free(
        self, paths: Iterator[Array], speeds: Sequence[float | None], carrying: ObjectClass | None
    ) -> Trajectory:
        blocked: list[Blocked] = []
        for path in paths:
            trajectory = Trajectory(path, self.limits, self._rates(path, speeds))
            trajectory.check(self.limits)
            try:
                self._require_level(path, SAG if carrying is None else SAG_LOADED)
                if self._clearance is not None:
                    self._clearance(trajectory.path(SPACING), carrying)
            except Blocked as error:
                blocked.append(error)
                continue
            return trajectory
        others = f"; of {len(blocked)} ways tried none is free" if len(blocked) > 1 else ""
        raise Blocked(f"{blocked[0]}{others}")

    def _require_level(self, path: Array, allowed: float) -> None:
        """Make sure that the tool sinks nowhere between two waypoints by more than `allowed` [m].

        `path` is the joint positions `(N, 7)` [rad] of the waypoints; it counts from the lower of the two.

        A via's height is what keeps tool and load above walls and loose objects, and a straight line
        between two joint positions of equal height may sag by centimetres on the way.

        Raises:
            Blocked: It does; the text says how far.
        """
        along = np.linspace(0, 1, 25)[:, None, None]
        states = path[None, :-1] + along * np.diff(path, axis=0)
        heights = self.kinematics.positions(states.reshape(-1, 7))[:, 2].reshape(states.shape[:2])
        sag = float(np.max(np.minimum(heights[0], heights[-1]) - heights.min(axis=0)))
        if sag > allowed:
            raise Blocked(
                f"the tool would sink {sag * 1000:.0f} mm below its way; {allowed * 1000:.0f} mm are allowed"
            )

    def _rates(self, path: Array, speeds: Sequence[float | None]) -> list[float]:
        """Return the largest path rate of each segment [1/s] at which the tool keeps its speed limit."""
        rates = []
        for start, end, speed in zip(path[:-1], path[1:], speeds, strict=True):
            if speed is None:
                rates.append(math.inf)
                continue
            samples = start + np.linspace(0, 1, 17)[:, None] * (end - start)
            along = self.kinematics.velocities(samples, np.broadcast_to(end - start, samples.shape))
            fastest = float(np.max(np.linalg.norm(along, axis=1)))
            rates.append(speed / fastest if fastest > 1e-9 else math.inf)
        return rates

    def _joint_paths(self, start: Array, vias: Sequence[Via]) -> Iterator[Array]:
        """Yield joint paths `(1 + len(vias), 7)` [rad] from `start`, fastest first, each unlike the others.

        Dynamic programming from stroke to stroke: of all ways to begin a stroke in a posture only the
        fastest is kept. Joint 7 is no part of the posture where the yaw is free: it turns least.
        """
        paths, times = start[None, None], np.zeros(1)
        for stroke in strokes(vias, self.kinematics.forward(start)):
            chains = find_postures(self.kinematics, stroke, start).after(paths[:, -1, 6])
            within = rest_to_rest(np.diff(chains[0], axis=1), self.limits).sum(axis=1)
            towards = rest_to_rest(chains[:, :, 0] - paths[:, None, -1], self.limits)
            totals = times[:, None] + towards + within
            best = totals.argmin(axis=0)
            columns = np.argsort(totals.min(axis=0), kind="stable")[:WIDTH]
            rows = best[columns]
            paths = np.concatenate([paths[rows], chains[rows, columns]], axis=1)
            times = totals[rows, columns]
        yielded: list[Array] = []
        for path in paths:
            if len(yielded) < ATTEMPTS and all(np.max(np.abs(path - other)) > UNLIKE for other in yielded):
                yielded.append(path)
                yield path
