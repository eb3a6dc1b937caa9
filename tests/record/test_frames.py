"""Which pictures a run leaves, and what they show."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from executive.cell.frame import Frame
from executive.events import Event
from executive.geometry import Pose
from executive.record import frames as module
from executive.record.frames import KEPT, Frames, picture_of
from executive.record.pictures.drawer import Drawer

CUBE = {"label": "cube", "confidence": 0.9, "box": (20, 40, 50, 70), "position": (0.5, 0.1, 0.02)}
NEAR = {"label": "cube", "confidence": 0.8, "box": (90, 40, 120, 70), "position": (0.5, -0.1, 0.02)}
DUCK = {"label": "duck", "confidence": 0.7, "box": (20, 90, 50, 120), "position": (0.6, 0.1, 0.02)}


def look(number: int, *found: dict) -> Event:
    image = np.full((160, 160, 3), 150, np.uint8)
    visible = np.ones((160, 160), bool)
    frame = Frame(number, "overhead", image, None, np.eye(3), Pose.identity(), 0.5, visible, 0)
    data = {"frame": number, "frame_object": frame, "detector": "embedded", "found": found}
    return Event("look", number, 0.5, data)


def decision(frame: int = 1, tick: int = 12, **chosen) -> Event:
    data = {"item": "cube-1", "label": "cube", "frame": frame, "bin": "red_bin", **chosen}
    return Event("decision", tick, 0.75, data)


def item(name: str, state: str, **more) -> Event:
    return Event("item", 1, 0.0, {"item": name, "state": state, **more})


def skill(name: str, status: str, item: str = "", reason: str = "", tick: int = 90) -> Event:
    message = f"it was {reason}" if reason else ""
    data = {"node": f"tree/do/{name}", "status": status, "item": item, "reason": reason, "message": message}
    return Event("status", tick, 2.0, data)


def shown(folder, *events: Event) -> Frames:
    """Return an observer that has seen events."""
    frames = Frames(folder)
    for event in events:
        frames(event)
    return frames


@pytest.fixture
def drawn(monkeypatch):
    """The scenes that would be drawn, by file, without a process."""
    scenes = {}

    def draw(self, name, scene):
        scenes[name] = scene
        return True

    monkeypatch.setattr(Drawer, "draw", draw)
    return scenes


def test_a_decision_is_drawn_on_the_frame_it_rests_on(tmp_path):
    frames = shown(tmp_path / "frames", look(1, CUBE, DUCK), decision(position=(0.5, 0.1, 0.02)))
    frames.close()
    assert frames.problem == ""
    image = cv2.imread(str(tmp_path / "frames" / "000012_cube-1.jpg"))
    assert image.shape[1] == 640
    # The chosen box's edge has the colour of the first class; the image is drawn four times as large.
    blue, green, red = (int(value) for value in image[220, 80])
    assert blue > green > red + 40


def test_a_picture_says_what_the_run_is_about(tmp_path, drawn):
    shown(
        tmp_path, Event("run", 0, 0.0, {"mission": "sort"}), look(1, DUCK, CUBE),
        skill("SelectTarget", "RUNNING"), item("duck-1", "placed", bin="yellow_bin"),
        item("cube-1", "seen", position=(0.5, 0.1, 0.02), attempts=1), decision(),
    )  # fmt: skip
    scene = drawn["000012_cube-1.jpg"]
    assert (scene.mission, scene.clock, scene.age) == ("sort", 0.75, 0.25)
    assert (scene.camera, scene.detector) == ("overhead", "embedded")
    assert (scene.phase, scene.item, scene.bin, scene.attempts) == ("SelectTarget", "cube-1", "red_bin", 1)
    assert [(seen.label, seen.box) for seen in scene.seen] == [("duck", DUCK["box"]), ("cube", CUBE["box"])]
    assert (scene.chosen, scene.failure, scene.message) == (1, "", "")
    assert scene.fates == {"yellow_bin": ("duck-1",)}
    assert scene.classes == ("cube", "duck")


@pytest.mark.parametrize(
    ("found", "chosen", "expected"),
    [
        ((CUBE, DUCK), {}, 0),
        ((CUBE, NEAR), {"position": (0.5, -0.09, 0.02)}, 1),
        ((CUBE, NEAR), {}, None),
        ((DUCK,), {}, None),
    ],
)
def test_the_chosen_box_is_the_nearest_else_the_only_of_its_class(tmp_path, drawn, found, chosen, expected):
    shown(tmp_path, look(1, *found), decision(**chosen))
    assert drawn["000012_cube-1.jpg"].chosen == expected


def test_a_failed_attempt_is_drawn_on_what_was_decided_from(tmp_path, drawn):
    shown(
        tmp_path, look(1, CUBE), decision(), look(2), skill("Grasp", "RUNNING", "cube-1"),
        item("cube-1", "seen", position=(0.5, 0.1, 0.02), attempts=1),
        skill("Grasp", "FAILURE", "cube-1", "missed"),
    )  # fmt: skip
    scene = drawn["000090_cube-1_missed.jpg"]
    assert (scene.failure, scene.message) == ("Grasp.missed", "it was missed")
    assert (scene.phase, scene.attempts, scene.age) == ("Grasp", 1, 1.5)
    assert len(scene.seen) == 1
    assert (scene.chosen, scene.item, scene.bin) == (0, "cube-1", "red_bin")


def test_a_look_that_leads_to_nothing_is_drawn_once(tmp_path, drawn):
    shown(
        tmp_path, look(1, DUCK), skill("SelectTarget", "FAILURE", reason="unseen", tick=20),
        skill("MoveToScan", "FAILURE", reason="blocked", tick=30),
    )  # fmt: skip
    ((name, scene),) = drawn.items()
    assert name == "000020_unseen.jpg"
    assert (scene.failure, scene.item, scene.chosen) == ("SelectTarget.unseen", "", None)


def test_what_fails_because_a_skill_failed_is_not_drawn_again(tmp_path, drawn):
    failed = {"node": "tree/do", "status": "FAILURE", "reason": "Grasp.missed"}
    shown(tmp_path, look(1, CUBE), Event("status", 90, 2.0, failed))
    assert not drawn


def test_an_earlier_look_is_found_again_and_old_ones_are_forgotten(tmp_path, drawn):
    looks = [look(number, CUBE) for number in range(KEPT + 1)]
    frames = shown(tmp_path, *looks, decision(frame=1), decision(frame=0, tick=13))
    assert list(drawn) == ["000012_cube-1.jpg"]
    assert frames.problem == f"pictures left out: 1 of a look before the last {KEPT}"


def test_what_the_last_decision_rests_on_is_kept(tmp_path, drawn):
    looks = [look(number) for number in range(1, 2 * KEPT)]
    missed = skill("Grasp", "FAILURE", "cube-1", "missed")
    shown(tmp_path, look(0, CUBE), decision(frame=0), *looks, missed, decision(frame=KEPT, tick=91))
    assert list(drawn) == ["000012_cube-1.jpg", "000090_cube-1_missed.jpg"]


def test_a_long_run_keeps_its_first_pictures_and_says_what_it_left_out(tmp_path, drawn, monkeypatch):
    monkeypatch.setattr(module, "MOST", 3)
    frames = shown(tmp_path, look(1, CUBE), *(decision(tick=tick) for tick in range(5)))
    assert list(drawn) == ["000000_cube-1.jpg", "000001_cube-1.jpg", "000002_cube-1.jpg"]
    assert frames.problem == "pictures left out: 2 beyond the 3 that a run keeps"
    monkeypatch.setattr(Drawer, "draw", lambda self, name, scene: False)
    frames = shown(tmp_path, look(1, CUBE), decision())
    assert frames.problem == "pictures left out: 1 that came faster than they can be drawn"


def test_pictures_that_cannot_be_written_are_told_and_break_nothing(tmp_path):
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
    found = picture_of(tmp_path, item, reason)
    assert (found and found.name) == name
