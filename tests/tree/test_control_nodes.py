"""Sequence, fallback, try, timeout, invert and succeed."""

from __future__ import annotations

from typing import Any

import py_trees
import pytest
from build_nodes import names_of, sequence, timeout, try_catch
from py_trees.common import Status

from executive.events import NodeEnded, NodeStarted
from executive.tree.tree_node import halt


def test_finally_runs_neither_after_a_halt_nor_after_a_fault(leaf: Any, site: Any, log: Any) -> None:
    node = try_catch(site(), leaf("A", "R S", "!"), [([("A", "lost")], leaf("rescue"))], leaf("finish"))
    node.tick_once()
    assert halt(node) == []
    with pytest.raises(RuntimeError, match="broken"):
        node.tick_once()
    halt(node)
    assert log == ["A starts", "A halted", "A starts"]


def test_a_timeout_halts_its_body_and_says_timeout(leaf: Any, site: Any, clock: Any, log: Any) -> None:
    node = timeout(site("here"), leaf("A", "R R R R"), 0.3, clock)
    for clock.now in (0.0, 0.1, 0.2, 0.1 + 0.2):
        node.tick_once()
    assert node.status is Status.FAILURE
    assert str(node.failure) == "timeout.timeout"
    assert node.failure.message == "the body did not end within 0.3 s"
    assert log == ["A starts", "A halted"]


@pytest.mark.parametrize(
    ("script", "times", "status"),
    [("R S", (0.0, 5.0), Status.SUCCESS), ("R R S", (1.0, 1.2), Status.RUNNING)],
)
def test_a_body_has_its_time(
    leaf: Any, site: Any, clock: Any, script: str, times: tuple[float, ...], status: Status
) -> None:
    node = timeout(site(), leaf("A", script), 0.3, clock)
    for clock.now in times:
        node.tick_once()
    assert node.status is status


def test_labels_gather_on_the_way_up(leaf: Any, site: Any, ticks: Any) -> None:
    inner = sequence(site("tree/inner", "inner"), [leaf("A", "lost")])
    node = sequence(site("tree", "outer"), [inner])
    ticks(node)
    for source in ("A", "inner", "outer"):
        assert node.failure.matches(names_of([(source, "lost")]))
    assert not node.failure.matches(names_of([("B", "lost"), ("A", "stuck")]))


def test_every_change_of_status_is_reported_once(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    ticks(sequence(site("tree"), [leaf("A", "R R lost")]))
    assert events == [
        NodeStarted("tree"),
        NodeEnded("tree", "FAILURE", reason="A.lost", message="lost happened", origin="A"),
    ]


def test_a_stock_behaviour_may_stand_in_a_tree(site: Any, ticks: Any) -> None:
    node = sequence(site("tree"), [py_trees.behaviours.Success("yes"), py_trees.behaviours.Failure("no")])
    assert (ticks(node), str(node.failure)) == ("F", "no.failed")


def test_a_tree_may_stand_in_a_stock_tree(leaf: Any, site: Any, log: Any) -> None:
    inner = sequence(site("tree"), [leaf("A", "R S")])
    root = py_trees.composites.Sequence("root", True, [inner])
    root.tick_once()
    root.stop(Status.INVALID)
    assert log == ["A starts", "A halted"]
    root.tick_once()
    root.tick_once()
    assert root.status is Status.SUCCESS
