"""Path deviation, acceleration and jerk of a braking arm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from executive.clock import STEP
from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.trajectory import Trajectory


def measure_braking(
    commands: Sequence[Array], before: int, path: Trajectory | None, limits: JointLimits
) -> dict[str, float]:
    """Return how the arm came to rest: distance from its path, acceleration and jerk over the stop limits.

    Args:
        commands: Joint positions of consecutive control steps [rad].
        before: Number of commands from before the stop.
        path: The motion under way at the stop; None if the arm stood.
        limits: The arm's.
    """
    accelerations = np.diff(commands, 2, axis=0) / STEP**2
    jerks = np.diff(accelerations, axis=0) / STEP
    if path is None:
        deviation = float(np.ptp(commands[max(0, before - 1) :], axis=0).max())
    else:
        deviation = max(measure_distance(command, path) for command in commands[before:])
    return {
        "deviation_rad": deviation,
        "acceleration_share": float(np.max(np.abs(accelerations) / limits.stop_acceleration, initial=0.0)),
        "jerk_share": float(np.max(np.abs(jerks) / limits.stop_jerk, initial=0.0)),
    }


def measure_distance(q: Array, path: Trajectory) -> float:
    """Return the distance of joint positions `(7,)` from the nearest place of a motion [rad].

    The place is searched around the nearest of the straight lines between the motion's samples. The nearest
    sample may belong to another part of a path that returns to where it was.
    """
    corners = path.samples.q
    lines = np.diff(corners, axis=0)
    squares = np.maximum(np.sum(lines**2, axis=1), np.finfo(float).tiny)
    along = np.clip(np.sum((q - corners[:-1]) * lines, axis=1) / squares, 0.0, 1.0)
    feet = corners[:-1] + along[:, None] * lines
    time = int(np.argmin(np.linalg.norm(feet - q, axis=1))) * STEP
    nearest = minimize_scalar(
        lambda s: float(np.linalg.norm(path.at(s).q - q)),
        bounds=(time - STEP / 2, time + STEP * 3 / 2),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float(np.abs(path.at(nearest.x).q - q).max())
