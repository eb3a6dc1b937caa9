from __future__ import annotations

from executive.events import Event
from executive.record.planning import PlanningTally


def test_plans_are_counted_and_what_was_waited_for_them():
    tally = PlanningTally()
    for tick, (ahead, waits) in enumerate([(False, 0.05), (True, 0.0), (True, 0.02)]):
        tally(Event("plan", tick, tick / 240, {"ahead": ahead, "waits": waits, "duration": 1.0}))
    tally(Event("end", 3, 0.0125, {"status": "SUCCESS"}))
    assert tally.figures() == {"motions": 3, "ahead": 2, "waited_s": 0.07}


def test_a_plan_that_found_no_way_counts_too():
    tally = PlanningTally()
    found_nothing = {"ahead": False, "waits": 0.05, "duration": 0.0}
    tally(Event("plan", 1, 1 / 240, found_nothing))
    assert tally.figures()["motions"] == 1


def test_a_run_without_a_motion_has_none():
    assert PlanningTally().figures() == {"motions": 0, "ahead": 0, "waited_s": 0.0}
