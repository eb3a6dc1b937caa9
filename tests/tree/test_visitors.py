"""What visitors and displays of py_trees see of our nodes."""

from __future__ import annotations

from typing import Any

import pytest
from build_nodes import fallback, invert, sequence
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase


class Notes(VisitorBase):
    """A visitor that notes the names of the nodes, tick by tick."""

    def __init__(self) -> None:
        super().__init__(full=False)
        self.ticks: list[list[str]] = []

    def initialise(self) -> None:
        self.ticks.append([])

    def run(self, behaviour: Behaviour) -> None:
        self.ticks[-1].append(behaviour.name)


def test_every_ticked_node_is_seen_children_first_and_no_other(leaf: Any, site: Any) -> None:
    first = sequence(site("first"), [leaf("A", "S"), leaf("B", "lost")])
    tree = BehaviourTree(fallback(site("root"), [first, leaf("C", "R S"), leaf("never")]))
    notes = Notes()
    tree.add_visitor(notes)
    for _ in range(2):
        tree.tick()
    assert notes.ticks == [["A", "B", "sequence", "C", "fallback"], ["C", "fallback"]]


def test_the_nodes_of_a_behaviour_of_py_trees_below_are_seen_too(leaf: Any, site: Any) -> None:
    inner = Selector("inner", memory=True, children=[leaf("A", "lost"), leaf("B")])
    assert [node.name for node in sequence(site(), [inner]).tick()] == ["A", "B", "inner", "sequence"]


def test_feedback_is_the_failure_and_the_next_start_clears_it(leaf: Any, site: Any) -> None:
    node = invert(site(), sequence(site(), [leaf("A", "lost", "R")]))
    (body,) = node.children
    node.tick_once()
    assert (body.feedback_message, node.feedback_message) == ("A.lost: lost happened", "")
    node.tick_once()
    assert body.feedback_message == ""


def test_a_tick_that_raises_leaves_the_direct_tick_as_it_was(leaf: Any, site: Any) -> None:
    node = sequence(site(), [leaf("A", "!", "R")])
    with pytest.raises(RuntimeError, match="broken"):
        list(node.tick())
    node.stop(Status.INVALID)
    node.tick_once()
    assert node.status is Status.RUNNING
