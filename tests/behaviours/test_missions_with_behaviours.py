"""Missions whose leaves are behaviours of py_trees: run, halted, explained, checked, replayed and resumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import foreign
import pytest
from guide_blocks import blocks
from py_trees.blackboard import Blackboard

from executive.behaviours import load_skills
from executive.errors import InputError
from executive.events import NodeEnded, TimedEvent
from executive.mission.load import load_mission
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import replay_run, resume_run
from executive.record.result import Result
from executive.record.run_directory import find_run
from executive.run.assembly import RunOptions
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import MissionResult, run_mission
from executive.text.findings import MissionError
from tests.cut_off import Cut, Cutter

PROJECT = """\
[project]
name = "hall"
[project.entry-points."executive.skills"]
Quiet = "foreign:Quiet"
Double = "foreign:Double"
Tally = "foreign:Counter"
"""

Write = Callable[[str], Path]
OPTIONS = RunOptions(0, (), make_cell=FakeCell)


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Write a mission with a tree into a project that registers behaviours."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pyproject.toml").write_text(PROJECT)

    def write(tree: str) -> Path:
        path = tmp_path / "tried.yaml"
        path.write_text(f"mission: tried\ncell: cells/overhead.yaml\ntree:\n{tree}", encoding="utf-8")
        return path

    return write


def find_outputs(result: MissionResult) -> list[Mapping[str, object]]:
    ends = [timed.event for timed in result.events if isinstance(timed.event, NodeEnded)]
    return [end.outputs for end in ends if end.skill]


def find_ends(events: list[TimedEvent] | MissionResult) -> list[tuple[str, str]]:
    """Return skill and status of each skill that ended."""
    timed_events = events.events if isinstance(events, MissionResult) else events
    ends = [timed.event for timed in timed_events if isinstance(timed.event, NodeEnded)]
    return [(end.skill, end.status) for end in ends if end.skill]


FIVE = """\
  - PyTree: {class: py_trees.behaviours:TickCounter, duration: 3, completion_status: SUCCESS}
  - PyTree:
      {class: py_trees.behaviours:SetBlackboardVariable, variable_name: a, variable_value: 1, overwrite: true}
  - PyTree: {class: py_trees.behaviours:CheckBlackboardVariableExists, variable_name: a}
  - PyTree: {class: py_trees.behaviours:SuccessEveryN, n: 1}
  - PyTree: {class: py_trees.behaviours:StatusQueue, queue: [RUNNING, RUNNING], eventually: SUCCESS}
"""
COUNT = """\
  repeat:
    until: Tally.failed
    do:
      - Tally: {most: 3}
      - PyTree: {class: py_trees.behaviours:TickCounter, duration: 20, completion_status: SUCCESS}
"""


def test_five_behaviours_of_py_trees_run_as_leaves(write: Write) -> None:
    before = dict(Blackboard.storage), dict(Blackboard.clients)
    result = run_mission(write(FIVE))
    assert (result.status, result.message) == ("SUCCESS", "")
    assert find_ends(result)[0] == ("TickCounter", "SUCCESS")
    assert [status for _, status in find_ends(result)] == ["SUCCESS"] * 5
    # Three ticks of the counter and two of the queue end with a control step.
    assert result.robot_time == pytest.approx(5 / 240, abs=1e-6)
    assert (dict(Blackboard.storage), dict(Blackboard.clients)) == before


@pytest.mark.parametrize(
    ("node", "status", "message"),
    [
        ("PyTree: {class: py_trees.behaviours:SuccessEveryN, n: 2}", "FAILURE", "not yet"),
        ("timeout: {seconds: 0.1, do: {PyTree: {class: py_trees.behaviours:Running}}}", "FAILURE", "0.1 s"),
        ("try: Quiet\n  catch: [{on: Quiet.failed, do: succeed}]", "SUCCESS", ""),
        ("PyTree: {class: py_trees.behaviours:BlackboardToStatus, variable_name: a}", "FAULT", "KeyError"),
    ],
)
def test_failures_halts_and_faults_are_those_of_a_skill(
    node: str, status: str, message: str, write: Write
) -> None:
    result = run_mission(write(f"  {node}\n"))
    assert result.status == status
    assert message in result.message


def test_ports_are_connected_to_variables(write: Write) -> None:
    tree = """\
  - for_each: {each: size, in: [1.5, 2.0], do: {Double: {number: $size, doubled: $twice}}}
  - Double: {number: $twice, offset: 1.0, note: again, remark: $text}
"""
    assert find_outputs(run_mission(write(tree))) == [
        {"doubled": 3.5, "remark": "note: none"},
        {"doubled": 4.5, "remark": "note: none"},
        {"doubled": 10.0, "remark": "note: again"},
    ]


@pytest.mark.parametrize(
    ("tree", "place", "code"),
    [
        ("  - Double\n", "4:5", "unwritten"),
        ("  - Double: {number: many}\n", "4:22", "wrong-type"),
        ("  - MoveToScan\n  - Detect\n  - Double: {number: $detections}\n", "6:22", "port-type"),
        ("  - parallel: {do: [{Double: {number: 1}}, {Double: {number: 2}}]}\n", "4:45", "shared-variable"),
    ],
)
def test_ports_are_checked(tree: str, place: str, code: str, write: Write) -> None:
    with pytest.raises(MissionError) as caught:
        load_mission(write(tree), load_skills())
    found = [(f"{finding.line}:{finding.col}", finding.code) for finding in caught.value.findings]
    assert (place, code) in found, str(caught.value)


def record(path: Path, *views: Cutter) -> Path:
    loaded = load_mission(path, load_skills())
    with suppress(Cut):
        record_run(loaded, OPTIONS, path.parent / "runs", RecordOptions(views, saves_pictures=False))
    return find_run("latest", path.parent / "runs")


def resume(run: Path) -> Result:
    return resume_run(run, load_skills(), OPTIONS, RecordOptions(saves_pictures=False))


def test_a_replay_executes_no_behaviour(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    run = record(write(COUNT))
    monkeypatch.setattr(foreign.Counter, "update", lambda self: 1 / 0)
    result = replay_run(run, read_journal(run / "journal.jsonl"), load_skills())
    assert (result.is_equal, result.difference) == (True, "")
    assert result.decisions > 10


def test_an_interrupted_run_continues_with_its_blackboard(write: Write) -> None:
    run = record(write(COUNT), Cutter(40))
    assert resume(run).status == "SUCCESS"
    ends = find_ends(list(read_journal(run / "journal.jsonl")))
    assert ends.count(("Tally", "SUCCESS")) == 3, "the count goes on where it was"


def test_a_value_that_json_cannot_restore_prevents_a_resumption(write: Write) -> None:
    run = record(write("  - PyTree: {class: foreign:Keep}\n  - Wait: {seconds: 1}\n"), Cutter(40))
    with pytest.raises(InputError, match=r'"/kept" \(Status\)'):
        resume(run)


def test_the_behaviour_of_the_guide_is_a_leaf(write: Write) -> None:
    texts = {
        block.language: block.text for block in blocks("missions/expressions.md") if "Average" in block.text
    }
    Path("hall").mkdir()
    Path("hall/average.py").write_text(texts["python"])
    Path("pyproject.toml").write_text(PROJECT + texts["toml"].splitlines()[-1])
    result = run_mission(write("  - Average: {first: 3.0, second: 1.0}\n  - Average: {first: $mean}\n"))
    assert find_outputs(result) == [{"mean": 2.0}, {"mean": 1.0}]
