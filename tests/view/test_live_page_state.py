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

from executive.events import BinsEmptied, Event, OperatorAsked, RequestGiven, TargetSelected
from executive.geometry import Pose
from executive.view.live_page import PageState, SearchedFrame, encode_poses


@pytest.mark.parametrize(
    ("event", "news"),
    [
        (run_started(mission="sort", seed=7), {"run": {"mission": "sort", "seed": 7}}),
        (TargetSelected("cube-1", "cube", 3, "red_bin"),
         {"decision": vars(TargetSelected("cube-1", "cube", 3, "red_bin"))}),
        (item_changed("cube-1", "held"), {"items": {"cube-1": vars(item_changed("cube-1", "held"))}}),
        (OperatorAsked(["cube", "duck"]), {"choices": ["cube", "duck"]}),
        (RequestGiven("cube"), {"choices": None}),
        (run_ended(), {"choices": None, "has_ended": True}),
    ],
)  # fmt: skip
def test_the_news_of_an_event_is_its_change_of_the_page(event: Event, news: dict) -> None:
    page_state = PageState()
    page_state.apply(at(0, event))
    assert page_state.take_changes() == {"clock": 0.0, **news}


def test_the_items_of_an_emptied_bin_disappear() -> None:
    page_state = PageState()
    page_state.apply(at(0, item_changed("cube-1", "placed", bin="red_bin")))
    page_state.apply(at(1, BinsEmptied(["red_bin"])))
    assert (page_state.take_changes()["items"], page_state.values["items"]) == ({"cube-1": None}, {})


def test_every_end_of_a_node_is_counted() -> None:
    page_state = PageState()
    for status in ("SUCCESS", "SUCCESS", "INVALID"):
        page_state.apply(at(1, skill_started("tree/Grasp")))
        page_state.apply(at(2, skill_ended("tree/Grasp", status)))
    page_state.apply(at(3, skill_started("tree/Grasp", "cube-1")))
    page_state.take_changes()
    failure = {"reason": "missed", "message": "no seal", "item": "cube-1"}
    page_state.apply(at(360, skill_ended("tree/Grasp", "FAILURE", **failure)))
    assert page_state.take_changes() == {
        "clock": 1.5,
        "nodes": {
            "tree/Grasp": {
                "done": 2, "failed": 1, "halted": 1, "status": "failure", "failure": "missed: no seal",
                "item": "cube-1",
            }
        },
    }  # fmt: skip


def test_poses_are_places_and_quaternions_that_begin_with_w() -> None:
    pose = Pose.of((1.0, 2.0, 3.0), (0.0, 0.0, 1.0, 0.0))
    assert encode_poses({"tool": pose}) == {"tool": (1, 2, 3, 0, 0, 0, 1)}


def test_an_image_is_shown_with_what_the_arm_hides_darker() -> None:
    visible = np.ones((48, 64), bool)
    visible[:, 32:] = False
    image = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    frame = SimpleNamespace(image=image, visible=visible, id=3, camera="wrist", stamp=0.5)
    box = detected("cube", confidence=0.5, box=[1, 2, 3, 4], position=[0.5, 0.0, 0.02])
    page_state = PageState()
    page_state.apply(SearchedFrame(frame, frame_searched(box)))
    look = dict(page_state.values["look"])
    data = base64.b64decode(look.pop("source").removeprefix("data:image/jpeg;base64,"))
    assert look == {
        "frame": 3, "camera": "wrist", "detector": "embedded", "stamp": 0.5, "width": 64, "height": 48,
        "detections": [vars(box)],
    }  # fmt: skip
    shown = cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert np.allclose(shown[24, 8], (200, 100, 50), atol=6)
    assert np.allclose(shown[24, 56], (110, 55, 27), atol=6)
