"""Every mission that is shipped does what it promises, on the fake cell and on the simulated one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executive.mission.load import LoadedMission, load_mission
from executive.record.result import ledger_agrees
from executive.runtime.cells import robot_check
from executive.runtime.run import Outcome, Run
from executive.skill import discover
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import oracle_cell
from executive.workcell import Workcell

MISSIONS = sorted((Path(__file__).parents[2] / "missions").glob("*.yaml"))


@pytest.fixture(params=MISSIONS, ids=lambda path: path.stem)
def loaded(request: pytest.FixtureRequest) -> LoadedMission:
    return load_mission(request.param, discover(), robot_check=robot_check)


def execute(
    loaded: LoadedMission, seed: int, kind: Callable[..., Workcell]
) -> tuple[Outcome, dict[str, Any], dict[str, int]]:
    # Where an operator is asked, every class is asked for until there can be none of it left.
    requests = [*loaded.routes] * 6
    run = Run(loaded, discover(), seed=seed, kind=kind, requests=requests)
    try:
        outcome = run.execute()
        return outcome, run.items(), dict(run.audit() or {})
    finally:
        run.close()


def test_there_are_missions() -> None:
    assert {path.stem for path in MISSIONS} >= {"sort_overhead", "sort_wrist", "pick_on_request"}


def test_it_loads_without_a_finding_and_says_what_it_teaches(loaded: LoadedMission) -> None:
    assert loaded.warnings == ()
    assert loaded.mission.name == loaded.path.stem
    assert "# Teaches: " in loaded.text


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_it_sorts_everything_on_the_fake_cell(loaded: LoadedMission, seed: int) -> None:
    outcome, items, audit = execute(loaded, seed, FakeCell.from_config)
    assert (outcome.status, outcome.message) == ("SUCCESS", "")
    assert items["placed"] == items["seen"] == audit["right"] >= 3
    assert ledger_agrees({"items": items, "audit": audit})


@pytest.mark.parametrize("seed", [1, 2])
def test_it_sorts_everything_in_the_simulated_world(loaded: LoadedMission, seed: int) -> None:
    outcome, items, audit = execute(loaded, seed, oracle_cell())
    assert (outcome.status, outcome.message) == ("SUCCESS", "")
    assert items["placed"] == items["seen"] == audit["right"] == sum(audit.values()) >= 3
    assert ledger_agrees({"items": items, "audit": audit})
