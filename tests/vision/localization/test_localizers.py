"""Where the three ways of localizing put what a camera sees."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.errors import NoDepth
from executive.geometry import Array, Pose
from executive.messages import Detection, Frame, ObjectClass
from executive.vision.camera_model import camera_matrix, looking_at, project
from executive.vision.localization.build import build_localizer
from executive.vision.localization.depth import DepthLocalizer
from executive.vision.localization.plane import PlaneLocalizer
from executive.vision.localization.ray import RayLocalizer

SIDE = 0.05
CLASSES = {"cube": ObjectClass("cube", SIDE, 0.0354)}
K = camera_matrix(640, 480, 55)
ABOVE = looking_at([0.5, 0.0, 1.2], [0.5, 0.0, 0.0], [1, 0, 0])
ASKEW = looking_at([0.3, 0.3, 1.0], [0.5, 0.0, 0.0], [1, 0, 0])
PIXELS = np.stack(np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5, [1.0]), axis=-1)[:, :, 0]


def showing_cube(centre: Array, X_WC: Pose = ABOVE) -> tuple[Detection, Frame]:
    """Return the view of a cube over a table: the depth of its top face and of the table."""
    rays = PIXELS @ np.linalg.inv(K).T @ X_WC.rotation.T
    drop = centre[2] + SIDE / 2 - X_WC.position[2]
    on_top = X_WC.position + rays * (drop / rays[..., 2:])
    top = np.all(np.abs(on_top[..., :2] - centre[:2]) < SIDE / 2, axis=-1)
    depth = np.where(top, drop / rays[..., 2], -X_WC.position[2] / rays[..., 2])
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    pixels = project(K, X_WC, centre + np.array(corners) * SIDE / 2)
    (left, up), (right, down) = pixels.min(axis=0), pixels.max(axis=0)
    frame = Frame(
        id=7, camera="eye", image=np.zeros((480, 640, 3), np.uint8), depth=depth, matrix=K, X_WC=X_WC,
        stamp=0.0, visible=np.ones((480, 640), np.bool_), epoch=0,
    )  # fmt: skip
    return Detection("cube", 0.9, (left, up, right, down)), frame


@settings(deadline=None, max_examples=30)
@given(st.floats(0.42, 0.64), st.floats(-0.22, 0.22), st.floats(0.0, 0.15), st.sampled_from([ABOVE, ASKEW]))
def test_depth_finds_an_object_at_any_height(x: float, y: float, below: float, X_WC: Pose) -> None:
    centre = np.array([x, y, below + SIDE / 2])
    found = DepthLocalizer(CLASSES).locate(*showing_cube(centre, X_WC))
    # A box around an oblique cube is not quite centred on it.
    assert found == pytest.approx(centre, abs=0.004)
    assert found[2] == pytest.approx(centre[2], abs=5e-4)


def test_plane_puts_everything_on_the_table() -> None:
    on_table, raised = np.array([0.6, 0.2, SIDE / 2]), np.array([0.6, 0.2, 0.05 + SIDE / 2])
    assert PlaneLocalizer(CLASSES).locate(*showing_cube(on_table)) == pytest.approx(on_table, abs=0.002)
    found = PlaneLocalizer(CLASSES).locate(*showing_cube(raised))
    assert found[2] == pytest.approx(SIDE / 2)
    assert np.linalg.norm(found[:2] - raised[:2]) > 0.008


def test_a_neighbour_at_the_side_of_the_box_does_not_count() -> None:
    centre = np.array([0.5, 0.0, SIDE / 2])
    detection, frame = showing_cube(centre)
    assert frame.depth is not None
    frame.depth[:, : round(detection.box[0]) + 3] = 1.0
    assert DepthLocalizer(CLASSES).locate(detection, frame) == pytest.approx(centre, abs=0.002)


def test_noise_and_pixels_without_depth_move_it_by_millimetres() -> None:
    random = np.random.default_rng(3)
    centre = np.array([0.5, 0.1, 0.08])
    detection, frame = showing_cube(centre)
    assert frame.depth is not None
    frame.depth[:] += random.normal(0, 0.005, frame.depth.shape)
    frame.depth[random.random(frame.depth.shape) < 0.5] = np.nan
    assert DepthLocalizer(CLASSES).locate(detection, frame) == pytest.approx(centre, abs=0.005)


def test_too_few_pixels_with_a_depth_are_counted() -> None:
    detection, frame = showing_cube(np.array([0.5, 0.0, SIDE / 2]))
    assert frame.depth is not None
    frame.depth[:] = np.nan
    frame.depth[240, 320] = 1.15
    with pytest.raises(NoDepth) as caught:
        DepthLocalizer(CLASSES).locate(detection, frame)
    assert str(caught.value) == (
        "1 of 196 pixels in the middle of the box (310, 230, 330, 250) of frame 7 have a depth; 20 are needed"
    )


def test_what_the_arm_may_hide_has_no_depth() -> None:
    detection, frame = showing_cube(np.array([0.5, 0.0, SIDE / 2]))
    frame.visible[:] = False
    with pytest.raises(NoDepth, match="0 of 196 pixels"):
        DepthLocalizer(CLASSES).locate(detection, frame)


def test_a_box_outside_of_the_image_has_no_depth() -> None:
    _, frame = showing_cube(np.array([0.5, 0.0, SIDE / 2]))
    with pytest.raises(NoDepth, match="0 of 0 pixels"):
        DepthLocalizer(CLASSES).locate(Detection("cube", 0.9, (700, 100, 720, 120)), frame)


def test_a_frame_without_a_depth_image_says_which_camera_lacks_it() -> None:
    detection, frame = showing_cube(np.array([0.5, 0.0, SIDE / 2]))
    with pytest.raises(NoDepth) as caught:
        DepthLocalizer(CLASSES).locate(detection, dataclasses.replace(frame, depth=None))
    assert str(caught.value) == "frame 7 has no depth image; localize by plane, or give camera eye one"


def test_a_ray_is_cast_from_the_lens_through_the_middle_of_the_box() -> None:
    centre = np.array([0.6, 0.2, 0.05 + SIDE / 2])
    detection, frame = showing_cube(centre)

    def onto_the_top(origin: Array, direction: Array) -> Array:
        assert origin == pytest.approx(ABOVE.position)
        return np.asarray(origin + (centre[2] + SIDE / 2 - origin[2]) / direction[2] * direction)

    assert RayLocalizer(CLASSES, onto_the_top).locate(detection, frame) == pytest.approx(centre, abs=0.002)


def test_a_ray_that_hits_nothing_says_where_it_went() -> None:
    detection, frame = showing_cube(np.array([0.5, 0.0, SIDE / 2]))
    with pytest.raises(NoDepth) as caught:
        RayLocalizer(CLASSES, lambda origin, direction: None).locate(detection, frame)
    assert str(caught.value) == "the ray through pixel (320, 240) of frame 7 hits nothing"


def test_a_camera_that_looks_up_meets_no_plane() -> None:
    detection, frame = showing_cube(np.array([0.5, 0.0, SIDE / 2]))
    upwards = dataclasses.replace(frame, X_WC=looking_at([0.5, 0, 1.2], [0.5, 0, 2.0], [1, 0, 0]))
    with pytest.raises(NoDepth) as caught:
        PlaneLocalizer(CLASSES).locate(detection, upwards)
    assert str(caught.value) == (
        "the ray through pixel (320, 240) of frame 7 does not meet the plane 25 mm above the table"
    )


@pytest.mark.parametrize(
    ("way", "kind"), [("plane", PlaneLocalizer), ("depth", DepthLocalizer), ("ray", RayLocalizer)]
)
def test_the_cell_file_s_word_decides(way, kind) -> None:
    assert type(build_localizer(way, CLASSES, lambda origin, direction: None)) is kind
