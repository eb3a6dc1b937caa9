"""Which pictures a run leaves, and what they show."""

from __future__ import annotations

from itertools import chain

import cv2
import numpy as np
import pytest
from events import (
    at,
    detected,
    frame_searched,
    item_changed,
    run_ended,
    run_started,
    skill_ended,
    skill_started,
)  # fmt: skip

from executive.cell.frame import Frame, FrameCaptured
from executive.events import DetectedObject, NodeEnded, TargetSelected, TimedEvent
from executive.geometry import Pose
from executive.record import picture_recorder as module
from executive.record.picture_recorder import MAX_STORED_LOOKS, PictureRecorder, find_picture
from executive.record.pictures.drawing_thread import PictureDrawer

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


def decision(frame: int = 1, tick: int = 12) -> list[TimedEvent]:
    return [at(tick, TargetSelected("cube-1", "cube", frame, "red_bin"), 0.75)]


def item(name: str, state: str, **more) -> list[TimedEvent]:
    return [at(1, item_changed(name, state, **more), 0.0)]


def started(name: str, item: str = "") -> list[TimedEvent]:
    return [at(90, skill_started(f"tree/do/{name}", item), 2.0)]


def failed(name: str, reason: str, item: str = "", tick: int = 90) -> list[TimedEvent]:
    event = skill_ended(f"tree/do/{name}", "FAILURE", item, reason=reason, message=f"it was {reason}")
    return [at(tick, event, 2.0)]


def shown(folder, *events: list[TimedEvent]) -> PictureRecorder:
    """Return an observer that has seen events."""
    frames = PictureRecorder(folder)
    for event in chain.from_iterable(events):
        frames(event)
    return frames


@pytest.fixture
def drawn(monkeypatch):
    """The scenes that would be drawn, by file, without a process."""
    scenes = {}

    def queue(self, name, scene):
        scenes[name] = scene
        return True

    monkeypatch.setattr(PictureDrawer, "queue", queue)
    return scenes


def test_a_decision_is_drawn_on_the_frame_it_rests_on(tmp_path):
    frames = shown(
        tmp_path / "frames",
        look(1, CUBE, DUCK),
        item("cube-1", "seen", position=[0.5, 0.1, 0.02]),
        decision(),
    )
    frames.close()
    assert frames.problem == ""
    image = cv2.imread(str(tmp_path / "frames" / "000012_cube-1.jpg"))
    assert image.shape[1] == 640
    # The chosen box's edge has the colour of the first class; the image is drawn four times as large.
    blue, green, red = (int(value) for value in image[220, 80])
    assert blue > green > red + 40


def test_a_rejected_item_of_no_class_is_drawn_at_the_end(tmp_path, drawn):
    # The ledger reports an item before the look that shows it.
    position = (0.6, 0.1, 0.02)
    shown(
        tmp_path, item("duck-1", "seen", position=position, looks=1),
        look(1, DUCK, CUBE, unknown_labels=["duck"]), look(2, CUBE), decision(),
        item("duck-1", "rejected", position=position, looks=1), item("cube-2", "rejected"),
        [at(20, run_ended(), 1.0)],
    )  # fmt: skip
    scene = drawn["000020_duck-1.jpg"]
    assert (scene.item, scene.selected_index, len(scene.detections)) == ("duck-1", 0, 2)
    assert list(drawn) == ["000012_cube-1.jpg", "000020_duck-1.jpg"]


def test_a_picture_says_what_the_run_is_about(tmp_path, drawn):
    shown(
        tmp_path, [at(0, run_started(mission="sort"))], look(1, DUCK, CUBE),
        started("SelectTarget"), item("duck-1", "placed", bin="yellow_bin"),
        item("cube-1", "seen", position=(0.5, 0.1, 0.02), attempts=1), decision(),
    )  # fmt: skip
    scene = drawn["000012_cube-1.jpg"]
    assert (scene.mission, scene.clock, scene.age) == ("sort", 0.75, 0.25)
    assert (scene.camera, scene.detector) == ("overhead", "embedded")
    assert (scene.running_skills, scene.failed_attempts) == (["SelectTarget"], 1)
    assert (scene.item, scene.bin) == ("cube-1", "red_bin")
    assert [(seen.label, seen.box) for seen in scene.detections] == [
        ("duck", [20, 90, 50, 120]),
        ("cube", [20, 40, 50, 70]),
    ]
    assert (scene.selected_index, scene.failure, scene.message) == (1, "", "")
    assert scene.outcomes == {"yellow_bin": ["duck-1"]}
    assert scene.classes == ("cube", "duck")


@pytest.mark.parametrize(
    ("found", "position", "expected"),
    [
        ((CUBE, DUCK), None, 0),
        ((CUBE, NEAR), [0.5, -0.09, 0.02], 1),
        ((CUBE, NEAR), None, None),
        ((DUCK,), None, None),
    ],
)
def test_the_chosen_box_is_the_nearest_else_the_only_of_its_class(tmp_path, drawn, found, position, expected):
    known = [] if position is None else item("cube-1", "seen", position=position)
    shown(tmp_path, look(1, *found), known, decision())
    assert drawn["000012_cube-1.jpg"].selected_index == expected


