"""Motions as the simulated arm makes them, and what is said of those it could not make."""

from __future__ import annotations

import numpy as np
import pytest

from executive.campaign.motion_execution import execute
from executive.campaign.motion_gauge import Gauge
from executive.errors import Blocked, Fault, Unreachable
from executive.motion.planner import Planner
from executive.sim.tool import SuctionTool


def test_executed_motions_keep_the_object_and_touch_nothing_else(overhead):
    seen = execute(overhead, 2, 5)
    assert (seen.pairs, seen.missed, seen.drops, seen.contacts, seen.failures) == (2, 0, 0, (), ())
    assert seen.clearance > 0
    assert 0 < seen.slip < 0.001
    assert 0 < seen.tracking < 1e-4
    assert 1 < seen.time < 4
    assert execute(overhead, 2, 5) == seen


def test_an_object_that_is_lost_on_the_way_is_counted(overhead, monkeypatch):
    bear = SuctionTool._bear
    steps = []

    def wear_out(self, grip):
        steps.append(grip)
        grip.bears = grip.bears if len(steps) < 100 else 0.0
        bear(self, grip)

    monkeypatch.setattr(SuctionTool, "_bear", wear_out)
    seen = execute(overhead, 1, 5)
    assert (seen.missed, seen.drops) == (0, 1)


def test_without_a_grasp_that_held_there_is_no_time_of_a_pair(overhead, monkeypatch):
    monkeypatch.setattr(SuctionTool, "close", lambda self: None)
    seen = execute(overhead, 2, 5)
    assert (seen.pairs, seen.missed, seen.drops, seen.failures) == (2, 2, 0, ())
    assert seen.time is None
    assert seen.clearance > 0


@pytest.mark.parametrize("error", [Blocked("a wall"), Unreachable("too far")])
def test_a_pair_without_a_motion_is_told_and_the_next_one_is_made(overhead, monkeypatch, error):
    plan, asked = Planner.plan, []

    def find(self, start, goal, task):
        asked.append(goal)
        if len(asked) == 2:  # the first one brings the arm to where it begins
            raise error
        return plan(self, start, goal, task)

    monkeypatch.setattr(Planner, "plan", find)
    seen = execute(overhead, 2, 5)
    assert seen.failures == (str(error),)
    assert (seen.missed, seen.drops, len(asked)) == (0, 0, 4)
    assert seen.time is not None


def test_where_no_motion_is_found_nothing_was_near(overhead, monkeypatch):
    plan = Planner.plan

    def blocked(self, start, goal, task):
        if task.target is None:
            return plan(self, start, goal, task)
        raise Blocked("a wall")

    monkeypatch.setattr(Planner, "plan", blocked)
    seen = execute(overhead, 1, 5)
    assert (seen.clearance, seen.nearest, seen.time, seen.failures) == (None, "nothing", None, ("a wall",))


def test_an_arm_that_is_not_on_its_path_ends_the_measurement(overhead, monkeypatch):
    begin = Gauge.begin

    def push(self, scene, held=None):
        begin(self, scene, held)
        self._world.set_arm(np.radians(overhead.arm.poses_deg["home"]))

    monkeypatch.setattr(Gauge, "begin", push)
    with pytest.raises(Fault, match=r"the motion starts .*° away from where joint \d of the arm is"):
        execute(overhead, 1, 5)
