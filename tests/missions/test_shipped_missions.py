"""Every mission that is shipped does what it promises, on the fake cell and in the simulator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executive.discovery import discover
from executive.events import Event
from executive.mission.load import LoadedMission, load_mission
from executive.record.result import ledger_agrees
from executive.runtime.cells import cell_kind
from executive.runtime.run import Outcome, Run
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import oracle_cell
from executive.workcell import Workcell

MISSIONS = sorted((Path(__file__).parents[2] / "missions").glob("*.yaml"))

KEEPS_SOMETHING = {"sort_by_priority", "kit_fasteners", "recycle", "tray_instruments"}
"""Missions that are done while something is left on the table, which the ledger then calls rejected."""


@pytest.fixture(params=MISSIONS, ids=lambda path: path.stem)
def loaded(request: pytest.FixtureRequest) -> LoadedMission:
    return load_mission(request.param, discover(), kinds=cell_kind)


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


def assert_done(
    loaded: LoadedMission, outcome: Outcome, items: dict[str, Any], audit: dict[str, int]
) -> None:
    assert (outcome.status, outcome.message) == ("SUCCESS", "")
    assert ledger_agrees({"items": items, "audit": audit})
    assert items["placed"] == audit["right"] >= 1
    assert items["lost"] == audit["wrong_bin"] == 0
    if loaded.mission.name not in KEEPS_SOMETHING:
        assert items["placed"] == items["seen"] >= 3


def test_every_kind_of_sorting_is_there() -> None:
    names = {path.stem for path in MISSIONS}
    assert names >= {"sort_overhead", "sort_wrist", "pick_on_request", "sort_by_priority", "kit_fasteners"}
    assert names >= {"recycle", "inspect_then_sort", "detector_cascade", *KEEPS_SOMETHING}


def test_it_loads_without_a_finding_and_says_what_it_teaches(loaded: LoadedMission) -> None:
    assert loaded.warnings == ()
    assert loaded.mission.name == loaded.path.stem
    assert loaded.mission.description
    assert "# Teaches: " in loaded.text


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_it_does_its_work_on_the_fake_cell(loaded: LoadedMission, seed: int) -> None:
    assert_done(loaded, *execute(loaded, seed, FakeCell))


@pytest.mark.parametrize("name", ["sort_overhead", "sort_wrist"])
def test_nothing_is_waited_for_between_one_object_and_the_next(name: str) -> None:
    path = next(path for path in MISSIONS if path.stem == name)
    plans: list[bool] = []

    def observe(event: Event) -> None:
        if event.kind == "plan":
            plans.append(event.data["ahead"])

    run = Run(load_mission(path, discover()), discover(), seed=1, kind=FakeCell, observers=[observe])
    run.execute()
    placed = run.items()["placed"]
    assert placed >= 3
    # To the first object, and to look around before and after, nobody could think ahead.
    assert sum(plans) == 2 * placed - 1


@pytest.mark.parametrize("seed", [1, 2])
def test_it_does_its_work_in_the_simulated_world(loaded: LoadedMission, seed: int) -> None:
    if loaded.cell_config.kind != "sim":
        pytest.skip(f"its cell is of kind {loaded.cell_config.kind}")
    assert_done(loaded, *execute(loaded, seed, oracle_cell()))


def kit(seed: int) -> dict[str, list[str]]:
    """Return the classes that lie in each bin after kit_fasteners."""
    path = next(path for path in MISSIONS if path.stem == "kit_fasteners")
    _, items, _ = execute(load_mission(path, discover()), seed, FakeCell)
    bins: dict[str, list[str]] = {}
    for row in items["rows"]:
        bins.setdefault(row["bin"], []).append(row["label"])
    return bins


@pytest.mark.parametrize("seed", range(6))
def test_no_kit_gets_a_part_twice(seed: int) -> None:
    bins = kit(seed)
    for tray in ("tray_1", "tray_2"):
        assert len(bins.get(tray, [])) == len(set(bins.get(tray, [])))
    assert set(bins["tray_1"]) >= set(bins.get("tray_2", []))


def test_a_full_table_gives_two_whole_kits() -> None:
    kits = [kit(seed) for seed in range(12)]
    whole = ["bolt", "nut", "washer"]
    assert any(all(sorted(bins.get(tray, [])) == whole for tray in ("tray_1", "tray_2")) for bins in kits)


@pytest.mark.parametrize("quota", [1, 3])
def test_no_bin_gets_more_than_its_quota(quota: int) -> None:
    path = next(path for path in MISSIONS if path.stem == "sort_by_priority")
    loaded = load_mission(path, discover(), {"quota": str(quota), "cell.table.objects": "[6, 6]"})
    _, items, _ = execute(loaded, 5, FakeCell)
    placed = [row["label"] for row in items["rows"] if row["bin"]]
    there = [row["label"] for row in items["rows"]]
    assert {label: placed.count(label) for label in placed} == {
        label: min(quota, there.count(label)) for label in set(there)
    }
