"""How a simulated arm brakes: whether its commands stay on their path, and inside the stop limits."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from executive.clock import STEP
from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.trajectory import Trajectory
from executive.sim.arm import SimArm

BEFORE = 5
"""Commands looked at from before the arm was told to stop, so that no edge is missed."""


@dataclass(frozen=True)
class Braking:
    """How the arm came to rest.

    Attributes:
        deviation: Largest distance of a joint's command from the path it was on, or where it stood [rad].
        acceleration: Largest acceleration of a joint over its stop limit.
        jerk: Largest jerk of a joint over its stop limit.
    """

    deviation: float
    acceleration: float
    jerk: float


class CommandLog:
    """Keeps what a simulated arm is commanded: the last few steps, and from `begin` on every one."""

    def __init__(self, arm: SimArm) -> None:
        self._arm = arm
        self._before: deque[Array] = deque(maxlen=BEFORE)
        self._since: list[Array] = []
        self._path: Trajectory | None = None
        self._begun = False

    def keep(self) -> None:
        """Keep the newest command; called after every control step."""
        (self._since if self._begun else self._before).append(self._arm._command)

    def begin(self) -> None:
        """Note the motion under way: what is commanded from now on is measured by it."""
        self._begun, self._path = True, self._arm._motion

    def braking(self, limits: JointLimits) -> Braking:
        """Return how the arm came to rest since `begin`; one control step or more must have passed."""
        commands = np.array([*self._before, *self._since])
        accelerations = np.diff(commands, 2, axis=0) / STEP**2
        jerks = np.diff(accelerations, axis=0) / STEP
        if self._path is None:
            stood = [*self._before][-1:]
            deviation = float(np.ptp([*stood, *self._since], axis=0).max())
        else:
            deviation = max(off_path(command, self._path) for command in self._since)
        return Braking(
            deviation,
            float(np.max(np.abs(accelerations) / limits.stop_acceleration, initial=0.0)),
            float(np.max(np.abs(jerks) / limits.stop_jerk, initial=0.0)),
        )


def off_path(q: Array, path: Trajectory) -> float:
    """Return how far joint positions `(7,)` are from all that a motion passes [rad].

    The nearest place is looked for around the nearest of the straight lines between its samples: of the
    samples themselves one elsewhere may be nearer, where a path comes back to where it has been.
    """
    near = _nearest_line(q, path.samples.q) * STEP
    nearest = minimize_scalar(
        lambda s: float(np.linalg.norm(path.at(s).q - q)),
        bounds=(near - STEP / 2, near + STEP * 3 / 2),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float(np.abs(path.at(nearest.x).q - q).max())


def _nearest_line(q: Array, corners: Array) -> int:
    """Return which of the lines between `corners` `(N, 7)`, N at least 2, comes nearest to `q` `(7,)`."""
    lines = np.diff(corners, axis=0)
    squares = np.maximum(np.sum(lines**2, axis=1), np.finfo(float).tiny)
    along = np.clip(np.sum((q - corners[:-1]) * lines, axis=1) / squares, 0.0, 1.0)
    feet = corners[:-1] + along[:, None] * lines
    return int(np.argmin(np.linalg.norm(feet - q, axis=1)))
