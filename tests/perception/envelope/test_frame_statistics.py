"""Statistics of the workspace in a frame, and their comparison with the measured ranges."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from plain_frames import frame_of

from executive.cell.config import TableConfig
from executive.perception.envelope import (
    FrameRange,
    compute_frame_statistics,
)

WOOD = (220, 200, 160)


def cell(**table):
    """A cell whose camera sees the whole workspace."""
    return SimpleNamespace(
        table=TableConfig(**table), cameras={"overhead": SimpleNamespace(partial_views=False)}
    )


def test_a_few_objects_change_neither_brightness_nor_colours_of_the_table():
    frame = frame_of(WOOD)
    frame.image[200:260, 280:360] = (10, 10, 10)
    statistics = compute_frame_statistics(frame, cell())
    assert (statistics["red"], statistics["green"], statistics["blue"]) == WOOD
    assert statistics["brightness"] == pytest.approx(sum(WOOD) / 3)
    assert statistics["contrast"] == 0


def test_what_lies_beside_the_workspace_does_not_count():
    frame = frame_of((0, 0, 0))
    frame.image[140:310, 230:410] = WOOD
    assert compute_frame_statistics(frame, cell(x=(0.48, 0.55), y=(-0.1, 0.1)))["red"] == WOOD[0]


def test_a_frame_that_shows_the_workspace_in_part_says_nothing():
    assert compute_frame_statistics(frame_of(WOOD), cell(x=(0.4, 2.0))) is None
    hidden = replace(frame_of(WOOD), visible=np.zeros((480, 640), bool))
    assert compute_frame_statistics(hidden, cell()) is None


def test_a_frame_within_the_tolerance_of_the_range_is_no_difference_and_a_darker_one_is():
    frames = [compute_frame_statistics(frame_of(colour), cell()) for colour in (WOOD, (200, 180, 150))]
    measured = FrameRange.compute([frame for frame in frames if frame])
    assert measured.brightness == (176.7, 193.3)
    near = {"brightness": 170.0, "contrast": 0.0, "red": 195.0, "green": 175.0, "blue": 145.0}
    assert measured.describe_difference(near) == ""
    dark = {"brightness": 30.0, "contrast": 0.0, "red": 35.0, "green": 180.0, "blue": 150.0}
    expected = "brightness 30, measured 177 to 193; red 35, measured 200 to 220"
    assert measured.describe_difference(dark) == expected


def test_without_frames_there_is_no_range():
    assert FrameRange.compute([]) is None
