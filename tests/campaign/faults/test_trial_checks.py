"""What must be true of a run in which something went wrong, and what is said where it is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from events import at, frame_searched, item_changed

from executive.campaign.faults.planned_fault import PlannedFault, SkillFault
from executive.campaign.faults.trial_checks import (
    UnobservedCounts,
    check_detection,
    check_end,
    check_ledger,
    check_losses,
    count_unobserved_objects,
    describe_unexpected_reason,
)
from executive.cell.frame import FrameCaptured
from executive.cells.fake.cell import FakeCell
from executive.events import FaultInjected, FrameSearched, RunEnded, TimedEvent
from executive.mission.flow_analysis import UnhandledFailure
from executive.record.timeline.timeline import Timeline
from executive.testing.faults import during, seal_fails
from executive.testing.world_access import TrueObject

BUG = PlannedFault("tree/Grasp", "Grasp", "", "raises", "first", "", SkillFault("tree/Grasp", "raises"))
SEAL_FAILS = during("tree/Grasp", seal_fails())
MISS = PlannedFault("tree/Grasp", "Grasp", "", "missed", "first", "", SEAL_FAILS, is_failure_reason=True)
ENDINGS = (UnhandledFailure("Grasp", "missed", "tree/Grasp", "a.yaml", 3),)
ITEMS = {"seen": 3, "placed": 2, "rejected": 1, "skipped": 0, "lost": 0, "phantom": 0}
AUDIT = {"right": 2, "wrong_bin": 0, "left": 1, "elsewhere": 0, "unseen": 0}

PLACES = ((0.5, 0.0, 0.025), (1.6, 0.0, 0.025), (0.24, -0.48, 0.025))
"""In the workspace, far beside it, and in a bin that the camera shows."""


def outcome(status: str, reason: str = "", message: str = "", node: str = "") -> RunEnded:
    return RunEnded(status, reason, message, node, True, "", 10, 1.0)


def searched(frame_id: int, view: str) -> TimedEvent:
    return at(21, FrameSearched(frame_id, "overhead", "rfdetr", view, (), (), ()))


def books(*args: Any) -> list[str]:
    return list(check_ledger(*args, *(0, UnobservedCounts())[len(args) - 3 :]))


def end(out: RunEnded, fault: PlannedFault, *, raised: bool = False) -> list[str]:
    return list(check_end(out, [fault], ENDINGS, raised))


def test_a_bug_has_to_end_the_run_and_to_be_found_at_its_node() -> None:
    fault = outcome("FAULT", "fault", "Grasp: InjectedError: a bug", "tree/Grasp")
    halted = outcome("FAULT", "fault", "tree/Grasp: Grasp: InjectedError while it was halted: a bug")
    assert end(fault, BUG, raised=True) == end(halted, BUG, raised=True) == []
    elsewhere = outcome("FAULT", "fault", "Wait: InjectedError: a bug", "tree/Wait")
    assert end(elsewhere, BUG, raised=True) == [
        "the bug was in tree/Grasp, but the run names tree/Wait: Wait: InjectedError: a bug"
    ]
    assert end(outcome("SUCCESS"), BUG, raised=True) == [
        "the injected error was raised, but the run ended as SUCCESS "
    ]


def test_no_other_fault_may_end_a_run() -> None:
    own = outcome("FAULT", "fault", "Grasp: KeyError: 'cube'", "tree/Grasp")
    problem = "the run ended as FAULT at tree/Grasp: Grasp: KeyError: 'cube'"
    assert end(own, MISS) == end(own, BUG, raised=True) == [problem]


def test_a_failure_has_to_be_one_that_the_checker_knows_of() -> None:
    assert end(outcome("FAILURE", "Grasp.missed", "", "tree/Grasp"), MISS) == []
    assert end(outcome("FAILURE", "lost"), MISS) == []
    assert end(outcome("FAILURE", "Wait.missed", "", "tree/Wait"), MISS) == [
        "the run ended with Wait.missed at tree/Wait; `check` lists no such end"
    ]


def test_the_books_have_to_be_what_the_world_is() -> None:
    assert books(outcome("SUCCESS"), ITEMS, AUDIT) == books(outcome("SUCCESS"), ITEMS, None) == []
    lost = {**ITEMS, "rejected": 0, "lost": 1}
    (problem,) = books(outcome("SUCCESS"), lost, AUDIT)
    assert problem.startswith("the ledger says seen 3, placed 2, rejected 0, skipped 0, lost 1")
    assert "the audit right 2, wrong_bin 0, left 1" in problem
    (problem,) = books(outcome("SUCCESS"), ITEMS, {**AUDIT, "right": 1, "wrong_bin": 1})
    assert problem.startswith("1 objects in wrong bins; ")
    (problem,) = books(outcome("SUCCESS"), {**ITEMS, "seen": 4}, AUDIT)
    assert problem.startswith("the ledger does not balance: ")


@pytest.mark.parametrize(
    ("status", "reason", "looked", "said"),
    [
        ("FAILURE", "Detect.unavailable", True, []),
        # One that never looked does not say that nothing is there.
        ("SUCCESS", "", False, []),
        ("SUCCESS", "", True, [
            "the run succeeded, but 1 objects were never seen; "
            "the audit right 2, wrong_bin 0, left 2, elsewhere 0, unseen 1",
        ]),
    ],
)  # fmt: skip
def test_what_nobody_saw_is_no_disagreement_unless_the_run_says_success(
    status: str, reason: str, looked: bool, said: list[str]
) -> None:
    unseen = {**AUDIT, "left": 2, "unseen": 1}
    assert books(outcome(status, reason), ITEMS, unseen) == []
    timeline = Timeline.from_events([at(1, frame_searched())] * looked)
    assert list(check_detection(outcome(status, reason), unseen, timeline)) == said


def test_what_fell_just_before_a_run_ended_early_may_lie_anywhere() -> None:
    fallen = {**ITEMS, "rejected": 0, "lost": 1}
    for early in (outcome("FAULT"), outcome("FAILURE", "Detect.unavailable", "", "tree/Detect")):
        assert books(early, fallen, AUDIT) == books(early, fallen, {**AUDIT, "right": 3, "left": 0}) == []
        assert len(books(early, fallen, {**AUDIT, "right": 1, "left": 2})) == 1
    assert len(books(outcome("FAILURE", "lost"), fallen, AUDIT)) == 1


def test_what_was_taken_where_nobody_had_to_look_is_no_disagreement() -> None:
    taken = {**AUDIT, "left": 0, "elsewhere": 1}
    counts = [len(books(outcome("SUCCESS"), ITEMS, *more)) for more in (
        (taken, 1), (taken,), ({**taken, "left": 1}, 1),
    )]  # fmt: skip
    assert counts == [0, 1, 1]


def test_only_what_the_fault_reached_for_may_be_out_of_reach() -> None:
    gone = {**AUDIT, "elsewhere": 1}
    taken = Timeline.from_events([at(1, FaultInjected("object_removed", "", "", "", []))])
    slow = Timeline.from_events([at(1, FaultInjected("detector_slow", "", "", "", []))])
    assert list(check_losses(gone, taken)) == list(check_losses(None, Timeline())) == []
    assert list(check_losses(gone, slow)) == ["1 objects are out of reach, but the faults displaced 0"]


def test_a_failure_for_another_reason_is_remarked() -> None:
    assert describe_unexpected_reason(outcome("FAILURE", "Grasp.missed"), [MISS]) == ""
    assert (
        describe_unexpected_reason(outcome("FAILURE", "lost"), [MISS])
        == describe_unexpected_reason(outcome("SUCCESS"), [MISS])
        == ""
    )
    said = describe_unexpected_reason(outcome("FAILURE", "Transit.dropped"), [MISS])
    assert said == "failed because of Transit.dropped, not of missed"
    dead = PlannedFault(
        "detector", "detector", "", "dead for ever", "first", "", SEAL_FAILS, expected_reason="unavailable"
    )
    assert describe_unexpected_reason(outcome("FAILURE", "Detect.unavailable"), [MISS, dead]) == ""
    assert describe_unexpected_reason(outcome("FAILURE", "SelectTarget.unseen"), [dead]) == (
        "failed because of SelectTarget.unseen, not of unavailable"
    )


@pytest.mark.parametrize(
    ("changes", "hidden", "problems"),
    [
        ({}, UnobservedCounts(1, 0), 0),
        ({"right": 3, "left": 0}, UnobservedCounts(0, 1), 0),
        ({}, UnobservedCounts(0, 0), 1),
        ({}, UnobservedCounts(0, 1), 1),
        # Only one of two is hidden.
        ({"right": 1, "left": 2}, UnobservedCounts(1, 0), 1),
    ],
)
def test_what_fell_where_no_look_shows_it_is_out_of_reach_wherever_it_lies(
    changes: dict[str, int], hidden: UnobservedCounts, problems: int
) -> None:
    lost = {**ITEMS, "rejected": 0, "lost": 1}
    assert len(books(outcome("FAILURE", "lost"), lost, {**AUDIT, **changes}, 0, hidden)) == problems


def test_an_object_is_out_of_sight_if_no_look_since_the_last_fall_shows_its_place(fake: FakeCell) -> None:
    camera, bins = fake.cell.camera, fake.cell.bins.values()
    seen, beside = (TrueObject(body, "cube", np.array(place)) for body, place in enumerate(PLACES[:2]))
    inside = TrueObject(2, "cube", np.array(PLACES[2]))
    fall = at(10, item_changed("cube-1", "dropped"))
    look = at(20, FrameCaptured(camera.capture()))
    before = at(5, look.event)
    things = [seen, beside, inside]
    search = searched(look.event.frame.id, "full")
    assert count_unobserved_objects(things, bins, [fall, look, search]) == UnobservedCounts(1, 0)
    assert count_unobserved_objects(things, bins, [before, fall]) == UnobservedCounts(2, 1), (
        "what was seen before it fell is old"
    )
    assert count_unobserved_objects(things, bins, [look]) == UnobservedCounts(0, 0), "nothing fell"


@pytest.mark.parametrize("views", [[], ["table"], ["full of another frame"]])
def test_an_object_in_a_bin_is_out_of_sight_if_no_detector_searched_an_image_of_the_bin(
    fake: FakeCell, views: list[str]
) -> None:
    frame = fake.cell.camera.capture()
    inside = TrueObject(2, "cube", np.array(PLACES[2]))
    searches = [
        searched(frame.id + 1, "full") if "other" in view else searched(frame.id, view) for view in views
    ]
    looks = [at(10, item_changed("cube-1", "dropped")), at(20, FrameCaptured(frame)), *searches]
    assert count_unobserved_objects([inside], fake.cell.bins.values(), looks) == UnobservedCounts(0, 1)
