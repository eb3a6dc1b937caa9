"""What py_trees' own nodes do and ours must not, one test each."""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterator
from typing import Any

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from scripted_leaf import Leaf

from executive.control.attempt import Try
from executive.control.backoff import Backoff
from executive.control.fallback import Fallback
from executive.control.for_each import ForEach
from executive.control.halting import halt
from executive.control.invert import Invert
from executive.control.node import ControlNode
from executive.control.parallel import Parallel
from executive.control.repeat import Repeat
from executive.control.retry import Retry
from executive.control.scope import Scope
from executive.control.sequence import Sequence
from executive.control.succeed import Succeed
from executive.control.timeout import Timeout
from executive.control.while_loop import While
from executive.errors import Fault, InputError


class Terminated(Leaf):
    """A leaf that notes every `terminate`, whatever for."""

    def terminate(self, new_status: Status) -> None:
        self._log.append(f"{self.name}: {self.status.value} to {new_status.value}")


class Returning(Behaviour):
    """Returns from `update` whatever it is told to."""

    def __init__(self, value: Any) -> None:
        super().__init__("odd")
        self.value = value

    def update(self) -> Any:
        return self.value


@pytest.mark.parametrize("kind", [Sequence, Fallback, Parallel])
def test_children_that_finished_are_not_terminated_by_a_new_round_nor_by_a_halt(kind: Any, site: Any) -> None:
    log: list[str] = []
    end = "lost" if kind is Fallback else "S"
    node = kind(site(), [Terminated("A", (end,), log), Terminated("B", ("S", "R R"), log)])
    node.tick_once()
    node.tick_once()
    halt(node)
    status = Status.FAILURE if kind is Fallback else Status.SUCCESS
    told = [line for line in log if line.startswith("A: ")]
    # Its own end, once a round, and nothing else.
    assert told == [f"A: INVALID to {status.value}", f"A: {status.value} to {status.value}"]


def test_halting_does_not_reach_a_child_that_never_ran(leaf: Any, site: Any) -> None:
    log: list[str] = []
    never = Terminated("never", ("S",), log)
    node = Sequence(site(), [leaf("A", "R"), Invert(site("invert"), never)])
    node.tick_once()
    halt(node)
    node.stop(Status.INVALID)
    assert log == []


def test_earlier_children_are_not_run_again_while_a_later_one_runs(
    leaf: Any, site: Any, ticks: Any, log: Any
) -> None:
    assert ticks(Sequence(site(), [leaf("A"), leaf("B", "R R R S")])) == "RRRS"
    assert ticks(Fallback(site(), [leaf("C", "lost"), leaf("D", "R R R S")])) == "RRRS"
    assert log == ["A starts", "B starts", "C starts", "D starts"]


def test_children_that_succeeded_are_not_run_again_beside_one_that_runs(
    leaf: Any, site: Any, ticks: Any, log: Any
) -> None:
    assert ticks(Parallel(site(), [leaf("A"), leaf("B", "R R R S"), leaf("C", "R S")])) == "RRRS"
    assert log == ["A starts", "B starts", "C starts"]


def test_a_success_counts_although_another_child_failed_in_the_same_tick(
    leaf: Any, site: Any, ticks: Any
) -> None:
    assert ticks(Parallel(site(), [leaf("A", "R lost"), leaf("B", "R S")], 1)) == "RS"


def test_the_old_status_of_a_child_that_was_not_ticked_decides_nothing_and_is_told_to_nobody(
    leaf: Any, site: Any, ticks: Any, events: Any
) -> None:
    tried = Sequence(site("tried"), [leaf("A", "lost", "S", "lost")])
    ghost = Sequence(site("ghost"), [leaf("B", "S", "lost")])
    node = Fallback(site("root"), [tried, ghost])
    assert ticks(node) == "S"
    assert ghost.status is Status.SUCCESS
    events.clear()
    assert ticks(node) == "S"
    assert "ghost" not in {event["node"] for event in events}
    # Nor is it taken for a success later on, when the node does get there.
    assert ticks(node) == "F"


@pytest.mark.parametrize("attempts", [0, -1])
def test_no_attempt_at_all_is_refused_and_not_one_attempt(attempts: int, leaf: Any, site: Any) -> None:
    with pytest.raises(InputError, match=f"a retry makes 1 attempt or more, not {attempts}"):
        Retry(site(), leaf("A"), attempts)


