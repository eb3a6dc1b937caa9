"""Conformance of the kinematics of every shipped arm, with each solver that can solve it."""

from __future__ import annotations

import functools
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from executive.arms.eaik import build_analytic
from executive.arms.iiwa14 import Iiwa14
from executive.arms.numeric import ChainKinematics
from executive.cell.arm_config import ArmConfig, BaseConfig, FlangeConfig, LimitsConfig
from executive.cell.config import CellConfig
from executive.errors import InputError, Unreachable
from executive.geometry import Array, Pose, make_tool_down_pose, rotate_about_z
from executive.mission.cell_file import load_cell
from executive.motion.configurations import COARSE_ANGLE_STEP, FINE_ANGLE_STEP
from executive.motion.joints import Kinematics, wrap_angles
from executive.physics.cell_world import CellWorld
from executive.text.files import get_shipped_folder

TOOL_LENGTH = 0.12
BASE = BaseConfig(position=(0.1, -0.2, 0.05), yaw_deg=40)
SOLVERS = {"iiwa14": Iiwa14, "eaik": build_analytic, "numeric": ChainKinematics}
CASES = [
    *(("overhead", solver) for solver in SOLVERS),
    *itertools.product(("ur5e", "panda"), ("eaik", "numeric")),
    ("xarm6", "numeric"),
]
MAX_ERROR = 1e-8
FIVE_JOINTS = {"yaw": ("0 0 1", 0.2), "lift": ("0 1 0", 0.1), "elbow": ("0 1 0", 0.3), "bend": ("0 1 0", 0.3)}
"""Axis of each joint of an arm but the last, and its height above the joint before [m]."""

every_case = pytest.mark.parametrize(("cell", "solver"), CASES)


@functools.cache
def load_moved_cell(name: str) -> CellConfig:
    """Return a shipped cell whose arm is not at the origin, and turned."""
    if name == "ur5e":
        pytest.importorskip("airo_models")
    cell = load_cell(get_shipped_folder() / "cells" / f"{name}.yaml")
    return cell.model_copy(update={"arm": cell.arm.model_copy(update={"base": BASE})})


@functools.cache
def build(cell: str, solver: str) -> Kinematics:
    if solver == "eaik":
        pytest.importorskip("eaik")
    return SOLVERS[solver](load_moved_cell(cell).arm, TOOL_LENGTH)


def draw_configurations(kinematics: Kinematics, count: int) -> Array:
    lower, upper = kinematics.joint_range
    return np.random.default_rng(1).uniform(lower, upper, (count, len(lower)))


def list_goals(cell: str) -> list[Pose]:
    """Return tool poses that the arm reaches: six with the tool down, and one with the tool tilted."""
    random = np.random.default_rng(2)
    goals = []
    for azimuth, yaw in random.uniform(-math.pi, math.pi, (6, 2)):
        offset = random.uniform((0.45, 0.0, 0.0), (0.55, 0.0, 0.1))
        goals.append(make_tool_down_pose(np.array(BASE.position) + rotate_about_z(azimuth) @ offset, yaw))
    home = np.radians(load_moved_cell(cell).arm.poses_deg["home"])
    home[-2] += 0.4
    return [*goals, build(cell, "numeric").compute_tool_pose(home)]


def measure_error(kinematics: Kinematics, qs: Array, goal: Pose) -> float:
    """Return the largest error of the position [m] and of the rotation matrix of solutions `(B, n)`."""
    poses = map(kinematics.compute_tool_pose, qs)
    matrices = [np.column_stack([pose.rotation, pose.position]) for pose in poses]
    return float(np.abs(matrices - np.column_stack([goal.rotation, goal.position])).max())


def find_in_range(kinematics: Kinematics, goal: Pose, seed: Array) -> Array:
    (qs,), _ = kinematics.solve_all([goal], seed, COARSE_ANGLE_STEP)
    return qs[kinematics.joint_range.without_last().contains(qs[:, :-1])]


def get_home(cell: str) -> Array:
    return np.radians(load_moved_cell(cell).arm.poses_deg["home"])


def test_every_shipped_arm_is_tested() -> None:
    arms = {load_moved_cell(cell).arm.arm for cell, _ in CASES}
    assert arms == {path.stem for path in (get_shipped_folder() / "arms").glob("*.yaml")}


def test_an_arm_that_eaik_does_not_know_is_an_error() -> None:
    with pytest.raises(InputError, match="does not know the arm xarm6 with 6 joints; use the solver `num"):
        build("xarm6", "eaik")


