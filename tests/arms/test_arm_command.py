"""`executive arm` and `executive init --urdf`: from a URDF to an arm file, and to the first sorted object."""

from __future__ import annotations

import importlib.metadata
import json
import math
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pybullet
import pytest
from at_terminal import invoke
from PIL import Image

from executive import plugins
from executive.arms.urdf import find_model
from executive.cell.arm_config import BaseConfig
from executive.cell.config import CellConfig
from executive.errors import InputError
from executive.geometry import Pose
from executive.mission.cell_file import load_cell
from executive.motion.joints import build_planning_kinematics
from executive.motion.reach import find_braking_errors, find_places_out_of_reach, measure_reach
from executive.physics.arm_model import ArmHulls
from executive.physics.cell_world import CellWorld
from executive.plugins import find_package_folder
from executive.station.arm_report import find_blocked_motions
from executive.station.check import find_payload_errors, find_pose_errors, load_checker
from executive.text.files import get_shipped_folder

SHIPPED = get_shipped_folder()


@pytest.fixture
def xarm6() -> CellConfig:
    return load_cell(SHIPPED / "cells" / "xarm6.yaml")


def with_arm(config: CellConfig, **changes: object) -> CellConfig:
    return config.model_copy(update={"arm": config.arm.model_copy(update=changes)})


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the model of the xArm6 with its gripper, as in a project of a user."""
    folder = find_package_folder("pybullet_data")
    assert folder is not None
    shutil.copytree(folder / "xarm", tmp_path / "bench")
    monkeypatch.chdir(tmp_path)
    return Path("bench/xarm6_with_gripper.urdf")


def test_it_describes_a_urdf_and_writes_an_arm_file_that_it_reads(model: Path) -> None:
    result = invoke("arm", str(model), "--write", "arm.yaml", "--picture", "reach.png", "--json")
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert (value["flange"]["link"], value["solver"]) == ("link6", "numeric")
    assert [joint["name"] for joint in value["joints"]] == [f"joint{number}" for number in range(1, 7)]
    assert "left_finger" in value["left_out"]
    assert (value["reach"]["the workspace"], value["reach"]['the bin "yellow_bin"']) == (
        1,
        pytest.approx(2 / 3),
    )
    assert set(value["reach_from_best_base"].values()) == {1}
    assert list(value["poses_deg"]) == ["home", "aside"]
    with Image.open("reach.png") as image:
        shades = {colour for _, colour in image.getcolors(10_000) or ()}
    assert (214, 236, 214) in shades
    again = json.loads(invoke("arm", "arm.yaml", "--json").stdout)
    assert (again["joints"], again["poses_deg"]) == (value["joints"], value["poses_deg"])


def test_what_is_no_arm_is_refused_with_the_link_or_joint(model: Path) -> None:
    text = model.read_text()
    joint_3 = 'name="joint3" type="revolute"'
    model.with_name("lift.urdf").write_text(text.replace(joint_3, 'name="joint3" type="prismatic"'))
    model.with_name("still.urdf").write_text(text.replace(' velocity="3.14"', ""))
    for words, message in (
        (("bench/still.urdf",), "bench/still.urdf: the model still.urdf has no limits.velocity_deg"),
        (("bench/lift.urdf",), 'the joint "joint3" of the model lift.urdf is prismatic; the'),
        (("cube.urdf",), "the model cube.urdf has no chain of revolute joints"),
        ((str(model), "--flange", "link_base"), 'has 0 joint(s) up to the link "link_base"'),
        (("nothing.urdf",), "there is no model nothing.urdf"),
        ((str(model), "--base", "nan", "0", "0"), "--base nan 0.0 0.0 is no position of an arm; write three"),
        ((str(model), "--base", "0", "-1e9", "0"), "write three numbers from -10 to 10 m"),
        ((str(model), "--write", "elsewhere/arm.yaml"), "outside of its folder"),
        ((str(model), "--write", "old.yaml"), "old.yaml exists; name a new file"),
        ((str(model), "--picture", "reach.jpg"), "reach.jpg is no name of a PNG file"),
        (("xarm6", "--write", "arm.yaml"), "xarm6 is an arm file, but --flange and --write are for a URDF"),
        (("xarm6", "--flange", "link5"), "xarm6 is an arm file, but --flange and --write are for a URDF"),
    ):  # fmt: skip
        Path("elsewhere").mkdir(exist_ok=True)
        Path("old.yaml").touch()
        result = invoke("arm", *words)
        assert (result.exit_code, message in result.stderr) == (2, True), result.stderr


@pytest.mark.slow
def test_a_report_with_a_problem_ends_with_exit_code_2(model: Path) -> None:
    model.write_text(model.read_text().replace('effort="50.0"', 'effort="1"'))
    result = invoke("arm", str(model))
    assert (result.exit_code, "problem: joint 2 needs" in result.stdout) == (2, True)


@pytest.mark.slow
def test_the_guide_leads_from_a_urdf_to_sorted_objects(model: Path) -> None:
    guide = (SHIPPED / "arms.md").read_text()
    steps = re.findall(r"^\d\. `(.*?)`", guide, re.MULTILINE)
    assert len(steps) == 2
    init = steps[0].replace("my_arm/robot.urdf", str(model)).replace("tool0", "link6")
    assert invoke(*shlex.split(init)[1:]).exit_code == 0
    change_folder, _, run = steps[1].partition(" && ")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(change_folder.split()[1])
        result = invoke(*shlex.split(run)[1:], "--seed", "3", "--json", "--quiet")
    value = json.loads(result.stdout)
    assert (value["status"], value["items"]["placed"]) == ("SUCCESS", value["items"]["seen"])
    assert value["audit"]["agrees"] and value["items"]["placed"] >= 3


def check_project(*words: str) -> CellConfig:
    """Create a project with an arm, and return its cell, in which the check finds no error."""
    result = invoke("init", "hall", *words)
    assert result.exit_code == 0, result.output
    path = Path("hall/cells/table.yaml")
    config = load_cell(path)
    assert list(load_checker("sim").check(config, path.parent)) == []
    return config


@pytest.mark.slow
def test_the_cell_of_a_new_project_passes_its_check(model: Path) -> None:
    check_project("--urdf", "kuka_iiwa/model.urdf", "--flange", "lbr_iiwa_link_7")


@pytest.mark.slow
def test_a_new_project_turns_the_range_of_the_first_joint_to_the_workspace(model: Path) -> None:
    text = model.read_text()
    limit = 'lower="-6.28318530718" upper="6.28318530718"'
    model.write_text(text.replace(limit, 'lower="1" upper="4"', 1))
    assert check_project("--urdf", str(model)).arm.base.yaw_deg != 0
    shutil.rmtree("hall")
    narrow = model.with_name("narrow.urdf")
    narrow.write_text(text.replace(limit, 'lower="0" upper="0.6"', 1))
    result = invoke("init", "hall", "--urdf", str(narrow))
    assert (result.exit_code, Path("hall").exists()) == (2, False)
    assert "cannot work in the cell of a new project: it does not reach" in result.stderr


@pytest.mark.slow
def test_the_reach_is_measured_from_the_axis_of_the_first_joint(model: Path) -> None:
    text = model.read_text()
    before, joint, after = text.partition('name="world_joint"')
    model.write_text(before + joint + after.replace('xyz="0 0 0"', 'xyz="-0.5 0.4 0"', 1))
    value = json.loads(invoke("arm", str(model), "--base", "0.56", "-0.34", "0", "--json").stdout)
    assert set(value["reach"].values()) == {1}
    value = json.loads(invoke("arm", str(model), "--base", "0.5", "-0.4", "0", "--json").stdout)
    assert value["reach"]['the bin "yellow_bin"'] == pytest.approx(2 / 3)
    assert value["best_base"]["position"] == [0.56, -0.34, 0]


@pytest.mark.slow
def test_places_out_of_reach_have_an_advice_that_helps(xarm6: CellConfig) -> None:
    far = with_arm(xarm6, base=BaseConfig())
    ((keys, message),) = find_places_out_of_reach(far)
    assert keys == ("bins", "yellow_bin", "position")
    assert 'the bin "yellow_bin" is out of reach (33% of it): the tool cannot reach' in message
    best_base = measure_reach(far, build_planning_kinematics(far)).best_base
    x, y, _ = best_base.position
    assert f"with arm.base.position [{x:g}, {y:g}, ...], it reaches everything" in message
    moved = with_arm(xarm6, base=best_base)
    assert not list(find_places_out_of_reach(moved))


def test_a_place_out_of_reach_is_as_far_from_the_joint_range_as_the_nearest_turn(xarm6: CellConfig) -> None:
    lower, upper = zip(*xarm6.arm.limits.position_ranges_deg, strict=True)
    ranges = {"min_position_deg": (-28.0, *lower[1:]), "position_deg": (28.0, *upper[1:])}
    limits = xarm6.arm.limits.model_copy(update=ranges)
    messages = dict(find_places_out_of_reach(with_arm(xarm6, base=BaseConfig(), limits=limits)))
    assert "leaves joint 1 5.7° outside ±28°" in messages["safe_place",]


def test_a_descent_from_which_the_arm_cannot_stop_in_time_is_an_error(xarm6: CellConfig) -> None:
    assert not list(find_braking_errors(xarm6))
    fast = xarm6.model_copy(update={"motion": xarm6.motion.model_copy(update={"descent_speed": 0.05})})
    ((keys, message),) = find_braking_errors(fast)
    assert keys == ("motion", "descent_speed")
    assert re.search(
        r"at 0.05 m/s, the arm xarm6 needs 1\.\d+ mm to stop, but .* only 1 mm .*at most 0.03", message
    )


def test_joints_too_weak_for_the_load_are_an_error(xarm6: CellConfig, tmp_path: Path) -> None:
    world = CellWorld(xarm6, visuals=False)
    poses = xarm6.arm.poses_deg
    assert not list(find_payload_errors(xarm6, world, poses))
    model = tmp_path / "cube.urdf"
    model.write_text('<robot name="cube"><link><inertial><mass value="9"/></inertial></link></robot>')
    for change in ({"mass": 9.0}, {"urdf": str(model)}):
        cube = xarm6.objects["cube"].model_copy(update=change)
        heavy = xarm6.model_copy(update={"objects": {"cube": cube}})
        messages = dict(find_payload_errors(heavy, world, poses))
        message = messages["arm", "poses_deg", "home"]
        assert re.match(r"joint \d needs [\d.]+ Nm to hold arm, tool and 9 kg", message)
    world.close()


@pytest.mark.parametrize("name", ["overhead", "xarm6", "panda"])
def test_the_hulls_hide_the_pixels_of_the_arm_and_little_more(name: str) -> None:
    config = load_cell(SHIPPED / "cells" / f"{name}.yaml")
    moved = with_arm(config, base=BaseConfig(position=(0.1, -0.1, 0.0), yaw_deg=40.0))
    world = CellWorld(moved)
    q = np.radians(config.arm.poses_deg["home"]) + 0.3
    world.set_joint_positions(q)
    eye = np.array([1.4, 0.3, 1.5])
    z = np.array([0.2, 0.1, 0.3]) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, [0, 0, 1]) / np.linalg.norm(np.cross(z, [0, 0, 1]))
    X_WC = Pose(np.stack([x, np.cross(z, x), z], axis=1), eye)
    view = world.client.computeViewMatrix(eye.tolist(), (eye + z).tolist(), [0, 0, 1])
    projection = world.client.computeProjectionMatrixFOV(50, 1, 0.05, 5)
    flags = pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX
    segments = np.reshape(world.client.getCameraImage(240, 240, view, projection, flags=flags)[4], (240, 240))
    is_arm = (segments & 0xFFFFFF == world.arm) & (segments >= 0) & (segments >> 24 != world.tool_index + 1)
    world.close()
    focal_length = 120 / math.tan(math.radians(25))
    mask = np.zeros((240, 240), np.uint8)
    matrix = np.array([[focal_length, 0, 120], [0, focal_length, 120], [0, 0, 1]])
    ArmHulls(moved.arm).draw(mask, q, matrix, X_WC)
    assert is_arm.sum() > 1500
    assert not (is_arm & (mask == 0)).any()
    assert mask.sum() < 1.8 * is_arm.sum()


def test_a_model_in_a_package_stays_in_its_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "package:pybullet_data/xarm/xarm6_robot.urdf"
    assert find_model(name) == find_model("xarm/xarm6_robot.urdf")
    monkeypatch.setattr(plugins, "find_package_folder", lambda name: None)
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: ['pybullet-data; extra == "arms"'])
    with pytest.raises(InputError, match="`uv sync --extra arms` or `pip install"):
        find_model(name)
    monkeypatch.undo()
    for reference, message in (
        ("package:pybullet_data/../numpy/__init__.py", "leads out of the folder"),
        ("package:pybullet_data//etc/passwd", "leads out of the folder"),
        ("package:nowhere_at_all/a.urdf", "is not installed; install the package"),
        ("package:os.path/a.urdf", "is not installed"),
        ("package:pybullet_data/a.urdf", 'has no file "a.urdf"'),
    ):
        with pytest.raises(InputError, match=message):
            find_model(reference)


def test_the_reason_about_a_joint_comes_before_that_about_the_flange(model: Path) -> None:
    model.write_text(model.read_text().replace('lower="-2.059" upper="2.0944"', 'lower="-118" upper="120"'))
    result = invoke("arm", str(model))
    assert result.exit_code == 2
    assert "has the limits -118 to 120 rad; angles in a URDF are in radians" in result.stderr


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("arm", "bench/xarm6_with_gripper.urdf", "--write", "arm.txt"), "name a file that ends with .yaml"),
        (("init", "hall", "--flange", "link6"), "name the URDF with --urdf"),
    ],
)
def test_what_a_command_would_ignore_is_an_error(model: Path, words: tuple[str, ...], text: str) -> None:
    result = invoke(*words)
    assert result.exit_code == 2
    assert text in result.stderr


SLOW_CELL = """\
base: overhead.yaml
cell: slow
arm:
  file: arms/iiwa14.yaml
  limits: {acceleration: 2}
  effort: 99
  poses_deg: {home: [0, 0, 0, 0, 0, 0, 0], aside: [9, 0, 0, 0, 0, 0, 0]}
