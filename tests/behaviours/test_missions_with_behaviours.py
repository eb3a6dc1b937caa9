"""Missions whose leaves are behaviours of py_trees: run, halted, explained, checked, replayed and resumed."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import foreign
import jsonschema
import pytest
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from executive.campaign.mission_under_test import MissionUnderTest
from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.events import NodeEnded, TimedEvent
from executive.mission.findings import MissionError
from executive.mission.load import load_mission
from executive.mission.schema.file_schemas import make_mission_schema
from executive.mission.source import Source
from executive.mission.text.yaml_text import parse_yaml
from executive.plugins import load_skills
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import replay_run
from executive.record.run_directory import find_run
from executive.run.assembly import RunOptions, assemble
from executive.testing.run_mission import MissionResult, run_mission
from executive.testing.substitutes import make_failing
from executive.tree.node_registry import load_control_nodes
from tests.benchmarks import kills
from tests.record.test_resume import Cut, Cutter, decided_again, resumed

PROJECT = """\
[project]
name = "hall"
[project.entry-points."executive.skills"]
Never = "foreign:Never"
Denied = "foreign:Denied"
Double = "foreign:Double"
Tally = "foreign:Counter"
Draw = "foreign:Draw"
"""

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Write a mission with a tree into a project that registers behaviours."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pyproject.toml").write_text(PROJECT)

    def write(tree: str, keys: str = "") -> Path:
        path = tmp_path / "tried.yaml"
        path.write_text(f"mission: tried\ncell: cells/overhead.yaml\n{keys}tree:\n{tree}", encoding="utf-8")
        return path

    return write


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
FIVE_NAMES = (
    "TickCounter", "SetBlackboardVariable", "CheckBlackboardVariableExists", "SuccessEveryN", "StatusQueue",
)  # fmt: skip
COUNT = """\
  repeat:
    until: Tally.failed
    do:
      - Tally: {most: 3}
      - PyTree: {class: py_trees.behaviours:TickCounter, duration: 2, completion_status: SUCCESS}
"""


RANDOM = """\
      - {PyTree: {class: "py_trees.timers:Timer", duration: 0.004}}
      - retry: {attempts: 99, do: {PyTree: {class: py_trees.behaviours:ProbabilisticBehaviour}}}
      - parallel: {do: [{Draw: {number: $drawn}}, {Draw: {most_ticks: 40}, as: other}]}
      - try: {timeout: {seconds: 0.1, do: {Draw: {most_ticks: 999999}, as: long}}}
        catch: [{on: timeout.timeout, do: succeed}]
      - [Tally, {IsEqual: {value: $drawn, to: $drawn}}]
"""
DRAW_THRICE = "  for_each:\n    each: turn\n    in: [1, 2, 3]\n    do:\n" + RANDOM
CARRY = "      - [{use: find, as: found}, {use: carry}]\n"
SORT = f"  repeat:\n    until: found.no_candidate\n    do:\n{RANDOM}{CARRY}\n"


def test_five_behaviours_of_py_trees_run_as_leaves(write: Write) -> None:
    before = dict(Blackboard.storage), dict(Blackboard.clients)
    result = run_mission(write(FIVE))
    assert (result.status, result.message) == ("SUCCESS", "")
    assert find_ends(result) == [(name, "SUCCESS") for name in FIVE_NAMES]
    # Three ticks of the counter and two of the queue end with a control step.
    assert result.robot_time == pytest.approx(5 / 240, abs=1e-6)
    assert (dict(Blackboard.storage), dict(Blackboard.clients)) == before


def test_they_fail_with_their_feedback_message(write: Write) -> None:
    result = run_mission(write("  - PyTree: {class: py_trees.behaviours:SuccessEveryN, n: 2}\n"))
    assert (result.status, result.reason, result.message) == ("FAILURE", "SuccessEveryN.failed", "not yet")


@pytest.mark.parametrize(
    ("node", "name", "message"),
    [
        ("{PyTree: {class: py_trees.behaviours:CheckBlackboardVariableExists, variable_name: a}}",
         "CheckBlackboardVariableExists", "variable 'a' not found"),
        ("{PyTree: {class: py_trees.behaviours:Failure}}", "Failure", "failure"),
        ("Denied", "Denied", "success -> failure"),
    ],
)  # fmt: skip
def test_a_failure_is_handled_by_its_reason(node: str, name: str, message: str, write: Write) -> None:
    result = run_mission(write(f"  try: {node}\n  catch: [{{on: {name}.failed, do: succeed}}]\n"))
    assert result.status == "SUCCESS"
    ends = [timed.event for timed in result.events if isinstance(timed.event, NodeEnded)]
    (failure,) = [end for end in ends if end.skill == name]
    assert (failure.status, failure.reason, failure.message) == ("FAILURE", "failed", message)


@pytest.mark.parametrize(
    "behaviour",
    [
        "{PyTree: {class: py_trees.behaviours:TickCounter, duration: 9999, completion_status: SUCCESS}}",
        "{PyTree: {class: py_trees.behaviours:Running}}",
        "{PyTree: {class: py_trees.behaviours:Dummy}}",
        "{PyTree: {class: py_trees.behaviours:StatusQueue, queue: [RUNNING], eventually: null}}",
        "{PyTree: {class: py_trees.behaviours:WaitForBlackboardVariable, variable_name: a}}",
        "Never",
    ],
)
def test_they_are_halted(behaviour: str, write: Write) -> None:
    result = run_mission(write(f"  timeout: {{seconds: 0.1, do: {behaviour}}}\n"))
    assert (result.status, result.reason) == ("FAILURE", "timeout.timeout")
    assert [status for _, status in find_ends(result)] == ["INVALID"]


def test_an_exception_is_a_fault_of_the_node(write: Write) -> None:
    tree = "  PyTree: {class: py_trees.behaviours:BlackboardToStatus, variable_name: a}\n"
    result = run_mission(write(tree))
    assert (result.status, result.node) == ("FAULT", "tree/BlackboardToStatus")
    assert result.message.startswith("BlackboardToStatus: KeyError: ")


def test_interleaved_runs_count_for_themselves(write: Write) -> None:
    loaded = load_mission(write(COUNT), load_skills())
    events: list[list[TimedEvent]] = [[], []]
    runs = [assemble(loaded, RunOptions(0, (), make_cell=FakeCell), [each.append]) for each in events]
    for _ in range(20):
        for run in runs:
            if run.root.status is not Status.SUCCESS:
                run.root.tick_once()
                run.workcell.advance()
    for each in events:
        assert find_ends(each).count(("Tally", "SUCCESS")) == 3
        assert find_ends(each)[-1] == ("Tally", "FAILURE")
    for run in runs:
        run.close()


def test_ports_are_connected_to_variables(write: Write) -> None:
    tree = """\
  - for_each: {each: size, in: [1.5, 2.0], do: {Double: {number: $size, doubled: $twice}}}
  - Double: {number: $twice, offset: 1.0, note: again, remark: $text}
