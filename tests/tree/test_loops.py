"""Retry, repeat and while."""

from __future__ import annotations

from typing import Any

import pytest
from build_nodes import repeat, retry, sequence, while_loop
from py_trees.common import Status

from executive.errors import InputError
from executive.events import BranchChosen, NodeEnded
from executive.tree.keys import Child, key
from executive.tree.loops import GeneratorNode, NodeRun


def test_a_failed_condition_is_a_success_with_a_report(leaf: Any, site: Any, ticks: Any, events: Any) -> None:
    node = while_loop(site("here"), leaf("more", "none"), leaf("A"))
    assert ticks(node) == "S"
    assert node.failure is None
    assert events[1] == BranchChosen("here", "done", "more.none", "none happened")


def test_a_loop_of_many_rounds_needs_no_deep_stack(leaf: Any, site: Any) -> None:
    node = repeat(site(), sequence(site("s"), [leaf("A", "R S")]), times=5000)
    for _ in range(5001):
        node.tick_once()
    assert node.status is Status.SUCCESS


def test_the_generator_of_a_halted_node_is_closed_before_the_node_ends(
    leaf: Any, site: Any, events: Any
) -> None:
    class Lamp(GeneratorNode):
        keyword = "lamp"
        do: Child = key(doc="Body.")

        def run(self) -> NodeRun:
            try:
                return (yield from self.run_child(self.do))
            finally:
                self.report_choice("lamp off")

    node = Lamp(site("here"), do=leaf("A", "R"))
    node.tick_once()
    node.stop()
    assert events[-2:] == [BranchChosen("here", "lamp off", "", ""), NodeEnded("here", "INVALID")]


@pytest.mark.parametrize("attempts", [1, 4])
def test_details_say_what_the_mission_says(leaf: Any, site: Any, attempts: int) -> None:
    assert retry(site(), leaf("A"), attempts).detail == f"up to {attempts} attempts, on any failure"
    assert repeat(site(), leaf("A"), until=[("A", "lost"), ("B", "x")]).detail == "until A.lost, B.x"
    assert repeat(site(), leaf("A"), times=3).detail == "3 times"
    assert repeat(site(), leaf("A"), 3, [("A", "lost")]).detail == "3 times or until A.lost"


def test_a_number_of_rounds_that_makes_no_sense_is_refused(leaf: Any, site: Any) -> None:
    with pytest.raises(InputError, match=r"tree/x: repeat\.times cannot be -1: .* or equal to 0"):
        repeat(site("tree/x"), leaf("A"), times=-1)
    with pytest.raises(InputError, match=r"tree/x: retry\.attempts cannot be 0: .* or equal to 1"):
        retry(site("tree/x"), leaf("A"), 0)
