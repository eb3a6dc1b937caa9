from __future__ import annotations

import math
from collections.abc import Iterator

import pybullet
import pytest
from pybullet_utils.bullet_client import BulletClient

from executive.cell.device_config import ToolConfig
from executive.drivers.sim.tool import CupContact, compute_breakaway_force, measure_contact
from executive.geometry import make_tool_down_pose

REACH = 0.002
TOOL = ToolConfig(
    cup_radius=0.006, reach=REACH, force=8.0, gap=0.004, tilt_deg=60, min_force=1.0, source="test"
)


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
