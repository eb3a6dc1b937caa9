"""News of a run, and what browsers are shown from it."""

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
    read,
    run_ended,
    run_started,
    skill_ended,
    skill_started,
)

from executive.events import Event, OperatorAsked, RequestGiven, RunResumed, TargetSelected
from executive.geometry import Pose
from executive.record.entry import OldEvent, old_event
from executive.view.live.board import Board
from executive.view.live.telling import Teller, picture, poses


def ended(status: str, **fields: str) -> OldEvent:
    return old_event(at(360, skill_ended("tree/Grasp", status, **fields)))


@pytest.mark.parametrize(
    ("event", "news"),
    [
        (run_started(mission="sort", seed=7), {"run": {"mission": "sort", "seed": 7}}),
        (TargetSelected("cube-1", "cube", 3, "red_bin"),
         {"decision": {"item": "cube-1", "label": "cube", "frame": 3, "bin": "red_bin"}}),
        (item_changed("cube-1", "held"),
         {"items": {"cube-1": {"item": "cube-1", "label": "cube", "state": "held", "bin": "", "why": "",
                               "position": [0.5, 0.0, 0.02]}}}),
        (OperatorAsked(["cube", "duck"]), {"asking": ["cube", "duck"]}),
        (RequestGiven("cube"), {"asking": None}),
        (run_ended(), {"asking": None, "over": True}),
        (RunResumed(3, "", {}), {}),
        (read("arm.q", []), None),
    ],
)  # fmt: skip
def test_the_news_of_an_event_is_what_a_person_wants_to_see(event: Event, news: dict | None) -> None:
    assert Teller().news(old_event(at(0, event))) == (None if news is None else {"clock": 0.0, **news})


def test_every_end_of_a_node_is_counted() -> None:
    teller = Teller()
    for status in ("SUCCESS", "SUCCESS", "INVALID"):
        teller.news(old_event(at(1, skill_started("tree/Grasp"))))
        teller.news(ended(status))
    assert teller.news(ended("FAILURE", reason="missed", message="no seal", item="cube-1")) == {
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
    box = detected("cube", confidence=0.5, box=[1, 2, 3, 4], position=[0.5, 0.0, 0.02])
    board = Board()
    board.take(picture(frame, frame_searched(box)))
    look = dict(board.everything["look"])
    data = base64.b64decode(look.pop("source").removeprefix("data:image/jpeg;base64,"))
    assert look == {
        "frame": 3, "camera": "wrist", "detector": "embedded", "stamp": 0.5, "width": 64, "height": 48,
        "found": [{"label": "cube", "confidence": 0.5, "box": [1, 2, 3, 4], "position": [0.5, 0.0, 0.02]}],
    }  # fmt: skip
    shown = cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert np.allclose(shown[24, 8], (200, 100, 50), atol=6)
    assert np.allclose(shown[24, 56], (110, 55, 27), atol=6)
