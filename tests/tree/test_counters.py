"""Counters of the run that end a repeat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from build_nodes import repeat

from executive.events import BranchChosen
from executive.tree.tree_node import NodeContext


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
    assert choices(events) == [f"done, {name}: 2"]


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
    assert (log, choices(events)) == ([], ["done, placed: 4"])


def test_a_reason_and_a_number_of_iterations_end_the_loop_as_before(
    leaf: Any, counting_site: NodeContext, ticks: Any, events: list[Any]
) -> None:
    assert ticks(repeat(counting_site, leaf("A", "S", "lost"), until=[("A", "lost")], placed=4)) == "RS"
    assert choices(events) == ["done"]
    assert ticks(repeat(counting_site, leaf("A"), times=3, placed=4)) == "RRS"
    assert choices(events) == ["done"]


def test_details_name_the_limits(leaf: Any, counting_site: NodeContext) -> None:
    node = repeat(counting_site, leaf("A"), until=[("A", "lost")], placed=4, elapsed=1.5)
    assert node.detail == "until A.lost, placed: 4, elapsed: 1.5"
