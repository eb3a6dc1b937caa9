"""Several detectors are asked about the same frame, and all of them are waited for."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from executive.cell_config import DetectorConfig
from executive.errors import InputError, Unavailable
from executive.geometry import Pose
from executive.messages import Detection, Frame, Reliability
from executive.testing.fake_camera import FakeRequest
from executive.vision.detectors.agreement.detector import AgreementDetector
from executive.vision.detectors.cascade.detector import CascadeDetector
from executive.vision.detectors.registry import build_detectors
from executive.vision.detectors.setting import Setting

CUBE = Detection("cube", 0.9, (0.0, 0.0, 40.0, 40.0))
DUCK = Detection("duck", 0.8, (0.0, 0.0, 40.0, 40.0))


class Scripted:
    """A detector that answers as it is told, `latency` after it is asked."""

    def __init__(self, name, clock, latency=0.05):
        self.name, self.clock, self.latency = name, clock, latency
        self.answer = [CUBE]
        self.asked = []

    def request(self, frame, view):
        self.asked.append((self.clock.now, frame, view))
        by = Reliability(0.5, misses=0.1, confused=0.1, invented=0.1, jitter=1.0)
        return FakeRequest(self.clock.now + self.latency, self.clock, self.answer, self.name, by)


@pytest.fixture
def clock():
    return SimpleNamespace(now=0.0, step=1 / 240)


@pytest.fixture
def server(clock):
    return Scripted("server", clock)


@pytest.fixture
def embedded(clock):
    return Scripted("embedded", clock)


@pytest.fixture
def cell(clock, server, embedded):
    """The detectors of a cell by name: `both` asks server and embedded, `eye` both, then embedded."""
    detectors = {"server": server, "embedded": embedded}
    for name, kind, built, members in (
        ("both", "agreement", AgreementDetector, ["server", "embedded"]),
        ("eye", "cascade", CascadeDetector, ["both", "embedded"]),
    ):
        config = DetectorConfig(kind=kind, detectors=members)
        setting = Setting(name, None, clock, None, 0, detectors.__getitem__)
        detectors[name] = built.from_config(config, setting)
    return detectors


def frame():
    image = np.zeros((4, 4, 3), np.uint8)
    return Frame(1, "overhead", image, None, np.eye(3), Pose.identity(), 0.0, image[..., 0] == 0, 0)


def ask(detector, clock, view="table"):
    """Return what a detector answers, and after how long."""
    asked = clock.now
    request = detector.request(frame(), view)
    while not request.ready:
        clock.now += clock.step
    try:
        answer = request.result()
    except Unavailable as error:
        answer = str(error)
    return answer, clock.now - asked


def test_all_are_asked_at_once_about_the_same_frame(cell, clock, server, embedded):
    answer, _ = ask(cell["both"], clock, "full")
    assert (answer.detector, answer.found) == ("both", (CUBE,))
    assert server.asked == embedded.asked
    assert [(when, view) for when, _, view in server.asked] == [(0.0, "full")]


@pytest.mark.parametrize(("slow", "after"), [(0.3, 0.3), (0.0, 0.05)])
def test_it_waits_for_the_slowest_and_for_its_own_latency(cell, clock, server, embedded, slow, after):
    server.latency, embedded.latency = slow, 0.0
    assert ask(cell["both"], clock)[1] == pytest.approx(after, abs=clock.step)


def test_without_the_answer_of_each_it_has_none_and_says_why_of_each(cell, clock, server, embedded):
    server.answer = "no answer within 1.0 s"
    assert ask(cell["both"], clock)[0] == (
        "not every detector gave an answer. server: no answer within 1.0 s"
    )
    embedded.answer = "onnxruntime failed"
    assert ask(cell["both"], clock)[0] == (
        "not every detector gave an answer. server: no answer within 1.0 s. embedded: onnxruntime failed"
    )


def test_where_they_disagree_a_cascade_goes_on_to_the_next(cell, clock, server, embedded):
    server.answer = [DUCK]
    answer, _ = ask(cell["eye"], clock)
    assert (answer.detector, answer.found) == ("embedded", (CUBE,))
    assert (len(server.asked), len(embedded.asked)) == (1, 2)


def test_why_they_disagree_is_said_where_nobody_is_left(cell, clock, server):
    server.answer = [DUCK]
    assert ask(cell["both"], clock)[0] == (
        "server and embedded disagree about 1 of 1 objects: "
        "server sees a duck where embedded sees a cube (0.80, 0.90)"
    )


def test_a_member_that_asks_others_goes_on_while_another_is_waited_for(cell, clock, server, embedded):
    server.latency = 1.0
    embedded.answer = "onnxruntime failed"
    spare = Scripted("spare", clock, latency=0.9)
    members = {"server": server, "embedded": embedded, "spare": spare}
    setting = Setting("eye", None, clock, None, 0, members.__getitem__)
    members["eye"] = CascadeDetector.from_config(
        DetectorConfig(kind="cascade", detectors=["embedded", "spare"]), setting
    )
    config = DetectorConfig(kind="agreement", detectors=["server", "eye"])
    answer, after = ask(AgreementDetector.from_config(config, setting), clock)
    assert answer.found == (CUBE,)
    assert after == pytest.approx(1.0, abs=2 * clock.step)
    assert spare.asked[0][0] == pytest.approx(0.05, abs=clock.step)


def test_asking_too_early_is_a_bug(cell):
    with pytest.raises(RuntimeError, match="the agreement has no answer yet"):
        cell["both"].request(frame(), "table").result()


def configs(**detectors):
    return {name: DetectorConfig(**options) for name, options in detectors.items()}


EMBEDDED = {"kind": "embedded"}
WRONG = [
    ({"both": {"kind": "agreement"}}, "detectors", "field required"),
    ({"both": {"kind": "agreement", "detectors": ["e"]}, "e": EMBEDDED}, "detectors", "at least 2 items"),
    (
        {"both": {"kind": "agreement", "detectors": ["e", "nobody"]}, "e": EMBEDDED},
        "detectors",
        'no detector "nobody"; it has: both, e',
    ),
    (
        {"both": {"kind": "agreement", "detectors": ["e", "e"]}, "e": EMBEDDED},
        "detectors",
        'the agreement names "e" twice; a detector is asked once',
    ),
    (
        {
            "both": {"kind": "agreement", "detectors": ["e", "eye"]},
            "eye": {"kind": "cascade", "detectors": ["e", "both"]},
            "e": EMBEDDED,
        },
        "detectors",
        "the agreement rests on itself: eye -> both",
    ),
    (
        {"both": {"kind": "agreement", "detectors": ["e", "f"], "misses": 0.1}, "e": EMBEDDED, "f": EMBEDDED},
        "misses",
        "an agreement has no misses: its answer is judged by those of the detectors it asks",
    ),
]


@pytest.mark.parametrize(("detectors", "option", "text"), WRONG)
def test_a_wrong_option_is_said_in_a_sentence(tmp_path, detectors, option, text):
    cell = configs(**detectors)
    ((found, sentence),) = AgreementDetector.check(cell["both"], tmp_path, cell)
    assert found == option
    assert text in sentence


@pytest.mark.parametrize("detectors", [WRONG[1][0], WRONG[2][0], WRONG[4][0]])
def test_what_cannot_be_built_is_not(tmp_path, detectors):
    with pytest.raises(InputError):
        build_detectors(configs(**detectors), camera=None, clock=None, base=tmp_path, seed=0)


def test_a_cascade_around_it_notices_that_it_rests_on_itself(tmp_path):
    cell = configs(**WRONG[4][0])
    ((_, sentence),) = CascadeDetector.check(cell["eye"], tmp_path, cell)
    assert sentence == "the cascade rests on itself: both -> eye"


def test_it_knows_the_classes_that_any_member_knows(tmp_path):
    own = {"kind": "rfdetr", "model_path": "m.onnx", "labels": ["banana", "cube"]}
    cell = configs(both={"kind": "agreement", "detectors": ["own", "e"]}, own=own, e=EMBEDDED)
    assert AgreementDetector.labels(cell["both"], tmp_path, cell) == ("banana", "cube", "sphere", "duck")


def test_it_does_not_know_its_classes_where_a_member_does_not_or_it_is_wrong(tmp_path):
    server = {"kind": "roboflow", "model_id": "shapes/1"}
    cell = configs(both={"kind": "agreement", "detectors": ["server", "e"]}, server=server, e=EMBEDDED)
    assert AgreementDetector.labels(cell["both"], tmp_path, cell) is None
    ring = configs(**WRONG[4][0])
    assert AgreementDetector.labels(ring["both"], tmp_path, ring) is None
