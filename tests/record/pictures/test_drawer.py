"""The process that draws."""

from __future__ import annotations

import cv2
import numpy as np

from executive.record.pictures.drawer import WAITING, Drawer
from executive.record.pictures.scene import Scene, Seen

SCENE = Scene(np.full((480, 640, 3), 150, np.uint8), seen=[Seen("cube", 0.9, (100, 200, 160, 260))], chosen=0)


def test_a_scene_becomes_a_small_file(tmp_path):
    noisy = Scene(np.random.default_rng(0).integers(120, 140, (480, 640, 3)).astype(np.uint8))
    drawer = Drawer(tmp_path / "frames")
    assert drawer.draw("a.jpg", SCENE)
    assert drawer.draw("b.jpg", noisy)
    drawer.close()
    assert drawer.problem == ""
    assert cv2.imread(str(tmp_path / "frames" / "a.jpg")).shape[1] == 640
    assert 0 < (tmp_path / "frames" / "b.jpg").stat().st_size < 100_000


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "frames").write_text("a file, no folder")
    drawer = Drawer(tmp_path / "frames")
    drawer.draw("a.jpg", SCENE)
    drawer.close()
    assert drawer.problem == "no pictures were drawn: file exists"


def test_a_picture_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "a.jpg").mkdir()
    drawer = Drawer(tmp_path)
    drawer.draw("a.jpg", SCENE)
    drawer.close()
    path = tmp_path / "a.jpg"
    assert drawer.problem == (
        f'not every picture was drawn: executive.errors.ExecutiveError: cannot write the picture "{path}"'
    )


def test_no_more_pictures_wait_than_the_memory_holds(tmp_path, monkeypatch):
    monkeypatch.setattr(Drawer, "_send", lambda self: None)
    drawer = Drawer(tmp_path)
    taken = [drawer.draw("a.jpg", SCENE) for _ in range(WAITING + 1)]
    assert taken == [True] * WAITING + [False]


def test_without_a_scene_no_process_starts(tmp_path):
    drawer = Drawer(tmp_path / "frames")
    drawer.close()
    assert not (tmp_path / "frames").exists()
