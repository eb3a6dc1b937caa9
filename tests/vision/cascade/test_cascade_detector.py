"""The next detector where the first gives no answer, the first again once it does."""

from __future__ import annotations

import numpy as np
import pytest

from executive.cell_config import DetectorConfig
from executive.errors import InputError, Unavailable
from executive.geometry import Pose
from executive.messages import Answer, Detection, Frame, Reliability
from executive.vision.detectors.cascade.detector import CascadeDetector
from executive.vision.detectors.registry import build_detectors
from executive.vision.detectors.setting import Setting

FOUND = (Detection("cube", 0.9, (0.0, 0.0, 1.0, 1.0)),)


class Clock:
    def __init__(self):
        self.now = 0.0
        self.step = 1 / 240


class Request:
    def __init__(self, due, clock, answer):
        self.due, self.clock, self.answer = due, clock, answer

    @property
    def ready(self):
        return self.clock.now >= self.due

    def result(self):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


class Scripted:
    """A detector that answers as it is told, `latency` after it is asked; None: with what it finds."""

    def __init__(self, name, clock, latency=0.05):
        self.name, self.clock, self.latency = name, clock, latency
        self.frames = []
        self.trouble = None
        self.reliability = Reliability(0.5, misses=0.1, confused=0.1, invented=0.1, jitter=1.0)

    def request(self, frame, view):
        self.frames.append((frame, view))
        answer = self.trouble or Answer(self.name, FOUND, self.reliability)
        return Request(self.clock.now + self.latency, self.clock, answer)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def server(clock):
    return Scripted("server", clock)


@pytest.fixture
def spare(clock):
    return Scripted("spare", clock)


@pytest.fixture
def cascade(clock, server, spare):
    config = DetectorConfig(kind="cascade", detectors=["server", "spare"], failures=2, rest=10.0)
    members = {"server": server, "spare": spare}
    return CascadeDetector.from_config(config, Setting("eye", None, clock, None, 0, members.__getitem__))


def frame():
    image = np.zeros((4, 4, 3), np.uint8)
    return Frame(1, "overhead", image, None, np.eye(3), Pose.identity(), 0.0, image[..., 0] == 0, 0)


def ask(cascade, clock, view="table"):
    """Return what the cascade answers, and after how long."""
    asked = clock.now
    request = cascade.request(frame(), view)
    while not request.ready:
        clock.now += clock.step
    try:
        answer = request.result()
    except Unavailable as error:
        answer = str(error)
    return answer, clock.now - asked


def test_the_answer_is_the_members_own_and_the_others_are_not_asked(cascade, clock, server, spare):
    answer, after = ask(cascade, clock)
    assert (answer.detector, answer.found, answer.reliability) == ("server", FOUND, server.reliability)
    assert after == pytest.approx(0.05, abs=clock.step)
    assert spare.frames == []


def test_the_next_one_is_asked_about_the_same_frame_from_when_the_first_fails(cascade, clock, server, spare):
    server.trouble, server.latency = Unavailable("no answer within 1.0 s"), 1.0
    answer, after = ask(cascade, clock, "full")
    assert answer.detector == "spare"
    assert after == pytest.approx(1.05, abs=2 * clock.step)
    assert spare.frames == server.frames
    assert spare.frames[0][1] == "full"


def test_no_answer_shows_before_the_cascades_own_latency(cascade, clock, server):
    server.latency = 0.0
    assert ask(cascade, clock)[1] == pytest.approx(0.05, abs=clock.step)


def test_without_any_answer_it_says_why_of_each(cascade, clock, server, spare):
    server.trouble, spare.trouble = Unavailable("the model is gone"), Unavailable("onnxruntime failed")
    answer, _ = ask(cascade, clock)
    assert answer == ("no detector gave an answer. server: the model is gone. spare: onnxruntime failed")


def test_one_that_fails_twice_is_left_alone_and_is_back_after_its_rest(cascade, clock, server, spare):
    server.trouble = Unavailable("the model is gone")
    for _ in range(5):
        assert ask(cascade, clock)[0].detector == "spare"
    assert len(server.frames) == 2
    clock.now = 10.2
    assert ask(cascade, clock)[0].detector == "spare"
    assert len(server.frames) == 3
    server.trouble = None
    clock.now = 20.3
    assert [ask(cascade, clock)[0].detector for _ in range(3)] == ["server"] * 3