@pytest.mark.parametrize("cell", dict(CASES))
def test_forward_kinematics_agree_with_pybullet(cell: str) -> None:
    world = CellWorld(load_moved_cell(cell), visuals=False)
    for solver in {"iiwa14", "numeric"} & {solver for name, solver in CASES if name == cell}:
        kinematics = build(cell, solver)
        for q in draw_configurations(kinematics, 10):
            world.set_joint_positions(q)
            pose = world.get_flange_pose() @ Pose.of([0, 0, TOOL_LENGTH])
            assert measure_error(kinematics, q[None], pose) < 1e-6
    world.close()


@every_case
def test_points_and_axes_are_those_of_the_tool_poses(cell: str, solver: str) -> None:
    kinematics = build(cell, solver)
    qs = draw_configurations(kinematics, 20)
    poses = [kinematics.compute_tool_pose(q) for q in qs]
    tcps, axes = kinematics.compute_tcps_and_axes(qs)
    np.testing.assert_allclose(tcps, [pose.position for pose in poses], atol=1e-12)
    np.testing.assert_allclose(axes, [pose.rotation[:, 2] for pose in poses], atol=1e-12)


@every_case
def test_every_solution_reaches_its_pose_and_is_that_of_its_branch(cell: str, solver: str) -> None:
    kinematics = build(cell, solver)
    for goal in list_goals(cell):
        (qs,), branches = kinematics.solve_all([goal], get_home(cell), math.radians(20))
        assert len(qs) == len(branches) > 0
        assert measure_error(kinematics, qs, goal) < MAX_ERROR
        for q, branch in zip(qs[:5], branches, strict=False):
            assert np.abs(wrap_angles(kinematics.solve([goal], branch)[0] - q)).max() < 1e-6


@every_case
def test_the_branch_of_a_configuration_leads_back_to_it(cell: str, solver: str) -> None:
    kinematics = build(cell, solver)
    for q in draw_configurations(kinematics, 10):
        (found,) = kinematics.solve([kinematics.compute_tool_pose(q)], kinematics.find_branch(q))
        assert np.abs(wrap_angles(found - q)).max() < 1e-6


@every_case
def test_a_line_upwards_is_straight_and_continuous(cell: str, solver: str) -> None:
    kinematics = build(cell, solver)
    for goal in list_goals(cell)[:3]:
        line = [Pose(goal.rotation, goal.position + np.array([0, 0, height])) for height in (0.0, 0.05, 0.1)]
        q_by_pose, branches = kinematics.solve_all(line[::-1], get_home(cell), COARSE_ANGLE_STEP)
        is_inside = kinematics.joint_range.contains(q_by_pose).all(axis=0)
        assert is_inside.any()
        for index in np.flatnonzero(is_inside)[:10]:
            qs = kinematics.solve(line, branches[index])
            assert np.abs(wrap_angles(qs - q_by_pose[::-1, index])).max() < 1e-6
            assert np.abs(wrap_angles(np.diff(qs, axis=0))).max() < 1.0
            errors = [measure_error(kinematics, q[None], pose) for q, pose in zip(qs, line, strict=True)]
            assert max(errors) < MAX_ERROR


def test_a_flange_beside_the_axis_of_the_last_joint_reaches_its_pose() -> None:
    arm = load_moved_cell("panda").arm
    flange = FlangeConfig(link=arm.flange.link, rotation_deg=(0.04, 0, 20))
    kinematics = ChainKinematics(arm.model_copy(update={"flange": flange}), TOOL_LENGTH)
    for goal in list_goals("panda")[:2]:
        (qs,), _ = kinematics.solve_all([goal], get_home("panda"), COARSE_ANGLE_STEP)
        assert measure_error(kinematics, qs, goal) < MAX_ERROR
        np.testing.assert_allclose(kinematics.compute_tcps_and_axes(qs)[0] - goal.position, 0, atol=MAX_ERROR)


@every_case
def test_a_joint_that_can_turn_twice_stays_near_its_position(cell: str, solver: str) -> None:
    kinematics = build(cell, solver)
    lower, upper = kinematics.joint_range
    seed = np.clip(get_home(cell) + math.radians(300), lower, upper)
    qs = find_in_range(kinematics, list_goals(cell)[0], seed)
    for joint, q in itertools.product(np.flatnonzero(upper - lower > 2 * math.tau - 1e-6), qs):
        turned = q[joint] + math.tau * np.array([-1, 0, 1])
        inside = turned[(lower[joint] <= turned) & (turned <= upper[joint])]
        assert q[joint] == pytest.approx(min(inside, key=lambda angle: abs(angle - seed[joint])))


