"""Sequence and fallback without memory, as ReactiveSequence and ReactiveFallback of BehaviorTree.CPP."""

from __future__ import annotations

from typing import Any

import pytest
from build_nodes import sequence

from executive.events import BranchChosen, NodeStarted
from executive.tree.sequences import Fallback, Sequence
from tests.node_behaviours import build


def reactive(kind: Any, site: Any, children: Any) -> Any:
    return build(site("node"), kind, memory=False, do=children)


@pytest.mark.parametrize(
    ("kind", "first", "second", "statuses", "log"),
    [
        (Sequence, ("S",), ("R R S",), "RRS", ["A starts", "B starts", "A starts", "A starts"]),
        (Sequence, ("S", "lost"), ("R R S",), "RF", ["A starts", "B starts", "A starts", "B halted"]),
        (Sequence, ("S", "R S"), ("R S", "S"), "RRS",
         ["A starts", "B starts", "A starts", "B halted", "B starts"]),
        (Sequence, ("R S",), ("lost",), "RF", ["A starts", "B starts"]),
        (Fallback, ("lost",), ("R R S",), "RRS", ["A starts", "B starts", "A starts", "A starts"]),
        (Fallback, ("lost", "S"), ("R R S",), "RS", ["A starts", "B starts", "A starts", "B halted"]),
        (Fallback, ("lost", "R lost"), ("R S", "S"), "RRS",
         ["A starts", "B starts", "A starts", "B halted", "B starts"]),
        (Fallback, ("lost",), ("R off",), "RF", ["A starts", "B starts", "A starts"]),
    ],
)  # fmt: skip
def test_a_node_without_memory_begins_every_tick_with_its_first_child(
    leaf: Any, site: Any, ticks: Any, kind: Any, first: Any, second: Any, statuses: str, log: Any,
    request: Any,
) -> None:  # fmt: skip
    node = reactive(kind, site, [leaf("A", *first), leaf("B", *second)])
    assert ticks(node) == statuses
    assert request.getfixturevalue("log") == log


def test_a_repeated_check_with_an_equal_result_is_no_event(
    leaf: Any, site: Any, ticks: Any, events: Any
) -> None:
    check = sequence(site("node/check"), [leaf("A", "S")])
    work = sequence(site("node/work"), [leaf("B", "R " * 5 + "S")])
    assert ticks(reactive(Sequence, site, [check, work])) == "RRRRRS"
    assert [event.node for event in events if isinstance(event, NodeStarted)] == [
        "node", "node/check", "node/work",
    ]  # fmt: skip


def test_a_fallback_reports_its_choice_only_when_the_choice_changes(
    leaf: Any, site: Any, ticks: Any, events: Any
) -> None:
    ticks(reactive(Fallback, site, [leaf("A", "lost"), leaf("B", "R R R S")]))
    assert [event.choice for event in events if isinstance(event, BranchChosen)] == ["choice 2 of 2"]
