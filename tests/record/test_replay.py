"""Deciding a recorded run once more."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.events import (
    BranchChosen,
    InputRead,
    ItemChanged,
    NodeEnded,
    NodeStarted,
    TargetSelected,
    ToolCommanded,
)
from executive.geometry import GRAVITY
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import ReplayResult, replay_and_compare, replay_run
from executive.record.run_directory import find_run
from executive.replay.input_log import InputLog
from executive.run.assembly import RunOptions
from executive.testing.faults import during, seal_fails
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import run_mission

ALL = sorted(path.stem for path in (Path(__file__).parents[2] / "missions").glob("*.yaml"))
QUICK = "sort_overhead"


def recorded(missions: Path, runs: Path, name: str, kind: Any = FakeCell) -> Path:
    loaded = load_mission(missions / f"{name}.yaml", load_skills())
    requests = [*loaded.routes] * 4
    options = RunOptions(3, requests, make_cell=kind)
    record_run(loaded, options, runs, RecordOptions(saves_pictures=False))
    return find_run("latest", runs)


def again(path: Path, mission: Path | None = None) -> ReplayResult:
    return replay_run(path, read_journal(path / "journal.jsonl"), load_skills(), mission)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == QUICK else pytest.mark.slow) for name in ALL]
)
def test_the_same_mission_decides_the_same(missions: Path, tmp_path: Path, name: str) -> None:
    done = again(recorded(missions, tmp_path, name))
    assert (done.is_equal, done.difference) == (True, "")
    assert done.decisions > 100


def test_a_weighing_is_replayed_without_the_tool(missions: Path, tmp_path: Path) -> None:
    path = recorded(missions, tmp_path, "weigh_and_sort")
    events = [timed.event for timed in read_journal(path / "journal.jsonl")]
    readings = [event.value for event in events if isinstance(event, InputRead) and event.name == "tool.load"]
    assert 0.15 * GRAVITY in [pytest.approx(value) for value in readings]
    assert again(path).is_equal


@pytest.mark.slow
@pytest.mark.parametrize("name", ["weigh_and_sort", "sort_wrist"])
def test_a_simulated_run_is_replayed_without_the_simulator(missions: Path, tmp_path: Path, name: str) -> None:
    done = again(recorded(missions, tmp_path, name, kind=make_oracle_kind()))
    assert (done.is_equal, done.edited) == (True, False)


def edited(path: Path, old: str, new: str) -> Path:
    text = (path / "mission.yaml").read_text()
    assert old in text
    # Beside its library, as a mission lies.
    file = path / "edited.yaml"
    file.write_text(text.replace(old, new))
    return file


def test_the_first_other_decision_of_an_edited_mission_is_reported(missions: Path, tmp_path: Path) -> None:
    path = recorded(missions, tmp_path, "inspect_then_sort")
    done = again(path, edited(path, "try: {SelectTarget: {prefer: surest}}", "try: SelectTarget"))
    assert done.edited
    assert done.recorded.event.item != done.replayed.event.item
    assert re.match(
        r"recorded: at [\d.]+ s \(step \d+\) TargetSelected: item .*; replayed: at ", done.difference
    )


def test_a_mission_that_gives_up_sooner_says_where(missions: Path) -> None:
    file, skills = missions / "sort_overhead.yaml", load_skills()
    four_times = [during("*/Grasp", seal_fails(), activations=(1, 2, 3, 4))]
    log = InputLog(run_mission(file, seed=3, faults=four_times).events)
    assert replay_and_compare(load_mission(file, skills), log, 3).is_equal
    done = replay_and_compare(load_mission(file, skills, {"attempts": "2"}), log, 3, edited=True)
    assert done.replayed.event.node == "RejectTarget"


def test_where_the_record_has_no_answer_it_says_so(missions: Path, tmp_path: Path) -> None:
    path = recorded(missions, tmp_path, "sort_fruit")
    stock = "  - use: take_stock\n"
    done = again(path, edited(path, stock, "  - {MoveToScan: {pose: aside}}\n" + stock))
    assert (done.replayed.event.node, done.replayed.event.status) == ("MoveToScan", "INVALID")
    assert "the replay reads plan.ready in step 1, but the journal has no earlier value" in done.difference


def test_a_directory_without_answers_cannot_be_replayed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="can be replayed: its journal has no inputs"):
        replay_run(tmp_path, [], load_skills())


def test_a_decision_too_many_is_a_difference_in_a_run_that_was_cut_off_too(missions: Path) -> None:
    """What the record did not decide in a step that it ended was not decided."""
    file, skills = missions / "sort_overhead.yaml", load_skills()
    cut = [timed for timed in run_mission(file, seed=3).events if timed.tick <= 600]
    missing = next(n for n, timed in enumerate(cut) if isinstance(timed.event, ToolCommanded))
    decided = NodeStarted | NodeEnded | BranchChosen | TargetSelected | ItemChanged | ToolCommanded
    without = [one for n, one in enumerate(cut) if n < missing or not isinstance(one.event, decided)]
    loaded = load_mission(file, skills)
    assert replay_and_compare(loaded, InputLog(cut), 3).is_equal
    done = replay_and_compare(loaded, InputLog(without), 3)
    assert (done.recorded, done.replayed and type(done.replayed.event)) == (None, ToolCommanded)