def test_solutions_beyond_half_a_turn_are_found_within_asymmetric_limits() -> None:
    kinematics = build("xarm6", "numeric")
    q = np.radians([30.0, -70.0, -200.0, 20.0, 50.0, 40.0])
    qs = find_in_range(kinematics, kinematics.compute_tool_pose(q), np.zeros(6))
    assert np.abs(qs - q).max(axis=1).min() < 1e-6


@pytest.mark.parametrize("solver", ["eaik", "numeric"])
def test_a_second_search_finds_a_solution_with_three_joints_at_the_ends_of_their_ranges(solver: str) -> None:
    kinematics = build("panda", solver)
    goal = kinematics.compute_tool_pose([-2.2067, -0.517, 0.3086, -3.0439, -2.8767, 3.7523, -0.449])
    (qs,), _ = kinematics.solve_all([goal], get_home("panda"), FINE_ANGLE_STEP)
    assert kinematics.joint_range.without_last().contains(qs[:, :-1]).any()


@pytest.mark.parametrize("solver", ["eaik", "numeric"])
def test_the_other_solvers_agree_with_that_of_the_iiwa(solver: str) -> None:
    special = build("overhead", "iiwa14")
    kinematics = build("overhead", solver)
    home = get_home("overhead")
    for goal in list_goals("overhead")[:3]:
        qs, special_qs = (find_in_range(solver, goal, home) for solver in (kinematics, special))
        for q in qs:
            (found,) = special.solve([goal], special.find_branch(q))
            assert np.abs(wrap_angles(found - q)).max() < 1e-6
        distances = np.abs(wrap_angles(special_qs[:, None] - qs)).max(axis=2).min(axis=1)
        assert np.mean(distances < math.radians(20)) > 0.97


@every_case
def test_a_pose_out_of_reach_is_an_error_with_the_distance(cell: str, solver: str) -> None:
    goal = make_tool_down_pose([2.0, 0.0, 0.1])
    message = r"cannot reach \(2\.000, 0\.000, 0\.100\) m: .* [12]\.\d+ m (from|beyond)"
    with pytest.raises(Unreachable, match=message):
        build(cell, solver).solve_all([goal], get_home(cell), COARSE_ANGLE_STEP)


def make_five_joint_arm(folder: Path) -> ArmConfig:
    """Return an arm with a vertical joint, three parallel ones, and a last one that turns the tool."""
    joints = {**FIVE_JOINTS, "turn": ("0 0 1", 0.1)}
    links = "".join(f'<link name="{name}"/>' for name in ("base", *joints))
    text = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}"/>'
        f'<origin xyz="0 0 {height}"/><axis xyz="{axis}"/></joint>'
        for parent, (name, (axis, height)) in zip(("base", *joints), joints.items(), strict=False)
    )
    path = folder / "five.urdf"
    path.write_text(f'<robot name="five">{links}{text}</robot>')
    rates = dict.fromkeys(("acceleration", "jerk", "stop_acceleration", "stop_jerk"), (5.0,) * 5)
    limits = LimitsConfig(source="invented", position_deg=(143,) * 5, velocity_deg=(100,) * 5, **rates)
    return ArmConfig(
        arm="five", urdf=str(path), flange=FlangeConfig(link="turn"), limits=limits, effort=(50.0,) * 5,
        base=BASE, poses_deg={"home": (0, 20, 70, 90, 0)},
    )  # fmt: skip


def test_an_arm_with_five_joints_reaches_poses_with_the_tool_down(tmp_path: Path) -> None:
    kinematics = ChainKinematics(make_five_joint_arm(tmp_path), TOOL_LENGTH)
    home = np.radians([0.0, 20.0, 70.0, 90.0, 0.0])
    x, y, z = kinematics.compute_tool_pose(home).position
    line = [make_tool_down_pose([x, y, z + height], 1.0) for height in (0.05, 0.0)]
    (upper_qs, lower_qs), _ = kinematics.solve_all(line, home, COARSE_ANGLE_STEP)
    for qs, goal in zip((upper_qs, lower_qs), line, strict=True):
        qs = qs[kinematics.joint_range.contains(qs)]
        assert len(qs) > 0 and measure_error(kinematics, qs, goal) < MAX_ERROR
    with pytest.raises(Unreachable, match="no configuration of the arm brings the tool there"):
        sideways = rotate_about_z(math.radians(BASE.yaw_deg)) @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        kinematics.solve_all([Pose(sideways, np.array([x, y, z]))], home, COARSE_ANGLE_STEP)
