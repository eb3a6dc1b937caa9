"""What ticks and status changes cost beside bare py_trees, and that both sides tick the same tree."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.campaign import tick_cost
from executive.campaign.tick_cost import (
    MOST_RATIO,
    SIZES,
    ChangeCost,
    SteadyCost,
    best_of_turns,
    change_costs,
    steady_costs,
)
from executive.campaign.twin_trees import WAITING, Bare, Kit, Ours, ending
from executive.record.journal import read_journal

Shape = Callable[[Kit, int], Behaviour]


class Turns:
    """Stands for a clock and for two roots whose ticks take the times of a list [s]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.ticked = 0.0, ""
        monkeypatch.setattr(tick_cost.time, "thread_time", lambda: self.now)

    def root(self, name: str, *seconds: float) -> Behaviour:
        root, left = Bare().leaf(ends=False), list(seconds)

        def tick_once() -> None:
            assert not gc.isenabled()
            self.ticked += name
            self.now += left.pop(0)

        root.tick_once = tick_once
        return root


def outline(root: Behaviour) -> tuple[Status, list[object]]:
    return root.status, [outline(child) for child in root.children]


def running(root: Behaviour) -> list[Behaviour]:
    return [node for node in root.iterate() if not node.children and node.status is Status.RUNNING]


@pytest.mark.parametrize("nodes", [8, 9, 31, *SIZES])
@pytest.mark.parametrize("shape", [*WAITING.values(), ending])
def test_both_sides_tick_the_same_tree_of_so_many_nodes(shape: Shape, nodes: int) -> None:
    ours, bare = shape(Ours(), nodes), shape(Bare(), nodes)
    for _ in range(3):
        ours.tick_once()
        bare.tick_once()
        assert outline(ours) == outline(bare)
    assert len(list(ours.iterate())) == nodes


@pytest.mark.parametrize("nodes", [8, 9, 31, *SIZES])
@pytest.mark.parametrize("shape", WAITING.values())
def test_a_waiting_tree_waits_for_one_leaf_after_all_others(shape: Shape, nodes: int) -> None:
    root = shape(Bare(), nodes)
    root.tick_once()
    (leaf,) = running(root)
    done = [node for node in root.iterate() if not node.children and node.status is Status.SUCCESS]
    spare = [node for node in root.iterate() if node.status is Status.INVALID]
    leaves = [node for node in root.iterate() if not node.children]
    assert leaves == [*done, leaf, *spare]
    assert len(spare) == (shape is WAITING["nested"])


def test_a_balanced_tree_is_five_wide_and_no_deeper_than_needed() -> None:
    def depth(node: Behaviour) -> int:
        return 1 + max(map(depth, node.children), default=0)

    root = WAITING["balanced"](Bare(), 156)
    assert {len(node.children) for node in root.iterate()} == {0, 5}
    assert depth(root) == 4


def test_they_take_turns_and_the_best_block_of_each_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = Turns(monkeypatch)
    ours, bare = turns.root("o", 3, 3, 1, 2, 4, 4), turns.root("b", 9, 9, 9, 7, 8, 9)
    assert best_of_turns(ours, bare, blocks=3, ticks=2) == (1.5e6, 8e6)
    assert turns.ticked == "oobboobboobb"
    assert gc.isenabled()


def test_the_collector_is_on_again_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = Turns(monkeypatch)
    with pytest.raises(IndexError):
        best_of_turns(turns.root("o"), turns.root("b"), blocks=1, ticks=1)
    assert gc.isenabled()


def test_the_figures_are_the_ratio_and_the_extra_per_change() -> None:
    assert SteadyCost("flat", 10, ours=3.0, bare=2.0).ratio == 1.5
    assert ChangeCost(10, changes=20, ours=300.0, bare=100.0).extra == 10.0


def test_a_waiting_tick_costs_no_more_than_it_may() -> None:
    costs = steady_costs(blocks=5)
    assert [(cost.shape, cost.nodes) for cost in costs] == [
        (shape, nodes) for shape in WAITING for nodes in SIZES
    ]
    assert all(0 < cost.ratio <= MOST_RATIO for cost in costs), costs


def test_every_change_that_is_counted_is_in_the_journal(tmp_path: Path) -> None:
    (cost,) = change_costs(blocks=2, folder=tmp_path, sizes=[10])
    entries = read_journal(tmp_path / "10" / "journal.jsonl")
    assert cost.changes == 20
    assert len(entries) == 2 * (tick_cost.ENDING_NODES // 10) * cost.changes
    assert {(entry["kind"], entry["status"]) for entry in entries} == {
        ("status", "RUNNING"),
        ("status", "SUCCESS"),
    }
    assert 0 < cost.bare < cost.ours
