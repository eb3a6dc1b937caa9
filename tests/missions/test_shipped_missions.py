"""Every mission that is shipped does what it promises, on the fake cell and in the simulator."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from executive.cell.workcell import Workcell
from executive.cells.fake.cell import FakeCell
from executive.events import ItemChanged, MotionPlanned, RunEnded, TimedEvent
from executive.mission.load import LoadedMission, load_mission
from executive.plugins import load_cell_kind, load_skills
from executive.record.result import is_confirmed_by_audit
from executive.run.assembly import RunOptions, assemble
from executive.testing.oracle import make_oracle_kind

MISSIONS = {path.stem: path for path in sorted((Path(__file__).parents[2] / "missions").glob("*.yaml"))}
REHEARSED = {"kit_fasteners", "recycle", "sort_fruit", "tray_instruments"}
"""Missions whose cell has no physics."""

KEEPS_SOMETHING = {
    "sort_by_priority", "kit_fasteners", "kit_shapes", "pick_in_order", "recycle", "sort_until_four",
    "tray_instruments",
}  # fmt: skip
"""Missions that are done while something is left on the table, which the ledger then calls rejected."""

slow = pytest.mark.slow


@dataclass(frozen=True)
class Done:
    """A mission that was run: its outcome, the ledger's items, the audit, and if each plan was made ahead."""

    outcome: RunEnded
    items: dict[str, int]
    rows: Sequence[ItemChanged]
    audit: dict[str, int]
    ahead: list[bool]


@functools.cache
def loaded(name: str) -> LoadedMission:
    """Return a shipped mission."""
    return load_mission(MISSIONS[name], load_skills(), find_cell_kind=load_cell_kind)


def execute(mission: LoadedMission, seed: int, kind: Callable[..., Workcell] = FakeCell) -> Done:
    """Run a mission."""
    ahead: list[bool] = []

    def observe(timed: TimedEvent) -> None:
        if isinstance(timed.event, MotionPlanned):
            ahead.append(timed.event.planned_ahead)

    # Where an operator is asked, every class is asked for until there can be none of it left.
    requests = [*mission.routes] * 6
    options = RunOptions(seed, requests, make_cell=kind)
    run = assemble(mission, options, [observe])
    try:
        outcome = run.execute()
        return Done(
            outcome,
            run.count_items(),
            run.workcell.accounts.list_items(),
            dict(run.count_ground_truth() or {}),
            ahead,
        )
    finally:
        run.close()


def assert_done(name: str, done: Done) -> None:
    assert (done.outcome.status, done.outcome.message) == ("SUCCESS", "")
    assert is_confirmed_by_audit(done.items, done.audit, done.outcome.is_table_empty)
    assert done.items["placed"] == done.audit["right"] >= 1
    assert done.items["lost"] == done.audit["wrong_bin"] == 0
    if name not in KEEPS_SOMETHING:
        assert done.items["placed"] == done.items["seen"] >= 3


@pytest.mark.parametrize("name", MISSIONS)
def test_it_loads_without_a_finding_and_says_what_it_teaches(name: str) -> None:
    mission = loaded(name)
    assert mission.warnings == ()
    assert mission.mission.name == name
    assert mission.mission.description
    assert "# Teaches: " in mission.text


@pytest.mark.parametrize("name", ["sort_overhead", "sort_wrist"])
def test_the_missions_to_begin_with_are_a_few_lines(name: str) -> None:
    lines = [line.strip() for line in loaded(name).text.splitlines()]
    assert len([line for line in lines if line and not line.startswith("#")]) <= 12


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", MISSIONS)
def test_it_does_its_work_on_the_fake_cell(name: str, seed: int) -> None:
    done = execute(loaded(name), seed)
    assert_done(name, done)
    if name in ("sort_overhead", "sort_wrist"):
        # To the first object, and to look around before and after, nothing can be planned ahead.
        assert sum(done.ahead) == 2 * done.items["placed"] - 1


SIMULATED = [
    pytest.param(name, seed, marks=() if (name, seed) == ("sort_overhead", 1) else slow)
    for name in MISSIONS
    if name not in REHEARSED
    for seed in (1, 2)
]


@pytest.mark.parametrize(("name", "seed"), SIMULATED)
def test_it_does_its_work_in_the_simulated_world(name: str, seed: int) -> None:
    assert_done(name, execute(loaded(name), seed, make_oracle_kind()))


def test_only_rehearsals_are_left_out_of_the_simulated_world() -> None:
    assert {name for name in MISSIONS if loaded(name).cell_config.kind == "fake"} == REHEARSED


@pytest.mark.parametrize(
    ("seed", "second"), [(0, ["bolt", "nut", "washer"]), pytest.param(5, ["bolt"], marks=slow)]
)
def test_no_kit_gets_a_part_twice_and_a_full_table_gives_two_whole_kits(seed: int, second: list[str]) -> None:
    kits: dict[str, list[str]] = {}
    for row in execute(loaded("kit_fasteners"), seed).rows:
        kits.setdefault(row.bin, []).append(row.label)
    assert sorted(kits["tray_1"]) == ["bolt", "nut", "washer"]
    assert sorted(kits["tray_2"]) == second


@pytest.mark.parametrize("quota", [1, 3])
def test_no_bin_gets_more_than_its_quota(quota: int) -> None:
    overrides = {"quota": str(quota), "cell.table.objects": "[6, 6]"}
    done = execute(load_mission(MISSIONS["sort_by_priority"], load_skills(), overrides), 5)
    placed = [row.label for row in done.rows if row.bin]
    there = [row.label for row in done.rows]
    assert {label: placed.count(label) for label in placed} == {
        label: min(quota, there.count(label)) for label in set(there)
    }
