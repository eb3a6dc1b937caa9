"""Retry, repeat and while."""

from __future__ import annotations

from typing import Any

import pytest
from py_trees.common import Status

from executive.control.repeat import Repeat
from executive.control.retry import Retry
from executive.control.sequence import Sequence
from executive.control.while_loop import While
from executive.errors import InputError


def test_a_retry_halted_in_its_recovery_begins_with_the_body(leaf: Any, site: Any, log: Any) -> None:
    node = Retry(site(), leaf("A", "lost"), 3, [], leaf("fix", "R S"))
    node.tick_once()
    node.stop(Status.INVALID)
    assert log == ["A starts", "fix starts", "fix halted"]
    node.tick_once()
    assert log[3] == "A starts"


def test_a_body_is_not_repeated_a_negative_number_of_times(leaf: Any, site: Any) -> None:
    with pytest.raises(InputError, match="tree/x: a body can be repeated 0 times or more, not -1 times"):
        Repeat(site("tree/x"), leaf("A"), times=-1)


def test_a_failed_condition_is_a_success_that_is_told(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = While(site("here"), leaf("more", "none"), leaf("A"))
    assert ticks(node) == "S"
    assert node.failure is None
    assert events[1] == {
        "kind": "choice", "node": "here", "choice": "done", "reason": "more.none", "message": "none happened",
    }  # fmt: skip


def test_while_halted_in_its_body_begins_with_its_condition(leaf: Any, site: Any, log: Any) -> None:
    node = While(site(), leaf("more"), leaf("A", "R S"))
    node.tick_once()
    node.stop(Status.INVALID)
    node.tick_once()
    assert log == ["more starts", "A starts", "A halted", "more starts", "A starts"]


def test_a_retry_makes_at_least_one_attempt(leaf: Any, site: Any) -> None:
    with pytest.raises(InputError, match="tree/x: a retry makes 1 attempt or more, not 0"):
        Retry(site("tree/x"), leaf("A"), 0)


def test_a_loop_of_many_rounds_needs_no_deep_stack(leaf: Any, site: Any) -> None:
    node = Repeat(site(), Sequence(site("s"), [leaf("A", "R S")]), times=5000)
    for _ in range(5001):
        node.tick_once()
    assert node.status is Status.SUCCESS


@pytest.mark.parametrize("attempts", [1, 4])
def test_details_say_what_the_mission_says(leaf: Any, site: Any, attempts: int) -> None:
    assert Retry(site(), leaf("A"), attempts).detail == f"up to {attempts} attempts, on any failure"
    assert Repeat(site(), leaf("A"), until=[("A", "lost"), ("B", "x")]).detail == "until A.lost, B.x"
    assert Repeat(site(), leaf("A"), times=3).detail == "3 times"
    assert Repeat(site(), leaf("A"), 3, [("A", "lost")]).detail == "3 times or until A.lost"
