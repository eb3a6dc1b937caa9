"""The bench of motion in earnest, with a few pairs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executive.campaign.motion_execution import execute
from executive.campaign.motion_trial import measure
from executive.errors import Blocked, InputError
from executive.motion.planner import Planner
from executive.sim.tool import SuctionTool


def timeless(figures):
    """Return figures without what the wall's clock says."""
    slow = replace(figures.planning, median=0, p99=0, within_50=0, within_150=0)
    methods = {
        name: replace(getattr(figures, name), planning=None)
        for name in ("article", "stopping", "toppra", "floor", "ours")
    }
    return replace(figures, planning=slow, **methods)


def test_every_method_rides_the_same_pairs_and_a_seed_gives_the_same_figures(overhead):
    told = []
    figures = measure(overhead, 2, 5, lambda done, total: told.append((done, total)))
    assert told == [(1, 2), (2, 2)]
    assert (figures.pairs, figures.planning.motions, figures.planning.failures) == (2, 4, ())
    assert figures.free_floor <= figures.floor.time <= figures.ours.time < figures.stopping.time
    assert figures.stopping.time < figures.article.time == 6.5 < figures.article_cycle
    for method in (figures.ours, figures.stopping, figures.floor):
        assert max(method.peaks) <= 1 + 1e-6
    assert max(figures.article.peaks) > 1000
    assert figures.ours.clearance > 0
    assert timeless(measure(overhead, 2, 5)) == timeless(figures)


def test_pairs_without_a_motion_are_told_and_an_arm_that_gets_nowhere_is_an_error(overhead, monkeypatch):
    plan = Planner.plan

    def blocked(self, start, goal, task=None):
        if task is None:
            return plan(self, start, goal)
        raise Blocked("a wall")

    monkeypatch.setattr(Planner, "plan", blocked)
    with pytest.raises(InputError, match="no motion was found for any pair of cell overhead: a wall"):
        measure(overhead, 2, 5)


def test_executed_motions_keep_the_object_and_touch_nothing_else(overhead):
    seen = execute(overhead, 2, 5)
    assert (seen.pairs, seen.missed, seen.drops, seen.contacts, seen.failures) == (2, 0, 0, (), ())
    assert seen.clearance > 0
    assert 0 < seen.slip < 0.001
    assert 0 < seen.tracking < 1e-4
    assert 1 < seen.time < 4
    assert execute(overhead, 2, 5) == seen


def test_a_grasp_that_does_not_hold_is_counted(overhead, monkeypatch):
    monkeypatch.setattr(SuctionTool, "close", lambda self: None)
    assert execute(overhead, 1, 5).missed == 1


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