"""


def test_a_cell_may_have_one_number_for_all_joints(tmp_path: Path) -> None:
    path = tmp_path / "slow.yaml"
    path.write_text(SLOW_CELL)
    shutil.copy(SHIPPED / "cells" / "overhead.yaml", tmp_path)
    arm = load_cell(path).arm
    assert (set(arm.limits.acceleration), set(arm.effort), len(arm.effort)) == ({2.0}, {99.0}, 7)


def test_a_base_in_a_bin_is_an_error(xarm6: CellConfig) -> None:
    red_bin = xarm6.bins["red_bin"].model_copy(update={"position": (0.16, -0.16, 0.0)})
    moved = xarm6.model_copy(update={"bins": {**xarm6.bins, "red_bin": red_bin}})
    messages = dict(find_pose_errors(moved))
    assert messages["arm", "base"].startswith('the base of the arm stands in the bin "red_bin"')
    assert ("arm", "base") not in dict(find_pose_errors(xarm6))


@pytest.mark.slow
def test_places_between_which_an_arm_has_no_way_are_found(xarm6: CellConfig) -> None:
    assert not list(find_blocked_motions(xarm6))
    lower, upper = np.array(xarm6.arm.limits.position_ranges_deg).T
    # The pose `aside` is in a configuration that turns the tool round, and joint 4 cannot turn back.
    flipped = [-59.0, 24.0, -88.4, 180.0, -64.4, 0.0]
    lower[3] = 170.0
    limits = xarm6.arm.limits.model_copy(
        update={"min_position_deg": tuple(lower.tolist()), "position_deg": tuple(upper.tolist())}
    )
    changed = with_arm(xarm6, limits=limits, poses_deg={"home": tuple(flipped)})
    assert any("there is no motion from" in message for message in find_blocked_motions(changed))
