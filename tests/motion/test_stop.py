from __future__ import annotations

import numpy as np
import pytest

from executive.cell import Via
from executive.motion.stop import brake
from executive.motion.trajectory import Trajectory

STEP = 1 / 240


def commands(trajectory: Trajectory, s: float, times) -> np.ndarray:
    """Joint positions of the control steps around a stop from path time `s`."""
    before = [trajectory.at(max(0.0, s - k * STEP))[0] for k in range(4, -1, -1)]
    during = [trajectory.at(time)[0] for time in times]
    return np.array([*before, *during, *[during[-1]] * 4])


def test_a_halt_at_any_tick_is_short_and_inside_the_stop_limits(limits) -> None:
    rng = np.random.default_rng(4)
    for _ in range(60):
        start = rng.uniform(-limits.position, limits.position)
        end = start + (rng.uniform(-limits.position, limits.position) - start) * 10 ** rng.uniform(-1.5, 0)
        trajectory = Trajectory([start, end], limits)
        s = STEP * int(rng.uniform(0, trajectory.duration / STEP))
        times = brake(trajectory, s, limits, STEP)
        assert len(times) * STEP <= 0.5
        assert np.all(np.diff([s, *times]) >= 0)
        accelerations = np.diff(commands(trajectory, s, times), 2, axis=0) / STEP**2
        assert np.max(np.abs(accelerations) / limits.stop_acceleration) <= 1.0
        assert np.max(np.abs(np.diff(accelerations, axis=0)) / STEP / limits.stop_jerk) <= 1.02


def test_a_guarded_descent_stops_within_a_millimetre(planner, limits, kinematics, config) -> None:
    down = [Via(np.array([0.55, 0.1, 0.07])), Via(np.array([0.55, 0.1, 0.04]), speed=0.03)]
    trajectory = planner.plan(np.radians(config.arm.poses_deg["home"]), down)
    for share in (0.1, 0.3, 0.5, 0.8):
        s = trajectory.rests[1] + share * (trajectory.rests[2] - trajectory.rests[1])
        end = brake(trajectory, s, limits, STEP)[-1]
        before, after = kinematics.positions(np.array([trajectory.at(t)[0] for t in (s, end)]))
        assert np.linalg.norm(after - before) < 0.001


def test_near_a_rest_the_motion_runs_on_to_it(limits) -> None:
    trajectory = Trajectory([np.zeros(7), np.full(7, 0.5)], limits)
    s = trajectory.duration - 2 * STEP
    assert brake(trajectory, s, limits, STEP)[-1] == pytest.approx(trajectory.duration, abs=1e-3)
