"""Two fingers: grasps, evidence, limits of friction, neighbours, and grips in simulation and rehearsal."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from at_hand import look
from at_terminal import invoke

from executive.cell.config import CellConfig
from executive.cell.device_config import STEP, MotionConfig
from executive.cell.objects import GraspPoint, ObjectClass, Target
from executive.cell.tools import GraspAttempt, ToolMeasurement
from executive.drivers.sim.fingers import SimFingers
from executive.drivers.sim.world import World
from executive.geometry import GRAVITY, Pose, Yaw, rotate_about_z
from executive.ledger.final_states import MIN_EMPTY_PROBES
from executive.manipulation.grasps import choose_grasp
from executive.mission.cell_file import load_cell
from executive.motion.joints import build_kinematics
from executive.physics.cell_world import NORMAL_FORCE
from executive.testing.fake_cell import FakeCell
from executive.testing.faults import during, grip_fails, grip_lost
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import run_mission
from executive.testing.run_skill import run_skill
from executive.tools.fingers import Fingers
from skills.approach import Approach
from skills.grasp import Grasp
from tests.motion.joint_states import reach

TOOL = Fingers(
    length=0.2,
    stroke=0.11,
    finger=(0.02, 0.012, 0.09),
    tip=0.01,
    palm=(0.05, 0.11),
    force=20.0,
    source="test",
)
CUBE = ObjectClass("cube", 0.05, 0.0354, footprint=(0.05, 0.05), yaw_symmetry=4, friction=1.0)
BAR = ObjectClass("bar", 0.03, 0.051, footprint=(0.10, 0.02), yaw_symmetry=2)
NUT = ObjectClass("nut", 0.018, 0.0219, footprint=(0.0438, 0.038), yaw_symmetry=6)
BALL = ObjectClass("ball", 0.07, 0.035)
MOTION = MotionConfig()


@pytest.fixture(scope="module")
def config(missions: Path) -> CellConfig:
    return load_cell(missions / "cells" / "iiwa_wsg50.yaml")


def list_grasps(object_class: ObjectClass, yaw: Yaw | None, number: int = 0):
    position = np.array([0.5, 0.1, object_class.height / 2])
    target = Target("item-1", object_class.label, position, 0.9, 1, 0, 0.0, yaw)
    return TOOL.list_grasps(object_class, target, MOTION, GraspAttempt(number))


@pytest.mark.parametrize(
    ("object_class", "yaw_counts", "openings"),
    [(CUBE, [4], [0.062]), (BAR, [2, 2], [0.032, 0.11]), (NUT, [6], [0.05]), (BALL, [0], [0.082])],
)
def test_fingers_close_on_opposite_sides_the_narrowest_first(object_class, yaw_counts, openings) -> None:
    grasps = list_grasps(object_class, Yaw(0.3, 0.0))
    assert [len(grasp.goal.yaws) for grasp in grasps] == yaw_counts
    assert [grasp.opening for grasp in grasps] == pytest.approx(openings)
    assert {grasp.guard for grasp in grasps} == {"clear"}
    across = [yaw % math.pi for grasp in grasps[:1] for yaw in grasp.goal.yaws]
    assert any(yaw == pytest.approx(0.3) for yaw in across) or not across


def test_fingers_close_at_a_grasp_point_in_its_direction() -> None:
    points = (GraspPoint((0.04, 0.0, 0.03), width=0.02), GraspPoint((0.0, 0.0, 0.03), 0.05, direction=0.0))
    part = replace(BAR, height=0.05, yaw_symmetry=1, contact_radius=0.04, grasp_points=points)
    end, middle = list_grasps(part, Yaw(math.pi / 2, 1e-9, 1))
    assert end.goal.position == pytest.approx((0.5, 0.14, 0.03))
    assert middle.goal.position == pytest.approx((0.5, 0.1, 0.03))
    assert (end.opening, middle.opening) == pytest.approx((0.032, 0.062))
    assert np.sin(end.goal.yaws) == pytest.approx([1, -1])
    assert np.cos(middle.goal.yaws) == pytest.approx([1, -1])


def test_an_object_held_at_a_slant_has_this_yaw_in_the_fingers(config: CellConfig) -> None:
    part = ObjectClass(
        "part", 0.04, 0.05, footprint=(0.08, 0.03), yaw_symmetry=1,
        grasp_points=(GraspPoint((0.0, 0.0, 0.02), 0.03, math.radians(60)),),
    )  # fmt: skip
    yaw = Yaw(0.3, 0.01, 1)
    (grasp,) = list_grasps(part, yaw)
    for tool_yaw in grasp.goal.yaws:
        held = config.tool.compute_held_yaw(part, yaw, tool_yaw + 0.05)
        assert held.angle == pytest.approx(yaw.angle - tool_yaw)


def test_the_side_between_the_fingers_is_that_of_the_direction() -> None:
    for direction, width in ((90, 0.1), (0, 0.03)):
        point = GraspPoint((0.0, 0.0, 0.02), None, math.radians(direction))
        part = ObjectClass(
            "part", 0.04, 0.06, footprint=(0.03, 0.1), yaw_symmetry=2, grasp_points=(point,)
        )  # fmt: skip
        (grasp,) = list_grasps(part, Yaw(0.3, 0.0, 2))
        assert width <= grasp.opening < width + 0.02
    neck = ObjectClass("bottle", 0.04, 0.03, grasp_points=(GraspPoint((0.0, 0.0, 0.03), 0.015),))
    (grasp,) = list_grasps(neck, None)
    assert grasp.opening < 0.04


def test_another_attempt_is_at_the_other_end_of_an_object_whose_ends_look_alike() -> None:
    part = ObjectClass(
        "part", 0.04, 0.05, footprint=(0.08, 0.03), yaw_symmetry=1, contact_radius=0.02,
        grasp_points=(GraspPoint((0.02, 0.0, 0.02)),),
    )  # fmt: skip
    ends = [list_grasps(part, Yaw(0.0, 0.01, 2), number)[0].goal.position[0] for number in (0, 1)]
    assert ends[0] - ends[1] == pytest.approx(0.04)


def test_an_uncertain_yaw_a_failed_attempt_and_an_unknown_yaw_open_the_fingers_wider() -> None:
    openings = [
        list_grasps(CUBE, Yaw(0.0, std), number)[0].opening for std, number in ((0, 0), (0.05, 0), (0, 1))
    ]
    assert openings[1] == pytest.approx(openings[0] + 2 * CUBE.radius * math.sin(0.15))
    assert openings[2] > openings[0]
    (grasp,) = list_grasps(CUBE, None)
    assert (grasp.goal.yaws, grasp.opening) == ((), pytest.approx(2 * CUBE.radius + 2 * TOOL.allowance))


@pytest.mark.parametrize("height", [0.008, 0.05, 0.14])
def test_tips_stay_above_the_table_and_the_palm_above_the_object(height: float) -> None:
    hold_height = TOOL.get_hold_height(replace(CUBE, height=height))
    assert hold_height - TOOL.tip >= 0.008
    assert hold_height + TOOL.palm_offset >= height + 0.003


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, ""),
        ({"footprint": (0.105, 0.105), "radius": 0.08}, "a cube needs an opening of 113 mm"),
        ({"height": 0.006}, "a cube is 6 mm high, too low"),
        ({"grip_height": 0.06}, "a cube is 50 mm high, too low"),
        ({"grip_widths": (0.2, 0.3)}, "a cube is 200 to 300 mm wide in the fingers"),
    ],
)
def test_an_object_that_fits_between_no_fingers_is_unsuitable(changes, text) -> None:
    assert TOOL.explain_unsuitable(replace(CUBE, **changes)).startswith(text)
    assert bool(TOOL.explain_unsuitable(replace(CUBE, **changes))) is bool(text)


@pytest.mark.parametrize(
    ("opening", "is_contradiction", "is_miss"),
    [(0.051, False, False), (0.03, True, False), (0.001, False, True)],
)
def test_the_width_is_evidence_about_the_class(opening, is_contradiction, is_miss) -> None:
    measurement = TOOL.measure_grip(CUBE, opening)
    assert (bool(measurement.contradiction), measurement.is_miss) == (is_contradiction, is_miss)


def test_a_grip_above_the_centre_of_mass_holds_less() -> None:
    tall = replace(CUBE, height=0.2)
    assert TOOL.get_hold_height(tall) > 0.1
    assert TOOL.compute_holding_force(tall, 10.0) < TOOL.compute_holding_force(CUBE, 10.0) / 2


def test_classes_of_different_widths_are_distinct() -> None:
    classes = {each.label: each for each in (CUBE, BALL, replace(CUBE, label="box", height=0.04))}
    assert TOOL.find_distinct_labels(classes) == {"ball"}


class Bench:
    """An object between the open fingers, and an arm that is put where it should be."""

    def __init__(self, config: CellConfig, label: str) -> None:
        tool = config.tool
        self.world = World(config)
        self.tool: SimFingers = tool.build_sim(self.world)
        kinematics = build_kinematics(self.world.config)
        object_class = config.objects[label].build_class(label)
        self.start = np.array([0.5, 0.05, tool.get_hold_height(object_class)])
        home = np.radians(config.arm.poses_deg["home"])
        self.qs = [reach(kinematics, self.start, home)]
        for height in np.linspace(0.0, 0.1, 240)[1:]:
            self.qs.append(reach(kinematics, self.start + np.array([0.0, 0.0, height]), self.qs[-1]))
        self.world.set_joint_positions(self.qs[0])
        x_axis = self.world.get_tool_pose().rotation[:, 0]
        rotation = rotate_about_z(math.atan2(x_axis[1], x_axis[0]))
        X_WO = Pose(rotation, np.array([0.5, 0.05, object_class.height / 2]))
        self.body = self.world.add_object(label, X_WO, (1, 1, 1))
        self.steps(60)

    def steps(self, count: int) -> None:
        for _ in range(count):
            self.world.command_arm(self.qs[0])
            self.world.step()
            self.tool.advance()

    def lift(self) -> None:
        """Close the fingers, and lift by 0.1 m in a second."""
        self.tool.close()
        self.steps(120)
        for q in self.qs:
            self.qs[0] = q
            self.steps(1)
        self.steps(60)


@pytest.mark.parametrize(("label", "width"), [("cube", 0.05), ("sphere", 0.06), ("duck", 0.0423)])
def test_friction_alone_lifts_an_object_and_its_width_and_weight_are_measured(config, label, width) -> None:
    bench = Bench(config, label)
    bench.lift()
    assert bench.tool.holding
    assert bench.tool.held_body == bench.body
    assert bench.tool.opening == pytest.approx(width, abs=0.002)
    assert bench.tool.load == pytest.approx(0.1 * GRAVITY, abs=0.25)
    bench.tool.open()
    bench.steps(60)
    assert not bench.tool.holding
    assert bench.tool.opening == pytest.approx(width + 2 * config.tool.release_allowance, abs=0.003)
    assert bench.world.get_object_pose(bench.body).position[2] < 0.04


@pytest.mark.parametrize(("factor", "is_held"), [(0.9, True), (1.1, False)])
def test_an_object_slips_just_above_the_limit_of_friction(config, factor: float, is_held: bool) -> None:
    # Two fingers with the coefficient 1.0 * 0.5 carry a weight that is equal to their force.
    bench = Bench(config, "sphere")
    bench.world.client.changeDynamics(bench.body, -1, mass=factor * config.tool.force / GRAVITY)
    bench.lift()
    assert bool(bench.world.get_object_pose(bench.body).position[2] > 0.1) is is_held


def test_slow_fingers_press_with_the_declared_force(config: CellConfig) -> None:
    tool = config.tool.model_copy(update={"speed": 0.02, "force": 40.0})
    bench = Bench(config.model_copy(update={"tool": tool}), "cube")
    bench.tool.close()
    bench.steps(720)
    points = [
        point
        for link in bench.world.tool_links
        for point in bench.world.client.getContactPoints(bench.world.arm, bench.body, link, -1)
    ]
    assert sum(point[NORMAL_FORCE] for point in points) == pytest.approx(80.0, rel=0.1)


def test_a_loss_is_detected_within_a_tenth_of_a_second(config: CellConfig) -> None:
    bench = Bench(config, "cube")
    bench.lift()
    bench.tool.lose_grip()
    step_count = 0
    while bench.tool.holding and step_count < 240:
        bench.steps(1)
        step_count += 1
    assert step_count * STEP <= 0.1
    assert bench.tool.dropped_bodies == {bench.body}


@pytest.fixture
def fake_fingers(config: CellConfig) -> FakeCell:
    fake = FakeCell(config)
    fake.world.objects.clear()
    return fake


@pytest.mark.parametrize(("gap", "is_blocked"), [(0.05, False), (0.002, True)])
def test_neighbours_on_all_sides_block_a_grasp_and_are_named(fake_fingers, gap: float, is_blocked) -> None:
    distance = 2 * fake_fingers.cell.classes["cube"].radius + gap
    fake_fingers.world.put("cube", 0.5, 0.0)
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        fake_fingers.world.put("sphere", 0.5 + x * distance, y * distance)
    target = next(each for each in look(fake_fingers) if each.label == "cube")
    if is_blocked:
        with pytest.raises(Exception, match=r"no space beside cube-1: sphere-\d is in the way"):
            choose_grasp(fake_fingers.cell, target)
    else:
        assert choose_grasp(fake_fingers.cell, target)[0].opening > 0.05


def test_check_names_a_slot_in_which_the_fingers_cannot_open() -> None:
    slots = "cell.bins.red_bin.slots=[3, 4]"
    result = invoke("check", "sort_overhead", "--cell", "iiwa_wsg50", "--set", slots)
    assert result.exit_code == 2
    assert "cannot open to release a cube in slot 1: the wall of red_bin is in the way" in result.output


BOX = "<collision><origin xyz='{0}'/><geometry><box size='{1}'/></geometry></collision>"
FINGER = "<link name='{0}'>" + BOX.format("0 {1}0.006 0.165", "0.02 0.012 0.09") + "</link>"
JOINT = "<joint name='{0}' type='prismatic'><parent link='b'/><child link='{1}'/><axis xyz='{2}'/>{3}</joint>"
LIMIT = "<limit lower='0' upper='0.055' effort='20' velocity='0.1'/>"
GRIPPER = (
    "<robot name='g'><link name='b'>" + BOX.format("0 0 0.05", "0.05 0.11 0.1") + "</link>"
    + FINGER.format("l", "") + FINGER.format("r", "-")
    + JOINT.format("motor", "l", "0 1 0", LIMIT)
    + JOINT.format("gear", "r", "0 -1 0", LIMIT + "<mimic joint='motor'/>") + "</robot>"
)  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("", "", ""),
        ("'motor' type='prismatic'", "'motor' type='fixed'", 'the joint "motor" of gripper.urdf must be'),
        (LIMIT + "<mimic", "<mimic", 'the joint "gear" of gripper.urdf must be'),
        ("<mimic joint='motor'/>", "", "the model has 0 mm and 55 mm beside"),
        ("0 1 0", "1 0 0", "the model has 55 mm and nothing beside"),
        ("0 0.006 0.165", "0 0.026 0.165", "the model has 55 mm and 75 mm beside"),
        ("motor", "engine", 'no joint "motor"'),
        ("<mimic joint='motor'", "<mimic joint='motor' offset='0.01'", "its <mimic> without an offset"),
    ],
)
def test_check_compares_the_model_of_a_gripper_with_its_section(
    old, new, text, missions: Path, tmp_path: Path
) -> None:
    (tmp_path / "gripper.urdf").write_text(GRIPPER.replace(old, new))
    tool = yaml.safe_load((missions / "cells" / "iiwa_wsg50.yaml").read_text())["tool"]
    openings = [[0.0, 0.0], [0.055, 0.11]]
    model = {"urdf": "gripper.urdf", "joint": "motor", "openings": openings, "effort": 20.0}
    cell = tmp_path / "cell.yaml"
    cell.write_text(
        yaml.safe_dump({"tool": {**tool, "model": model}, "base": "iiwa_wsg50.yaml", "cell": "own"})
    )
    result = invoke("check", "sort_overhead", "--cell", str(cell))
    assert text in result.output.replace("\n", " ")
    assert result.exit_code == (2 if text else 0)
    assert ("cell.yaml:" in result.output) is bool(text)


def test_check_compares_every_part_of_the_openings(missions: Path, tmp_path: Path) -> None:
    (tmp_path / "gripper.urdf").write_text(GRIPPER)
    tool = yaml.safe_load((missions / "cells" / "iiwa_wsg50.yaml").read_text())["tool"]
    openings = [[0.0, 0.0], [0.0125, 0.05], [0.0276, 0.0552], [0.055, 0.11]]
    model = {"urdf": "gripper.urdf", "joint": "motor", "openings": openings, "effort": 20.0}
    cell = tmp_path / "cell.yaml"
    cell.write_text(
        yaml.safe_dump({"tool": {**tool, "model": model}, "base": "iiwa_wsg50.yaml", "cell": "own"})
    )
    assert "mm beside the tool centre point" in invoke("check", "sort_overhead", "--cell", str(cell)).output
    narrow = {**tool, "closed": 0.066}
    cell.write_text(yaml.safe_dump({"tool": narrow, "base": "iiwa_wsg50.yaml", "cell": "own"}))
    assert "beside the tool centre point" not in invoke("check", "sort_overhead", "--cell", str(cell)).output


def test_slow_fingers_get_the_time_to_press(missions: Path) -> None:
    result = run_mission(
        missions / "sort_overhead.yaml",
        make_oracle_kind(),
        cell="iiwa_wsg50",
        seed=4,
        set={"cell.tool.speed": "0.02"},
    )
    assert (result.status, result.agrees) == ("SUCCESS", True)


def test_closed_fingers_do_not_prove_that_nothing_is_there(fake_fingers: FakeCell) -> None:
    for y in (0.0, 0.15):
        fake_fingers.world.put("cube", 0.5, y)
    fake_fingers.tool.can_hold = lambda: False
    for _ in range(MIN_EMPTY_PROBES):
        target = look(fake_fingers)[0]
        run_skill(Approach(target=target), fake_fingers)
        assert run_skill(Grasp(target=target), fake_fingers).reason == "missed"
    look(fake_fingers)
    fake_fingers.ledger.record_measurement("cube-2", ToolMeasurement())
    fake_fingers.ledger.reject(target.item, "could not be picked")
    fake_fingers.ledger.set_final_states(completed=True)
    assert fake_fingers.ledger.count_states()["phantom"] == 0


def test_a_rehearsal_sorts_with_fingers_and_their_faults_have_their_wording(missions: Path) -> None:
    faults = [during("*/Grasp", grip_fails(), activations=1), during("*/Transit", grip_lost(), activations=1)]
    result = run_mission(missions / "sort_overhead.yaml", cell="iiwa_wsg50", faults=faults)
    messages = [timed.event.message for timed in result.events if getattr(timed.event, "message", "")]
    assert (result.status, result.agrees) == ("SUCCESS", True)
    assert any("no grip on" in message for message in messages)
    assert any("the grip on" in message and "broke on the way" in message for message in messages)
