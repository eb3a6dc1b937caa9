"""A kind of tool of another project is one file and one entry point; nothing in the package knows it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from at_terminal import invoke

from executive.behaviours import load_skills
from executive.drivers.sim.world import SimVisuals, World
from executive.mission.cell_file import load_cell
from executive.mission.load import load_mission
from executive.mission.schema import make_cell_schema
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import replay_run
from executive.run.assembly import RunOptions
from executive.station.check import load_checker
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import during, grip_fails, grip_lost
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import run_mission

PROJECT = '[project]\nname = "yard"\n[project.entry-points."executive.tools"]\nmagnet = "magnet:Magnet"\n'
CELL = """\
base: overhead.yaml
cell: yard
tool: {kind: magnet, force: 6, source: a test}
motion: {descent_speed: 0.03}
table: {objects: [3, 3]}
"""

WriteMission = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path, missions: Path, monkeypatch: pytest.MonkeyPatch) -> WriteMission:
    """Write a mission with these routes, and its cell, into a project that registers the magnet."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pyproject.toml").write_text(PROJECT)
    (tmp_path / "overhead.yaml").write_text((missions / "cells" / "overhead.yaml").read_text())
    (tmp_path / "yard.yaml").write_text(CELL)
    text = (missions / "sort_overhead.yaml").read_text(encoding="utf-8")

    def write(routes: str) -> Path:
        changed = text.replace("cells/overhead.yaml", "yard.yaml")
        changed = changed.replace("{cube: red_bin, sphere: blue_bin, duck: yellow_bin}", routes)
        path = tmp_path / "sort_steel.yaml"
        path.write_text(changed, encoding="utf-8")
        return path

    return write


@pytest.fixture
def mission(write: WriteMission) -> Path:
    """A mission that sorts cubes only."""
    return write("{cube: red_bin}")


def put_objects(cell: FakeCell) -> None:
    """Put two cubes and a sphere on the table, instead of the random objects."""
    cell.world.objects.clear()
    for label, y in (("cube", -0.1), ("sphere", 0.0), ("cube", 0.1)):
        cell.world.put(label, 0.5, y)


def test_a_mission_with_it_is_checked(write: WriteMission) -> None:
    assert invoke("check", str(write("{cube: red_bin}"))).exit_code == 0
    result = invoke("check", str(write("{cube: red_bin, sphere: blue_bin}")))
    assert "error[robot]: the magnet cannot hold a sphere" in result.output


def test_its_section_is_validated_with_its_own_keys(mission: Path) -> None:
    mission.with_name("yard.yaml").write_text(
        mission.with_name("yard.yaml").read_text().replace("force", "fource")
    )
    output = invoke("check", str(mission)).output
    assert 'error[unknown-key]: tool has no key "fource"' in output
    assert "force" in output.partition("Keys of tool")[2]


def test_the_schema_of_cells_contains_it_beside_the_shipped_kinds(mission: Path) -> None:
    kinds = [
        one["properties"]["kind"]["const"] for one in make_cell_schema()["definitions"]["ToolModel"]["anyOf"]
    ]
    assert kinds == ["fingers", "magnet", "suction"]


def test_it_sorts_the_objects_that_it_can_hold(mission: Path) -> None:
    result = run_mission(mission, arrange=put_objects)
    assert (result.status, result.agrees) == ("SUCCESS", True)
    assert (result.items["placed"], result.items["skipped"]) == (2, 1)


def test_it_holds_no_other_object(write: WriteMission) -> None:
    cell = FakeCell(load_cell(write("{cube: red_bin}").with_name("yard.yaml")))
    put_objects(cell)
    for label, is_holding in (("sphere", False), ("cube", True)):
        touched = next(each for each in cell.world.objects if each.label == label)
        height = cell.cell.classes[label].height
        cell.arm.set_tool_position(touched.position + np.array([0.0, 0.0, height / 2]))
        cell.tool.close()
        assert cell.tool.holding is is_holding
        cell.tool.open()


def test_its_faults_have_its_wording(mission: Path) -> None:
    faults = [during("*/Grasp", grip_fails(), activations=1), during("*/Transit", grip_lost(), activations=1)]
    result = run_mission(mission, arrange=put_objects, faults=faults)
    messages = [timed.event.message for timed in result.events if getattr(timed.event, "message", "")]
    assert any("no hold on cube-" in message for message in messages)
    assert any("the hold on cube-" in message and "broke on the way" in message for message in messages)
    assert (result.status, result.items["placed"]) == ("SUCCESS", 2)


def test_a_run_with_it_is_recorded_and_replayed(mission: Path, tmp_path: Path) -> None:
    loaded = load_mission(mission, load_skills())
    record_run(loaded, RunOptions(1, make_cell=FakeCell), tmp_path / "runs", RecordOptions())
    run = tmp_path / "runs" / "latest"
    assert "kind: magnet" in (run / "cell.yaml").read_text()
    assert replay_run(run, read_journal(run / "journal.jsonl"), load_skills()).is_equal


def test_its_parts_are_shown_and_checked(mission: Path) -> None:
    config = load_cell(mission.with_name("yard.yaml"))
    assert list(load_checker("sim").check(config, mission.parent)) == []
    world = World(config)
    rod, head = [shape for shape in SimVisuals(world).shapes if shape.kind == "cylinder"]
    world.close()
    assert (head.size[0], head.size[2]) == pytest.approx((0.024, 0.02))
    assert rod.size[2] + head.size[2] == pytest.approx(config.tool.length)


@pytest.mark.slow
def test_it_sorts_in_simulation_also_after_it_lost_an_object(mission: Path) -> None:
    faults = [during("*/Transit", grip_lost(), activations=1)]
    result = run_mission(mission, make_oracle_kind(), seed=2, faults=faults)
    assert (result.status, result.agrees) == ("SUCCESS", True)
    assert result.items["placed"] >= 1
