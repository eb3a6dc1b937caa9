"""What the strip below an image says."""

from __future__ import annotations

import numpy as np
import pytest

from executive.record.pictures.picture_content import PictureContent
from executive.record.pictures.status_bar import (
    ROW_COUNT,
    STATUS_BAR_HEIGHT,
    draw_status_bar,
    join_latest_names,
    make_status_bar_text,
    truncate,
    wrap_text,
)

IMAGE = np.zeros((48, 64, 3), np.uint8)


def at_most(count: int):
    return lambda text: len(text) <= count


@pytest.mark.parametrize(
    ("scene", "title", "lines"),
    [
        ({"item": "cube-1", "bin": "red_bin", "running_skills": ["SelectTarget"]},
         "cube-1 to red_bin", ("phase: SelectTarget",)),
        ({"item": "cube-1", "bin": "red_bin", "running_skills": ["Grasp"], "failed_attempts": 2,
          "failure": "Grasp.missed", "message": "no seal on cube-1"},
         "Grasp.missed: cube-1", ("phase: Grasp, 2 failed attempts", "no seal on cube-1")),
        ({"failure": "SelectTarget.unseen"}, "SelectTarget.unseen", ()),
    ],
)  # fmt: skip
def test_a_decision_shows_its_bin_and_a_failure_its_reason(scene, title, lines):
    assert make_status_bar_text(PictureContent(IMAGE, **scene))[:2] == (title, list(lines))


def test_the_strip_says_where_and_when():
    hidden = np.zeros((48, 64), bool)
    look = {"camera": "overhead", "detector": "embedded", "age": 0.05}
    _, _, notes = make_status_bar_text(PictureContent(IMAGE, hidden, mission="sort", clock=3.4, **look))
    assert notes == ["sort   3.40 s   shaded: occluded by the arm", "overhead by embedded, 0.05 s old"]
    _, _, notes = make_status_bar_text(PictureContent(IMAGE, ~hidden, camera="wrist"))
    assert notes == ["0.00 s", "wrist, 0.00 s old"]


@pytest.mark.parametrize(
    ("room", "expected"),
    [(30, "a-1, a-2, a-3, a-4"), (17, "a-2, a-3, a-4 +1"), (12, "a-3, a-4 +2"), (7, "a-4 +3"), (3, "4")],
)
def test_a_long_list_keeps_its_newest(room, expected):
    assert join_latest_names(["a-1", "a-2", "a-3", "a-4"], at_most(room)) == expected
    assert join_latest_names([], at_most(room)) == ""


def test_a_text_is_wrapped_between_words_and_cut_where_it_must():
    assert wrap_text("no seal on cube-1", at_most(8)) == ["no seal", "on", "cube-1"]
    assert wrap_text("unreachable", at_most(8)) == ["unrea..."]
    assert truncate("short", at_most(8)) == "short"


def test_each_outcome_has_a_row():
    outcomes = {"red_bin": ["cube-1", "cube-2"], "rejected": ["duck-1"]}
    strips = [
        draw_status_bar(PictureContent(IMAGE, outcomes=dict(list(outcomes.items())[:count])), 640)
        for count in range(3)
    ]
    assert len({strip.tobytes() for strip in strips}) == 3


@pytest.mark.parametrize("width", [640, 320])
def test_whatever_is_said_there_is_room_for_it(width):
    many = {f"bin_{number}_with_a_long_name": [f"cube-{number}"] * 40 for number in range(ROW_COUNT + 3)}
    long = {"item": "cube-1" * 20, "bin": "red", "message": "word " * 100, "camera": "c" * 90}
    strip = draw_status_bar(PictureContent(IMAGE, outcomes=many, **long), width)
    assert strip.shape == (STATUS_BAR_HEIGHT, width, 3)
    edges = (strip[:3], strip[-3:], strip[:, -3:])
    assert all(len(np.unique(edge.reshape(-1, 3), axis=0)) == 1 for edge in edges)  # Nothing is cut off.
