"""Detections from a Roboflow inference server, whatever it does."""

from __future__ import annotations

import json
import os
import re
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from stub_server import BODIES, MODEL, SPOILT, StubServer

from executive.cell_config import CameraConfig, DetectorConfig
from executive.errors import DeadlinePassed, Unavailable
from executive.geometry import Pose
from executive.messages import Frame
from executive.vision.detectors.roboflow.detector import RoboflowDetector
from executive.vision.detectors.roboflow.helper import Helper
from executive.vision.detectors.setting import Setting

SECRET = "SECRET1234567890"
TABLE = (192, 100, 448, 356)
DEADLINE = 2.0
"""Time for an answer [s]: more than inference-sdk takes for the three times that it asks."""


class Clock:
    now = 0.0
    step = 1 / 240


def camera():
    return CameraConfig(
        mount="fixed", position=(0.5, 0, 1.2), look_at=(0.5, 0, 0), up=(1, 0, 0), fov_deg=55,
        table_view=TABLE, scan_poses=("home",),
    )  # fmt: skip


def red(image):
    """The bounding box of what is red: a cube; of what is blue: a ball."""
    for channel, label in ((0, "cube"), (2, "ball")):
        rows, columns = np.nonzero(image[..., channel] > 127)
        if len(rows):
            left, right, top, bottom = columns.min(), columns.max() + 1, rows.min(), rows.max() + 1
            yield {
                "x": float(left + right) / 2, "y": float(top + bottom) / 2, "width": float(right - left),
                "height": float(bottom - top), "confidence": 0.9, "class": label,
            }  # fmt: skip


def spot(left=300, top=200, channel=0):
    image = np.zeros((480, 640, 3), np.uint8)
    image[top : top + 20, left : left + 30, channel] = 255
    return Frame(1, "overhead", image, None, np.eye(3), Pose.identity(), 0.0, image[..., 0] == 0, 0)


@pytest.fixture(scope="module")
def server():
    stub = StubServer(lambda image: list(red(image)))
    yield stub
    stub.stop()


@pytest.fixture(autouse=True)
def no_fault(server):
    server.faults = lambda look: ""
    server.asked.clear()


@pytest.fixture(scope="module")
def make(server):
    """Returns a detector with options; one with the same is made once, for it takes seconds to start."""
    made = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROBOFLOW_API_KEY", SECRET)

        def make(**options):
            options = {"model_id": MODEL, "url": server.url, "deadline": DEADLINE, **options}
            called = repr(sorted(options.items()))
            if called not in made:
                config = DetectorConfig(kind="roboflow", **options)
                made[called] = RoboflowDetector.from_config(
                    config, Setting("server", camera(), Clock(), None, 0, None)
                )
            return made[called]

        yield make
        for detector in made.values():
            detector.close()


@pytest.fixture(params=["v1", "v0"])
def detector(request, make):
    return make(api=request.param, class_map={"ball": "sphere"})


def children():
    """The processes of this one that have not been waited for."""
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()


def search(detector, frame, view="table"):
    request = detector.request(frame, view)
    clock = detector._setting.clock
    clock.now += detector._options.deadline
    assert request.ready
    return request.result()


def complaint(detector, view="table"):
    with pytest.raises(Unavailable) as caught:
        search(detector, spot(), view)
    assert SECRET not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("view", ["table", "full"])
def test_a_box_is_returned_in_the_frames_pixels_and_renamed(detector, view):
    answer = search(detector, spot(channel=2), view)
    ((label, box),) = [(found.label, found.box) for found in answer.found]
    assert (label, answer.detector) == ("sphere", "server")
    assert box == pytest.approx((300, 200, 330, 220), abs=1.0)


def test_red_is_red(detector):
    assert [found.label for found in search(detector, spot(channel=0)).found] == ["cube"]


def test_the_table_view_does_not_show_what_lies_beside_it(detector):
    assert search(detector, spot(20, 20)).found == ()
    assert len(search(detector, spot(20, 20), "full").found) == 1


def test_a_full_frame_can_be_sent_in_tiles(make, server):
    detector = make(full="tiles", deadline=5.0)
    looks = server.looks
    (found,) = search(detector, spot(180, 240), "full").found
    assert found.box == pytest.approx((180, 240, 210, 260), abs=1.0)
    assert server.looks - looks == 9


def test_the_key_goes_into_the_header_alone_and_the_floor_is_asked_for(detector, server):
    search(detector, spot())
    path, headers, body = server.asked[-1]
    assert headers["Authorization"] == f"Bearer {SECRET}"
    assert all(SECRET not in path and SECRET.encode() not in body for path, _, body in server.asked)
    asked = path if path.startswith("/shapes/1") else json.loads(body)["confidence"]
    assert asked == 0.25 or "confidence=0.25" in asked


def test_what_is_below_the_floor_is_left_out(make, server):
    server.faults = lambda look: "doubtful"
    detector = make(api="v1", class_map={"ball": "sphere"})
    assert search(detector, spot()).found == ()


