"""The behaviour that the guide adds to a new project."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from guide_blocks import Block, blocks

from executive.cli.init.project import write_project
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.testing.run_mission import run_mission

MISSION = """\
mission: average
cell: cells/table.yaml
tree:
  - for_each: {each: height, in: [1.0, 2.0], do: {Average: {first: 3.0, second: $height}}}
  - Average: {first: $mean, mean: $result}
  - Average: {first: $result}
"""


def find_block(language: str, text: str) -> Block:
    (block,) = (
        one for one in blocks("missions/expressions.md") if one.language == language and text in one.text
    )
    return block


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A new project with the behaviour, as the working directory."""
    folder = tmp_path / "hall"
    write_project(folder, "hall")
    (folder / "hall" / "average.py").write_text(find_block("python", "class Average").text)
    header, entry = find_block("toml", "Average").text.splitlines()
    file = folder / "pyproject.toml"
    assert header in file.read_text(), "the new project has this table"
    file.write_text(file.read_text().replace(header, f"{header}\n{entry}"))
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)
    yield folder
    for module in set(sys.modules) - before:
        del sys.modules[module]


def test_the_behaviour_is_a_leaf_with_checked_ports(project: Path) -> None:
    mission = project / "average.yaml"
    mission.write_text(MISSION)
    assert load_mission(mission, load_skills()).warnings == ()
    result = run_mission(mission)
    assert result.status == "SUCCESS"
    outputs = [
        end.outputs for end in (timed.event for timed in result.events) if getattr(end, "outputs", None)
    ]
    assert outputs == [{"mean": 2.0}, {"mean": 2.5}, {"mean": 1.25}, {"mean": 0.625}]
