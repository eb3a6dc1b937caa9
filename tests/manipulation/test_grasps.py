"""Yaws at which objects are placed: of slots, held objects and fingers, on a fake cell and in simulation."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from at_hand import look, pick

from executive.cell.config import BinConfig, CellConfig
from executive.cell.devices import TrueObject
from executive.errors import Blocked
from executive.events import TimedEvent
from executive.geometry import HeldPose, Yaw, compute_tool_yaw, make_tool_down_pose
from executive.manipulation.grasps import make_bin_goal
from executive.manipulation.tool_goals import find_layer_thickness
from executive.mission.cell_file import load_cell
from executive.station.station import Station
from executive.testing.fake_cell import FakeCell
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import run_mission
from executive.testing.run_skill import run_skill
from skills.transit import Transit

PLACE_YAW = 30.0
TOOLS = pytest.mark.parametrize("name", ["overhead", "iiwa_wsg50"])


def build_fake(missions: Path, name: str, **changes: object) -> FakeCell:
    """Return a fake cell without objects, whose red bin has other keys."""
    config = load_cell(missions / "cells" / f"{name}.yaml")
    bin = BinConfig(**{**dict(config.bins["red_bin"]), "place_yaw_deg": PLACE_YAW, **changes})
    fake = FakeCell(CellConfig(**{**dict(config), "bins": {**config.bins, "red_bin": bin}}))
    fake.world.objects.clear()
    return fake


def test_the_yaw_of_a_tool_that_points_down_is_that_of_its_pose() -> None:
    assert compute_tool_yaw(make_tool_down_pose((0.5, 0.0, 0.1), yaw=2.5)) == pytest.approx(2.5)


@TOOLS
@pytest.mark.parametrize(("label", "period"), [("cube", 90), ("duck", 180)])
def test_an_object_turns_from_its_yaw_to_that_of_the_slot(missions, name, label, period) -> None:
    fake = build_fake(missions, name, slots=(2, 2))
    fake.world.put(label, 0.5, 0.0, yaw=0.4)
    (target,) = look(fake)
    item = pick(fake, target)
    start = compute_tool_yaw(fake.arm.tool_pose)
    assert run_skill(Transit(held=item, bin="red_bin"), fake).status == "SUCCESS"
    turn = compute_tool_yaw(fake.arm.tool_pose) - start
    direction = fake.cell.classes[label].yaw_offset if period == 180 else 0.0
    error = math.degrees(0.4 + direction + turn) - PLACE_YAW
    assert math.remainder(error, period) == pytest.approx(0.0, abs=0.2)


def test_fingers_turn_the_sides_of_an_object_parallel_to_the_pads(missions: Path) -> None:
    cell = build_fake(missions, "iiwa_wsg50").cell
    held_yaw = cell.tool_model.compute_held_yaw(cell.classes["cube"], Yaw(1.7, 0.1, 4), 0.0)
    assert held_yaw.angle == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("held_pose", [None, HeldPose(Yaw(0.0, 0.1, 2))])
def test_an_unknown_yaw_blocks_the_transit_but_not_that_of_a_round_object(missions, held_pose) -> None:
    fake = build_fake(missions, "overhead")
    for label, y in (("cube", 0.1), ("sphere", -0.1)):
        fake.world.put(label, 0.5, y)
    targets = {target.label: target for target in look(fake)}
    assert make_bin_goal(fake.cell, "red_bin", targets["sphere"].item, None).yaws == ()
    assert make_bin_goal(fake.cell, "blue_bin", targets["cube"].item, None).yaws == ()
    item = pick(fake, targets["cube"])
    fake.ledger.record_grasp(item, held_pose)
    result = run_skill(Transit(held=item, bin="red_bin"), fake)
    assert result.reason == "blocked"
    assert result.message.startswith("red_bin needs cube-1 at 30 degrees, but no image showed the yaw")


def test_fingers_without_space_at_the_yaw_of_a_slot_are_blocked(missions: Path) -> None:
    fake = build_fake(missions, "iiwa_wsg50", size=(0.08, 0.3, 0.06), slots=(1, 2), place_yaw_deg=(45.0, 0.0))
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look(fake)
    with pytest.raises(Blocked, match="yaw that red_bin needs: the wall of red_bin is in the way"):
        make_bin_goal(fake.cell, "red_bin", target.item, HeldPose(Yaw(0.0, 0.1, 4)))


def test_the_middle_of_an_object_that_is_held_beside_it_comes_over_the_middle_of_the_slot(missions) -> None:
    fake = build_fake(missions, "overhead", slots=(1, 1), place_yaw_deg=90.0)
    fake.world.put("duck", 0.5, 0.0)
    (target,) = look(fake)
    held = HeldPose(Yaw(0.0, 0.1, 2), (0.02, 0.01))
    goal = make_bin_goal(fake.cell, "red_bin", target.item, held)
    tool = make_tool_down_pose(goal.position, goal.yaws[0])
    assert tool.apply([0.02, 0.01, 0.0])[:2] == pytest.approx(fake.cell.bins["red_bin"].slots[0])


def test_a_layer_of_a_pallet_is_as_thick_as_its_class(missions: Path) -> None:
    fake = build_fake(missions, "overhead")
    heights = [find_layer_thickness(fake.cell, name) for name in ("red_bin", "blue_bin", "yellow_bin")]
    assert heights == [0.05, 0.06, 0.06]


def test_a_bin_needs_an_angle_for_each_slot() -> None:
    with pytest.raises(ValueError, match="needs one place_yaw_deg for each of its 6 slots, not 2"):
        BinConfig(position=(0.0, 0.5, 0.0), size=(0.2, 0.3, 0.06), place_yaw_deg=(0.0, 90.0))


@pytest.mark.slow
@TOOLS
def test_two_layers_of_cubes_lie_aligned_in_simulation(name: str) -> None:
    keys = {"cell.table.objects": "[8, 8]", "cell.bins.red_bin.slots": "[2, 2]"}
    keys["cell.bins.red_bin.place_yaw_deg"] = "[30, 75, -20, 0]"
    stations: list[Station] = []
    objects: list[TrueObject] = []

    def observe(_: TimedEvent) -> None:
        objects[:] = stations[0].driver.list_objects()

    options = {"cell": name, "seed": 118, "set": keys, "arrange": stations.append, "observers": [observe]}
    result = run_mission("sort_overhead", make_oracle_kind(), **options)
    assert (result.status, result.agrees) == ("SUCCESS", True)
    cubes = [each for each in objects if each.label == "cube"]
    assert [sum(cube.position[2] > height for cube in cubes) for height in (0.02, 0.06)] == [6, 2]
    bin = stations[0].cell.bins["red_bin"]
    for cube in cubes:
        slot = min(range(4), key=lambda index: math.dist(bin.slots[index], cube.position[:2]))
        x_axis = cube.X_WO.rotation[:, 0]
        error = math.remainder(math.atan2(x_axis[1], x_axis[0]) - bin.place_yaws[slot], math.pi / 2)
        assert abs(math.degrees(error)) < 3
