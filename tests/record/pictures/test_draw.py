"""What a picture looks like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.events import DetectedObject
from executive.record.pictures.draw import PICTURE_WIDTH, draw_picture, make_captions
from executive.record.pictures.palette import BACKGROUND, PALETTE, choose_class_colour, to_bgr
from executive.record.pictures.picture_content import PictureContent
from executive.record.pictures.status_bar import STATUS_BAR_HEIGHT

GREY = 150
CUBE = DetectedObject("cube", 0.9, (100.0, 200.0, 160.0, 260.0), (0.0, 0.0, 0.0), "")
DUCK = DetectedObject("duck", 0.7, (300.0, 100.0, 340.0, 140.0), (0.0, 0.0, 0.0), "")
CLASSES = ("cube", "duck")


def scene(*seen: DetectedObject, height: int = 480, width: int = 640, **more) -> PictureContent:
    image = np.full((height, width, 3), GREY, np.uint8)
    return PictureContent(image, detections=seen, classes=CLASSES, **more)


def rgb(colour: str) -> tuple[int, ...]:
    return to_bgr(colour)[::-1]


def edge(picture: np.ndarray, row: int, column: int) -> list[tuple[int, ...]]:
    """Return the colours across the left edge of a box, from outside to inside."""
    return [tuple(int(value) for value in picture[row, x]) for x in range(column - 5, column + 6)]


def test_the_chosen_box_is_thick_and_rimmed_the_others_are_thin():
    picture = draw_picture(scene(CUBE, DUCK, selected_index=0))
    chosen, other = edge(picture, 230, 100), edge(picture, 120, 300)
    assert chosen[5] == rgb(PALETTE[0]) and other[5] == rgb(PALETTE[1])
    assert chosen.count(chosen[5]) > other.count(other[5])
    assert chosen[:5].count((0, 0, 0)) == chosen[6:].count((0, 0, 0)) == 1
    assert set(other) == {(GREY,) * 3, rgb(PALETTE[1])}


def test_the_strip_is_below_the_image_with_a_close_up_of_the_choice():
    image = np.full((480, 640, 3), GREY, np.uint8)
    image[200:260, 100:160] = (200, 30, 30)
    picture = draw_picture(replace(scene(CUBE, selected_index=0), image=image))
    assert picture.shape == (480 + STATUS_BAR_HEIGHT, PICTURE_WIDTH, 3)
    assert tuple(picture[480 + STATUS_BAR_HEIGHT // 2, STATUS_BAR_HEIGHT // 2]) == (200, 30, 30)
    assert tuple(picture[480 + STATUS_BAR_HEIGHT // 8, STATUS_BAR_HEIGHT // 8]) == (GREY,) * 3
    assert tuple(picture[480, 0]) == rgb(PALETTE[0])
    assert tuple(picture[-1, -1]) == rgb(BACKGROUND)


def test_without_a_choice_every_box_is_thin_and_there_is_no_close_up():
    picture = draw_picture(scene(CUBE))
    assert set(edge(picture, 230, 100)) == {(GREY,) * 3, rgb(PALETTE[0])}
    assert tuple(picture[480 + STATUS_BAR_HEIGHT // 2, 1]) == rgb(BACKGROUND)


def test_a_choice_at_the_edge_of_an_image_is_drawn_and_the_image_left_alone():
    cut_off = replace(CUBE, box=(-10.0, 460.0, 20.0, 490.0))
    drawn = scene(cut_off, selected_index=0, visible=np.zeros((480, 640), bool))
    assert draw_picture(drawn).shape == (480 + STATUS_BAR_HEIGHT, PICTURE_WIDTH, 3)
    assert (drawn.image == GREY).all()


def test_what_the_strip_says_is_written_on_it():
    silent, labelled = (draw_picture(scene(mission=mission))[480:] for mission in ("", "sort"))
    assert np.any(silent != labelled)


def test_hidden_parts_are_darker():
    visible = np.ones((480, 640), bool)
    visible[:, :320] = False
    picture = draw_picture(scene(visible=visible))
    assert picture[100, 100].max() < GREY - 20
    assert tuple(picture[100, 500]) == (GREY,) * 3


@pytest.mark.parametrize("width", [160, 1280])
def test_every_picture_is_as_wide_and_its_boxes_go_with_it(width):
    scale = width / PICTURE_WIDTH
    small = replace(CUBE, box=tuple(edge * scale for edge in CUBE.box))
    picture = draw_picture(scene(small, height=round(480 * scale), width=width))
    assert picture.shape == (480 + STATUS_BAR_HEIGHT, PICTURE_WIDTH, 3)
    assert tuple(picture[230, 100]) == rgb(PALETTE[0])


def test_a_label_says_the_class_and_the_confidence_that_of_the_choice_the_item():
    assert make_captions(scene(CUBE, DUCK, selected_index=1, item="duck-3")) == ["cube 0.90", "duck-3 0.70"]
    assert make_captions(scene(CUBE, selected_index=0)) == ["cube 0.90"]


def test_the_labels_of_boxes_side_by_side_do_not_cover_each_other():
    beside = replace(CUBE, label="duck", box=(104.0, 200.0, 164.0, 260.0))
    apart, close = (draw_picture(scene(CUBE, other))[:480] for other in (DUCK, beside))
    for colour in (rgb(PALETTE[0]), rgb(PALETTE[1])):
        labels = [(picture == colour).all(axis=-1).sum() for picture in (apart, close)]
        assert labels[1] > 0.6 * labels[0]


def test_colours_of_classes_come_again_when_there_are_no_more():
    classes = [f"class {number}" for number in range(len(PALETTE) + 1)]
    colours = [choose_class_colour(label, classes) for label in classes]
    assert len(set(colours)) == len(PALETTE)
    assert colours[-1] == colours[0]
