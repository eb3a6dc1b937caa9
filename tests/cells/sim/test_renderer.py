from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.cell.config import CellConfig
from executive.cells.sim.camera import get_camera_pose
from executive.cells.sim.renderer import CELL_LIGHT, FixedViewRenderer, RenderedImage, render
from executive.cells.sim.world import World
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


class Renderer:
    """Renderer of the overhead camera, with stored immobile bodies."""

    def __init__(self, world: World) -> None:
        self._world, self._renderer = world, FixedViewRenderer(world, REGION, CELL_LIGHT)

    def render(self) -> RenderedImage:
        camera = self._world.config.cameras["overhead"]
        return self._renderer.render(compute_calibration(camera)[0], get_camera_pose(self._world, camera))


def is_equal(image: RenderedImage, other: RenderedImage) -> bool:
    names = ("image", "segmentation", "depth_buffer")
    return all(np.array_equal(getattr(image, name), getattr(other, name)) for name in names)


def test_an_image_with_stored_immobile_bodies_is_equal_to_an_image_of_all_bodies(world: World) -> None:
    before = render_all_bodies(world)
    renderers = Renderer(world), Renderer(world)
    assert all(is_equal(renderer.render(), before) for renderer in renderers)
    world.set_joint_positions(np.radians([10, 40, 0, -80, 0, 60, 0]))
    duck, cube = world.labels
    world.place_object(duck, Pose.of([0.55, 0.0, 0.2]))
    world.remove_object(cube)
    world.add_object("sphere", Pose.of([0.45, 0.05, 0.03]), (0, 0, 1))
    after = render_all_bodies(world)
    assert not is_equal(after, before)
    assert all(is_equal(renderer.render(), after) for renderer in renderers)


def test_a_moved_camera_gets_a_new_image_of_the_immobile_bodies(world: World) -> None:
    renderer = Renderer(world)
    first = renderer.render()
    camera = world.config.cameras["overhead"]
    moved = camera.model_copy(update={"position": (0.5, 0.02, 1.2), "look_at": (0.5, 0.02, 0.0)})
    world.config = world.config.model_copy(update={"cameras": {"overhead": moved}})
    assert is_equal(renderer.render(), render_all_bodies(world))
    assert not is_equal(renderer.render(), first)
