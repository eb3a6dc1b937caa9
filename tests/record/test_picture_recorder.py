"""Which pictures a run leaves, and what they show."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
import pytest
from events import at, detected, frame_searched, item_changed, run_ended, skill_ended

from executive.cell.frame import Frame, FrameCaptured
from executive.events import DetectedObject, NodeEnded, TargetSelected, TimedEvent
from executive.geometry import Pose
from executive.record import picture_recorder as module
from executive.record.picture_recorder import (
    CAPTION_HEIGHT,
    MAX_STORED_LOOKS,
    PALETTE,
    PictureContent,
    PictureRecorder,
    draw_picture,
    find_picture,
)

CUBE = detected("cube")
NEAR = detected("cube", box=[90, 40, 120, 70], position=[0.5, -0.1, 0.02])
DUCK = detected("duck", box=[20, 90, 50, 120], position=[0.6, 0.1, 0.02])


def look(number: int, *found: DetectedObject, **more) -> list[TimedEvent]:
    image = np.full((160, 160, 3), 150, np.uint8)
    visible = np.ones((160, 160), bool)
    frame = Frame(number, "overhead", image, None, np.eye(3), Pose.identity(), 0.5, visible, 0)
    return [
        at(number, FrameCaptured(frame), 0.5),
        at(number, frame_searched(*found, frame=number, **more), 0.5),
    ]


def select(frame: int = 1, tick: int = 12) -> list[TimedEvent]:
    return [at(tick, TargetSelected("cube-1", "cube", frame, "red_bin"), 0.75)]


def change(name: str, state: str, **more) -> list[TimedEvent]:
    return [at(1, item_changed(name, state, **more), 0.0)]


def fail(name: str, reason: str, item: str = "", tick: int = 90) -> list[TimedEvent]:
    event = skill_ended(f"tree/do/{name}", "FAILURE", item, reason=reason, message=f"it was {reason}")
    return [at(tick, event, 2.0)]


def record(folder: Path, *events: list[TimedEvent]) -> PictureRecorder:
    """Return a closed recorder that received events."""
    recorder = PictureRecorder(folder)
    for event in chain.from_iterable(events):
        recorder(event)
    recorder.close()
    return recorder


@pytest.fixture
def draw(tmp_path, monkeypatch) -> Callable[..., dict[str, PictureContent]]:
    """Record events, and return the pictures by file name."""
    pictures: list[PictureContent] = []

    def store(picture: PictureContent) -> np.ndarray:
        pictures.append(picture)
        return np.zeros((8, 8, 3), np.uint8)

    def record_events(*events: list[TimedEvent]) -> dict[str, PictureContent]:
        assert record(tmp_path, *events).problem == ""
        names = sorted(file.name for file in tmp_path.iterdir())
        return dict(zip(names, pictures, strict=True))

    monkeypatch.setattr(module, "draw_picture", store)
    return record_events


def test_boxes_labels_and_caption_are_drawn_on_the_scaled_image():
    image = np.full((160, 160, 3), 150, np.uint8)
    thing = detected("thing", box=[100, 100, 140, 140], position=[0.7, 0.1, 0.02])
    picture = PictureContent(
        image, [CUBE, DUCK, thing], 1, "duck-1", ("cube", "duck"), "2.50 s   duck-1 to red_bin"
    )
    drawn = draw_picture(picture)
    assert drawn.shape == (640 + CAPTION_HEIGHT, 640, 3)
    colours = [tuple(bytes.fromhex(colour[1:])) for colour in PALETTE[:2]]
    # The boxes begin at the columns 20 and 100, so the lines are at 80 and 400; the selected line is wider.
    for row, column, colour in ((220, 80, colours[0]), (420, 80, colours[1]), (500, 400, (255, 255, 255))):
        assert tuple(drawn[row, column]) == colour
    assert tuple(drawn[220, 81]) == (150, 150, 150)
    assert tuple(drawn[420, 81]) == colours[1]
    assert (drawn[140:158, 80:150] == colours[0]).all(axis=2).mean() > 0.3  # the label above the first box
    assert drawn[640:].max() > 200
    unnamed = draw_picture(PictureContent(image, [CUBE, DUCK, thing], None, "", ("cube", "duck"), ""))
    assert (unnamed[640:] == 0).all()
    assert (unnamed[340:358] != drawn[340:358]).any()


def test_a_selection_leaves_a_picture_of_its_frame(tmp_path):
    seen = change("cube-1", "seen", position=[0.5, 0.1, 0.02])
    assert record(tmp_path / "frames", look(1, CUBE, DUCK), seen, select()).problem == ""
    image = cv2.imread(str(tmp_path / "frames" / "000012_cube-1.jpg"))
    assert image.shape[1] == 640
    blue, green, red = (int(value) for value in image[220, 80])
    assert blue > green > red + 40


def test_a_rejected_item_of_no_class_is_drawn_at_the_end(draw):
    # The ledger reports an item before the look that shows it.
    position = (0.6, 0.1, 0.02)
    pictures = draw(
        change("duck-1", "seen", position=position, looks=1),
        look(1, DUCK, CUBE, unknown_labels=["duck"]), look(2, CUBE), select(),
        change("duck-1", "rejected", position=position, looks=1), change("cube-2", "rejected"),
        [at(20, run_ended(), 1.0)],
    )  # fmt: skip
    assert list(pictures) == ["000012_cube-1.jpg", "000020_duck-1.jpg"]
    picture = pictures["000020_duck-1.jpg"]
    assert (picture.item, picture.selected_index, len(picture.detections)) == ("duck-1", 0, 2)


def test_a_picture_shows_the_selection_and_then_its_failure(draw):
    pictures = draw(
        look(1, DUCK, CUBE), change("cube-1", "seen", position=(0.5, 0.1, 0.02)), select(), look(2),
        fail("Grasp", "missed", "cube-1"),
    )  # fmt: skip
    first = pictures["000012_cube-1.jpg"]
    second = pictures["000090_cube-1_missed.jpg"]
    assert first.caption == "0.75 s   overhead, 0.25 s old   cube-1 to red_bin"
    assert second.caption == "2.00 s   overhead, 1.50 s old   Grasp.missed: it was missed"
    for picture in (first, second):
        assert (picture.item, picture.selected_index, picture.classes) == ("cube-1", 1, ("cube", "duck"))
        assert [each.label for each in picture.detections] == ["duck", "cube"]


@pytest.mark.parametrize(
    ("found", "position", "expected"),
    [
        ((CUBE, DUCK), None, 0),
        ((CUBE, NEAR), [0.5, -0.09, 0.02], 1),
        ((CUBE, NEAR), None, None),
        ((DUCK,), None, None),
    ],
)
def test_the_selected_box_is_the_nearest_else_the_only_of_its_class(draw, found, position, expected):
    known = [] if position is None else change("cube-1", "seen", position=position)
    assert draw(look(1, *found), known, select())["000012_cube-1.jpg"].selected_index == expected


def test_a_look_that_leads_to_nothing_is_drawn_once(draw):
    control_node_end = [at(90, NodeEnded("tree/do", "FAILURE", reason="SelectTarget.unseen"))]
    failures = [*fail("SelectTarget", "unseen", tick=20), *fail("MoveToScan", "blocked", tick=30)]
    pictures = draw(look(1, DUCK), failures, look(2), control_node_end)
    ((name, picture),) = pictures.items()
    assert name == "000020_unseen.jpg"
    assert (picture.item, picture.selected_index) == ("", None)
    assert picture.caption.endswith("SelectTarget.unseen: it was unseen")


def test_old_looks_are_forgotten_except_that_of_the_last_selection(tmp_path):
    looks = [look(number, CUBE) for number in range(MAX_STORED_LOOKS + 1)]
    recorder = record(tmp_path / "a", *looks, select(frame=1), select(frame=0, tick=13))
    assert [file.name for file in (tmp_path / "a").iterdir()] == ["000012_cube-1.jpg"]
    assert f"only the last {MAX_STORED_LOOKS} images are kept" in recorder.problem
    missed = fail("Grasp", "missed", "cube-1")
    record(tmp_path / "b", look(0, CUBE), select(frame=0), *map(look, range(1, 2 * MAX_STORED_LOOKS)), missed)
    assert (tmp_path / "b" / "000090_cube-1_missed.jpg").exists()


def test_pictures_that_cannot_be_written_are_reported_and_the_run_continues(tmp_path):
    (tmp_path / "frames").write_text("a file, no folder")
    recorder = record(tmp_path / "frames", look(1, CUBE), select())
    assert recorder.problem.startswith("not every picture was drawn")
    assert str(tmp_path / "frames") in recorder.problem


@pytest.mark.parametrize(
    ("item", "reason", "name"),
    [
        ("cube-1", "missed", "1000000_cube-1_missed.jpg"),
        ("cube-1", "", "000012_cube-1.jpg"),
        ("hex_nut-1", "", "000003_hex_nut-1.jpg"),
        ("", "unseen", "000020_unseen.jpg"),
        ("cube-1", "dropped", None),
        ("", "", None),
    ],
)
def test_the_last_picture_of_an_item_and_a_reason_is_found_again(tmp_path, item, reason, name):
    for file in (
        "000003_hex_nut-1.jpg", "000012_cube-1.jpg", "000020_unseen.jpg", "000090_cube-1_missed.jpg",
        "1000000_cube-1_missed.jpg", "000004_cube-1.jpg",
    ):  # fmt: skip
        (tmp_path / file).touch()
    found = find_picture(tmp_path, item, reason)
    assert (found and found.name) == name