"""
    result = run_mission(write(tree))
    assert result.status == "SUCCESS"
    ends = [timed.event for timed in result.events if isinstance(timed.event, NodeEnded)]
    outputs = [end.outputs for end in ends if end.skill]
    assert outputs == [
        {"doubled": 3.5, "remark": "note: none"},
        {"doubled": 4.5, "remark": "note: none"},
        {"doubled": 10.0, "remark": "note: again"},
    ]


@pytest.mark.parametrize(
    ("tree", "place", "code"),
    [
        ("  - Double\n", "4:5", "unwritten"),
        ("  - Double: {number: $size}\n", "4:22", "unwritten"),
        ("  - Double: {numbr: 3.0}\n", "4:14", "unknown-param"),
        ("  - Double: {number: many}\n", "4:22", "wrong-type"),
        ("  - Double: {number: 3, doubled: 4}\n", "4:34", "wrong-type"),
        ("  - Double: {number: 3, remark: $text}\n  - Double: {number: $text}\n", "5:22", "port-type"),
        ("  - MoveToScan\n  - Detect\n  - Double: {number: $detections}\n", "6:22", "port-type"),
        ("  - Double: {number: 3}\n  - SelectTarget: {targets: $doubled}\n", "5:29", "port-type"),
        ("  - for_each: {each: size, in: [1, a], do: {Double: {number: $size}}}\n", "4:36", "port-type"),
        ("  - parallel: {do: [{Double: {number: 1}}, {Double: {number: 2}}]}\n", "4:45", "shared-variable"),
    ],
)
def test_ports_are_checked(tree: str, place: str, code: str, write: Write) -> None:
    with pytest.raises(MissionError) as caught:
        load_mission(write(tree), load_skills())
    found = [(f"{finding.line}:{finding.col}", finding.code) for finding in caught.value.findings]
    assert (place, code) in found, str(caught.value)


def test_two_classes_of_one_name_are_refused(write: Write) -> None:
    (Path.cwd() / "pyproject.toml").write_text(PROJECT.replace("Tally", "SuccessEveryN"))
    with pytest.raises(MissionError, match=r'4:21: .*there is another skill "SuccessEveryN"; register'):
        load_mission(write("  - PyTree: {class: py_trees.behaviours:SuccessEveryN, n: 2}\n"), load_skills())


def test_a_registered_class_may_be_named_by_its_path_too(write: Write) -> None:
    result = run_mission(write("  - PyTree: {class: foreign:Double, number: 1}\n  - Double: {number: 2}\n"))
    assert find_ends(result) == [("Double", "SUCCESS")] * 2


def record(path: Path, tmp_path: Path) -> Path:
    loaded = load_mission(path, load_skills())
    options = RunOptions(0, (), make_cell=FakeCell)
    record_run(loaded, options, tmp_path / "runs", RecordOptions(saves_pictures=False))
    return find_run("latest", tmp_path / "runs")


def test_a_replay_executes_no_behaviour(write: Write, tmp_path: Path) -> None:
    run = record(write(DRAW_THRICE), tmp_path)
    foreign.Draw.count = 0
    result = replay_run(run, read_journal(run / "journal.jsonl"), load_skills())
    assert (result.is_equal, result.difference, foreign.Draw.count) == (True, "", 0)
    assert result.decisions > 40


def cut(path: Path, tmp_path: Path, tick: int) -> Path:
    """Begin a run that is cut off in a control step, and return its directory."""
    loaded, options = load_mission(path, load_skills()), RunOptions(0, (), make_cell=FakeCell)
    with pytest.raises(Cut):
        record_run(loaded, options, tmp_path / "runs", RecordOptions([Cutter(tick)], False))
    return find_run("latest", tmp_path / "runs")


def test_an_interrupted_run_continues_with_its_blackboard(write: Write, tmp_path: Path) -> None:
    run = cut(write(COUNT), tmp_path, 4)
    assert resumed(run).status == "SUCCESS"
    ends = find_ends(list(read_journal(run / "journal.jsonl")))
    assert ends.count(("Tally", "SUCCESS")) == 3, "the count goes on where it was"


@pytest.mark.parametrize("tick", [1, 30, 60])
def test_a_twice_interrupted_run_keeps_its_random_results(write: Write, tmp_path: Path, tick: int) -> None:
    run = cut(write(DRAW_THRICE), tmp_path, tick)
    with pytest.raises(Cut):
        resumed(run, views=[Cutter(tick + 10)])
    assert (resumed(run).status, decided_again(run).difference) == ("SUCCESS", "")


@pytest.mark.slow
def test_decisions_and_books_survive_random_interruptions(write: Write, tmp_path: Path) -> None:
    keys = "library: library/sorting.yaml\nroutes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}\n"
    loaded = load_mission(write(SORT, keys), load_skills())
    subject = MissionUnderTest(loaded, FakeCell, "fake", seed=0)
    count = int(os.environ.get("INTERRUPTIONS", "10"))
    assert kills.measure(subject, tmp_path, count, changed=0, halted=count // 2)["problems"] == []


def test_what_a_halted_behaviour_wrote_is_restored(write: Write, tmp_path: Path) -> None:
    tree = """\
  - try: {timeout: {seconds: 0.1, do: {Draw: {most_ticks: 999999}}}}
    catch: [{on: timeout.timeout, do: succeed}]
  - Wait: {seconds: 1}
  - PyTree: {class: py_trees.behaviours:CheckBlackboardVariableExists, variable_name: drawing}