STATUSES = {
    "400": "could not use the request",
    "401": r"does not accept the key \(401: key \*\*\* is no good\); set ROBOFLOW_API_KEY to a key",
    "402": "wants to be paid .* look at the plan",
    "403": "does not accept the key .* set ROBOFLOW_API_KEY",
    "404": "has no model shapes/1 .* check model_id and url",
    "413": "finds the image too large",
    "418": "gave no answer",
    "429": "asked too often",
    "500": "has an error of its own .* look at its log",
    "502": "has lost the server behind it",
    "503": "is not ready, or cannot load shapes/1",
}


@pytest.mark.parametrize("status", STATUSES)
def test_a_server_that_refuses_is_quoted_with_what_to_do(detector, server, status):
    server.faults = lambda look: status
    assert_matches(complaint(detector), f"^{server.url}|no answer within", STATUSES[status])


@pytest.mark.parametrize("body", sorted(BODIES))
def test_an_answer_that_is_none_is_unavailable(detector, server, body):
    server.faults = lambda look: body
    assert_matches(complaint(detector), f"^{server.url} (answered with something that|gave an answer that)")


@pytest.mark.parametrize("fault", sorted(set(SPOILT) - {"swapped", "strangers", "doubtful"}))
def test_an_answer_that_cannot_be_right_is_unavailable(detector, server, fault):
    server.faults = lambda look: fault
    assert_matches(complaint(detector), f"^{server.url} gave an answer that cannot be right: ", "shapes/1")


def test_classes_nobody_asked_for_are_no_fault(detector, server):
    server.faults = lambda look: "strangers"
    assert "cube" in [found.label for found in search(detector, spot()).found]


def assert_matches(text, *patterns):
    for pattern in patterns:
        assert re.search(pattern, text), text


def test_a_server_that_is_gone_and_comes_back(make, server):
    detector = make(api="v1", class_map={"ball": "sphere"})
    server.stop()
    try:
        assert_matches(complaint(detector), f"^{server.url} refused the connection .*; is it running")
    finally:
        server.start()
    assert len(search(detector, spot()).found) == 1


def test_a_server_that_ends_in_the_middle_broke_off(make, server):
    detector = make(api="v1", class_map={"ball": "sphere"})
    server.faults = lambda look: "stop"
    try:
        assert_matches(complaint(detector), "broke off|refused the connection")
    finally:
        server.over.wait(5)
        server.start()


@pytest.mark.parametrize(
    ("url", "text"),
    [
        ("http://nobody.invalid:9001", r"http://nobody.invalid:9001 is not known by this name"),
        ("https://127.0.0.1:{port}", r"https://127.0.0.1:\d+ cannot be trusted \(TLS\)"),
    ],
)
def test_an_address_that_does_not_work_is_said(make, server, url, text):
    assert_matches(complaint(make(url=url.format(port=server.port), deadline=30.0)), text)


def test_a_missing_key_is_asked_for(server, monkeypatch):
    monkeypatch.delenv("ROBOFLOW_API_KEY", raising=False)
    config = DetectorConfig(kind="roboflow", model_id=MODEL, url=server.url, api="v0", deadline=DEADLINE)
    detector = RoboflowDetector.from_config(config, Setting("server", camera(), Clock(), None, 0, None))
    try:
        assert_matches(complaint(detector), "wants a key .*; set ROBOFLOW_API_KEY")
    finally:
        detector.close()


@pytest.fixture
def hasty(make):
    """A detector that waits for a fifth of a second, ready."""
    detector = make(api="v1", deadline=0.2)
    detector._helper.wait_until_ready()
    return detector


@pytest.mark.parametrize("fault", ["hang", "drip"])
def test_a_server_that_never_answers_costs_its_deadline_and_shows_it_on_the_runs_clock(hasty, server, fault):
    server.faults = lambda look: fault
    hasty._setting.clock.now = 10.0
    began = time.monotonic()
    request = hasty.request(spot(), "table")
    hasty._setting.clock.now = 10.05
    assert not request.ready
    assert 0.15 < time.monotonic() - began < 1.5
    hasty._setting.clock.now = 10.2
    with pytest.raises(DeadlinePassed, match=r"^no answer within 0\.2 s from http://127"):
        request.result()


def test_closing_does_not_wait_for_a_server_that_hangs(server):
    config = DetectorConfig(kind="roboflow", model_id=MODEL, url=server.url, deadline=60.0)
    before = children()
    detector = RoboflowDetector.from_config(config, Setting("closing", camera(), Clock(), None, 0, None))
    assert len(children()) == len(before) + 1
    detector.request(spot(), "table")
    began = time.monotonic()
    detector.close()
    assert time.monotonic() - began < 2.0
    assert not [thread for thread in threading.enumerate() if "closing" in thread.name]
    assert children() == before


def test_a_bug_of_ours_is_no_lack_of_an_answer(detector, monkeypatch):
    monkeypatch.setattr(Helper, "ask", lambda *_: {"answer": 1 / 0})
    with pytest.raises(ZeroDivisionError):
        search(detector, spot())


def test_inference_sdk_is_never_imported_here():
    assert "inference_sdk" not in sys.modules
