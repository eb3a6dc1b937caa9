"""Control node of a third party: one file and one entry point in a project made by `executive init`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from at_terminal import invoke

from executive.behaviours import load_skills
from executive.events import NodeEnded
from executive.mission.load import load_mission
from executive.station.check import load_checker
from executive.testing.run_mission import run_mission
from executive.text.findings import MissionError

RACE = '''
"""Race of branches."""

from collections.abc import Iterator

from py_trees.common import Status

from executive.skill import Seconds
from executive.tree.flow import Flow, FlowFunction, FlowState, join_states
from executive.tree.keys import Children, key
from executive.tree.node import ControlNode, NodeBehaviour, PropagatedFailure
from executive.tree.parallel import combine_tool_states, find_end_tool_states


class Race(ControlNode):
    """All at the same time; the first branch that succeeds halts the others."""

    keyword = "race"
    symbol = "⚑"

    head_start: Seconds = key(default=0.0, ge=0, doc="Time before the other branches begin [s].")
    do: Children = key(shorthand=True, doc="The branches.")

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        flows = [get_flow(child, state) for child in self.do]
        ends = [find_end_tool_states(flow, state, can_be_halted=True) for flow in flows]
        tools = combine_tool_states(state.tool_states, ends)
        success = join_states(flow.success for flow in flows)
        halted = join_states(flow.halted for flow in flows)
        success, halted = (end and end.with_tool_states(tools) for end in (success, halted))
        ends = [end for flow in flows for end in flow.failures.items()]
        return Flow(success, {failure: end.with_tool_states(tools) for failure, end in ends}, halted)

    @property
    def concurrent_children(self) -> Children:
        return self.do

    def explain(self, failure: PropagatedFailure) -> str:
        return f"none of the {len(self.do)} branches succeeded"

    class Behaviour(NodeBehaviour):
        node: "Race"

        def start(self) -> None:
            self._running = list(self.node.do)
            self._begin = self.clock.now + self.node.head_start

        def step(self) -> Status:
            for child in list(self._running):
                if child is not self.node.do[0] and self.clock.now < self._begin:
                    continue
                status = self.tick_child(child)
                if status is Status.SUCCESS:
                    self.halt_children(other for other in self._running if other is not child)
                    return status
                if status is Status.FAILURE:
                    self._running.remove(child)
                    if not self._running:
                        return self.fail(self.get_failure(child))
            return Status.RUNNING
'''

MISSION = """
mission: race
cell: cells/table.yaml
params: {{pause: 0.3}}
tree: {tree}
"""


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A new project with the control node `race`; it is the working directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    created = invoke("init", "arena")
    assert created.exit_code == 0, created.output
    folder = tmp_path / "arena"
    (folder / "arena" / "race.py").write_text(RACE, encoding="utf-8")
    with (folder / "pyproject.toml").open("a") as file:
        file.write('\n[project.entry-points."executive.control_nodes"]\nrace = "arena.race:Race"\n')
    monkeypatch.chdir(folder)
    yield folder
    for module in [name for name in sys.modules if name.partition(".")[0] == "arena"]:
        del sys.modules[module]


def write(tree: str) -> Path:
    path = Path("race.yaml")
    path.write_text(MISSION.format(tree=tree), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("tree", "code"),
    [
        ("{race: {do: [Wait: {seconds: 1}], head_start: -1}}", "out-of-range"),
        ("[{race: [Wait: {seconds: 1}, {Detect: {view: table}}]}, Localize]", "unwritten"),
        ("[{race: [Wait: {seconds: 1}, Wait: {seconds: 2}]}, Release]", "tool-state"),
        ("{race: [{MoveToScan: {pose: scan}}, {MoveToScan: {pose: scan}}]}", "shared-resource"),
    ],
)
def test_a_mission_that_uses_it_is_checked(project: Path, tree: str, code: str) -> None:
    with pytest.raises(MissionError) as caught:
        load_mission(write(tree), load_skills(), find_checker=load_checker)
    assert code in {finding.code for finding in caught.value.findings}


def test_it_is_in_the_schema_the_hints_and_the_drawings(project: Path) -> None:
    definitions = json.loads(invoke("schema").stdout)["definitions"]
    assert set(definitions["race"]["anyOf"][1]["properties"]) == {"head_start", "do"}
    assert "race" in definitions["node"]["dependencies"]
    assert 'Did you mean "race"?' in invoke("check", str(write("{rase: [Wait: {seconds: 1}]}"))).output
    path = str(write("{race: {head_start: 0.5, do: [Wait: {seconds: 1}, Wait: {seconds: 2}]}}"))
    assert invoke("tree", path).stdout.splitlines()[0] == "race  (head_start: 0.5)"
    xml = invoke("tree", path, "--format", "btcpp").stdout
    assert '<race head_start="0.5">' in xml and '<Control ID="race">' in xml


def test_the_first_branch_that_succeeds_halts_the_others(project: Path) -> None:
    slow = "{race: [Wait: {seconds: 2}, Wait: {seconds: 3}]}"
    result = run_mission(write(f"{{race: {{head_start: $pause, do: [{slow}, Wait: {{seconds: 0.5}}]}}}}"))
    assert (result.status, round(result.robot_time, 1)) == ("SUCCESS", 0.8)
    ends = {one.event.node: one.event.status for one in result.events if isinstance(one.event, NodeEnded)}
    assert ends["tree/race/1:race"] == ends["tree/race/1:race/1:Wait"] == "INVALID"
    assert ends["tree/race"] == "SUCCESS"


def test_a_failure_that_it_passes_on_is_explained(project: Path) -> None:
    path = write("{race: [{invert: {Wait: {seconds: 0.1}}}, {invert: {Wait: {seconds: 0.2}}}]}")
    result = invoke("run", str(path), "--set", "cell.kind=fake", "--runs", "runs")
    assert result.exit_code == 1, result.output
    assert "none of the 2 branches succeeded" in result.output


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("class Race:\n    pass\n", "is not a ControlNode subclass"),
        (RACE.replace('keyword = "race"', 'keyword = "run"'), 'in lower case: "run"'),
        (RACE.replace("def compute_flow", "def flow"), "has no method compute_flow"),
        (RACE.replace("do: Children", "label: Children"), 'cannot have the key "label"'),
        (RACE.replace("class Behaviour", "class Other"), "has no inner class Behaviour"),
        (RACE.replace("do: Children =", "do ="), "requires a type annotation"),
    ],
)
def test_a_broken_class_is_one_clear_message(project: Path, source: str, message: str) -> None:
    Path("arena/race.py").write_text(source, encoding="utf-8")
    result = invoke("check", str(write("{Wait: {seconds: 1}}")))
    assert result.exit_code == 2
    assert message in result.output
