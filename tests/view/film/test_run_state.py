"""What a person sees at each control step."""

from __future__ import annotations

from pathlib import Path

import pytest
from events import at, item_changed
from small_tree import NODES, ended, started

from executive.events import Event, FaultRaised, RunHalted, RunResumed, TargetSelected
from executive.view.film.run_state import INCIDENT_DISPLAY_TIME, FilmRunState

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


def statuses(state: FilmRunState) -> dict[str, str]:
    """Return the status of each node that ran in the present round."""
    current = ((node.path, state.timeline.find_current_activation(node.path)) for node in NODES)
    return {path: last.status for path, last in current if last is not None}


@pytest.fixture
def state() -> FilmRunState:
    return FilmRunState(
        EVENTS, NODES, [Path("frames/000250_cube-1_missed.jpg"), Path("frames/000003_cube-1.jpg")]
    )


def test_what_happens_in_a_step_is_seen_in_it_and_not_before(state: FilmRunState) -> None:
    state.advance_to(2, 2 / 240)
    assert (statuses(state), state.action_text) == ({"tree": "RUNNING"}, "")
    assert list(state.timeline.items.by_name) == ["cube-1"]
    assert state.image_file is None
    state.advance_to(3, 3 / 240)
    assert statuses(state)["tree/Grasp"] == "RUNNING"
    assert state.action_text == "Grasp cube-1"
    assert state.timeline.find_current_activation("tree/Grasp").reason_or_item == "cube-1"
    assert state.image_file == Path("frames/000003_cube-1.jpg")


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
    state = FilmRunState(events, NODES, [])
    state.advance_to(960, 4.0)
    assert (state.active_paths, statuses(state)) == (opened, known)


def test_a_failure_with_an_item_is_shown_for_some_time(state: FilmRunState) -> None:
    state.advance_to(240, 1.0)
    assert state.incident_text == "Grasp.missed: no seal"
    state.advance_to(300, 1.25)
    assert state.image_file == Path("frames/000250_cube-1_missed.jpg")
    assert state.incident_text
    state.advance_to(700, 1.0 + INCIDENT_DISPLAY_TIME + 0.01)
    assert state.incident_text == ""


def test_of_a_tree_that_ended_what_ended_last_stays_open(state: FilmRunState) -> None:
    state.advance_to(900, 3.75)
    assert state.action_text == "Transit cube-1 to red_bin"
    assert state.active_paths == {"tree", "tree/Transit"}
    state.advance_to(960, 4.0)
    assert state.active_paths == {"tree", "tree/Transit"}
    assert statuses(state)["tree"] == "FAILURE"
    assert state.timeline.find_current_activation("tree/Transit").reason_or_item == "blocked"
    # It was about no item: the tree says it, and nothing else has to.
    assert state.incident_text == ""


@pytest.mark.parametrize(
    ("event", "sentence"),
    [(FaultRaised("Traceback"), "fault"), (RunHalted(True), "halt"), (RunResumed(0, "", {}), "resumed")],
)
def test_events_of_the_whole_run_are_shown(event: Event, sentence: str) -> None:
    state = FilmRunState([at(1, event, 0.0)], NODES, [])
    state.advance_to(1, 0.0)
    assert state.incident_text == sentence
