"""Loops with their delays and counters, and parallel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from build_nodes import make_backoff, parallel, repeat, retry, while_loop
from py_trees.common import Status

from executive.errors import Fault
from executive.events import BranchChosen, NodeEnded
from executive.tree.blackboard import NodeContext
from executive.tree.keys import key
from executive.tree.loops import GeneratorBehaviour, NodeRun
from executive.tree.node import ControlNode
from executive.tree.retry import Backoff, Retry
from executive.tree.specification import Child
from tests.node_behaviours import build


def test_a_failed_condition_is_a_success_with_a_report(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = while_loop(site("here"), leaf("more", "none"), leaf("A"))
    assert ticks(node) == "S"
    assert node.failure is None
    assert events[1] == BranchChosen("here", "done", "more.none", "none happened")


def test_the_generator_of_a_halted_node_is_closed_before_the_node_ends(
    leaf: Any, site: Any, events: Any
) -> None:
    class Lamp(ControlNode):
        keyword = "lamp"
        do: Child = key(doc="Body.")

        class Behaviour(GeneratorBehaviour):
            def run(self) -> NodeRun:
                try:
                    return (yield from self.run_child(self.node.do))
                finally:
                    self.report_choice("lamp off")

    node = build(site("here"), Lamp, do=leaf("A", "R"))
    node.tick_once()
    node.stop()
    assert events[-2:] == [BranchChosen("here", "lamp off", "", ""), NodeEnded("here", "INVALID")]


def test_a_run_that_advances_the_run_of_its_child_continues_at_every_tick(
    leaf: Any, site: Any, ticks: Any
) -> None:
    class Limit(ControlNode):
        keyword = "limit"
        do: Child = key(doc="Body.")

        class Behaviour(GeneratorBehaviour):
            def run(self) -> NodeRun:
                for tick, _ in enumerate(self.run_child(self.node.do)):
                    if tick == 2:
                        self.halt_children([self.node.do])
                        return None
                    yield None

    assert ticks(build(site("here"), Limit, do=leaf("A", "R R R R R S"))) == "RRS"


def test_details_say_what_the_mission_says(leaf: Any, site: Any) -> None:
    assert retry(site(), leaf("A"), 4).detail == "up to 4 attempts, on any failure"
    assert repeat(site(), leaf("A"), until=[("A", "lost"), ("B", "x")]).detail == "until A.lost, B.x"
    assert repeat(site(), leaf("A"), times=3).detail == "3 times"
    assert repeat(site(), leaf("A"), 3, [("A", "lost")]).detail == "3 times or until A.lost"


@pytest.mark.parametrize(
    ("backoff", "delays"),
    [
        (make_backoff(0.5), [0.5, 0.5, 0.5, 0.5]),
        (make_backoff(0.5, 2), [0.5, 1.0, 2.0, 4.0]),
        (make_backoff(0.5, 3, max=2.0), [0.5, 1.5, 2.0, 2.0]),
        (make_backoff(3.0, max=2.0), [2.0, 2.0, 2.0, 2.0]),
    ],
)
def test_waits_grow_by_the_factor_up_to_the_most(backoff: Backoff, delays: list[float]) -> None:
    assert [backoff.compute_delay(attempt) for attempt in range(1, 5)] == delays


@pytest.mark.parametrize("factor", [2, 2.0])
def test_no_number_of_attempts_is_too_large(factor: float) -> None:
    assert make_backoff(0.5, factor, max=8.0).compute_delay(100_000) == 8.0


def runs(node: Retry, clock: Any, times: list[float]) -> str:
    """Tick at these times and return every status by its first letter."""
    seen = ""
    for clock.now in times:
        node.tick_once()
        seen += node.status.value[0]
    return seen


def test_a_retry_waits_on_the_clock_then_recovers_then_tries_again(
    leaf: Any, site: Any, clock: Any, log: Any
) -> None:
    body = leaf("A", "R lost", "S")
    fix = leaf("fix", "R S")
    node = retry(site(), body, 3, [], fix, make_backoff(0.5), clock)
    assert (runs(node, clock, [0.0, 0.125, 0.25, 0.5]), log) == ("RRRR", ["A starts"])
    assert (body.status, fix.status) == (Status.FAILURE, Status.INVALID)
    # Half a second after the failure at 0.125 s.
    assert (runs(node, clock, [0.625]), log) == ("R", ["A starts", "fix starts"])
    assert (runs(node, clock, [0.75]), log) == ("S", ["A starts", "fix starts", "A starts"])


def test_the_wait_is_reported_and_shown_in_the_detail(leaf: Any, site: Any, clock: Any, events: Any) -> None:
    node = retry(site(), leaf("A", "lost"), 3, [("A", "lost")], None, make_backoff(0.5, 2, 8), clock)
    node.tick_once()
    assert (events[-1].choice, events[-1].reason) == ("attempt 2 of 3 in 0.5 s", "A.lost")
    assert node.detail == "up to 3 attempts, on A.lost, backoff 0.5 s, factor 2, at most 8 s"


@pytest.fixture
def counts() -> dict[str, float]:
    """The counters of the run."""
    return {"placed": 0, "rejected": 0, "elapsed": 0.0}


class ElapsedClock:
    """Clock that shows the counter `elapsed`."""

    def __init__(self, counts: dict[str, float]) -> None:
        self.counts = counts

    @property
    def now(self) -> float:
        return self.counts["elapsed"]


@pytest.fixture
def counting_site(site: Callable[..., NodeContext], counts: dict[str, float]) -> NodeContext:
    ledger: Any = SimpleNamespace(count_items=counts.__getitem__)
    clock: Any = ElapsedClock(counts)
    return replace(site("here"), ledger=ledger, clock=clock)


def choices(events: list[Any]) -> list[str]:
    return [event.choice for event in events if isinstance(event, BranchChosen)]


def tick(node: Any) -> str:
    node.tick_once()
    return node.status.value[0]


@pytest.mark.parametrize("name", ["placed", "rejected", "elapsed"])
def test_the_loop_ends_when_a_counter_reaches_its_limit_and_says_which(
    leaf: Any, counting_site: NodeContext, counts: dict[str, float], events: list[Any], name: str
) -> None:
    node = repeat(counting_site, leaf("A"), **{"placed": 9, "rejected": 9, "elapsed": 9, name: 2})
    assert tick(node) == "R"
    counts[name] = 1
    assert tick(node) == "R"
    counts[name] = 2
    assert tick(node) == "S"
    assert choices(events) == [f"done, run.{name} >= 2"]


def test_the_last_iteration_is_not_interrupted(
    leaf: Any, counting_site: NodeContext, counts: dict[str, float], log: list[str]
) -> None:
    node = repeat(counting_site, leaf("A", "R R S"), placed=1)
    assert tick(node) == "R"
    counts["placed"] = 1
    assert [tick(node), tick(node)] == ["R", "S"]
    assert log == ["A starts"]


def test_the_counters_are_read_before_the_first_iteration(
    leaf: Any, counting_site: NodeContext, counts: dict[str, float], log: list[str], events: list[Any]
) -> None:
    counts["placed"] = 5
    assert tick(repeat(counting_site, leaf("A"), placed=4)) == "S"
    assert (log, choices(events)) == ([], ["done, run.placed >= 4"])


def test_a_reason_and_a_number_of_iterations_end_the_loop_as_before(
    leaf: Any, counting_site: NodeContext, ticks: Any, events: list[Any]
) -> None:
    assert ticks(repeat(counting_site, leaf("A", "S", "lost"), until=[("A", "lost")], placed=4)) == "RS"
    assert choices(events) == ["done"]
    assert ticks(repeat(counting_site, leaf("A"), times=3, placed=4)) == "RRS"
    assert choices(events) == ["done"]


def test_all_that_cannot_be_halted_are_named(leaf: Any, site: Any, log: Any) -> None:
    children = [leaf("A", "R R"), leaf("B", "R S"), leaf("C", "R R"), leaf("D", "R R")]
    for child in (children[0], children[2]):
        child.breaks = True
    node = parallel(site("here"), children, 1)
    node.tick_once()
    with pytest.raises(Fault) as caught:
        node.tick_once()
    assert str(caught.value) == "A: RuntimeError: cannot stop; C: RuntimeError: cannot stop"
    assert caught.value.node == "here"
    assert log[4:] == ["A halted", "C halted", "D halted"]
    assert all(child.status is not Status.RUNNING for child in children)
