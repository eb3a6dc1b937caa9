"""Where the three ways of localizing put what a camera sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.cell.frame import Detection, Frame
from executive.cell.objects import ObjectClass
from executive.errors import NoDepth
from executive.perception.camera_model import compute_camera_matrix, compute_look_at_pose, project
from executive.perception.localization import CellLocalizer

SIDE = 0.05
CLASSES = {"cube": ObjectClass("cube", SIDE, 0.0354)}
PLANE, DEPTH = CellLocalizer("plane", CLASSES), CellLocalizer("depth", CLASSES)
NO_HIT = CellLocalizer("ray", CLASSES, cast_ray=lambda origin, direction: None)
K = compute_camera_matrix(640, 480, 55)
ABOVE = compute_look_at_pose([0.5, 0.0, 1.2], [0.5, 0.0, 0.0], [1, 0, 0])
ASKEW = compute_look_at_pose([0.3, 0.3, 1.0], [0.5, 0.0, 0.0], [1, 0, 0])
UPWARDS = compute_look_at_pose([0.5, 0, 1.2], [0.5, 0, 2.0], [1, 0, 0])
PIXELS = np.stack(np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5, [1.0]), axis=-1)[:, :, 0]
IN_THE_MIDDLE = np.array([0.5, 0.0, SIDE / 2])


def show_cube(centre, X_WC=ABOVE):
    """Return the view of a cube over a table: the depth of its top face and of the table."""
    rays = PIXELS @ np.linalg.inv(K).T @ X_WC.rotation.T
    drop = centre[2] + SIDE / 2 - X_WC.position[2]
    on_top = X_WC.position + rays * (drop / rays[..., 2:])
    top = np.all(np.abs(on_top[..., :2] - centre[:2]) < SIDE / 2, axis=-1)
    depth = np.where(top, drop / rays[..., 2], -X_WC.position[2] / rays[..., 2])
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    pixels = project(K, X_WC, centre + np.array(corners) * SIDE / 2)
    (left, up), (right, down) = pixels.min(axis=0), pixels.max(axis=0)
    image, visible = np.zeros((480, 640, 3), np.uint8), np.ones((480, 640), np.bool_)
    frame = Frame(7, "eye", image, depth, K, X_WC, 0.0, visible, 0)
    return Detection("cube", 0.9, (left, up, right, down)), frame


@settings(max_examples=10)
@given(st.floats(0.42, 0.64), st.floats(-0.22, 0.22), st.floats(0.0, 0.15), st.sampled_from([ABOVE, ASKEW]))
def test_depth_finds_an_object_at_any_height(x, y, below, X_WC):
    centre = np.array([x, y, below + SIDE / 2])
    found = DEPTH.locate(*show_cube(centre, X_WC))
    # A box around an oblique cube is not quite centred on it.
    assert found == pytest.approx(centre, abs=0.004)
    assert found[2] == pytest.approx(centre[2], abs=5e-4)


def test_plane_puts_everything_on_the_table():
    on_table, raised = np.array([0.6, 0.2, SIDE / 2]), np.array([0.6, 0.2, 0.05 + SIDE / 2])
    assert PLANE.locate(*show_cube(on_table)) == pytest.approx(on_table, abs=0.002)
    found = PLANE.locate(*show_cube(raised))
    assert found[2] == pytest.approx(SIDE / 2)
    assert np.linalg.norm(found[:2] - raised[:2]) > 0.008


def test_a_ray_is_cast_from_the_lens_through_the_middle_of_the_box():
    centre = np.array([0.6, 0.2, 0.05 + SIDE / 2])

    def hit_top(origin, direction):
        assert origin == pytest.approx(ABOVE.position)
        return origin + (centre[2] + SIDE / 2 - origin[2]) / direction[2] * direction

    found = CellLocalizer("ray", CLASSES, cast_ray=hit_top).locate(*show_cube(centre))
    assert found == pytest.approx(centre, abs=0.002)


def keep_one_pixel(detection, frame):
    depth = np.full_like(frame.depth, np.nan)
    depth[240, 320] = 1.15
    return detection, replace(frame, depth=depth)


@pytest.mark.parametrize(
    ("localizer", "spoil", "text"),
    [
        (DEPTH, keep_one_pixel, r"^1 of 196 pixels in the middle of .*310, 230, 330, 250.* 20 are required"),
        (DEPTH, lambda one, frame: (one, replace(frame, visible=~frame.visible)), "^0 of 196 pixels in the"),
        (DEPTH, lambda one, frame: (replace(one, box=(700, 100, 720, 120)), frame), "^0 of 0 pixels in the"),
        (DEPTH, lambda one, frame: (one, replace(frame, depth=None)), "frame 7 has no depth image; set"),
        (NO_HIT, lambda one, frame: (one, frame), r"pixel \(320, 240\) of frame 7 hits nothing"),
        (
            PLANE,
            lambda one, frame: (one, replace(frame, X_WC=UPWARDS)),
            "not intersect the plane 25 mm above",
        ),
    ],
)
def test_the_cause_of_a_failed_localization_is_reported(localizer, spoil, text):
    with pytest.raises(NoDepth, match=text):
        localizer.locate(*spoil(*show_cube(IN_THE_MIDDLE)))
