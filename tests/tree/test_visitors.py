"""What visitors and displays of py_trees see of our nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from build_nodes import fallback, invert, retry, sequence
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector
from py_trees.display import dot_tree, unicode_tree
from py_trees.trees import BehaviourTree
from py_trees.visitors import SnapshotVisitor, VisitorBase

from executive.cells.fake.cell import FakeCell
from executive.errors import Fault
from executive.events import NodeEnded, NodeStarted
from executive.record.recorder import Trace
from executive.testing.run_mission import run_mission
from executive.tree.node import ControlNode
from executive.tree.skill_leaf import SkillLeaf


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


def test_the_tree_is_displayed_with_status_and_feedback(leaf: Any, site: Any) -> None:
    tree, snapshot = BehaviourTree(retry(site(), leaf("A", "lost", "R"), 1)), SnapshotVisitor()
    tree.add_visitor(snapshot)
    tree.tick()
    text = unicode_tree(
        tree.root, show_status=True, visited=snapshot.visited, previously_visited=snapshot.previously_visited
    )
    assert "retry [✕] -- A.lost: lost happened" in text
    assert "--> A [✕]" in text
    (edge,) = dot_tree(tree.root).get_edges()
    assert (edge.get_source(), edge.get_destination()) == ("retry", "A")


def test_a_tick_that_raises_leaves_the_direct_tick_as_it_was(leaf: Any, site: Any) -> None:
    node = sequence(site(), [leaf("A", "!", "R")])
    with pytest.raises(RuntimeError, match="broken"):
        list(node.tick())
    node.stop(Status.INVALID)
    node.tick_once()
    assert node.status is Status.RUNNING


def test_a_child_without_a_status_is_a_fault_under_visitors_too(leaf: Any, site: Any) -> None:
    broken = leaf("A")
    broken.update = lambda: None
    with pytest.raises(Fault, match="A was ticked but has no status"):
        list(sequence(site(), [broken]).tick())


@pytest.fixture
def direct_ticks(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[set[str]]]:
    """Record the paths of the nodes whose `tick_once` is called, tick by tick of the root."""
    ticks: list[set[str]] = []

    def watch(kind: type) -> None:
        original: Callable[[Any], None] = kind.tick_once

        def tick_once(node: Any) -> None:
            if node.parent is None:
                ticks.append(set())
            ticks[-1].add(node.path)
            original(node)

        monkeypatch.setattr(kind, "tick_once", tick_once)

    watch(ControlNode)
    watch(SkillLeaf)
    return ticks


class Statuses(SnapshotVisitor):
    """A snapshot visitor that keeps every snapshot, by the paths of the nodes."""

    def __init__(self) -> None:
        super().__init__()
        self.snapshots: list[dict[str, Status]] = []
        self.paths: dict[Any, str] = {}

    def run(self, behaviour: Behaviour) -> None:
        super().run(behaviour)
        self.paths[behaviour.id] = behaviour.path

    def finalise(self) -> None:
        self.snapshots.append({self.paths[key]: status for key, status in self.visited.items()})


def put_a_duck(cell: FakeCell) -> None:
    cell.world.objects.clear()
    cell.world.put("duck", 0.5, 0.1)


def test_a_snapshot_of_the_shipped_mission_has_every_ticked_node_at_every_tick(
    direct_ticks: list[set[str]],
) -> None:
    statuses = Statuses()
    result = run_mission("sort_overhead", visitors=[statuses], arrange=put_a_duck)
    assert result.status == "SUCCESS"
    assert [set(snapshot) for snapshot in statuses.snapshots] == direct_ticks
    assert len(direct_ticks) > 300
    events = {
        (timed.tick, timed.event.node): timed.event
        for timed in result.events
        if isinstance(timed.event, NodeStarted | NodeEnded)
    }
    for (tick, path), event in events.items():
        # The last event of a node in a tick tells its status; py_trees visits no node that is only halted.
        status = event.status if isinstance(event, NodeEnded) else "RUNNING"
        default = Status.INVALID if status == "INVALID" else None
        assert statuses.snapshots[tick].get(path, default) is Status(status)


def test_visitors_change_no_decision_of_a_run() -> None:
    traces = []
    for visitors in ([Notes()], []):
        trace = Trace()
        run_mission("sort_overhead", visitors=visitors, observers=[trace], arrange=put_a_duck)
        traces.append(trace.hexdigest())
    assert traces[0] == traces[1]
