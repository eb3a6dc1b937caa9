"""What a person sees at each control step."""

from __future__ import annotations

from pathlib import Path

import pytest
from events import at, item_changed
from small_tree import NODES, ended, started

from executive.events import Event, FaultRaised, RunHalted, RunResumed, TargetSelected
from executive.view.film.course import FAILURE_TIME, FilmCourse

EVENTS = [
    started(0, "tree"),
    at(2, item_changed("cube-1")),
    at(3, TargetSelected("cube-1", "cube", 1, "red_bin")),
    started(3, "tree/Grasp", "cube-1"),
    ended(240, "tree/Grasp", "FAILURE", "cube-1", reason="missed", message="no seal"),
    started(240, "tree/Grasp", "cube-1"),
    ended(900, "tree/Grasp", "SUCCESS", "cube-1"),
    at(900, item_changed("cube-1", "held")),
    started(900, "tree/Transit", "cube-1"),
    ended(960, "tree/Transit", "FAILURE", reason="blocked", message="a wall"),
    ended(960, "tree", "FAILURE", reason="Transit.blocked"),
]


def statuses(course: FilmCourse) -> dict[str, str]:
    """Return the status of each node that ran in the present round."""
    current = ((node.path, course.timeline.current(node.path)) for node in NODES)
    return {path: last.status for path, last in current if last is not None}


@pytest.fixture
def course() -> FilmCourse:
    return FilmCourse(
        EVENTS, NODES, [Path("frames/000250_cube-1_missed.jpg"), Path("frames/000003_cube-1.jpg")]
    )


def test_what_happens_in_a_step_is_seen_in_it_and_not_before(course: FilmCourse) -> None:
    course.go_to(2, 2 / 240)
    assert (statuses(course), course.current_action) == ({"tree": "RUNNING"}, "")
    assert list(course.timeline.items.by_name) == ["cube-1"]
    assert course.picture is None
    course.go_to(3, 3 / 240)
    assert statuses(course)["tree/Grasp"] == "RUNNING"
    assert course.current_action == "Grasp cube-1"
    assert course.timeline.current("tree/Grasp").note == "cube-1"
    assert course.picture == Path("frames/000003_cube-1.jpg")


@pytest.mark.parametrize(
    ("events", "opened", "known"),
    [
        ([*EVENTS[:7], started(910, "tree")], {"tree"}, {"tree": "RUNNING"}),
        ([*EVENTS[:-1], ended(960, "tree")], {"tree"},
         {"tree": "SUCCESS", "tree/Grasp": "SUCCESS", "tree/Transit": "FAILURE"}),
    ],
    ids=["a node that begins again knows nothing of the round before", "a failure under a success is folded"],
)  # fmt: skip
def test_a_round_is_over_where_its_root_begins_again_or_succeeds(events, opened, known) -> None:
    course = FilmCourse(events, NODES, [])
    course.go_to(960, 4.0)
    assert (course.open_paths, statuses(course)) == (opened, known)


def test_a_failure_with_an_item_is_told_for_a_while(course: FilmCourse) -> None:
    course.go_to(240, 1.0)
    assert course.failure == "Grasp.missed: no seal"
    course.go_to(300, 1.25)
    assert course.picture == Path("frames/000250_cube-1_missed.jpg")
    assert course.failure
    course.go_to(700, 1.0 + FAILURE_TIME + 0.01)
    assert course.failure == ""


def test_of_a_tree_that_ended_what_ended_last_stays_open(course: FilmCourse) -> None:
    course.go_to(900, 3.75)
    assert course.current_action == "Transit cube-1 to red_bin"
    assert course.open_paths == {"tree", "tree/Transit"}
    course.go_to(960, 4.0)
    assert course.open_paths == {"tree", "tree/Transit"}
    assert statuses(course)["tree"] == "FAILURE"
    assert course.timeline.current("tree/Transit").note == "blocked"
    # It was about no item: the tree says it, and nothing else has to.
    assert course.failure == ""


@pytest.mark.parametrize(
    ("event", "sentence"),
    [(FaultRaised("Traceback"), "fault"), (RunHalted(True), "halt"), (RunResumed(0, "", {}), "resumed")],
)
def test_what_befalls_a_whole_run_is_told(event: Event, sentence: str) -> None:
    course = FilmCourse([at(1, event, 0.0)], NODES, [])
    course.go_to(1, 0.0)
    assert course.failure == sentence
