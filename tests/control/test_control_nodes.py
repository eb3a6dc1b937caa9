"""Sequence, fallback, try, timeout, invert and succeed."""

from __future__ import annotations

from typing import Any

import py_trees
import pytest
from py_trees.common import Status

from executive.control.attempt import Try
from executive.control.fallback import Fallback
from executive.control.halting import halt
from executive.control.invert import Invert
from executive.control.sequence import Sequence
from executive.control.succeed import Succeed
from executive.control.timeout import Timeout
from executive.errors import Fault


def test_a_sequence_has_no_idle_ticks(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Sequence(site(), [leaf("A", "R S"), leaf("B"), leaf("C", "R S")])) == "RRS"
    assert log == ["A starts", "B starts", "C starts"]


def test_a_sequence_fails_with_the_first_failure(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Sequence(site(), [leaf("A"), leaf("B", "lost"), leaf("C")])
    assert ticks(node) == "F"
    assert (str(node.failure), node.failure.path) == ("B.lost", "B")
    assert log == ["A starts", "B starts"]


def test_a_sequence_begins_again_when_it_is_ticked_again(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    node = Sequence(site(), [leaf("A", "lost", "S")])
    assert ticks(node) + ticks(node) == "FS"
    assert node.failure is None


def test_a_fallback_takes_the_next_best_and_tells_why(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = Fallback(site(), [leaf("A", "R lost"), leaf("B"), leaf("C")])
    assert ticks(node) == "RS"
    (choice,) = [event for event in events if event["kind"] == "choice"]
    assert (choice["choice"], choice["reason"]) == ("choice 2 of 3", "A.lost")


def test_a_fallback_fails_with_the_last_failure(leaf: Any, site: Any, ticks: Any) -> None:
    node = Fallback(site(), [leaf("A", "lost"), leaf("B", "stuck")])
    assert ticks(node) == "F"
    assert str(node.failure) == "B.stuck"


def test_a_caught_failure_is_a_success(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    handlers = [([("B", "lost")], leaf("other")), ([("A", "lost"), ("A", "stuck")], leaf("rescue", "R S"))]
    assert ticks(Try(site(), leaf("A", "stuck"), handlers)) == "RS"
    assert log == ["A starts", "rescue starts"]


def test_an_uncaught_failure_passes_on(leaf: Any, site: Any, ticks: Any) -> None:
    node = Try(site(), leaf("A", "lost"), [([("A", "stuck")], leaf("rescue"))])
    assert ticks(node) == "F"
    assert str(node.failure) == "A.lost"


def test_a_failing_catch_fails_with_its_own_failure(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    handlers = [([("A", "lost")], leaf("rescue", "stuck")), ([("rescue", "stuck")], leaf("never"))]
    node = Try(site(), leaf("A", "lost"), handlers)
    assert ticks(node) == "F"
    assert str(node.failure) == "rescue.stuck"
    assert "never starts" not in log


@pytest.mark.parametrize(
    ("body", "caught", "finish", "end", "reason"),
    [
        ("S", "S", "R S", "RS", None),
        ("lost", "S", "S", "S", None),
        ("other", "S", "S", "F", "A.other"),
        ("lost", "stuck", "S", "F", "rescue.stuck"),
        ("S", "S", "late", "F", "finish.late"),
        ("other", "S", "late", "F", "A.other"),
    ],
)
def test_finally_runs_after_success_and_failure(
    body: str,
    caught: str,
    finish: str,
    end: str,
    reason: str | None,
    leaf: Any,
    site: Any,
    ticks: Any,
    log: Any,
) -> None:
    handlers = [([("A", "lost")], leaf("rescue", caught))]
    node = Try(site(), leaf("A", body), handlers, leaf("finish", finish))
    assert ticks(node) == end
    assert (str(node.failure) if node.failure else None) == reason
    assert log[-1] == "finish starts"


def test_finally_does_not_run_after_a_halt(leaf: Any, site: Any, log: Any) -> None:
    node = Try(site(), leaf("A", "R S"), [], leaf("finish"))
    node.tick_once()
    assert halt(node) == []
    assert log == ["A starts", "A halted"]


def test_finally_does_not_run_after_a_fault(leaf: Any, site: Any, log: Any) -> None:
    node = Try(site(), leaf("A", "!"), [([("A", "lost")], leaf("rescue"))], leaf("finish"))
    with pytest.raises(RuntimeError, match="broken"):
        node.tick_once()
    halt(node)
    assert log == ["A starts"]


def test_a_timeout_halts_its_body_and_says_timeout(leaf: Any, site: Any, clock: Any, log: Any) -> None:
    node = Timeout(site("here"), leaf("A", "R R R R"), 0.3, clock)
    for clock.now in (0.0, 0.1, 0.2, 0.1 + 0.2):
        node.tick_once()
    assert node.status is Status.FAILURE
    assert (str(node.failure), node.failure.message) == ("timeout.timeout", "not done after 0.3 s")
    assert log == ["A starts", "A halted"]


def test_a_body_that_ends_in_the_last_moment_has_made_it(leaf: Any, site: Any, clock: Any) -> None:
    node = Timeout(site(), leaf("A", "R S"), 0.3, clock)
    for clock.now in (0.0, 5.0):
        node.tick_once()
    assert node.status is Status.SUCCESS


def test_a_timeout_counts_anew_every_time(leaf: Any, site: Any, clock: Any) -> None:
    node = Timeout(site(), leaf("A", "R R S"), 0.3, clock)
    for clock.now in (1.0, 1.2):
        node.tick_once()
    assert node.status is Status.RUNNING


def test_a_body_that_cannot_be_halted_is_a_fault(leaf: Any, site: Any, clock: Any) -> None:
    body = leaf("A", "R R")
    body.breaks = True
    node = Timeout(site("here"), body, 0.1, clock)
    node.tick_once()
    clock.now = 1.0
    with pytest.raises(Fault, match="A: cannot stop") as caught:
        node.tick_once()
    assert caught.value.node == "here"


def test_invert_turns_the_result_round(leaf: Any, site: Any, ticks: Any) -> None:
    assert ticks(Invert(site(), leaf("A", "R lost"))) == "RS"
    node = Invert(site(), leaf("A", "R S"))
    assert ticks(node) == "RF"
    assert (str(node.failure), node.failure.message) == ("invert.inverted", "A succeeded")


def test_succeed_succeeds_in_any_case(leaf: Any, site: Any, ticks: Any) -> None:
    assert ticks(Succeed(site(), leaf("A", "R lost"))) == "RS"
    assert ticks(Succeed(site(), leaf("A"))) == "S"
    assert ticks(Succeed(site())) == "S"


def test_labels_gather_on_the_way_up(leaf: Any, site: Any, ticks: Any) -> None:
    inner = Sequence(site("tree/inner", "inner"), [leaf("A", "lost")])
    node = Sequence(site("tree", "outer"), [inner])
    ticks(node)
    for source in ("A", "inner", "outer"):
        assert node.failure.matches([(source, "lost")])
    assert not node.failure.matches([("B", "lost"), ("A", "stuck")])


def test_every_change_of_status_is_told_once(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    ticks(Sequence(site("tree"), [leaf("A", "R R lost")]))
    assert events == [
        {"kind": "status", "node": "tree", "status": "RUNNING"},
        {
            "kind": "status", "node": "tree", "status": "FAILURE",
            "reason": "A.lost", "message": "lost happened", "origin": "A",
        },
    ]  # fmt: skip


def test_a_stock_behaviour_may_stand_in_a_tree(site: Any, ticks: Any) -> None:
    node = Sequence(site("tree"), [py_trees.behaviours.Success("yes"), py_trees.behaviours.Failure("no")])
    assert ticks(node) == "F"
    assert str(node.failure) == "no.failed"


def test_a_tree_may_stand_in_a_stock_tree(leaf: Any, site: Any, log: Any) -> None:
    inner = Sequence(site("tree"), [leaf("A", "R S")])
    root = py_trees.composites.Sequence("root", True, [inner])
    root.tick_once()
    root.stop(Status.INVALID)
    assert log == ["A starts", "A halted"]
    root.tick_once()
    root.tick_once()
    assert root.status is Status.SUCCESS
