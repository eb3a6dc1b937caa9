"""The pictures behind the decisions."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from executive.events import Event
from executive.geometry import Pose
from executive.messages import Frame
from executive.record.frames import KEPT, Frames
from executive.record.overlay import Picture, draw

CUBE = {"label": "cube", "confidence": 0.9, "box": (20, 40, 50, 70), "position": (0.5, 0.1, 0.02)}
NEAR = {"label": "cube", "confidence": 0.8, "box": (90, 40, 120, 70), "position": (0.5, -0.1, 0.02)}
DUCK = {"label": "duck", "confidence": 0.7, "box": (20, 90, 50, 120), "position": (0.6, 0.1, 0.02)}


def look(number: int, *found: dict) -> Event:
    image = np.full((160, 160, 3), 150, np.uint8)
    visible = np.ones((160, 160), bool)
    frame = Frame(number, "overhead", image, None, np.eye(3), Pose.identity(), 0.0, visible, 0)
    return Event("look", number, 0.0, {"frame": number, "frame_object": frame, "found": found})


def decision(frame: int = 1, tick: int = 12, **chosen) -> Event:
    return Event("decision", tick, 0.0, {"item": "cube-1", "label": "cube", "frame": frame, **chosen})


@pytest.fixture
def drawn(monkeypatch):
    """The pictures that would be drawn, without a process."""
    pictures = []
    monkeypatch.setattr(Frames, "_draw", lambda self, picture: pictures.append(picture))
    return pictures


def test_a_decision_is_drawn_on_the_frame_it_rests_on(tmp_path):
    frames = Frames(tmp_path / "frames")
    frames(look(1, CUBE, DUCK))
    frames(decision(position=(0.5, 0.1, 0.02)))
    frames.close()
    assert frames.problem == ""
    image = cv2.imread(str(tmp_path / "frames" / "000012_cube-1.jpg"))
    blue, green, red = (int(value) for value in image[55, 20])
    assert green > 150 and green > red + 60 and green > blue + 60  # The chosen box's edge is green.


def test_only_the_chosen_box_is_highlighted():
    boxes = [CUBE["box"], DUCK["box"]]
    picture = Picture("", np.zeros((160, 160, 3), np.uint8), boxes, ["cube-1 0.90", "duck 0.70"], 0)
    image = draw(picture)
    assert tuple(image[55, 20]) == (0, 200, 83)
    assert tuple(image[105, 20]) == (176, 190, 197)
    assert not picture.image.any()  # The record's own image is left alone.


@pytest.mark.parametrize(
    ("found", "chosen", "expected"),
    [
        ((CUBE, DUCK), {}, 0),
        ((CUBE, NEAR), {"position": (0.5, -0.09, 0.02)}, 1),
        ((CUBE, NEAR), {}, None),
        ((DUCK,), {}, None),
    ],
)
def test_the_chosen_box_is_the_nearest_else_the_only_one_of_its_class(
    tmp_path, drawn, found, chosen, expected
):
    frames = Frames(tmp_path)
    frames(look(1, *found))
    frames(decision(**chosen))
    assert drawn[0].chosen == expected


def test_an_item_is_where_the_ledger_last_said(tmp_path, drawn):
    frames = Frames(tmp_path)
    frames(Event("item", 1, 0.0, {"item": "cube-1", "position": (0.5, -0.1, 0.02)}))
    frames(look(1, CUBE, NEAR))
    frames(decision())
    assert drawn[0].chosen == 1
    assert drawn[0].captions == ["cube 0.90", "cube-1 0.80"]


def test_an_earlier_look_is_found_again_and_old_ones_are_forgotten(tmp_path, drawn):
    frames = Frames(tmp_path)
    for number in range(KEPT + 1):
        frames(look(number, CUBE))
    frames(decision(frame=0))
    frames(decision(frame=1))
    assert len(drawn) == 1


def test_a_run_without_decisions_draws_nothing_and_starts_no_process(tmp_path):
    frames = Frames(tmp_path / "frames")
    frames(look(1, CUBE))
    frames.close()
    assert not (tmp_path / "frames").exists()


def test_pictures_that_cannot_be_written_are_told_and_break_nothing(tmp_path):
    (tmp_path / "frames").write_text("a file, no folder")
    frames = Frames(tmp_path / "frames")
    frames(look(1, CUBE))
    frames(decision())
    frames.close()
    assert frames.problem == "no pictures were drawn: file exists"
