from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pybullet
import pytest
from pybullet_utils.bullet_client import BulletClient

from executive.cell.device_config import MotionConfig
from executive.cell.objects import GraspPoint, ObjectClass, Target
from executive.cell.tools import GraspAttempt, ToolMeasurement
from executive.errors import Blocked
from executive.geometry import Yaw, make_tool_down_pose
from executive.tools.suction import CupContact, Suction, compute_breakaway_force, measure_contact

REACH = 0.002
TOOL = Suction(cup_radius=0.006, reach=REACH, force=8.0, gap=0.004, tilt_deg=60, min_force=1.0, source="test")
CLASSES = {
    "cube": ObjectClass("cube", 0.05, 0.0354, support_heights=(0.0, 0.05)),
    "sphere": ObjectClass("sphere", 0.06, 0.03), "duck": ObjectClass("duck", 0.056, 0.0295),
}  # fmt: skip


@pytest.fixture
def client() -> Iterator[BulletClient]:
    client = BulletClient(pybullet.DIRECT)
    yield client
    client.disconnect()


def box(client: BulletClient, centre: tuple[float, float, float], half: float, roll: float = 0.0) -> int:
    shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[half] * 3)
    turned = client.getQuaternionFromEuler([roll, 0, 0])
    return client.createMultiBody(0.1, shape, basePosition=centre, baseOrientation=turned)


def ball(client: BulletClient, radius: float) -> int:
    shape = client.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius)
    return client.createMultiBody(0.1, shape, basePosition=(0, 0, -radius))


def test_a_cup_over_the_middle_of_a_cube_seals_perfectly_at_the_distance_it_has(client: BulletClient) -> None:
    body = box(client, (0, 0, -0.025), 0.025)
    seal = measure_contact(client, make_tool_down_pose([0, 0, 0.0015]), {body}, 0.006, REACH)
    assert seal is not None
    assert seal.body == body
    assert seal.distance == pytest.approx(0.0015, abs=1e-5)
    assert seal.gap == pytest.approx(0, abs=1e-5)
    assert seal.tilt == pytest.approx(0, abs=1e-3)
    assert compute_breakaway_force(seal, TOOL) == pytest.approx(TOOL.force, rel=0.01)


def test_a_cup_reaching_over_the_edge_of_a_cube_has_no_seal(client: BulletClient) -> None:
    body = box(client, (0, 0, -0.025), 0.025)
    inside = measure_contact(client, make_tool_down_pose([0.018, 0, 0.001]), {body}, 0.006, REACH)
    outside = measure_contact(client, make_tool_down_pose([0.020, 0, 0.001]), {body}, 0.006, REACH)
    assert compute_breakaway_force(inside, TOOL) == pytest.approx(TOOL.force, rel=0.01)
    assert outside is not None and math.isinf(outside.gap)
    assert compute_breakaway_force(outside, TOOL) == 0


@pytest.mark.parametrize("cup", [0.004, 0.006, 0.012])
def test_the_gap_on_a_sphere_is_the_height_of_the_cap_under_the_cup(client: BulletClient, cup: float) -> None:
    radius = 0.03
    seal = measure_contact(client, make_tool_down_pose([0, 0, 0.0]), {ball(client, radius)}, cup, REACH)
    assert seal is not None
    assert seal.gap == pytest.approx(radius - math.sqrt(radius**2 - cup**2), abs=5e-5)
    assert seal.tilt == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("angle", [0.1, 0.4])
def test_a_tilted_face_costs_tilt_and_no_gap(client: BulletClient, angle: float) -> None:
    body = box(client, (0, 0, 0), 0.025, roll=angle)
    height = 0.025 / math.cos(angle) + 0.006 * math.tan(angle)
    seal = measure_contact(client, make_tool_down_pose([0, 0, height]), {body}, 0.006, REACH)
    assert seal is not None
    assert seal.tilt == pytest.approx(angle, abs=1e-3)
    assert seal.gap == pytest.approx(0, abs=2e-5)


def test_half_the_gap_and_half_the_tilt_leave_a_quarter_of_the_force() -> None:
    seal = CupContact(1, 0.0, TOOL.gap / 2, math.radians(TOOL.tilt_deg) / 2)
    assert compute_breakaway_force(seal, TOOL) == pytest.approx(TOOL.force / 4)
    for bad in (CupContact(1, 0.0, 2 * TOOL.gap, 0.0), CupContact(1, 0.0, 2 * TOOL.gap, 1.5), None):
        assert compute_breakaway_force(bad, TOOL) == 0.0


def measure(label: str, height: float) -> ToolMeasurement:
    """Return the evidence of a touch of an object on the table, if the whole upper half counts as the top."""
    centre = np.array([0.5, 0.0, CLASSES[label].height / 2])
    return TOOL.measure_contact(CLASSES[label], centre, height, CLASSES, overtravel=0.03)


