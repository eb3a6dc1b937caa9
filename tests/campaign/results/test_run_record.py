"""The rows of a run: equal in process and from the journal, and as the journal says."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.campaign.results.rows import ItemRow, SkillRow, make_record
from executive.events import ItemChanged, NodeEnded, NodeStarted, RunEnded, TargetSelected, TimedEvent
from executive.mission.load import load_mission
from executive.plugins import load_cell_kind, load_skills
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.result import Result, read_result
from executive.record.run_directory import RunDirectory
from executive.record.timeline.timeline import Timeline
from executive.run.assembly import RunOptions

RESULT = Result(mission="sort", status="SUCCESS", reason="", message="", node="", seed=7, robot_time_s=1 / 3)


def change(item: str, state: str, bin: str = "", attempts: int = 0) -> ItemChanged:
    return ItemChanged(item, item[:-2], state, (0.5, 0.0, 0.0), 1, attempts, bin, "")


def timeline(*events: tuple[float, object]) -> Timeline:
    return Timeline.from_events(TimedEvent(round(clock * 240), clock, event) for clock, event in events)


def test_an_item_takes_the_time_from_its_selections_to_its_end() -> None:
    seen = timeline(
        (0.0, change("cube-1", "seen")),
        (0.0, change("duck-1", "seen")),
        (1.0, TargetSelected("cube-1", "cube", 1, "left")),
        (2.0, TargetSelected("duck-1", "duck", 1, "right")),
        (5.0, change("duck-1", "placed", "right")),
        (6.0, TargetSelected("cube-1", "cube", 1, "left")),
        (8.0, change("cube-1", "rejected", attempts=3)),
        (9.0, RunEnded("INCOMPLETE", "", "", "", False, "", 9, 9.0)),
    )
    shared = {"run_index": 4, "robot_time_s": 3.0}
    assert make_record(4, {}, RESULT, seen).items == (
        ItemRow(item="cube-1", label="cube", state="rejected", bin="", failed_attempts=3, **shared),
        ItemRow(item="duck-1", label="duck", state="placed", bin="right", failed_attempts=0, **shared),
    )


def test_a_row_contains_all_activations_of_a_skill() -> None:
    seen = timeline(
        (0.0, NodeStarted("tree")),
        (0.0, NodeStarted("tree/Grasp", "Grasp")),
        (0.1, NodeEnded("tree/Grasp", "FAILURE", "Grasp", reason="missed")),
        (0.2, NodeStarted("tree/again:Grasp", "Grasp")),
        (0.4, NodeEnded("tree/again:Grasp", "SUCCESS", "Grasp")),
        (0.4, NodeStarted("tree/Release", "Release")),
        (0.5, NodeEnded("tree/Release", "INVALID", "Release")),
    )
    assert make_record(4, {}, RESULT, seen).skills == (
        SkillRow(run_index=4, skill="Grasp", activations=2, failed_activations=1, robot_time_s=0.3),
        SkillRow(run_index=4, skill="Release", activations=1, failed_activations=0, robot_time_s=0.1),
    )


@pytest.mark.parametrize("seed", [0, 3])
def test_the_rows_follow_from_the_record_of_the_run(seed: int, tmp_path: Path) -> None:
    skills, history = load_skills(), Timeline()
    loaded = load_mission("sort_fruit", skills, {}, load_cell_kind)
    result = record_run(loaded, RunOptions(seed), tmp_path, RecordOptions(timeline=history))
    record = make_record(5, {"a": "1"}, result, history)
    journal = read_journal(Path(result.run) / "journal.jsonl")
    stored = read_result(RunDirectory(Path(result.run)), journal)
    assert stored is not None
    assert record == make_record(5, {"a": "1"}, stored, Timeline.from_events(journal))
    assert (record.run.run_index, record.run.seed, record.run.variant) == (5, seed, {"a": "1"})
    assert record.run.items.placed == sum(item.state == "placed" for item in record.items) > 0
    assert 0 < sum(item.robot_time_s for item in record.items) < record.run.robot_time_s
    assert {"Detect", "Grasp", "Release"} <= {row.skill for row in record.skills}
