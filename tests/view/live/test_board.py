"""News of a run, and what browsers are shown from it."""

from __future__ import annotations

import base64
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from executive.events import Event
from executive.geometry import Pose
from executive.view.live.board import Board
from executive.view.live.telling import Teller, picture, poses


def status(status: str, **more: str) -> Event:
    return Event("status", 360, 1.5, {"node": "tree/Grasp", "status": status, **more})


@pytest.mark.parametrize(
    ("event", "news"),
    [
        (Event("run", 0, 0.0, {"mission": "sort", "seed": 7, "params": {}}),
         {"run": {"mission": "sort", "seed": 7}}),
        (Event("decision", 1, 0.0, {"item": "cube-1", "bin": "red_bin", "position": 1}),
         {"decision": {"item": "cube-1", "bin": "red_bin"}}),
        (Event("item", 1, 0.0, {"item": "cube-1", "state": "held", "position": np.array([0.5]), "looks": 3}),
         {"items": {"cube-1": {"item": "cube-1", "state": "held", "position": [0.5]}}}),
        (Event("asking", 1, 0.0, {"choices": ("cube", "duck")}), {"asking": ["cube", "duck"]}),
        (Event("request", 1, 0.0, {"wanted": "cube"}), {"asking": None}),
        (Event("end", 1, 0.0, {"status": "SUCCESS"}), {"asking": None, "over": True}),
        (Event("resume", 1, 0.0, {"ticked": 3}), {}),
        (Event("sense", 1, 0.0, {"name": "arm.q", "value": []}), None),
    ],
)  # fmt: skip
def test_the_news_of_an_event_is_what_a_person_wants_to_see(event: Event, news: dict | None) -> None:
    assert Teller().news(event) == (None if news is None else {"clock": 0.0, **news})


def test_every_end_of_a_node_is_counted() -> None:
    teller = Teller()
    for word in ("RUNNING", "SUCCESS", "RUNNING", "SUCCESS", "RUNNING", "INVALID", "RUNNING"):
        teller.news(status(word))
    assert teller.news(status("FAILURE", reason="missed", message="no seal", item="cube-1")) == {
        "clock": 1.5,
        "nodes": {
            "tree/Grasp": {
                "done": 2, "failed": 1, "halted": 1, "status": "failure", "said": "missed: no seal",
                "item": "cube-1",
            }
        },
    }  # fmt: skip


def test_poses_are_places_and_quaternions_that_begin_with_w() -> None:
    pose = Pose.of((1.0, 2.0, 3.0), (0.0, 0.0, 1.0, 0.0))
    assert poses(2.0, {"tool": pose}) == {"clock": 2.0, "bodies": {"tool": (1, 2, 3, 0, 0, 0, 1)}}


def test_who_comes_late_is_shown_everything_and_then_only_news() -> None:
    board = Board()
    for news in (
        {"tree": "<svg/>"}, {"nodes": {"a": {"status": "running"}}, "clock": 0.5},
        {"nodes": {"b": {"status": "running"}}, "items": {"cube-1": {"state": "held"}}, "clock": 1.0},
    ):  # fmt: skip
        board.take(news)
    assert board.news()["tree"] == "<svg/>"
    board.take({"nodes": {"b": {"status": "failure"}}, "clock": 1.5})
    assert board.news() == {"nodes": {"b": {"status": "failure"}}, "clock": 1.5}
    assert board.news() == {}
    assert board.everything == {
        "paused": False, "over": False, "tree": "<svg/>", "clock": 1.5,
        "items": {"cube-1": {"state": "held"}},
        "nodes": {"a": {"status": "running"}, "b": {"status": "failure"}},
    }  # fmt: skip


def test_an_image_is_shown_with_what_the_arm_hides_darker() -> None:
    visible = np.ones((48, 64), bool)
    visible[:, 32:] = False
    image = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    frame = SimpleNamespace(image=image, visible=visible, id=3, camera="wrist", stamp=0.5)
    box = {"label": "cube", "confidence": np.float32(0.5), "box": (1, 2, 3, 4), "position": None}
    data = {"frame_object": frame, "found": [box | {"mask": object()}], "detector": "embedded"}
    board = Board()
    board.take(picture(Event("look", 1, 0.5, data)))
    look = dict(board.everything["look"])
    data = base64.b64decode(look.pop("source").removeprefix("data:image/jpeg;base64,"))
    assert look == {
        "frame": 3, "camera": "wrist", "detector": "embedded", "stamp": 0.5, "width": 64, "height": 48,
        "found": [{"label": "cube", "confidence": 0.5, "box": [1, 2, 3, 4], "position": None}],
    }  # fmt: skip
    shown = cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert np.allclose(shown[24, 8], (200, 100, 50), atol=6)
    assert np.allclose(shown[24, 56], (110, 55, 27), atol=6)
