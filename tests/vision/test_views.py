"""Which parts of a frame are searched, and how overlapping answers become one."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.errors import InputError
from executive.messages import Detection
from executive.vision.detectors.views import Finding, iou, merge, parts_of

TABLE = (192, 100, 448, 356)
SIZE = (640, 480)


def found(box, confidence=0.9, part=(0, 0, 256, 256), label="cube"):
    return Finding(Detection(label, confidence, box), part)


def test_the_table_view_is_the_square_of_the_cell_file():
    assert parts_of("table", TABLE, SIZE) == [TABLE]


def test_an_unknown_view_is_named():
    with pytest.raises(InputError, match='no view "ceiling"; there are table and full'):
        parts_of("ceiling", TABLE, SIZE)


@given(
    st.integers(64, 300).flatmap(
        lambda side: st.tuples(st.just(side), st.integers(side, 900), st.integers(side, 900))
    ),
    st.data(),
)
def test_every_small_object_is_whole_in_some_tile_of_the_full_view(sizes, data):
    side, width, height = sizes
    extent = side // 5
    left = data.draw(st.integers(0, width - extent))
    top = data.draw(st.integers(0, height - extent))
    parts = parts_of("full", (0, 0, side, side), (width, height))
    assert all(part[2] - part[0] == side and part[3] - part[1] == side for part in parts)
    assert any(
        part[0] <= left and part[1] <= top and left + extent <= part[2] and top + extent <= part[3]
        for part in parts
    )


def test_a_frame_smaller_than_the_table_view_is_one_tile():
    assert parts_of("full", TABLE, (200, 150)) == [(0, 0, 200, 150)]


def test_of_two_views_of_an_object_the_one_that_is_whole_wins_though_less_confident():
    cut = found((240, 100, 256, 130), confidence=0.95)
    whole = found((240, 100, 270, 130), confidence=0.80, part=(192, 0, 448, 256))
    assert merge([cut, whole], SIZE) == [whole.detection]


def test_of_two_whole_views_of_an_object_the_more_confident_wins():
    one = found((200, 100, 230, 130), confidence=0.80)
    other = found((201, 101, 231, 131), confidence=0.90, part=(192, 0, 448, 256))
    assert merge([one, other], SIZE) == [other.detection]


def test_two_objects_that_overlap_in_one_tile_stay_two():
    one, other = found((10, 10, 40, 40)), found((20, 10, 50, 40), confidence=0.8)
    assert merge([other, one], SIZE) == [one.detection, other.detection]


def test_an_object_cut_off_by_the_frame_itself_is_not_called_cut():
    at_edge = found((0, 100, 20, 130), confidence=0.9)
    shifted = found((0, 101, 20, 131), confidence=0.8, part=(0, 112, 256, 368))
    assert merge([at_edge, shifted], SIZE) == [at_edge.detection]


def test_overlap_is_one_for_equal_boxes_and_zero_for_distant_ones():
    assert iou((0, 0, 10, 10), (0, 0, 10, 10)) == pytest.approx(1)
    assert iou((0, 0, 10, 10), (5, 0, 15, 10)) == pytest.approx(1 / 3)
    assert iou((0, 0, 10, 10), (20, 20, 30, 30)) == 0
