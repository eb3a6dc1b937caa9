"""Halting: every running node ends once, children first, whatever the others do."""

from __future__ import annotations

from typing import Any

from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel

from executive.control.halting import halt
from executive.control.sequence import Sequence


def running(leaf: Any, site: Any) -> Any:
    siblings = [leaf("A", "R R"), leaf("B", "R R")]
    both = Parallel("both", ParallelPolicy.SuccessOnAll(), siblings)
    root = Sequence(site("root"), [leaf("done"), both, leaf("later")])
    root.tick_once()
    return root, siblings


def test_only_running_nodes_are_halted(leaf: Any, site: Any, log: Any) -> None:
    root, _ = running(leaf, site)
    assert halt(root) == []
    assert log == ["done starts", "A starts", "B starts", "A halted", "B halted"]
    assert all(node.status is not Status.RUNNING for node in root.iterate())


def test_halting_twice_does_nothing(leaf: Any, site: Any, log: Any) -> None:
    root, _ = running(leaf, site)
    halt(root)
    before = list(log)
    assert halt(root) == []
    assert log == before


def test_one_that_cannot_stop_does_not_keep_the_others_from_it(leaf: Any, site: Any, log: Any) -> None:
    root, (first, _) = running(leaf, site)
    first.breaks = True
    assert halt(root) == ["A: cannot stop"]
    assert log[-2:] == ["A halted", "B halted"]
    assert root.status is Status.INVALID


def test_parents_are_told_after_their_children(leaf: Any, site: Any, events: Any) -> None:
    root = Sequence(site("root"), [Sequence(site("root/inner"), [leaf("A", "R")])])
    root.tick_once()
    events.clear()
    halt(root)
    assert [(event["node"], event["status"]) for event in events] == [
        ("root/inner", "INVALID"),
        ("root", "INVALID"),
    ]
