from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.drivers.sim.camera import CELL_LIGHT, FixedViewRenderer, RenderedImage, get_camera_pose, render
from executive.drivers.sim.world import World
from executive.geometry import Pose
from executive.perception.camera_model import compute_calibration

REGION = (0, 60, 640, 420)


@pytest.fixture
def world(build: Callable[[CellConfig], World], overhead: CellConfig) -> World:
    world = build(overhead)
    world.add_object("duck", Pose.of([0.5, 0.1, 0.03]), (0.9, 0.8, 0.1))
    world.add_object("cube", Pose.of([0.5, -0.1, 0.025]), (1, 0, 0))
    return world


def render_all_bodies(world: World) -> RenderedImage:
    camera = world.config.cameras["overhead"]
    return render(world, compute_calibration(camera)[0], get_camera_pose(world, camera), REGION, CELL_LIGHT)


def render_combined(renderer: FixedViewRenderer, world: World) -> RenderedImage:
    camera = world.config.cameras["overhead"]
    return renderer.render(compute_calibration(camera)[0], get_camera_pose(world, camera))


def is_equal(image: RenderedImage, other: RenderedImage) -> bool:
    names = ("image", "segmentation", "depth_buffer")
    return all(np.array_equal(getattr(image, name), getattr(other, name)) for name in names)


def test_an_image_with_stored_immobile_bodies_is_equal_to_an_image_of_all_bodies(world: World) -> None:
    before = render_all_bodies(world)
    renderer = FixedViewRenderer(world, REGION, CELL_LIGHT)
    assert is_equal(render_combined(renderer, world), before)
    world.set_joint_positions(np.radians([10, 40, 0, -80, 0, 60, 0]))
    duck, cube = world.labels
    world.place_object(duck, Pose.of([0.55, 0.0, 0.2]))
    world.remove_object(cube)
    world.add_object("sphere", Pose.of([0.45, 0.05, 0.03]), (0, 0, 1))
    after = render_all_bodies(world)
    assert not is_equal(after, before)
    assert is_equal(render_combined(renderer, world), after)
    camera = world.config.cameras["overhead"]
    moved = camera.model_copy(update={"position": (0.5, 0.02, 1.2), "look_at": (0.5, 0.02, 0.0)})
    world.config = world.config.model_copy(update={"cameras": {"overhead": moved}})
    assert is_equal(render_combined(renderer, world), render_all_bodies(world))
    assert not is_equal(render_combined(renderer, world), after)
