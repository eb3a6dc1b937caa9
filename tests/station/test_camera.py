"""The camera as skills see it: what a frame says beside the image of the device."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from at_hand import intercept, look, pick

from executive.cell.config import CellConfig
from executive.cell.devices import CameraImage
from executive.events import Event, InputRead
from executive.geometry import Pose
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.detect import Detect


def test_frames_are_numbered_from_1_and_have_time_and_changes_of_the_ledger(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    first = fake.cell.camera.capture()
    pick(fake, look(fake)[0])
    later = fake.cell.camera.capture()
    assert (first.id, first.stamp, first.change_count, later.id) == (1, 0.0, 0, 3)
    assert later.stamp == fake.cell.clock.now > 0.0
    assert later.change_count == fake.ledger.change_count > 0


def test_a_frame_of_a_camera_at_the_wrist_says_where_it_was(wrist: CellConfig) -> None:
    fake = FakeCell(wrist)
    poses_in_tool = []
    for x in (0.5, 0.6):
        fake.arm.set_tool_position(np.array((x, 0.0, 0.3)))
        X_WC = fake.cell.camera.capture().X_WC
        poses_in_tool.append((fake.arm.tool_pose.inverse() @ X_WC).to_rounded_list(6))
    assert poses_in_tool[0] == poses_in_tool[1] != Pose.identity().to_rounded_list(6)


def test_pixels_that_the_device_says_are_hidden_are_not_visible(fake: FakeCell) -> None:
    fake.camera.occluded_regions.append((10.0, 20.0, 30.0, 40.0))
    frame = fake.cell.camera.capture()
    assert not frame.visible[20:40, 10:30].any()
    assert frame.visible.sum() == frame.visible.size - 400


IMAGE = CameraImage(np.zeros((480, 640, 3), np.uint8), None, 0.0)


@pytest.mark.parametrize(
    ("image", "problem"),
    [
        (None, "a NoneType"),
        (IMAGE._replace(colour=IMAGE.colour[::2, ::2]), "320 x 240 pixels instead of 640 x 480"),
        (IMAGE._replace(colour=IMAGE.colour[..., 0]), r"an array \(480, 640\) of uint8 as colour"),
        (IMAGE._replace(depth=np.zeros((3, 3))), "of float64 as depth"),
        (IMAGE._replace(stamp=float("nan")), "the stamp nan"),
    ],
)
def test_an_image_that_is_not_as_declared_is_a_recorded_reason(image: Any, problem: str) -> None:
    events: list[Event] = []
    fake = FakeCell(emit=events.append)
    intercept(fake, "image.capture", lambda: image)
    result = run_skill(Detect(), fake)
    assert result.reason == "wrong_image"
    assert re.search(problem, result.message)
    reads = [event for event in events if isinstance(event, InputRead) and event.name == "camera.image"]
    assert image is not None or reads[0].exception == "WrongImage"


def test_a_stamp_that_stands_while_time_passes_shows_a_frozen_camera(fake: FakeCell) -> None:
    intercept(fake, "image.capture", lambda: IMAGE._replace(true_detections=()))
    assert run_skill(Detect(), fake).status == "SUCCESS"
    result = run_skill(Detect(), fake)
    assert (result.reason, "frame 2 has the stamp 0.000 s" in result.message) == ("frozen", True)