def test_a_failed_attempt_is_drawn_on_what_was_decided_from(tmp_path, drawn):
    shown(
        tmp_path, look(1, CUBE), decision(), look(2), started("Grasp", "cube-1"),
        item("cube-1", "seen", position=(0.5, 0.1, 0.02), attempts=1),
        failed("Grasp", "missed", "cube-1"),
    )  # fmt: skip
    scene = drawn["000090_cube-1_missed.jpg"]
    assert (scene.failure, scene.message) == ("Grasp.missed", "it was missed")
    assert (scene.running_skills, scene.failed_attempts, scene.age) == (["Grasp"], 1, 1.5)
    assert len(scene.detections) == 1
    assert (scene.selected_index, scene.item, scene.bin) == (0, "cube-1", "red_bin")


def test_a_look_that_leads_to_nothing_is_drawn_once(tmp_path, drawn):
    shown(
        tmp_path, look(1, DUCK), failed("SelectTarget", "unseen", tick=20),
        failed("MoveToScan", "blocked", tick=30),
    )  # fmt: skip
    ((name, scene),) = drawn.items()
    assert name == "000020_unseen.jpg"
    assert (scene.failure, scene.item, scene.selected_index) == ("SelectTarget.unseen", "", None)


def test_what_fails_because_a_skill_failed_is_not_drawn_again(tmp_path, drawn):
    shown(tmp_path, look(1, CUBE), [at(90, NodeEnded("tree/do", "FAILURE", reason="Grasp.missed"))])
    assert not drawn


def test_an_earlier_look_is_found_again_and_old_ones_are_forgotten(tmp_path, drawn):
    looks = [look(number, CUBE) for number in range(MAX_STORED_LOOKS + 1)]
    frames = shown(tmp_path, *looks, decision(frame=1), decision(frame=0, tick=13))
    assert list(drawn) == ["000012_cube-1.jpg"]
    assert frames.problem == f"missing pictures: 1 because only the last {MAX_STORED_LOOKS} images are kept"


def test_what_the_last_decision_rests_on_is_kept(tmp_path, drawn):
    looks = [look(number) for number in range(1, 2 * MAX_STORED_LOOKS)]
    missed = failed("Grasp", "missed", "cube-1")
    shown(
        tmp_path, look(0, CUBE), decision(frame=0), *looks, missed, decision(frame=MAX_STORED_LOOKS, tick=91)
    )
    assert list(drawn) == ["000012_cube-1.jpg", "000090_cube-1_missed.jpg"]


def test_a_long_run_keeps_its_first_pictures_and_says_what_it_left_out(tmp_path, drawn, monkeypatch):
    monkeypatch.setattr(module, "MAX_PICTURES", 3)
    frames = shown(tmp_path, look(1, CUBE), *(decision(tick=tick) for tick in range(5)))
    assert list(drawn) == ["000000_cube-1.jpg", "000001_cube-1.jpg", "000002_cube-1.jpg"]
    assert frames.problem == "missing pictures: 2 after the first 3"
    monkeypatch.setattr(PictureDrawer, "queue", lambda self, name, scene: False)
    frames = shown(tmp_path, look(1, CUBE), decision())
    assert frames.problem == "missing pictures: 1 because of a full queue"


def test_pictures_that_cannot_be_written_are_reported_and_the_run_continues(tmp_path):
    (tmp_path / "frames").write_text("a file, no folder")
    frames = shown(tmp_path / "frames", look(1, CUBE), decision())
    frames.close()
    problem = f'not every picture was drawn: cannot make the folder "{tmp_path}/frames": File exists'
    assert frames.problem == problem


@pytest.mark.parametrize(
    ("item", "reason", "name"),
    [
        ("cube-1", "missed", "1000000_cube-1_missed.jpg"),
        ("cube-1", "no_contact", "000007_cube-1_no_contact.jpg"),
        ("cube-1", "", "000012_cube-1.jpg"),
        ("hex_nut-1", "", "000003_hex_nut-1.jpg"),
        ("", "unseen", "000020_unseen.jpg"),
        ("cube-1", "dropped", None),
        ("cube-2", "missed", None),
        ("", "", None),
    ],
)
def test_the_last_picture_of_an_item_and_a_reason_is_found_again(tmp_path, item, reason, name):
    for file in (
        "000003_hex_nut-1.jpg", "000007_cube-1_no_contact.jpg", "000012_cube-1.jpg", "000020_unseen.jpg",
        "000090_cube-1_missed.jpg", "1000000_cube-1_missed.jpg", "000004_cube-1.jpg",
    ):  # fmt: skip
        (tmp_path / file).touch()
    found = find_picture(tmp_path, item, reason)
    assert (found and found.name) == name