"""
    result = resumed(cut(write(tree), tmp_path, 60))
    assert result.reason == "CheckBlackboardVariableExists.failed"


def test_a_value_that_json_cannot_restore_prevents_a_resumption(write: Write, tmp_path: Path) -> None:
    run = cut(write("  - PyTree: {class: foreign:Keep}\n  - Wait: {seconds: 1}\n"), tmp_path, 4)
    assert decided_again(run).difference == ""
    with pytest.raises(InputError, match=r'"/kept" \(Status\)'):
        resumed(run)


def test_the_failure_of_a_recorded_run_is_explained(write: Write, tmp_path: Path) -> None:
    tree = "  retry: {attempts: 2, do: {PyTree: {class: py_trees.behaviours:Failure}}}\n"
    run = record(write(tree), tmp_path)
    text = (run / "result.json").read_text()
    assert "Failure failed (failed) on the last of 2 attempts: failure" in text
    assert "tried.yaml:4" in text


def test_a_substitute_replaces_a_behaviour(write: Write) -> None:
    path = write("  - {PyTree: {class: py_trees.behaviours:Success}}\n")
    skill = load_mission(path, load_skills()).skills["Success"]
    result = run_mission(path, substitutes={"*/Success": make_failing(skill, "failed")})
    assert (result.status, result.message) == ("FAILURE", "injected failure")


@pytest.mark.parametrize("tree", [FIVE, COUNT])
def test_an_editor_accepts_the_mission(tree: str, write: Write) -> None:
    root, _ = parse_yaml(Source("tried.yaml", write(tree).read_text()))
    assert root is not None
    schema = make_mission_schema(load_skills(), load_control_nodes())
    jsonschema.validate(root.python_value, schema)


def test_an_editor_misses_the_class(write: Write) -> None:
    root, _ = parse_yaml(Source("tried.yaml", write("  - PyTree: {n: 3}\n").read_text()))
    assert root is not None
    schema = make_mission_schema(load_skills(), load_control_nodes())
    with pytest.raises(jsonschema.ValidationError, match="'class' is a required property"):
        jsonschema.validate(root.python_value, schema)
