"""Side by side."""

from __future__ import annotations

from typing import Any

import pytest
from py_trees.common import Status

from executive.control.parallel import Parallel
from executive.errors import Fault, InputError


def choices(events: Any) -> list[tuple[str, str]]:
    return [(event["choice"], event["reason"]) for event in events if event["kind"] == "choice"]


def test_all_children_start_in_order_in_the_first_tick(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Parallel(site(), [leaf("A", "R R S"), leaf("B"), leaf("C", "R S")])) == "RRS"
    assert log == ["A starts", "B starts", "C starts"]


def test_a_child_that_ended_is_not_run_again(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Parallel(site(), [leaf("A"), leaf("B", "lost"), leaf("C", "R R R S")])) == "RRRF"
    assert log == ["A starts", "B starts", "C starts"]


@pytest.mark.parametrize(
    ("wait_for", "end", "halted"),
    [(1, "RS", ["B halted", "C halted"]), (2, "RRS", ["C halted"]), (3, "RRRS", []), (None, "RRRS", [])],
)
def test_it_succeeds_when_enough_have(
    wait_for: int | None, end: str, halted: list[str], leaf: Any, site: Any, ticks: Any, log: Any
) -> None:
    children = [leaf("A", "R S"), leaf("B", "R R S"), leaf("C", "R R R S")]
    assert ticks(Parallel(site(), children, wait_for)) == end
    assert log[3:] == halted


def test_siblings_finish_before_a_failure_is_reported(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Parallel(site(), [leaf("A", "R R R S"), leaf("B", "R lost")])
    assert ticks(node) == "RRRF"
    assert str(node.failure) == "B.lost"
    assert log == ["A starts", "B starts"]


def test_with_halt_siblings_are_halted_at_once(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Parallel(site(), [leaf("A", "R R R S"), leaf("B", "R lost")], halt=True)
    assert ticks(node) == "RF"
    assert str(node.failure) == "B.lost"
    assert log == ["A starts", "B starts", "A halted"]


def test_a_failure_that_leaves_enough_is_passed_over(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = Parallel(site(), [leaf("A", "lost"), leaf("B", "R S"), leaf("C", "R R R")], 1, halt=True)
    assert ticks(node) == "RS"
    assert node.failure is None
    assert choices(events) == [("go on with the others", "A.lost")]


def test_enough_successes_win_over_too_many_failures_of_the_same_tick(
    leaf: Any, site: Any, ticks: Any, events: Any
) -> None:
    node = Parallel(site(), [leaf("A", "R lost"), leaf("B", "R stuck"), leaf("C", "R S")], 1)
    assert ticks(node) == "RS"
    assert choices(events) == [("enough others succeeded", "A.lost"), ("enough others succeeded", "B.stuck")]


def test_it_fails_with_the_failure_that_came_first(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    children = [leaf("A", "R R late"), leaf("B", "R lost"), leaf("C", "R stuck")]
    node = Parallel(site("here"), children)
    assert ticks(node) == "RRF"
    assert (str(node.failure), node.failure.path) == ("B.lost", "B")
    assert choices(events) == [
        ("let the others finish, then fail", "B.lost"),
        ("let the others finish, then fail", "C.stuck"),
        ("fail with B.lost", "A.late"),
    ]
    assert events[-1]["origin"] == "B"


def test_of_one_tick_the_first_child_s_failure_counts(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = Parallel(site(), [leaf("A"), leaf("B", "lost"), leaf("C", "stuck")])
    assert ticks(node) == "F"
    assert str(node.failure) == "B.lost"
    assert choices(events) == [("fail with B.lost", "C.stuck")]


def test_a_success_after_too_many_failures_changes_nothing(leaf: Any, site: Any, ticks: Any) -> None:
    children = [leaf("A", "lost"), leaf("B", "lost"), leaf("C", "R S"), leaf("D", "R R S")]
    assert ticks(Parallel(site(), children, 3)) == "RRF"


def test_every_activation_runs_all_children_again(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Parallel(site(), [leaf("A", "lost", "S"), leaf("B", "R S")])
    assert ticks(node) + ticks(node) == "RFRS"
    assert log == ["A starts", "B starts"] * 2


def test_nothing_side_by_side_is_a_success(site: Any, ticks: Any) -> None:
    assert ticks(Parallel(site(), [])) == "S"


def test_its_label_stands_for_the_failure(leaf: Any, site: Any, ticks: Any) -> None:
    node = Parallel(site("tree", "both"), [leaf("A", "lost"), leaf("B")])
    ticks(node)
    assert node.failure.matches([("both", "lost")]) and node.failure.matches([("A", "lost")])


def test_all_that_cannot_be_halted_are_named(leaf: Any, site: Any, log: Any) -> None:
    children = [leaf("A", "R R"), leaf("B", "R S"), leaf("C", "R R"), leaf("D", "R R")]
    for child in (children[0], children[2]):
        child.breaks = True
    node = Parallel(site("here"), children, 1)
    node.tick_once()
    with pytest.raises(Fault) as caught:
        node.tick_once()
    assert (str(caught.value), caught.value.node) == ("A: cannot stop; C: cannot stop", "here")
    assert log[4:] == ["A halted", "C halted", "D halted"]
    assert all(child.status is not Status.RUNNING for child in children)


@pytest.mark.parametrize("wait_for", [0, 3])
def test_it_cannot_wait_for_more_than_there_are(wait_for: int, leaf: Any, site: Any) -> None:
    with pytest.raises(InputError) as caught:
        Parallel(site("tree/x"), [leaf("A"), leaf("B")], wait_for)
    assert str(caught.value) == (
        f"tree/x: a parallel of 2 can wait for 1 to 2 of them, not for {wait_for}"
    )  # fmt: skip


def test_details_say_what_the_mission_says(leaf: Any, site: Any) -> None:
    def detail(*args: Any, **more: Any) -> str:
        return Parallel(site(), [leaf("A"), leaf("B"), leaf("C")], *args, **more).detail

    assert detail() == detail(3) == "wait for all"
    assert detail(2) == "wait for 2 of 3"
    assert detail(1, halt=True) == "wait for 1 of 3, halt"