def test_who_is_left_alone_is_said_with_the_reason(cascade, clock, server, spare):
    server.trouble = Unavailable("the model is gone")
    ask(cascade, clock)
    ask(cascade, clock)
    spare.trouble = Unavailable("onnxruntime failed")
    answer, _ = ask(cascade, clock)
    assert (
        "server: not asked until 10.2 s, for 2 times in a row it gave no answer (the model is gone)" in answer
    )


def test_a_failure_that_nobody_waited_for_counts_too(cascade, clock, server, spare):
    server.trouble, server.latency = Unavailable("no answer within 1.0 s"), 1.0
    for _ in range(3):
        cascade.request(frame(), "table")
        clock.now += 2.0
    assert (len(server.frames), len(spare.frames)) == (2, 1)


def test_what_is_no_lack_of_an_answer_ends_the_run(cascade, clock, server):
    server.trouble = ZeroDivisionError("a bug")
    request = cascade.request(frame(), "table")
    clock.now = 0.1
    with pytest.raises(ZeroDivisionError):
        assert request.ready


def test_asking_too_early_is_a_bug(cascade):
    with pytest.raises(RuntimeError, match="no answer yet"):
        cascade.request(frame(), "table").result()


def configs(**detectors):
    return {name: DetectorConfig(**options) for name, options in detectors.items()}


EMBEDDED = {"kind": "embedded"}
WRONG = [
    ({"eye": {"kind": "cascade"}}, "detectors", "field required"),
    ({"eye": {"kind": "cascade", "detectors": []}}, "detectors", "at least 1 item"),
    ({"eye": {"kind": "cascade", "detectors": ["nobody"]}}, "detectors", 'no detector "nobody"; it has: eye'),
    ({"eye": {"kind": "cascade", "detectors": ["eye"]}}, "detectors", "rests on itself: eye"),
    (
        {"eye": {"kind": "cascade", "detectors": ["e", "e"]}, "e": EMBEDDED},
        "detectors",
        'names "e" twice; a detector is asked once',
    ),
    (
        {
            "eye": {"kind": "cascade", "detectors": ["e", "other"]},
            "other": {"kind": "cascade", "detectors": ["third"]},
            "third": {"kind": "cascade", "detectors": ["e", "eye"]},
            "e": EMBEDDED,
        },
        "detectors",
        "rests on itself: other -> third -> eye",
    ),
    ({"eye": {"kind": "cascade", "detectors": ["e"], "rest": 0}, "e": EMBEDDED}, "rest", "greater than 0"),
    (
        {"eye": {"kind": "cascade", "detectors": ["e"], "threshold": 0.7}, "e": EMBEDDED},
        "threshold",
        "a cascade has no threshold: an answer is judged by that of the detector that gave it",
    ),
]


@pytest.mark.parametrize(("detectors", "option", "text"), WRONG)
def test_a_wrong_option_is_said_in_a_sentence(tmp_path, detectors, option, text):
    cell = configs(**detectors)
    ((found, sentence),) = CascadeDetector.check(cell["eye"], tmp_path, cell)
    assert found == option
    assert text in sentence


@pytest.mark.parametrize("detectors", [detectors for detectors, _, _ in WRONG[:6] if len(detectors) != 2])
def test_what_cannot_be_built_is_not(tmp_path, detectors):
    with pytest.raises(InputError):
        build_detectors(configs(**detectors), camera=None, clock=None, base=tmp_path, seed=0)


def test_it_knows_the_classes_that_any_member_knows(tmp_path):
    own = {"kind": "rfdetr", "model_path": "m.onnx", "labels": ["banana", "cube"]}
    cell = configs(eye={"kind": "cascade", "detectors": ["own", "e"]}, own=own, e=EMBEDDED)
    assert CascadeDetector.labels(cell["eye"], tmp_path, cell) == ("banana", "cube", "sphere", "duck")


def test_it_does_not_know_its_classes_where_a_member_does_not(tmp_path):
    server = {"kind": "roboflow", "model_id": "shapes/1"}
    cell = configs(eye={"kind": "cascade", "detectors": ["server", "e"]}, server=server, e=EMBEDDED)
    assert CascadeDetector.labels(cell["eye"], tmp_path, cell) is None
    ring = configs(a={"kind": "cascade", "detectors": ["b"]}, b={"kind": "cascade", "detectors": ["b"]})
    assert CascadeDetector.labels(ring["a"], tmp_path, ring) is None
