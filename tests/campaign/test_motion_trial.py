"""The bench of motion in earnest, with a few pairs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executive.campaign.motion_trial import measure
from executive.errors import Blocked, InputError
from executive.motion.planner import Planner


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
