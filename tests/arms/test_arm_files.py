# ruff: noqa: E501 - findings are quoted as they are printed
"""Arms of other projects: an arm file beside a cell, checked, run and replayed with an unchanged package."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from at_terminal import invoke

from executive.arms.urdf import find_model
from executive.behaviours import load_skills
from executive.mission.cell_file import load_cell
from executive.mission.load import load_mission
from executive.record.run_directory import read_cell
from executive.station.check import load_checker
from executive.station.station import Station
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import run_mission
from executive.text.files import get_shipped_folder
from executive.text.findings import MissionError

CELL = """\
base: cells/overhead.yaml
cell: bench
arm:
  file: arms/cobot.yaml
  poses_deg: {home: [38, 33, 0, -88, 0, 59, 0], aside: [-38, 33, 0, -88, 0, 59, 0]}
"""
MISSION = "sort_bench.yaml"
ARM = (get_shipped_folder() / "arms" / "iiwa14.yaml").read_text().replace("arm: iiwa14", "arm: cobot", 1)
LIMITS = ARM[ARM.index("limits:") : ARM.index("# From the data sheet")]
ONE_FAKE_OBJECT = ("--set", "cell.kind=fake", "--set", "cell.table.objects=[1, 1]")
POSITIONS = "position_deg: [170, 120, 170, 120, 170, 120, 175]"


@pytest.fixture(autouse=True)
def _project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missions: Path) -> None:
    """Work in a project with an arm that is the iiwa 14 under another name."""
    monkeypatch.chdir(tmp_path)
    Path("cells/arms").mkdir(parents=True)
    Path("cells/bench.yaml").write_text(CELL)
    Path("cells/arms/cobot.yaml").write_text(ARM)
    mission = (missions / "sort_overhead.yaml").read_text()
    Path(MISSION).write_text(mission.replace("cells/overhead.yaml", "cells/bench.yaml"))


def change(file: str, old: str, new: str) -> None:
    text = Path(file).read_text()
    assert old in text
    Path(file).write_text(text.replace(old, new))


def test_an_arm_file_beside_the_cell_is_checked_and_run() -> None:
    loaded = load_mission(MISSION, load_skills(), find_checker=load_checker)
    assert loaded.cell_config.arm.arm == "cobot"
    assert [warning.code for warning in loaded.warnings] == ["not-measured"]  # The arm is in the images.
    result = run_mission(MISSION, FakeCell, seed=5, set={"cell.table.objects": "[2, 2]"})
    assert (result.status, result.agrees, result.items["placed"]) == ("SUCCESS", True, result.items["seen"])


@pytest.mark.slow
def test_the_same_arm_from_another_file_moves_in_the_same_way() -> None:
    change("cells/arms/cobot.yaml", "arm: cobot", "arm: iiwa14")  # Measurements are for an arm with a name.
    results = [run_mission(name, Station, seed=5) for name in (MISSION, "sort_overhead")]
    assert results[0].status == "SUCCESS" and results[0].agrees
    assert results[0].items == results[1].items
    assert results[0].events[-1].clock == results[1].events[-1].clock


def test_a_replay_needs_no_arm_file() -> None:
    for *words, status in (
        ("run", MISSION, *ONE_FAKE_OBJECT, "--quiet", "--runs", "runs", 0),
        ("check", MISSION, 0),
        ("replay", "latest", "--runs", "runs", 0),
        ("check", MISSION, 2),
    ):
        if words[0] == "replay":
            Path("cells/arms/cobot.yaml").unlink()
        result = invoke(*words)
        assert result.exit_code == status, result.output


def test_keys_of_the_cell_replace_keys_of_the_arm_file() -> None:
    slow = [10.0] * 7
    change(
        "cells/bench.yaml", "  poses_deg", f"  limits: {{source: a test, velocity_deg: {slow}}}\n  poses_deg"
    )
    path = Path("cells/bench.yaml")
    limits = load_cell(path, {"cell.arm.limits.jerk": "[9, 9, 9, 9, 9, 9, 9]"}).arm.limits
    assert (limits.velocity_deg, limits.jerk, limits.position_deg[6]) == ((10,) * 7, (9,) * 7, 175)
    assert load_cell(path, {"cell.arm.file": "arms/iiwa14.yaml"}).arm.arm == "iiwa14"


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        ("arms/cobot.yaml", "solver: iiwa14", "solver: iiwa", 'cobot.yaml:6:9: error[robot]: the solver "iiwa" of the arm cobot is not installed. Did you mean "iiwa14"? Installed solvers: auto, eaik, iiwa14, numeric.'),
        ("arms/cobot.yaml", "{link: lbr_iiwa_link_7", "{link: flange", 'cobot.yaml:5:16: error[robot]: the model model.urdf has no link "flange". Links of the model: lbr_iiwa_link_0, lbr_iiwa_link_1, '),
        ("arms/cobot.yaml", "{link: lbr_iiwa_link_7", "{link: lbr_iiwa_link_6", 'cobot.yaml:13:3: error[robot]: limits.position_deg has 7 values; kuka_iiwa/model.urdf needs a value for the 6 joints up to the link "lbr_iiwa_link_6": lbr_iiwa_joint_1, '),
        ("arms/cobot.yaml", LIMITS, "", 'cobot.yaml:3:1: error[missing-key]: the file needs the key "limits"'),
        ("arms/cobot.yaml", "effort: [320, ", "effort: [", "cobot.yaml:21:1: error[robot]: effort has 6 values; kuka_iiwa/model.urdf needs a value for the 7 joints"),
        ("arms/cobot.yaml", "[tool, lbr_iiwa_link_1]", "[tool, link_1]", 'cobot.yaml:27:5: error[robot]: the model model.urdf of the arm cobot has no link "link_1". Links of the arm: '),
        ("arms/cobot.yaml", POSITIONS, "position_deg: [170]", "cobot.yaml:13:3: error[robot]: limits.position_deg has 1 values; "),
        ("arms/cobot.yaml", "offset: 0.045", "offset: -1", "cobot.yaml:5:41: error[out-of-range]: flange.offset must be at least 0"),
        ("arms/cobot.yaml", "urdf: kuka", "urdf: ../kuka", 'cobot.yaml:4:7: error[outside]: "../kuka_iiwa/model.urdf" must be a relative path without ".."'),
        ("arms/cobot.yaml", "urdf: kuka_iiwa/model", "urdf: cobot", "cobot.yaml:4:7: error[robot]: there is no model cobot.urdf"),
        ("bench.yaml", "file: arms", "file: ../arms", 'bench.yaml:4:9: error[no-arm]: "../arms/cobot.yaml" is outside the folder of the file that names it; '),
        ("bench.yaml", "file: arms/cobot.yaml", "urdf: cobot.urdf", 'bench.yaml:4:9: error[no-arm]: an arm other than iiwa14 needs the key "file"'),
        ("bench.yaml", "file: arms/cobot.yaml", "file: 14", 'bench.yaml:4:9: error[no-arm]: there is no file "14" in cells or /'),
    ],
)  # fmt: skip
def test_a_wrong_arm_has_one_finding_at_its_place(file: str, old: str, new: str, expected: str) -> None:
    change(f"cells/{file}", old, new)
    with pytest.raises(MissionError) as caught:
        load_mission(MISSION, load_skills(), find_checker=load_checker)
    (finding,) = caught.value.findings
    assert str(finding).startswith(expected, str(finding).index(Path(file).name))


def test_a_solver_for_another_arm_is_a_finding() -> None:
    model = find_model("kuka_iiwa/model.urdf")
    text = model.read_text().replace('filename="meshes/', f'filename="{model.parent}/meshes/')
    Path("cells/arms/longer.urdf").write_text(text.replace('xyz="0 0.2045 0"', 'xyz="0 0.3045 0"'))
    change("cells/arms/cobot.yaml", "kuka_iiwa/model.urdf", "longer.urdf")
    config = load_cell(Path("cells/bench.yaml"))
    ((keys, message),) = load_checker("sim").check(config, Path("cells"))
    assert (keys, message.partition(" does not describe")[0]) == (("arm", "solver"), 'the solver "iiwa14"')
    assert "its tool is 0.100 m away from the tool of the model" in message


def test_the_arm_of_an_earlier_record_is_completed(missions: Path) -> None:
    cell = load_cell(missions / "cells" / "overhead.yaml")
    content = cell.model_dump(mode="json")
    content["arm"] = {key: content["arm"][key] for key in ("urdf", "limits", "poses_deg")}
    Path("cell.yaml").write_text(yaml.safe_dump(content))
    assert read_cell(Path()) == cell


def test_the_arm_of_a_record_needs_no_key_of_another_arm(missions: Path) -> None:
    cell = load_cell(missions / "cells" / "xarm6.yaml")
    content = cell.model_dump(mode="json", exclude_unset=True)
    Path("cell.yaml").write_text(yaml.safe_dump(content))
    assert read_cell(Path()).arm.model_dump() == cell.arm.model_dump()
