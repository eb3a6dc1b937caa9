"""What a person sees at each control step."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_tree import NODES, status

from executive.view.film.course import TOLD, Course

ENTRIES = [
    status(0, "tree", "RUNNING"),
    {"tick": 2, "clock": 2 / 240, "kind": "item", "item": "cube-1", "label": "cube", "state": "seen"},
    {"tick": 3, "clock": 3 / 240, "kind": "decision", "item": "cube-1", "label": "cube", "bin": "red_bin"},
    status(3, "tree/Grasp", "RUNNING", item="cube-1"),
    status(240, "tree/Grasp", "FAILURE", item="cube-1", reason="missed", message="no seal"),
    status(240, "tree/Grasp", "RUNNING", item="cube-1"),
    status(900, "tree/Grasp", "SUCCESS", item="cube-1"),
    {"tick": 900, "clock": 3.75, "kind": "item", "item": "cube-1", "label": "cube", "state": "held"},
    status(900, "tree/Transit", "RUNNING", item="cube-1"),
    status(960, "tree/Transit", "FAILURE", item="", reason="blocked", message="a wall"),
    status(960, "tree", "FAILURE", reason="Transit.blocked"),
]


@pytest.fixture
def course() -> Course:
    return Course(ENTRIES, NODES, [Path("frames/000250_cube-1_missed.jpg"), Path("frames/000003_cube-1.jpg")])


def test_what_happens_in_a_step_is_seen_in_it_and_not_before(course: Course) -> None:
    course.go_to(2, 2 / 240)
    assert (course.status, course.doing) == ({"tree": "RUNNING"}, "")
    assert [row.item for row in course.items] == ["cube-1"]
    assert course.picture is None
    course.go_to(3, 3 / 240)
    assert course.status["tree/Grasp"] == "RUNNING"
    assert course.doing == "Grasp cube-1"
    assert course.beside["tree/Grasp"] == "cube-1"
    assert course.picture == Path("frames/000003_cube-1.jpg")


@pytest.mark.parametrize(
    ("entries", "opened", "known"),
    [
        ([*ENTRIES[:7], status(910, "tree", "RUNNING")], {"tree"}, {"tree": "RUNNING"}),
        ([*ENTRIES[:-1], status(960, "tree", "SUCCESS")], {"tree"},
         {"tree": "SUCCESS", "tree/Grasp": "SUCCESS", "tree/Transit": "FAILURE"}),
    ],
    ids=["a node that begins again knows nothing of the round before", "a failure under a success is folded"],
)  # fmt: skip
def test_a_round_is_over_where_its_root_begins_again_or_succeeds(entries, opened, known) -> None:
    course = Course(entries, NODES, [])
    course.go_to(960, 4.0)
    assert (course.open, course.status) == (opened, known)
    assert set(course.beside) <= set(known)


def test_a_failure_with_an_item_is_told_for_a_while(course: Course) -> None:
    course.go_to(240, 1.0)
    assert course.trouble == "Grasp.missed: no seal"
    course.go_to(300, 1.25)
    assert course.picture == Path("frames/000250_cube-1_missed.jpg")
    assert course.trouble
    course.go_to(700, 1.0 + TOLD + 0.01)
    assert course.trouble == ""


def test_of_a_tree_that_ended_what_ended_last_stays_open(course: Course) -> None:
    course.go_to(900, 3.75)
    assert course.doing == "Transit cube-1 to red_bin"
    assert course.open == {"tree", "tree/Transit"}
    course.go_to(960, 4.0)
    assert course.open == {"tree", "tree/Transit"}
    assert course.status["tree"] == "FAILURE"
    assert course.beside["tree/Transit"] == "blocked"
    # It was about no item: the tree says it, and nothing else has to.
    assert course.trouble == ""


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ({"kind": "fault", "message": "it broke"}, "fault: it broke"),
        ({"kind": "halt"}, "halt"),
        ({"kind": "resume", "ticked": 0}, "taken up again"),
    ],
)
def test_what_befalls_a_whole_run_is_told(entry: dict[str, object], told: str) -> None:
    course = Course([{"tick": 1, "clock": 0.0, **entry}], NODES, [])
    course.go_to(1, 0.0)
    assert course.trouble == told
