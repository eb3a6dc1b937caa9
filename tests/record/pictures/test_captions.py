"""Places of the captions in a picture."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from executive.record.pictures.draw import MIN_GAP, place_caption

SIZE, IMAGE_SIZE = (60, 12), (640, 480)
CORNERS = st.tuples(st.integers(-50, 700), st.integers(-50, 550))


def test_a_caption_is_above_the_corner_of_its_box() -> None:
    assert place_caption((100, 200), SIZE, IMAGE_SIZE, []) == (100, 188, 160, 200)


def test_a_second_caption_is_below_the_first_if_that_is_nearer() -> None:
    first = place_caption((100, 200), SIZE, IMAGE_SIZE, [])
    assert place_caption((110, 203), SIZE, IMAGE_SIZE, [first]) == (110, 202, 170, 214)
    assert place_caption((110, 195), SIZE, IMAGE_SIZE, [first]) == (110, 174, 170, 186)


@given(st.lists(CORNERS, max_size=12))
def test_captions_are_in_the_image_and_do_not_overlap(corners: list[tuple[int, int]]) -> None:
    placed: list[tuple[int, int, int, int]] = []
    for corner in corners:
        left, top, right, bottom = place_caption(corner, SIZE, IMAGE_SIZE, placed)
        assert left >= 0 <= top and right <= 640 and bottom <= 480
        for other in placed:
            is_beside = left >= other[2] + MIN_GAP or other[0] >= right + MIN_GAP
            assert is_beside or top >= other[3] + MIN_GAP or other[1] >= bottom + MIN_GAP
        placed.append((left, top, right, bottom))
