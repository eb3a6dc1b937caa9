"""Many missions in one process: each as if it were alone, and the simulated world repeats itself."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from py_trees.blackboard import Blackboard

from executive.behaviours import load_skills
from executive.mission.load import LoadedMission, load_mission
from executive.record.journal import Trace
from executive.run.assembly import RunOptions, assemble
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import make_oracle_kind

pytestmark = pytest.mark.slow

MISSIONS = Path(__file__).parents[2] / "missions"
RUNS = [(name, seed) for seed in range(2) for name in ("sort_overhead", "sort_wrist")]
"""Missions and seeds."""


@cache
def loaded(name: str) -> LoadedMission:
    """Load a mission once for all runs, with one object on the table."""
    return load_mission(MISSIONS / f"{name}.yaml", load_skills(), {"cell.table.objects": "[1, 1]"})


def story_of(name: str, seed: int, make_cell: Callable[..., Any] = FakeCell) -> tuple[object, ...]:
    """Return status, ticks, decisions, books and truth of a run."""
    trace = Trace()
    run = assemble(loaded(name), RunOptions(seed, [], make_cell=make_cell), [trace])
    try:
        outcome = run.execute()
        items = run.station.ledger.list_items()
        return outcome.status, outcome.ticks, trace.hexdigest(), items, run.station.audit()
    finally:
        run.close()


def test_one_after_another_each_goes_as_if_alone() -> None:
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        alone = pool.starmap(story_of, RUNS, chunksize=1)
    assert len({story[2] for story in alone}) == len(RUNS)
    assert [story_of(*run) for run in RUNS] == alone
    assert (Blackboard.storage, Blackboard.metadata, Blackboard.clients) == ({}, {}, {})


def test_a_simulated_run_repeats_itself() -> None:
    first, other, again = (story_of("sort_wrist", seed, make_oracle_kind()) for seed in (7, 8, 7))
    assert first == again != other
    assert first[0] == "SUCCESS"
