"""The thread that draws."""

from __future__ import annotations

import threading

import cv2
import numpy as np

from executive.events import DetectedObject
from executive.record.pictures import drawing_thread as module
from executive.record.pictures.drawing_thread import MAX_QUEUED_PICTURES, PictureDrawer
from executive.record.pictures.picture_content import PictureContent

SCENE = PictureContent(
    np.full((480, 640, 3), 150, np.uint8),
    detections=[DetectedObject("cube", 0.9, (100, 200, 160, 260), (0.0, 0.0, 0.0), "")],
    selected_index=0,
    classes=("cube",),
)


def test_a_scene_becomes_a_small_file(tmp_path):
    noisy = PictureContent(np.random.default_rng(0).integers(120, 140, (480, 640, 3)).astype(np.uint8))
    drawer = PictureDrawer(tmp_path / "frames")
    assert not (tmp_path / "frames").exists()
    assert drawer.queue("a.jpg", SCENE)
    assert drawer.queue("b.jpg", noisy)
    drawer.close()
    assert drawer.problem == ""
    blue, _, red = cv2.imread(str(tmp_path / "frames" / "a.jpg"))[230, 100]
    assert int(blue) > int(red) + 50
    assert 0 < (tmp_path / "frames" / "b.jpg").stat().st_size < 100_000


def test_the_thread_starts_before_the_first_picture(tmp_path):
    drawer = PictureDrawer(tmp_path)
    assert any(thread.name.startswith("pictures") for thread in threading.enumerate())
    drawer.close()


def test_a_picture_that_cannot_be_written_is_a_problem_and_the_others_are_drawn(tmp_path):
    (tmp_path / "b.jpg").mkdir()
    drawer = PictureDrawer(tmp_path)
    for name in ("b.jpg", "a.jpg"):
        drawer.queue(name, SCENE)
    drawer.close()
    reason = f'cannot write the picture "{tmp_path}/b.jpg": is a directory'
    assert drawer.problem == f"not every picture was drawn: {reason}"
    assert (tmp_path / "a.jpg").exists()


def test_no_more_pictures_wait_than_the_memory_holds(tmp_path, monkeypatch):
    release = threading.Event()
    monkeypatch.setattr(module, "save_picture", lambda path, scene: release.wait())
    drawer = PictureDrawer(tmp_path)
    assert [drawer.queue("a.jpg", SCENE) for _ in range(MAX_QUEUED_PICTURES + 1)] == [
        True
    ] * MAX_QUEUED_PICTURES + [False]
    release.set()
    drawer.close()


def test_a_run_that_is_ended_by_force_waits_for_no_picture(tmp_path, monkeypatch):
    release, drawn = threading.Event(), []
    monkeypatch.setattr(module, "save_picture", lambda path, scene: drawn.append(path.name) or release.wait())
    drawer = PictureDrawer(tmp_path)
    for name in ("a.jpg", "b.jpg"):
        drawer.queue(name, SCENE)
    drawer.close(wait=False)
    release.set()
    assert drawn in ([], ["a.jpg"])


def test_pictures_that_do_not_end_are_given_up(tmp_path, monkeypatch):
    release = threading.Event()
    monkeypatch.setattr(module, "save_picture", lambda path, scene: release.wait())
    monkeypatch.setattr(module, "CLOSE_TIMEOUT", 0.0)
    drawer = PictureDrawer(tmp_path)
    drawer.queue("a.jpg", SCENE)
    drawer.close()
    release.set()
    assert drawer.problem == "1 pictures were not drawn within 0 s"
