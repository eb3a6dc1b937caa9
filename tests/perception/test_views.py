"""Parts of a frame that are searched, and overlapping answers that become one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.cell.frame import Detection
from executive.perception.detectors.views import (
    list_regions,
    merge_detections,
    remove_duplicates,
    search_regions,
)

TABLE = (192, 100, 448, 356)
SIZE = (640, 480)


def found(box, confidence=0.9, part=(0, 0, 256, 256), label="cube"):
    return Detection(label, confidence, box), part


def test_the_table_view_is_the_square_of_the_cell_file_and_a_smaller_frame_is_one_tile():
    assert list_regions("table", TABLE, SIZE) == [TABLE]
    assert list_regions("full", TABLE, (200, 150)) == [(0, 0, 200, 150)]


def test_a_detection_keeps_the_confidence_of_its_second_class_and_gets_the_name_of_the_cell():
    ball = Detection("ball", 0.6, (1, 2, 3, 4), second_confidence=0.5)
    (kept,) = search_regions(
        np.zeros((480, 640, 3), np.uint8), [TABLE], lambda part: [ball], {"ball": "sphere"}
    )
    assert kept == Detection("sphere", 0.6, (193, 102, 195, 104), second_confidence=0.5)


@given(st.integers(64, 300), st.integers(0, 600), st.floats(0, 1))
def test_every_small_object_is_whole_in_some_tile_of_the_full_view(side, further, fraction):
    width = side + further
    extent = side // 5
    left = round(fraction * (width - extent))
    parts = list_regions("full", (0, 0, side, side), (width, side))
    assert all(part[2] - part[0] == part[3] - part[1] == side for part in parts)
    assert any(part[0] <= left and left + extent <= part[2] for part in parts)
    turned = list_regions("full", (0, 0, side, side), (side, width))
    assert [(part[1], part[0], part[3], part[2]) for part in turned] == parts


OTHER = (192, 0, 448, 256)
"""A part that overlaps with the one from 0 to 256."""


@pytest.mark.parametrize(
    ("one", "other", "kept"),
    [
        # Of two whole views the more confident wins.
        (found((200, 100, 230, 130), 0.80), found((201, 101, 231, 131), 0.90, OTHER), (1,)),
        # A view that lies in the other to more than 0.7 shows the same object, one to 0.6 another one.
        (found((200, 100, 230, 130), 0.9), found((208, 100, 248, 140), 0.8, OTHER), (0,)),
        (found((200, 100, 230, 130), 0.9), found((212, 100, 252, 140), 0.8, OTHER), (0, 1)),
        # Two objects that overlap in one tile stay two.
        (found((10, 10, 40, 40), 0.9), found((15, 10, 45, 40), 0.8), (0, 1)),
    ],
)
def test_an_object_in_two_tiles_is_reported_once(one, other, kept):
    expected = [(one, other)[number][0] for number in kept]
    assert merge_detections([one, other]) == expected
    assert merge_detections([other, one]) == expected


@pytest.mark.parametrize("region_count", [1, 2])
def test_of_several_tiles_the_parts_of_objects_are_not_reported(region_count):
    regions = [(0, 0, 256, 256), (192, 0, 448, 256)][:region_count]
    at_image_edge = Detection("cube", 0.9, (0.0, 100.0, 20.0, 130.0))
    at_tile_edge = Detection("cube", 0.8, (240.0, 100.0, 256.0, 130.0))
    crops = iter([[at_image_edge, at_tile_edge], []])
    reported = search_regions(np.zeros((480, 640, 3), np.uint8), regions, lambda _: next(crops), {})
    assert reported == [at_image_edge, at_tile_edge][: 3 - region_count]


def test_of_boxes_that_overlap_by_more_than_seven_tenths_the_most_confident_is_kept():
    detections = [
        Detection("first", 0.9, (0, 0, 10, 10)),
        Detection("again", 0.8, (0, 0, 10, 14)),
        Detection("beside", 0.7, (0, 0, 10, 15)),
        Detection("far", 0.6, (50, 0, 60, 9)),
    ]
    assert [one.label for one in remove_duplicates(detections)] == ["first", "beside", "far"]
    assert remove_duplicates([]) == merge_detections([]) == []