def test_repeating_zero_times_ends_at_once(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(Repeat(site(), leaf("A"), times=0)) == "S"
    assert log == []


def test_an_attempt_or_a_round_costs_no_tick_of_its_own(leaf: Any, site: Any, ticks: Any) -> None:
    # Three bodies that hand back one tick each: three ticks, and the one in which the last ends.
    assert ticks(Retry(site(), leaf("A", "R lost", "R lost", "R S"), 3)) == "RRRS"
    assert ticks(Repeat(site(), leaf("A", "R S"), times=3)) == "RRRS"
    assert ticks(ForEach(site(), leaf("A", "R S"), Scope(), "it", [1, 2, 3])) == "RRRS"
    assert ticks(While(site(), leaf("more", "S", "S", "S", "no"), leaf("A", "R S"))) == "RRRS"


def test_an_exception_in_one_child_leaves_no_sibling_running_once_the_tree_is_halted(
    leaf: Any, site: Any, log: Any
) -> None:
    siblings = [leaf("A", "R R R"), leaf("B", "R !"), leaf("C", "R R R")]
    root = Sequence(site("root"), [Parallel(site("both"), siblings)])
    root.tick_once()
    with pytest.raises(RuntimeError, match="broken"):
        root.tick_once()
    assert halt(root) == []
    assert log[3:] == ["A halted", "B halted", "C halted"]
    assert all(node.status is not Status.RUNNING for node in root.iterate())


@pytest.mark.parametrize("end", [halt, lambda root: root.stop(Status.INVALID)])
def test_an_exception_in_one_clean_up_does_not_abort_the_halt(
    end: Any, leaf: Any, site: Any, log: Any
) -> None:
    siblings = [leaf("A", "R R"), leaf("B", "R R"), leaf("C", "R R")]
    siblings[0].breaks = siblings[1].breaks = True
    root = Sequence(site("root"), [Parallel(site("both"), siblings)])
    root.tick_once()
    try:
        problems = end(root)
    except Fault as fault:
        problems = str(fault).split("; ")
    assert problems == ["A: cannot stop", "B: cannot stop"]
    assert log[3:] == ["A halted", "B halted", "C halted"]
    assert all(node.status is Status.INVALID for node in root.iterate())


def one_of_each(site: Any, body: Behaviour, clock: Any) -> Iterator[ControlNode]:
    """Yield a tree of one node of every kind that has one body, each above the one before."""
    kinds: list[Any] = [
        lambda where, node: Sequence(where, [node]),
        lambda where, node: Fallback(where, [node]),
        lambda where, node: Parallel(where, [node]),
        lambda where, node: Retry(where, node, 2),
        lambda where, node: Repeat(where, node, 2),
        lambda where, node: While(where, Succeed(where), node),
        lambda where, node: ForEach(where, node, Scope(), "it", [1, 2]),
        lambda where, node: Try(where, node),
        lambda where, node: Timeout(where, node, 1e6, clock),
        lambda where, node: Invert(where, node),
        lambda where, node: Succeed(where, node),
    ]
    for level, kind in enumerate(kinds, 1):
        body = kind(site(f"level {level}"), body)
        yield body


def test_every_node_ends_after_what_runs_below_it(site: Any, clock: Any, leaf: Any, events: Any) -> None:
    *_, root = one_of_each(site, leaf("A", "R R"), clock)
    root.tick_once()
    events.clear()
    assert halt(root) == []
    assert [event["node"] for event in events] == [f"level {level}" for level in range(1, 12)]


def test_nothing_depends_on_the_clock_on_the_wall(
    leaf: Any, site: Any, clock: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forbidden() -> float:
        raise AssertionError("looked at the clock on the wall")

    for name in ("time", "monotonic", "perf_counter"):
        monkeypatch.setattr(time, name, forbidden)
    late = Timeout(site(), leaf("A", "R R R"), 0.25, clock)
    waits = Retry(site(), leaf("B", "lost", "S"), 2, [], None, Backoff(0.25), clock)
    for clock.now in (0.0, 0.125, 0.25):
        late.tick_once()
        waits.tick_once()
    assert (late.status, waits.status) == (Status.FAILURE, Status.SUCCESS)


def test_two_trees_with_the_same_names_share_no_variable_and_leave_nothing_in_the_process(
    leaf: Any, site: Any
) -> None:
    board = py_trees.blackboard.Blackboard
    before = dict(board.storage), len(board.clients)
    scopes = [Scope(), Scope()]
    nodes = [ForEach(site(), leaf("A", "R S"), scope, "it", [n]) for n, scope in enumerate(scopes)]
    for node in nodes:
        node.tick_once()
    assert [dict(scope) for scope in scopes] == [{"it": 0}, {"it": 1}]
    assert (dict(board.storage), len(board.clients)) == before


def test_for_an_empty_list_the_body_does_not_run(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(ForEach(site(), leaf("A"), Scope(), "it", [])) == "S"
    assert log == []


def test_an_element_that_is_none_does_not_end_the_list(leaf: Any, site: Any, ticks: Any, log: Any) -> None:
    assert ticks(ForEach(site(), leaf("A", "R S"), Scope(), "it", [1, None, 3])) == "RRRS"
    assert log == ["A starts"] * 3


def test_the_next_tick_goes_on_with_the_element_at_hand(leaf: Any, site: Any) -> None:
    scope = Scope()
    node = ForEach(site(), leaf("A", "R S", "R R S"), scope, "it", [1, 2])
    seen = []
    while node.status is not Status.SUCCESS:
        node.tick_once()
        seen.append(scope.get("it"))
    assert seen == [1, 2, 2, None]


def test_no_element_is_left_in_its_variable_after_a_halt(leaf: Any, site: Any) -> None:
    scope = Scope()
    node = ForEach(site(), leaf("A", "R R"), scope, "it", [1, 2])
    node.tick_once()
    halt(node)
    assert dict(scope) == {}


def test_nothing_survives_a_halt_that_a_second_run_would_skip_or_count_on(
    leaf: Any, site: Any, clock: Any, ticks: Any, log: Any
) -> None:
    def trees() -> Iterator[ControlNode]:
        yield Sequence(site(), [leaf("A", "R S"), leaf("B", "R R S")])
        yield Fallback(site(), [leaf("A", "R lost"), leaf("B", "R R S")])
        yield Parallel(site(), [leaf("A", "R S"), leaf("B", "R R R S")])
        yield Retry(site(), leaf("A", "R lost"), 3)
        yield Repeat(site(), leaf("A", "R S"), 3)
        yield While(site(), leaf("more", "R S"), leaf("A", "R lost"))
        yield ForEach(site(), leaf("A", "R S"), Scope(), "it", [1, 2, 3])
        yield Try(site(), leaf("A", "R lost"), [([("A", "lost")], leaf("B", "R R S"))])
        yield Timeout(site(), leaf("A", "R R R S"), 1.0, clock)

    for fresh, used in zip(trees(), trees(), strict=True):
        log.clear()
        expected = ticks(fresh), list(log)
        for _ in range(3):
            used.tick_once()
        assert halt(used) == []
        log.clear()
        assert (ticks(used), log) == expected


def test_a_tree_as_deep_as_the_language_allows_is_far_from_the_end_of_the_stack(
    site: Any, clock: Any
) -> None:
    deepest = []

    class Deep(Behaviour):
        def update(self) -> Status:
            deepest.append(len(inspect.stack(0)))
            return Status.RUNNING

        def terminate(self, new_status: Status) -> None:
            deepest.append(len(inspect.stack(0)))

    root: Behaviour = Deep("deep")
    for _ in range(4):
        *_, root = one_of_each(site, root, clock)
    here = len(inspect.stack(0))
    root.tick_once()
    assert halt(root) == []
    # 44 levels, of the 1000 frames that Python allows.
    assert len(deepest) == 2
    assert max(deepest) - here < 250


@pytest.mark.parametrize("value", [None, Status.INVALID, "SUCCESS"])
def test_a_node_without_a_status_is_a_fault_and_not_an_interruption(value: Any, leaf: Any, site: Any) -> None:
    sequence = Sequence(site("here"), [Returning(value), leaf("after")])
    root = Fallback(site("root"), [sequence, leaf("instead")])
    with pytest.raises(Fault, match="odd was ticked and has no status") as caught:
        root.tick_once()
    assert caught.value.node == "here"
    assert halt(root) == []
