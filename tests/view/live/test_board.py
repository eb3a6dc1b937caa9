"""Messages of a run, and the changes of the page."""

from __future__ import annotations

import base64
from types import SimpleNamespace

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
)

from executive.events import Event, OperatorAsked, RequestGiven, RunResumed, TargetSelected
from executive.geometry import Pose
from executive.view.live.board import Board
from executive.view.live.messages import CameraImage, Change, encode_poses


@pytest.mark.parametrize(
    ("event", "news"),
    [
        (run_started(mission="sort", seed=7), {"run": {"mission": "sort", "seed": 7}}),
        (TargetSelected("cube-1", "cube", 3, "red_bin"),
         {"decision": {"item": "cube-1", "label": "cube", "frame": 3, "bin": "red_bin"}}),
        (item_changed("cube-1", "held"), {"items": {"cube-1": vars(item_changed("cube-1", "held"))}}),
        (OperatorAsked(["cube", "duck"]), {"asking": ["cube", "duck"]}),
        (RequestGiven("cube"), {"asking": None}),
        (run_ended(), {"asking": None, "over": True}),
        (RunResumed(3, "", {}), {}),
    ],
)  # fmt: skip
def test_the_news_of_an_event_is_its_change_of_the_page(event: Event, news: dict) -> None:
    board = Board()
    board.apply(at(0, event))
    assert board.take_changes() == {"clock": 0.0, **news}


def test_every_end_of_a_node_is_counted() -> None:
    board = Board()
    for status in ("SUCCESS", "SUCCESS", "INVALID"):
        board.apply(at(1, skill_started("tree/Grasp")))
        board.apply(at(2, skill_ended("tree/Grasp", status)))
    board.apply(at(3, skill_started("tree/Grasp", "cube-1")))
    board.take_changes()
    failure = {"reason": "missed", "message": "no seal", "item": "cube-1"}
    board.apply(at(360, skill_ended("tree/Grasp", "FAILURE", **failure)))
    assert board.take_changes() == {
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
    assert encode_poses({"tool": pose}) == {"tool": (1, 2, 3, 0, 0, 0, 1)}


def test_who_comes_late_is_shown_everything_and_then_only_news() -> None:
    board = Board()
    for message in (
        Change(tree="<svg/>"), at(120, skill_started("a")), at(240, skill_started("b")),
        at(240, item_changed("cube-1", "held")),
    ):  # fmt: skip
        board.apply(message)
    assert board.take_changes()["tree"] == "<svg/>"
    board.apply(at(360, skill_ended("b", "FAILURE")))
    fresh = board.take_changes()
    assert (list(fresh), list(fresh["nodes"])) == (["clock", "nodes"], ["b"])
    assert board.take_changes() == {}
    shown = board.state
    assert {name: node["status"] for name, node in shown.pop("nodes").items()} == {
        "a": "running", "b": "failure",
    }  # fmt: skip
    assert list(shown.pop("items")) == ["cube-1"]
    assert shown == {"paused": False, "over": False, "tree": "<svg/>", "clock": 1.5}


def test_an_image_is_shown_with_what_the_arm_hides_darker() -> None:
    visible = np.ones((48, 64), bool)
    visible[:, 32:] = False
    image = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    frame = SimpleNamespace(image=image, visible=visible, id=3, camera="wrist", stamp=0.5)
    box = detected("cube", confidence=0.5, box=[1, 2, 3, 4], position=[0.5, 0.0, 0.02])
    board = Board()
    board.apply(CameraImage(frame, frame_searched(box)))
    look = dict(board.state["look"])
    data = base64.b64decode(look.pop("source").removeprefix("data:image/jpeg;base64,"))
    assert look == {
        "frame": 3, "camera": "wrist", "detector": "embedded", "stamp": 0.5, "width": 64, "height": 48,
        "found": [vars(box)],
    }  # fmt: skip
    shown = cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert np.allclose(shown[24, 8], (200, 100, 50), atol=6)
    assert np.allclose(shown[24, 56], (110, 55, 27), atol=6)
