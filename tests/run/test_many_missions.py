"""Many missions in one process, one after another and side by side: each as if it were alone."""

from __future__ import annotations

import gc
import multiprocessing
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from executive.cell.json_values import to_json
from executive.cell.workcell import Workcell
from executive.cells.fake.cell import FakeCell
from executive.mission.build import build_tree
from executive.mission.load import LoadedMission, load_mission
from executive.plugins import load_skills
from executive.record.recorder import Trace
from executive.run.assembly import RunOptions, assemble
from executive.run.lookahead_planner import LookaheadPlanner
from executive.run.run_context import RunContext
from executive.skill import Skill
from executive.tree.blackboard import Blackboard as Variables
from executive.tree.skill_leaf import SkillLeaf

pytestmark = pytest.mark.slow

MISSIONS = Path(__file__).parents[2] / "missions"
RUNS = [(name, seed) for seed in range(3) for name in ("sort_overhead", "sort_wrist")]
"""Missions and seeds."""

Story = tuple[Any, ...]
"""Status, ticks, decisions, variables, books and truth of a run."""


class Interleaved:
    """A mission on a cell of its own, ticked from outside."""

    def __init__(self, loaded: LoadedMission, seed: int) -> None:
        self._trace = Trace()
        self._context = RunContext([self._trace])
        emit = self._context.emit
        self._fake = FakeCell(loaded.cell_config, seed=seed, routes=loaded.routes, emit=emit)
        self._context.connect(self._fake, LookaheadPlanner(self._fake.cell))
        self._context.begin_step(0)
        self._root = build_tree(loaded, skills(), self._context.cell, Variables(), emit)

    def tick(self) -> bool:
        """Go on by one tick; return whether there is more to do."""
        self._root.tick_once()
        if self._root.status is not Status.RUNNING:
            return False
        self._context.plan_ahead()
        self._context.advance()
        assert self._context.tick < 5000, "the mission goes on for ever"
        return True

    def story(self) -> Story:
        self._fake.accounts.set_final_states(completed=self._root.status is Status.SUCCESS)
        return (
            self._root.status.value, self._context.tick, self._trace.hexdigest(), variables(self._root),
            items_of(self._fake), self._fake.audit(),
        )  # fmt: skip


@cache
def skills() -> dict[str, type[Skill]]:
    """Find the skills once: the search leaves caches of Python's own behind."""
    return load_skills()


@cache
def loaded(name: str) -> LoadedMission:
    """Load a mission once for all runs, with one object on the table."""
    return load_mission(MISSIONS / f"{name}.yaml", skills(), {"cell.table.objects": "[1, 1]"})


def variables(root: Behaviour) -> list[dict[str, Any]]:
    """Return the variables of every blackboard of a tree."""
    leaves = (node for node in root.iterate() if isinstance(node, SkillLeaf))
    scopes = {id(leaf.blackboard): leaf.blackboard for leaf in leaves}
    return [to_json(scope) for scope in scopes.values()]


def items_of(workcell: Workcell) -> dict[str, object]:
    """Return the counts and the final states of the items, and the labels and doubts of the ledger."""
    accounts = workcell.accounts
    details = {
        "unknown": accounts.unknown_labels,
        "reasons": accounts.assumption_reasons,
        "rows": accounts.list_items(),
    }
    return {**accounts.count_states(), **details}


def story_of(name: str, seed: int) -> Story:
    trace = Trace()
    run = assemble(loaded(name), RunOptions(seed, [], make_cell=FakeCell), [trace])
    try:
        outcome = run.execute()
        return (
            outcome.status, outcome.ticks, trace.hexdigest(), variables(run.root),
            items_of(run.workcell), run.count_ground_truth(),
        )  # fmt: skip
    finally:
        run.close()


@pytest.fixture(scope="module")
def alone() -> dict[tuple[str, int], Story]:
    """Tell the story of every run; the last by a process of its own, in which nothing ran before."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        last = pool.apply(story_of, RUNS[-1])
    return {run: story_of(*run) for run in RUNS[:-1]} | {RUNS[-1]: last}


def test_the_runs_differ(alone: dict[tuple[str, int], Story]) -> None:
    assert {story[0] for story in alone.values()} == {"SUCCESS"}
    assert len({story[2] for story in alone.values()}) == len(RUNS)
    assert all(story[3] and all(story[3]) for story in alone.values())


def test_one_after_another_each_goes_as_if_alone(alone: dict[tuple[str, int], Story]) -> None:
    Blackboard.clear()
    assert [run for run in RUNS if story_of(*run) != alone[run]] == []
    assert (Blackboard.storage, Blackboard.metadata, Blackboard.clients) == ({}, {}, {})


def test_side_by_side_each_goes_as_if_alone(alone: dict[tuple[str, int], Story]) -> None:
    runs = RUNS * 2
    missions = [Interleaved(loaded(name), seed) for name, seed in runs]
    active = missions
    while active:
        active = [mission for mission in active if mission.tick()]
    assert [run for run, mission in zip(runs, missions, strict=True) if mission.story() != alone[run]] == []


def test_one_after_another_they_leave_less_than_a_block_of_memory_each() -> None:
    def blocks_after(runs: int) -> int:
        for number in range(runs):
            story_of(*RUNS[number % len(RUNS)])
        gc.collect()
        return sys.getallocatedblocks()

    # After so many runs every cache is filled, numpy's too.
    before = blocks_after(240)
    assert blocks_after(100) - before < 100
