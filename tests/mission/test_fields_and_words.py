"""Missions that read fields of values, go through poses, bins, classes and items, and compare values."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from executive.behaviours import load_skills
from executive.events import NodeEnded
from executive.mission.load import load_mission
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import MissionResult, run_mission
from executive.text.findings import MissionError

HEAD = """\
mission: m
cell: cells/overhead.yaml
library: library/sorting.yaml
routes: {duck: yellow_bin, cube: red_bin}
"""

Execute = Callable[[str], MissionResult]


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    """Write a mission with the given tree, and return its path."""

    def write(text: str) -> Path:
        path = tmp_path / "m.yaml"
        path.write_text(HEAD + text)
        return path

    return write


@pytest.fixture
def execute(write: Callable[[str], Path]) -> Execute:
    """Run a mission on a table with two cubes, a duck and a sphere."""

    def put_four(cell: FakeCell) -> None:
        cell.world.objects.clear()
        for place in (("cube", 0.45, 0.1), ("cube", 0.6, 0.1), ("duck", 0.45, -0.1), ("sphere", 0.6, -0.1)):
            cell.world.put(*place)

    return lambda text: run_mission(write(text), arrange=put_four)


def list_ends(result: MissionResult) -> list[NodeEnded]:
    """Return the ends of all nodes `holds`."""
    ends = (timed.event for timed in result.events if isinstance(timed.event, NodeEnded))
    return [end for end in ends if end.node.endswith("holds")]


def compare(value: str, to: str) -> str:
    """Return a tree that selects an object and compares a value; the nearest object is a cube."""
    return f"tree: [{{use: look}}, SelectTarget, {{holds: {value} == {to}}}]"


@pytest.mark.parametrize(
    ("value", "to"),
    [
        ("$target.label", "'cube'"),
        ("$target.item", "$item"),
        ("$item.label", "$target.label"),
        ("$item.attempts", "0"),
    ],
)
def test_a_skill_reads_a_field_of_a_variable(execute: Execute, value: str, to: str) -> None:
    result = execute(compare(value, to))
    assert (result.status, result.message) == ("SUCCESS", "")


def test_the_fields_of_an_item_are_read_from_the_ledger_when_the_skill_starts(execute: Execute) -> None:
    result = execute(
        "tree:\n"
        "  - [{use: look}, SelectTarget, {holds: $item.deferrals == 0}]\n"
        "  - [Defer, {holds: $item.deferrals == 1}]\n"
        "  - [{holds: $item.state == 'deferred'}, {use: carry}]\n"
        "  - [{holds: $item.state == 'placed'}, {holds: $item.bin == 'red_bin'}]\n"
    )
    assert (result.status, result.message, result.items["placed"]) == ("SUCCESS", "", 1)


def test_a_loop_goes_through_a_field_with_a_list(execute: Execute) -> None:
    result = execute(
        "tree:\n"
        "  - [MoveToScan, Detect]\n"
        "  - for_each:\n"
        "      each: one\n"
        "      in: $detections.confident\n"
        "      do: {fallback: [{holds: $one.label == 'cube'}, succeed]}\n"
    )
    assert sorted(end.status for end in list_ends(result)) == ["FAILURE"] * 2 + ["SUCCESS"] * 2


@pytest.mark.parametrize(
    ("word", "elements"),
    [
        ("poses", ["home", "aside"]),
        ("bins", ["red_bin", "blue_bin", "yellow_bin"]),
        ("classes", ["duck", "cube"]),
        ("items", ["cube-1", "cube-2", "duck-1"]),
    ],
)
def test_a_word_stands_for_a_list_of_names(execute: Execute, word: str, elements: list[str]) -> None:
    result = execute(
        "tree:\n"
        "  - use: look\n"
        f"  - for_each: {{each: one, in: {word}, do: {{try: {{holds: \"$one == 'no'\"}},"
        " catch: [{on: [holds.false], do: succeed}]}}\n"
    )
    messages = [end.message for end in list_ends(result)]
    assert sorted(message.rpartition("= ")[2] for message in messages) == sorted(elements)


def test_a_word_is_no_mistake_if_the_cell_file_has_errors(tmp_path: Path) -> None:
    (tmp_path / "broken.yaml").write_text("base: cells/overhead.yaml\nbins: 3\n")
    path = tmp_path / "m.yaml"
    path.write_text(
        "mission: m\ncell: broken.yaml\nroutes: {}\n"
        "tree: {for_each: {each: pose, in: poses, do: {MoveToScan: {pose: $pose}}}}\n"
    )
    with pytest.raises(MissionError) as error:
        load_mission(path, load_skills())
    assert {finding.path for finding in error.value.findings} == {str(tmp_path / "broken.yaml")}
