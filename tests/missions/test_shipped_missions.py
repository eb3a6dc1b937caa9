"""Every mission that is shipped does what it promises, on the fake cell and in the simulator."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import pytest

from executive.behaviours import load_skills
from executive.events import ItemChanged, MotionPlanned, RunEnded, TimedEvent
from executive.mission.load import LoadedMission, load_mission
from executive.record.result import is_confirmed_by_audit
from executive.run.assembly import RunOptions, assemble
from executive.station.check import load_checker
from executive.station.station import Station
from executive.testing.fake_cell import FakeCell
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
    return load_mission(MISSIONS[name], load_skills(), find_checker=load_checker)


def execute(mission: LoadedMission, seed: int, kind: Callable[..., Station] = FakeCell) -> Done:
    """Run a mission."""
    events: list[TimedEvent] = []
    # Where an operator is asked, every class is asked for until there can be none of it left.
    options = RunOptions(seed, [*mission.routes] * 6, make_cell=kind)
    with closing(assemble(mission, options, [events.append])) as run:
        outcome = run.execute()
        rows = run.station.ledger.list_items()
        audit = dict(run.station.audit() or {})
    ahead = [one.event.planned_ahead for one in events if isinstance(one.event, MotionPlanned)]
    return Done(outcome, run.station.ledger.count_states(), rows, audit, ahead)


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
