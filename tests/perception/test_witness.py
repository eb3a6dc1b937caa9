"""Regions of an image that look different from the table, in images drawn without the simulator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from executive.cell.config import BinConfig, TableConfig
from executive.cell.frame import Box, Frame, Region
from executive.cell.objects import Obstacle
from executive.geometry import Array
from executive.perception.camera_model import compute_camera_matrix, project
from executive.perception.witness import find_unexplained
from executive.testing.fake_cell import load_empty_cell
from tests.camera_poses import looking_down

X_WC = looking_down([0.5, 0.0, 1.2])
MATRIX = compute_camera_matrix(640, 480, 55.0)
TABLE_COLOUR = np.array([215.0, 195.0, 165.0])
PLACE = np.array([0.53, 0.1, 0.0])
BIN = BinConfig(position=(0.53, 0.1, 0.0), size=(0.2, 0.2, 0.06))


def draw(*patches: tuple[Array, float, Array], depth: Array | None = None) -> Frame:
    """Return a frame of a table with a gradient, noise, and square patches: centre, side [m] and colour."""
    rows, columns = np.indices((480, 640))
    image = TABLE_COLOUR + (0.04 * rows - 0.02 * columns)[..., None]
    for centre, side, colour in patches:
        corners = project(MATRIX, X_WC, [centre - side / 2, centre + side / 2])
        left, top = corners.min(axis=0).astype(int)
        right, bottom = corners.max(axis=0).astype(int)
        image[top:bottom, left:right] = colour
    noisy = image + np.random.default_rng(1).normal(0, 2, image.shape)
    colour_image = np.clip(noisy, 0, 255).astype(np.uint8)
    return Frame(1, "top", colour_image, depth, MATRIX, X_WC, 0.0, np.ones((480, 640), np.bool_), 0)


def search(
    frame: Frame, *boxes: Box, bins: Sequence[BinConfig] = (), obstacles: Sequence[Obstacle] = ()
) -> list[Region]:
    sections = {f"bin {index}": section for index, section in enumerate(bins)}
    config = load_empty_cell().model_copy(update={"table": TableConfig(), "bins": sections})
    return find_unexplained(frame, boxes, config, obstacles)


@pytest.mark.parametrize("difference", [(-20, -20, -20), (30, 0, 0), (0, 0, -25), (25, 40, 60)])
def test_a_thing_of_another_colour_is_found_where_it_is(difference: tuple[int, int, int]) -> None:
    (region,) = search(draw((PLACE, 0.05, TABLE_COLOUR + difference)))
    assert region.position[:2] == pytest.approx(PLACE[:2], abs=0.01)
    assert "(0.53, 0.10) m" in region.text


def test_an_empty_table_has_no_region() -> None:
    assert search(draw()) == []


def test_an_unknown_class_a_known_object_or_a_bin_explains_a_region() -> None:
    frame = draw((PLACE, 0.05, np.zeros(3)))
    left, top = project(MATRIX, X_WC, [PLACE])[0] - 10
    assert search(frame, (left, top, left + 20, top + 20)) == []
    assert search(frame, obstacles=[Obstacle(0.53, 0.1, 0.035, 0.05, "cube-1")]) == []
    assert search(frame, bins=[BIN]) == []
    assert search(frame, obstacles=[Obstacle(0.53, 0.0, 0.035, 0.05, "cube-1")])


def test_a_region_beside_the_arm_or_larger_than_any_object_is_no_evidence() -> None:
    frame = draw((PLACE, 0.05, np.zeros(3)))
    column, row = project(MATRIX, X_WC, [PLACE])[0].astype(int)
    frame.visible[row - 30 : row + 30, :column] = False
    assert search(frame) == []
    assert search(draw((PLACE, 0.3, np.zeros(3)))) == []


def test_a_depth_image_shows_a_thing_of_the_colour_of_the_table() -> None:
    depth = np.full((480, 640), 1.2)
    column, row = project(MATRIX, X_WC, [PLACE])[0].astype(int)
    depth[row - 10 : row + 10, column - 10 : column + 10] = 1.15
    (region,) = search(draw(depth=depth))
    assert region.position[:2] == pytest.approx(PLACE[:2], abs=0.01)
