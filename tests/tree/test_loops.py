"""Retry, repeat and while."""

from __future__ import annotations

from typing import Any

import pytest
from py_trees.common import Status

from executive.errors import InputError
from executive.events import BranchChosen
from executive.tree.repeat import Repeat
from executive.tree.retry import Retry
from executive.tree.sequence import Sequence
from executive.tree.while_loop import While


def test_a_failed_condition_is_a_success_that_is_told(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = While(site("here"), leaf("more", "none"), leaf("A"))
    assert ticks(node) == "S"
    assert node.failure is None
    assert events[1] == BranchChosen("here", "done", "more.none", "none happened")


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


def test_a_number_of_rounds_that_makes_no_sense_is_refused(leaf: Any, site: Any) -> None:
    with pytest.raises(InputError, match="tree/x: a body can be repeated 0 times or more, not -1 times"):
        Repeat(site("tree/x"), leaf("A"), times=-1)
    with pytest.raises(InputError, match="tree/x: a retry makes 1 attempt or more, not 0"):
        Retry(site("tree/x"), leaf("A"), 0)
