"""Retry, repeat and while."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status
from scripted_leaf import Leaf

from executive.control.node import Site
from executive.control.repeat import Repeat
from executive.control.retry import Retry
from executive.control.sequence import Sequence
from executive.control.while_loop import While
from executive.errors import InputError


def test_a_retry_tries_again_in_the_tick_of_the_failure(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Retry(site(), leaf("A", "R lost", "R S"), 3)) == "RRS"
    assert log == ["A starts"] * 2


def test_an_exhausted_retry_passes_on_its_last_failure(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Retry(site(), leaf("A", "R lost", "R stuck"), 2)
    assert ticks(node) == "RRF"
    assert str(node.failure) == "A.stuck"
    assert log == ["A starts"] * 2


def test_a_retry_counts_anew_every_time(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Retry(site(), leaf("A", "R lost"), 2)
    ticks(node)
    ticks(node)
    assert len(log) == 4


def test_only_failures_on_the_list_are_tried_again(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Retry(site(), leaf("A", "R lost", "R stuck", "R S"), 5, [("A", "lost")])
    assert ticks(node) == "RRF"
    assert str(node.failure) == "A.stuck"


def test_a_recovery_runs_between_attempts_only(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Retry(site(), leaf("A", "R lost"), 3, [("A", "lost")], leaf("fix", "R S"))
    ticks(node)
    assert log == ["A starts", "fix starts", "A starts", "fix starts", "A starts"]


def test_a_failed_recovery_fails_with_what_came_before(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = Retry(site(), leaf("A", "R lost"), 3, [], leaf("fix", "R broken"))
    assert ticks(node) == "RRF"
    assert str(node.failure) == "A.lost"
    choices = [(event["choice"], event["reason"]) for event in events if event["kind"] == "choice"]
    assert choices == [("attempt 2 of 3", "A.lost"), ("give up: the recovery failed", "fix.broken")]


def test_attempts_that_take_no_time_wait_for_the_next_tick(leaf: Any, site: Any, ticks: Any) -> None:
    assert ticks(Retry(site(), leaf("A", "lost"), 3)) == "RRF"
    assert ticks(Retry(site(), leaf("A", "lost"), 3, [], leaf("fix"))) == "RRF"


def test_a_retry_halted_in_its_recovery_begins_with_the_body(leaf: Any, site: Any, log: Any) -> None:
    node = Retry(site(), leaf("A", "lost"), 3, [], leaf("fix", "R S"))
    node.tick_once()
    node.stop(Status.INVALID)
    assert log == ["A starts", "fix starts", "fix halted"]
    node.tick_once()
    assert log[3] == "A starts"


def test_repeat_counts_its_rounds(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Repeat(site(), leaf("A", "R S"), times=3)) == "RRRS"
    assert len(log) == 3


def test_repeat_zero_times_does_nothing(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Repeat(site(), leaf("A"), times=0)) == "S"
    assert log == []


def test_repeat_until_a_failure_is_a_success(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Repeat(site(), leaf("A", "R S", "R S", "empty"), until=[("A", "empty")])
    assert ticks(node) == "RRS"
    assert node.failure is None


@pytest.mark.parametrize(
    ("scripts", "end", "rounds"),
    [(("R S", "empty"), "RS", 2), (("R S",), "RRRS", 3), (("R S", "R S", "lost"), "RRF", 3)],
)
def test_of_times_and_until_the_first_to_come_ends_it(
    scripts: tuple[str, ...], end: str, rounds: int, leaf: Any, site: Any, ticks: Any, log: Any
) -> None:
    assert ticks(Repeat(site(), leaf("A", *scripts), times=3, until=[("A", "empty")])) == end
    assert log == ["A starts"] * rounds


def test_other_failures_of_the_body_are_passed_on(leaf: Any, site: Any, ticks: Any) -> None:
    node = Repeat(site(), leaf("A", "R S", "lost"), until=[("A", "empty")])
    assert ticks(node) == "RF"
    assert str(node.failure) == "A.lost"


def test_a_body_that_takes_no_time_does_not_hold_the_tick(leaf: Any, site: Any, ticks: Any) -> None:
    assert ticks(Repeat(site(), leaf("A"), until=[("A", "empty")]), most=20) == "R" * 20
    assert ticks(Repeat(site(), leaf("A"), times=3)) == "RRS"


def test_a_body_is_not_repeated_a_negative_number_of_times(leaf: Any, site: Any) -> None:
    with pytest.raises(InputError, match="tree/x: a body can be repeated 0 times or more, not -1 times"):
        Repeat(site("tree/x"), leaf("A"), times=-1)


def test_while_checks_its_condition_before_every_round(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    condition = leaf("more", "R S", "S", "R none")
    assert ticks(While(site(), condition, leaf("A", "R S"))) == "RRRRS"
    assert log == ["more starts", "A starts", "more starts", "A starts", "more starts"]


def test_a_failed_condition_is_a_success_that_is_told(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = While(site("here"), leaf("more", "none"), leaf("A"))
    assert ticks(node) == "S"
    assert node.failure is None
    assert events[1] == {
        "kind": "choice", "node": "here", "choice": "done", "reason": "more.none", "message": "none happened",
    }  # fmt: skip


def test_while_passes_on_a_failure_of_its_body(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = While(site(), leaf("more"), leaf("A", "R S", "R lost"))
    assert ticks(node) == "RRF"
    assert str(node.failure) == "A.lost"


def test_while_does_not_hold_the_tick(leaf: Any, site: Any, ticks: Any) -> None:
    assert ticks(While(site(), leaf("more"), leaf("A")), most=20) == "R" * 20
    assert ticks(While(site(), leaf("more", "R S", "none"), leaf("A"))) == "RS"


def test_while_halted_in_its_body_begins_with_its_condition(leaf: Any, site: Any, log: Any) -> None:
    node = While(site(), leaf("more"), leaf("A", "R S"))
    node.tick_once()
    node.stop(Status.INVALID)
    node.tick_once()
    assert log == ["more starts", "A starts", "A halted", "more starts", "A starts"]


def test_nested_loops_do_not_hold_the_tick(leaf: Any, site: Any, ticks: Any) -> None:
    inner = Repeat(site("inner"), leaf("A"), times=2)
    assert ticks(Repeat(site(), inner, times=2)) == "RRS"


def test_a_retry_makes_at_least_one_attempt(leaf: Any, site: Any) -> None:
    with pytest.raises(InputError, match="tree/x: a retry makes 1 attempt or more, not 0"):
        Retry(site("tree/x"), leaf("A"), 0)


@given(attempts=st.integers(1, 6), failures=st.integers(0, 8), took=st.booleans())
def test_a_retry_succeeds_if_there_are_enough_attempts(attempts: int, failures: int, took: bool) -> None:
    wait = "R " if took else ""
    log: list[str] = []
    node = Retry(Site("node"), Leaf("A", (f"{wait}lost",) * failures + (f"{wait}S",), log), attempts)
    for _ in range(30):
        node.tick_once()
        if node.status is not Status.RUNNING:
            break
    assert (node.status is Status.SUCCESS) == (failures < attempts)
    assert len(log) == min(failures + 1, attempts)


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
