"""Detections from a Roboflow inference server, whatever it does."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from stub_server import BODIES, FLOODS, MODEL, SPOILT, WORKFLOW, StubServer
from test_helper import SECRET, list_children

from executive.cell.config import DetectorConfig
from executive.errors import DeadlinePassed, Unavailable
from executive.perception.detectors.detector_registry import DetectorContext
from executive.perception.detectors.roboflow.detector import RoboflowDetector
from tests.benchmarks.hostile_input import damage_text

DEADLINE = 2.0
"""Time for an answer [s]: more than inference-sdk takes for the three times that it asks."""
V1 = {"api": "v1", "class_map": {"ball": "sphere"}}
NAMES = {"workspace": "acme", "workflow_id": "sorting", "workflow_input": "photo", "workflow_output": "boxes"}
APIS = {"v1": V1, "v0": {**V1, "api": "v0"}, "workflow": {**V1, "api": "workflow", **NAMES}}
"""Options of a detector by its interface."""
CAMERA = SimpleNamespace(table_view=(192, 100, 448, 356))


def find_colours(image):
    """Yield the bounding box of what is red, a cube, and of what is blue, a ball."""
    for channel, label in ((0, "cube"), (2, "ball")):
        rows, columns = np.nonzero(image[..., channel] > 127)
        if len(rows):
            left, right, top, bottom = columns.min(), columns.max() + 1, rows.min(), rows.max() + 1
            yield {
                "x": float(left + right) / 2, "y": float(top + bottom) / 2, "width": float(right - left),
                "height": float(bottom - top), "confidence": 0.9, "class": label,
            }  # fmt: skip


def show_spot(left=300, top=200, channel=0):
    image = np.zeros((480, 640, 3), np.uint8)
    image[top : top + 20, left : left + 30, channel] = 255
    return SimpleNamespace(image=image)


def build(name, **options):
    config = DetectorConfig(kind="roboflow", **{"model_id": MODEL, "deadline": DEADLINE, **options})
    return RoboflowDetector.from_config(config, DetectorContext(name, CAMERA, None, 0, None))


@pytest.fixture(scope="module")
def stub():
    stub = StubServer(lambda image: list(find_colours(image)))
    yield stub
    stub.stop()


@pytest.fixture
def server(stub):
    stub.faults = lambda look: ""
    stub.delay = 0.0
    stub.asked.clear()
    return stub


@pytest.fixture(scope="module")
def make(stub):
    """Returns a detector with options; one with the same is made once, for it takes seconds to start."""
    made = {}
    with pytest.MonkeyPatch.context() as patch:

        def make(key=SECRET, **options):
            called = repr((key, sorted(options.items())))
            if called not in made:
                patch.setenv("ROBOFLOW_API_KEY", key)
                made[called] = build("server", **{"url": stub.url, **options})
            return made[called]

        yield make
        for detector in made.values():
            detector.close()


def assert_unavailable(detector, *patterns):
    with pytest.raises(Unavailable) as caught:
        detector.detect(show_spot(), "table")
    text = str(caught.value)
    assert SECRET not in text
    for pattern in patterns:
        assert re.search(pattern, text), text


@pytest.mark.slow
@pytest.mark.parametrize("view", ["table", "full"])
@pytest.mark.parametrize("api", APIS)
def test_a_box_is_returned_in_the_frames_pixels_and_renamed(make, server, api, view):
    detector = make(**APIS[api])
    (found,) = detector.detect(show_spot(channel=2), view)
    assert found.label == "sphere"
    assert found.box == pytest.approx((300, 200, 330, 220), abs=1.0)
    assert len(detector.detect(show_spot(20, 20), view)) == (view == "full")
    path, headers, body = server.asked[-1]
    assert headers["Authorization"] == f"Bearer {SECRET}"
    assert all(SECRET not in path and SECRET.encode() not in body for path, _, body in server.asked)
    if api == "workflow":
        assert path == WORKFLOW
    else:
        assert "confidence=0.25" in path if api == "v0" else json.loads(body)["confidence"] == 0.25


@pytest.mark.slow
@pytest.mark.parametrize(("api", "requests"), [("v0", 1), ("v1", 2), ("workflow", 1)])
def test_tiles_and_whole_frames_take_the_stated_requests_within_one_deadline(make, server, api, requests):
    detector = make(**{**APIS[api], "full": "tiles", "deadline": 5.0})
    server.loaded.clear()
    (found,) = detector.detect(show_spot(180, 240), "full")
    assert found.box == pytest.approx((180, 240, 210, 260), abs=1.0)
    # A server that has not loaded the model is asked to load it.
    assert len(server.asked) == 9 * requests + (api == "v1")
    server.asked.clear()
    make(**APIS[api]).detect(show_spot(), "full")
    assert len(server.asked) == requests
    server.delay = 1.0
    start_time = time.monotonic()
    with pytest.raises(DeadlinePassed, match=r"^no answer within 5\.0 s from"):
        detector.detect(show_spot(), "full")
    assert 5.0 <= time.monotonic() - start_time < 6.0


@pytest.mark.slow
def test_what_is_below_the_floor_is_left_out_and_a_class_nobody_asked_for_is_not(make, server):
    server.faults = lambda look: "doubtful"
    assert make(**V1).detect(show_spot(), "table") == []
    server.faults = lambda look: "strangers"
    assert "cube" in [found.label for found in make(**V1).detect(show_spot(), "table")]


FAULTS = {
    "400": "rejected the request",
    "401": r"does not accept the key \(401: key \*\*\* is no good\); set ROBOFLOW_API_KEY to a key",
    "402": "requires a payment",
    "403": "does not accept the key",
    "404": "has no (model shapes/1|workflow acme/sorting)",
    "413": "rejected the image as too large",
    "418": "reported an unexpected status",
    "429": "received too many requests",
    "500": "had an internal error",
    "502": "is a gateway without a connection to the server",
    "503": "is not ready, or cannot load",
    **dict.fromkeys(sorted(BODIES), "sent an (answer that inference-sdk cannot read|invalid answer)"),
    **dict.fromkeys(sorted(set(SPOILT) - {"strangers", "doubtful"}), 'invalid answer: .*(shapes/1|"boxes")'),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("api", APIS)
def test_every_fault_of_the_server_is_unavailable_with_what_to_do(make, server, fault, api):
    server.faults = lambda look: fault
    assert_unavailable(make(**APIS[api]), f"^{server.url}|no answer within", FAULTS[fault])


def measure_helper(detector):
    """Return the peak memory of the helper process [MB]."""
    status = Path(f"/proc/{detector._process._process.pid}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+)", status)[1]) / 1e3


@pytest.mark.campaign
@pytest.mark.parametrize("api", APIS)
def test_50_random_answers_are_bounded(make, server, api):
    rng = random.Random(f"{os.environ.get('SEED')} {api}")
    detector = make(**APIS[api])
    for _ in range(50):
        body = damage_text(rng, json.dumps({"predictions": [*find_colours(show_spot().image)]}))
        FLOODS["damaged"] = 200, {}, lambda body=body: iter([body])
        fault = rng.choice([*["damaged"] * 10, *FLOODS, *FAULTS, "hang"])
        server.faults = lambda look, fault=fault: fault
        with contextlib.suppress(Unavailable):
            detector.detect(show_spot(), "table")
        detector._process.wait_until_ready()
        assert measure_helper(detector) < 500, fault


@pytest.mark.parametrize(
    "fault",
    ["oversized", "redirect", *(pytest.param(each, marks=pytest.mark.slow) for each in ("bomb", "chunks"))],
)
def test_a_bounded_part_of_an_answer_is_read_and_only_from_the_server(make, server, fault):
    server.faults = lambda look: fault
    problem = r"ValueError: (a redirect to http://127.0.0.1:9/|an answer of more than 8388608 bytes)"
    assert_unavailable(make(**V1), problem)
    assert measure_helper(make(**V1)) < 300
    server.faults = lambda look: "gzip"
    assert make(**V1).detect(show_spot(), "table") == []


@pytest.mark.slow
def test_a_server_that_is_gone_and_comes_back(make, server):
    detector = make(**V1)
    server.stop()
    try:
        assert_unavailable(detector, f"^{server.url} refused the connection")
    finally:
        server.start()
    server.faults = lambda look: "stop"
    try:
        assert_unavailable(detector, "closed the connection|refused the connection")
    finally:
        server.over.wait(5)
        server.start()
    server.faults = lambda look: ""
    assert len(detector.detect(show_spot(), "table")) == 1


@pytest.mark.slow
def test_a_server_on_this_computer_is_asked_without_a_proxy(server, monkeypatch):
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    with contextlib.closing(build("direct", url=server.url, **V1)) as detector:
        assert len(detector.detect(show_spot(), "table")) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"url": "http://nobody.invalid:9001"}, "http://nobody.invalid:9001 has an unknown host name"),
        ({"url": "https://127.0.0.1:{port}"}, r"https://127.0.0.1:\d+ failed the TLS handshake"),
        ({"key": "", "api": "v0"}, "requires a key .*; set ROBOFLOW_API_KEY"),
        ({**APIS["workflow"], "workflow_output": "circles"}, 'has no output "circles" .*picture, boxes'),
    ],
)
def test_an_address_key_or_output_that_does_not_work_is_said(make, server, options, text):
    options = {**options, **({"url": options["url"].format(port=server.port)} if "url" in options else {})}
    assert_unavailable(make(deadline=30.0, **options), text)


def test_closing_does_not_wait_for_a_server_that_hangs(server):
    before = list_children()
    detector = build("closing", url=server.url, deadline=60.0)
    assert len(list_children()) == len(before) + 1
    with ThreadPoolExecutor(1) as thread:
        request = thread.submit(detector.detect, show_spot(), "table")
        start_time = time.monotonic()
        detector.close()
        assert isinstance(request.exception(), Unavailable)
    assert time.monotonic() - start_time < 2.0
    assert list_children() == before


def test_a_server_that_never_answers_costs_its_deadline(make, server):
    detector = make(**V1)
    assert len(detector.detect(show_spot(), "table")) == 1
    server.faults = lambda look: "hang"
    start_time = time.monotonic()
    with pytest.raises(DeadlinePassed, match=r"^no answer within 2\.0 s from http://127") as caught:
        detector.detect(show_spot(), "table")
    assert DEADLINE - 0.05 < time.monotonic() - start_time < DEADLINE + 1.5
    assert caught.value.timeout == DEADLINE
