"""Side by side."""

from __future__ import annotations

from typing import Any

import pytest
from build_nodes import names_of, parallel
from py_trees.common import Status

from executive.errors import Fault, InputError


def test_its_label_stands_for_the_failure(leaf: Any, site: Any, ticks: Any) -> None:
    node = parallel(site("tree", "both"), [leaf("A", "lost"), leaf("B")])
    ticks(node)
    for source in ("both", "A"):
        assert node.failure.matches(names_of([(source, "lost")]))


def test_all_that_cannot_be_halted_are_named(leaf: Any, site: Any, log: Any) -> None:
    children = [leaf("A", "R R"), leaf("B", "R S"), leaf("C", "R R"), leaf("D", "R R")]
    for child in (children[0], children[2]):
        child.breaks = True
    node = parallel(site("here"), children, 1)
    node.tick_once()
    with pytest.raises(Fault) as caught:
        node.tick_once()
    assert (str(caught.value), caught.value.node) == ("A: cannot stop; C: cannot stop", "here")
    assert log[4:] == ["A halted", "C halted", "D halted"]
    assert all(child.status is not Status.RUNNING for child in children)


@pytest.mark.parametrize("wait_for", [0, 3])
def test_it_cannot_wait_for_more_than_there_are(wait_for: int, leaf: Any, site: Any) -> None:
    with pytest.raises(InputError) as caught:
        parallel(site("tree/x"), [leaf("A"), leaf("B")], wait_for)
    bound = {0: "greater than or equal to 1", 3: "less than or equal to 2"}[wait_for]
    assert str(caught.value) == f"tree/x: parallel.wait_for cannot be {wait_for}: Input should be {bound}"


def test_details_say_what_the_mission_says(leaf: Any, site: Any) -> None:
    def detail(*args: Any, **more: Any) -> str:
        return parallel(site(), [leaf("A"), leaf("B"), leaf("C")], *args, **more).detail

    assert detail() == detail(3) == "wait for all"
    assert (detail(2), detail(1, halt=True)) == ("wait for 2 of 3", "wait for 1 of 3, halt")
