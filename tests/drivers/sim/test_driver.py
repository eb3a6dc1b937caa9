"""The simulated devices as a whole: what the camera can see, and the truth about the objects."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.cell.arm import Goal, MotionGuard
from executive.cell.config import CellConfig
from executive.cell.devices import DriverOptions
from executive.cell.frame import TrueFrame
from executive.drivers.sim.driver import SimDriver
from executive.events import discard_event
from executive.geometry import Pose
from executive.mission.cell_file import load_cell
from executive.motion.planner import Planner
from executive.station.station import CellOptions, SilentOperator, Station
from executive.testing.fake_cell import SHIPPED_ROUTES
from executive.testing.oracle import make_oracle_kind

Build = Callable[..., Station]


@pytest.fixture
def build_cell(missions: Path, request: pytest.FixtureRequest) -> Build:
    """Build simulated stations whose detectors are oracles; they are closed after the test."""

    def build_cell(name: str = "overhead", seed: int = 4, **changes: Any) -> Station:
        path = missions / "cells" / f"{name}.yaml"
        config = load_cell(path).model_copy(update=changes)
        options = CellOptions(SilentOperator(), cell_folder=path.parent)
        made = make_oracle_kind(box_std=0.0)(
            config, seed=seed, routes=SHIPPED_ROUTES, emit=discard_event, options=options
        )
        request.addfinalizer(made.close)
        return made

    return build_cell


def test_the_table_is_hidden_while_the_arm_is_over_it(build_cell: Build) -> None:
    made = build_cell()
    cell = made.cell
    assert cell.camera.sees_table()
    planning = cell.arm.plan(Goal((0.53, 0.0, 0.16)))
    while not planning.ready:
        made.advance()
    cell.arm.start(planning.result())
    while not cell.arm.at_rest:
        made.advance()
    assert not cell.camera.sees_table()
    frame = cell.camera.capture()
    left, top, right, bottom = (int(side) for side in cell.camera.get_view_box("table"))
    hidden = ~frame.visible[top:bottom, left:right]
    assert 0.05 < hidden.mean() < 0.9
    x, y, z = frame.matrix @ frame.X_WC.inverse().apply(cell.arm.tool_pose.position)
    assert not frame.visible[int(y / z), int(x / z)]


@pytest.mark.parametrize(("way", "raised"), [("depth", 0.05), ("ray", 0.05), ("plane", 0.0)])
def test_only_depth_and_ray_find_what_does_not_stand_on_the_table(
    build_cell: Build, way: str, raised: float
) -> None:
    made = build_cell("depth", localization=way)
    body = next(body for body, label in made.driver.world.labels.items() if label == "cube")
    made.driver.world.place_object(body, Pose.of((0.6, 0.15, 0.075)))
    frame = made.cell.camera.capture()
    assert isinstance(frame, TrueFrame)
    found = [
        made.cell.localizer.locate(true, frame) for true in frame.true_detections if true.label == "cube"
    ]
    error = min(float(np.linalg.norm(place[:2] - (0.6, 0.15))) for place in found)
    assert (error < 0.003) == (way != "plane")
    height = min(found, key=lambda place: float(np.linalg.norm(place[:2] - (0.6, 0.15))))[2]
    assert height - 0.025 == pytest.approx(raised, abs=0.006)


def follow_down(config: CellConfig, step: float) -> list[list[float]]:
    """Descend on a cube with a guard, on a driver with this time between two ticks; return all positions."""
    clock = config.clock.model_copy(update={"step": step})
    driver = SimDriver(empty(config).model_copy(update={"clock": clock}), DriverOptions())
    driver.world.add_object("cube", Pose.of([0.5, 0.1, 0.025]), (1, 1, 1))
    goal = Goal((0.5, 0.1, 0.04), guarded_length=0.02, guarded_speed=0.05)
    motion = Planner(config).plan(driver.arm.q, goal)
    driver.arm.execute(motion, MotionGuard(touch=True))
    qs = []
    while not driver.arm.at_rest or len(qs) % round(1 / 60 / step):
        driver.clock.wait_for_tick()
        qs.append(driver.arm.q.tolist())
    assert driver.tool.touching and driver.clock.now < motion.duration, "the guard stopped the arm"
    driver.close()
    return qs


def test_arm_and_guard_do_the_same_at_a_lower_control_rate(overhead: CellConfig) -> None:
    assert follow_down(overhead, 1 / 60) == follow_down(overhead, 1 / 240)[3::4]


def empty(config: CellConfig) -> CellConfig:
    """Return the cell without objects."""
    table = config.table.model_copy(update={"objects": (0, 0)})
    return config.model_copy(update={"table": table})


def test_the_final_objects_are_in_their_bins_dropped_held_or_removed(overhead: CellConfig) -> None:
    driver = SimDriver(empty(overhead), DriverOptions())
    add = driver.world.add_object
    tip = driver.world.get_tool_pose().position
    in_bin = add("cube", Pose.of(overhead.bins["red_bin"].position), (1, 1, 1))
    places = [(0.5, 0.0, 0.025), (1.4, 0.0, -0.6), tip - (0.0, 0.0, 0.0255)]
    bodies = [in_bin, *(add("cube", Pose.of(place), (1, 1, 1)) for place in places)]
    for body in bodies:
        driver.world.rest_positions[body] = [np.zeros(3)]
    driver.tool.dropped_bodies.add(in_bin)
    driver.tool.close()
    driver.remove_object(driver.list_objects()[1])
    ends = [
        (each.bin, each.is_dropped, each.is_held, each.is_removed) for each in driver.list_final_objects()
    ]
    assert ends == [
        ("red_bin", True, False, False),
        ("", False, False, True),
        (None, False, False, False),
        ("yellow_bin", False, True, False),
    ]
    driver.close()
