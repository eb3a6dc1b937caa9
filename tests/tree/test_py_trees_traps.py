"""What py_trees' own nodes do and ours must not, one test each."""

from __future__ import annotations

from typing import Any

import pytest
from build_nodes import fallback, sequence
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from scripted_leaf import Leaf

from executive.errors import Fault
from executive.tree.parallel import Parallel
from executive.tree.sequences import Fallback, Sequence
from executive.tree.tree_node import halt
from tests.node_behaviours import build


class Terminated(Leaf):
    """A leaf that notes every `terminate`, whatever for."""

    def terminate(self, new_status: Status) -> None:
        self._log.append(f"{self.name}: {self.status.value} to {new_status.value}")


class Returning(Behaviour):
    """Leaf whose `update` returns a given status."""

    def __init__(self, value: Any) -> None:
        super().__init__("odd")
        self.value = value

    def update(self) -> Any:
        return self.value


@pytest.mark.parametrize("kind", [Sequence, Fallback, Parallel])
def test_children_that_finished_are_not_terminated_by_a_new_round_nor_by_a_halt(kind: Any, site: Any) -> None:
    log: list[str] = []
    end = "lost" if kind is Fallback else "S"
    node = build(site(), kind, do=[Terminated("A", (end,), log), Terminated("B", ("S", "R R"), log)])
    node.tick_once()
    node.tick_once()
    halt(node)
    status = Status.FAILURE if kind is Fallback else Status.SUCCESS
    messages = [line for line in log if line.startswith("A: ")]
    # Its own end, once a round, and nothing else.
    assert messages == [f"A: INVALID to {status.value}", f"A: {status.value} to {status.value}"]


def test_the_old_status_of_an_unticked_child_has_no_effect_and_is_not_reported(
    leaf: Any, site: Any, ticks: Any, events: Any
) -> None:
    tried = sequence(site("tried"), [leaf("A", "lost", "S", "lost")])
    ghost = sequence(site("ghost"), [leaf("B", "S", "lost")])
    node = fallback(site("root"), [tried, ghost])
    assert ticks(node) == "S"
    assert ghost.status is Status.SUCCESS
    events.clear()
    assert ticks(node) == "S"
    assert "ghost" not in {event.node for event in events}
    # Nor is it taken for a success later on, when the node does get there.
    assert ticks(node) == "F"


@pytest.mark.parametrize("value", [None, Status.INVALID])
def test_a_node_without_a_status_is_a_fault_and_not_an_interruption(value: Any, leaf: Any, site: Any) -> None:
    inner = sequence(site("here"), [Returning(value), leaf("after")])
    root = fallback(site("root"), [inner, leaf("instead")])
    with pytest.raises(Fault, match="odd was ticked but has no status") as caught:
        root.tick_once()
    assert (caught.value.node, halt(root)) == ("here", [])