@pytest.mark.parametrize(
    ("label", "height", "contradiction"),
    [
        ("cube", 0.0504, ""),
        ("cube", 0.1004, ""),  # on another cube
        ("cube", 0.06, "it was touched 60 mm above the table, and a cube is 50 mm high"),
        ("sphere", 0.11, "it was touched 110 mm above the table, and a sphere is 60 mm high"),
        ("sphere", 0.056, "it was touched 56 mm above the table, and a sphere is 60 mm high"),
    ],
)
def test_the_height_of_a_touch_has_to_be_that_of_the_class(label, height, contradiction):
    assert measure(label, height).contradiction == contradiction


def test_a_touch_far_below_the_top_is_a_miss():
    centre = np.array([0.5, 0.0, CLASSES["sphere"].height / 2])
    touches = [TOOL.measure_contact(CLASSES["sphere"], centre, height, CLASSES) for height in (0.04, 0.05)]
    assert [touch.is_miss for touch in touches] == [True, False]


SCISSORS = ObjectClass(
    "scissors", 0.02, 0.06, footprint=(0.12, 0.06), yaw_symmetry=1, contact_radius=0.03,
    grasp_points=(GraspPoint((0.03, 0.0, 0.01)), GraspPoint((-0.02, 0.01, 0.01))),
)  # fmt: skip


def list_places(yaw: Yaw | None, count: int) -> list[tuple[float, ...]]:
    """Return the contact points of successive attempts [mm] at scissors in the origin."""
    target = Target("scissors-1", "scissors", np.array([0, 0, 0.01]), 0.9, 1, 0, 0.0, yaw)
    places = []
    for number in range(count):
        (grasp,) = TOOL.list_grasps(SCISSORS, target, MotionConfig(), GraspAttempt(number))
        x, y, _ = grasp.goal.position
        places.append((round(1000 * x), round(1000 * y), round(1000 * grasp.contact_height)))
    return places


def test_attempts_go_from_point_to_point_and_to_both_ends_if_they_look_alike() -> None:
    quarter = math.pi / 2
    assert list_places(Yaw(quarter, 0.01, 1), 2) == [(0, 30, 10), (-10, -20, 10)]
    assert list_places(Yaw(quarter, 0.01, 2), 4)[2:] == [(0, -30, 10), (10, 20, 10)]
    x, y, _ = list_places(Yaw(quarter, 0.01, 1), 3)[2]
    assert math.dist((x, y), (0, 30)) == pytest.approx(2.5, abs=1), "the next round is beside the points"
    with pytest.raises(Blocked, match="scissors-1 can be held only at a known yaw"):
        list_places(None, 1)


@pytest.mark.parametrize(("height", "contradiction"), [(0.01, False), (0.02, True), (0.015, True)])
def test_a_touch_has_to_be_at_the_height_of_a_grasp_point(height: float, contradiction: bool) -> None:
    measurement = TOOL.measure_contact(SCISSORS, np.array([0, 0, 0.01]), height, {"scissors": SCISSORS})
    assert bool(measurement.contradiction) is contradiction


def test_an_approach_never_feels_below_the_middle_of_what_it_is_to_touch() -> None:
    washer = ObjectClass("washer", 0.006, 0.025, contact_radius=0.017)
    target = Target("washer-1", "washer", np.array([0.5, 0.1, 0.013]), 0.9, 1, 0, 0.0)  # on another one
    motion = MotionConfig(descent=0.02, descent_speed=0.05)
    (grasp,) = TOOL.list_grasps(washer, target, motion, GraspAttempt())
    assert grasp.goal.position == pytest.approx((0.517, 0.1, 0.013))
    assert (grasp.goal.guarded_length, grasp.goal.guarded_speed) == pytest.approx((0.003 + 0.02, 0.05))
    (further,) = TOOL.list_grasps(washer, target, motion, GraspAttempt(1, overtravel=0.001))
    assert further.goal.position[2] == pytest.approx(0.015)
    assert math.dist(further.goal.position[:2], (0.5, 0.1)) == pytest.approx(0.017)


@pytest.mark.parametrize(
    ("label", "height", "is_possible"),
    [("sphere", 0.04, True), ("sphere", 0.05, False), ("sphere", 0.065, False), ("cube", 0.035, True)],
)
def test_a_touch_that_is_too_low_for_all_classes_may_have_missed_the_top(label, height, is_possible):
    assert measure(label, height).may_be_wrong is is_possible


@pytest.mark.parametrize(
    ("is_flat", "height", "distinct"),
    [(True, 0.048, {"cube", "can"}), (False, 0.048, {"can"}), (False, 0.046, {"cube", "can"})],
)
def test_a_touch_tells_no_class_from_another_whose_height_agrees_with_it(is_flat, height, distinct):
    tool = TOOL.model_copy(update={"touch_tolerance": 0.001})
    can = ObjectClass("can", height, 0.03, flat_top=True)
    cube = ObjectClass("cube", 0.05, 0.0354, flat_top=is_flat)
    classes = {"cube": cube, "can": can}
    found = tool.measure_contact(cube, np.array([0.5, 0.0, 0.025]), height, classes, overtravel=0.03)
    assert tool.find_distinct_labels(classes) == distinct
    assert ("cube" in distinct) is bool(found.contradiction)
