"""A motion that is known by its samples alone."""

from __future__ import annotations

import numpy as np

from executive.arm import Goal
from executive.motion.trajectory import STEP
from executive.sim.rebuild import sampled


def test_it_passes_the_same_states_between_the_samples(planner, home, limits) -> None:
    motion = planner.plan(home, Goal((0.55, 0.15, 0.055), guarded=0.02, speed=0.04))
    again = sampled(motion.samples, motion.duration, motion.guarded)
    times = np.linspace(0.0, motion.duration, 997)
    for s in times:
        one, other = motion.at(float(s)), again.at(float(s))
        assert np.abs(one.q - other.q).max() < 1e-7
        assert np.abs(one.qd - other.qd).max() < 1e-4
        # Between two samples the jerk may jump, which no polynomial does.
        assert np.abs(one.qdd - other.qdd).max() <= limits.jerk.max() * STEP
    assert (again.duration, again.guarded) == (motion.duration, motion.guarded)
    assert np.array_equal(again.at(motion.duration).qd, np.zeros(7))


def test_a_motion_to_where_the_arm_is_stays_there(planner, home) -> None:
    goal = Goal((0.5, -0.1, 0.2))
    whole = planner.plan(planner.plan(home, goal).end, goal)
    same = sampled(whole.samples, whole.duration)
    assert (whole.duration, same.duration) == (0.0, 0.0)
    for time in (0.0, 1.0):
        for mine, theirs in zip(same.at(time), whole.at(time), strict=True):
            assert np.array_equal(mine, theirs)
