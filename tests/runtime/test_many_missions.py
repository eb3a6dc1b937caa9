"""Many missions in one process, one after another and side by side: each as if it were alone."""

from __future__ import annotations

import gc
import multiprocessing
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from executive.control.scope import Scope
from executive.control.skill_node import SkillNode
from executive.discovery import discover
from executive.mission.build import build
from executive.mission.load import LoadedMission, load_mission
from executive.record.plain import plain
from executive.record.trace import Trace
from executive.runtime.plant import Plant
from executive.runtime.run import Run
from executive.skill import Skill
from executive.testing.fake_cell import FakeCell

MISSIONS = Path(__file__).parents[2] / "missions"
RUNS = [(name, seed) for seed in range(10) for name in ("sort_overhead", "sort_wrist")]
"""Missions and seeds that differ; each is run five times."""

LONGEST = 5000
"""More ticks than any of them needs."""

MANY, WARM = 100, 140
"""Runs in one process, and runs before them after which every cache is filled, numpy's too."""


@dataclass(frozen=True)
class Story:
    """How a run went: its last status, its ticks, its decisions, its variables, its books and the truth."""

    status: str
    ticks: int
    trace: str
    variables: list[dict[str, Any]]
    items: dict[str, Any]
    audit: dict[str, int]


class Interleaved:
    """A mission on a cell of its own, ticked from outside."""

    def __init__(self, loaded: LoadedMission, seed: int) -> None:
        self._trace = Trace()
        self._plant = Plant([self._trace])
        emit = self._plant.emit
        self._fake = FakeCell(loaded.cell_config, seed=seed, routes=loaded.routes, emit=emit)
        self._plant.connect(self._fake)
        self._root = build(loaded, skills(), self._plant.cell, Scope(), emit)

    def tick(self) -> bool:
        """Go on by one tick; return whether there is more to do."""
        self._plant.begin_tick()
        self._root.tick_once()
        if self._root.status is not Status.RUNNING:
            return False
        self._plant.plan_ahead()
        self._plant.advance()
        assert self._plant.tick < LONGEST, "the mission goes on for ever"
        return True

    def story(self) -> Story:
        self._fake.accounts.close()
        items = {**self._fake.accounts.balance(), "rows": self._fake.accounts.rows()}
        return Story(
            self._root.status.value, self._plant.tick, self._trace.hexdigest(), variables(self._root), items,
            self._fake.audit(),
        )  # fmt: skip


@cache
def skills() -> dict[str, type[Skill]]:
    """Find the skills once: the search leaves caches of Python's own behind."""
    return discover()


@cache
def loaded(name: str) -> LoadedMission:
    """Load a mission once for all runs, with one object on the table."""
    return load_mission(MISSIONS / f"{name}.yaml", skills(), {"cell.table.objects": "[1, 1]"})


def variables(root: Behaviour) -> list[dict[str, Any]]:
    """Return the variables of every scope of a tree."""
    scopes = {id(node._scope): node._scope for node in root.iterate() if isinstance(node, SkillNode)}
    return [plain(scope) for scope in scopes.values()]


def story_of(name: str, seed: int) -> Story:
    trace = Trace()
    run = Run(loaded(name), skills(), seed=seed, observers=[trace], requests=[], kind=FakeCell)
    try:
        outcome = run.execute()
        return Story(
            outcome.status, outcome.ticks, trace.hexdigest(), variables(run.root), run.items(),
            dict(run.audit() or {}),
        )  # fmt: skip
    finally:
        run.close()


@dataclass(frozen=True)
class Hundred:
    """What many runs left behind.

    Attributes:
        unlike: The runs that went otherwise than alone.
        growth: Blocks of memory in use at the end and not after the first `WARM` runs.
    """

    unlike: list[tuple[str, int]]
    growth: int


@pytest.fixture(scope="module")
def alone() -> dict[tuple[str, int], Story]:
    """Give the story of every run; two are told by processes of their own, in which nothing ran before."""
    fresh = RUNS[-2:]
    with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=1) as pool:
        told = dict(zip(fresh, pool.starmap(story_of, fresh, chunksize=1), strict=True))
    return {run: told[run] if run in told else story_of(*run) for run in RUNS}


@pytest.fixture(scope="module")
def one_after_another(alone: dict[tuple[str, int], Story]) -> Hundred:
    Blackboard.clear()
    unlike, blocks = [], 0
    for number in range(WARM + MANY):
        run = RUNS[number % len(RUNS)]
        if story_of(*run) != alone[run]:
            unlike.append(run)
        if number + 1 == WARM:
            blocks = blocks_in_use()
    return Hundred(unlike, blocks_in_use() - blocks)


def blocks_in_use() -> int:
    gc.collect()
    return sys.getallocatedblocks()


def test_the_runs_differ(alone: dict[tuple[str, int], Story]) -> None:
    assert {story.status for story in alone.values()} == {"SUCCESS"}
    assert len({story.trace for story in alone.values()}) == len(RUNS)
    assert all(story.variables and all(story.variables) for story in alone.values())


def test_one_after_another_each_goes_as_if_alone(one_after_another: Hundred) -> None:
    assert one_after_another.unlike == []


def test_one_after_another_they_leave_less_than_a_block_of_memory_each(one_after_another: Hundred) -> None:
    assert one_after_another.growth < MANY


def test_side_by_side_each_goes_as_if_alone(alone: dict[tuple[str, int], Story]) -> None:
    runs = [RUNS[number % len(RUNS)] for number in range(MANY)]
    missions = [Interleaved(loaded(name), seed) for name, seed in runs]
    active = missions
    while active:
        active = [mission for mission in active if mission.tick()]
    stories = zip(runs, missions, strict=True)
    assert [run for run, mission in stories if mission.story() != alone[run]] == []


def test_nothing_is_left_on_the_blackboard_of_the_process(one_after_another: Hundred) -> None:
    assert (Blackboard.storage, Blackboard.metadata, Blackboard.clients) == ({}, {}, {})
