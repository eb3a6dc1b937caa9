from __future__ import annotations

import math

import pytest

from executive.messages import Detection
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.detect import Detect


def test_an_answer_becomes_visible_after_the_detectors_latency(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    result = run_skill(Detect(), fake)
    assert result.status == "SUCCESS"
    assert [found.label for found in result.outputs["detections"].found] == ["cube"]
    assert result.ticks == 12, "0.05 s at 240 Hz"


def test_an_empty_table_is_a_result_and_no_failure(fake: FakeCell) -> None:
    result = run_skill(Detect(), fake)
    assert (result.status, result.outputs["detections"].found) == ("SUCCESS", ())


def test_boxes_below_the_threshold_alone_are_unsure(fake: FakeCell) -> None:
    fake.detector.answers = lambda look, true: [Detection("duck", 0.4, (0, 0, 9, 9))]
    result = run_skill(Detect(), fake)
    assert result.reason == "unsure"
    assert result.message == "detector embedded saw nothing it is sure of: at best a duck at 0.40 < 0.50"


def test_a_weak_box_beside_a_sure_one_is_in_doubt(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    weak = Detection("duck", 0.4, (0, 0, 9, 9))
    fake.detector.answers = lambda look, true: [*true, weak]
    detections = run_skill(Detect(), fake).outputs["detections"]
    assert [d.label for d in detections.found] == ["cube"]
    assert detections.doubtful == (weak,)


def test_an_arm_in_the_way_is_hidden_and_nothing_is_photographed(fake: FakeCell) -> None:
    fake.camera.sees = lambda: False
    result = run_skill(Detect(), fake)
    assert result.reason == "hidden"
    assert result.message == "the arm hides part of the workspace from camera overhead"


def test_a_detector_without_an_answer_is_unavailable_with_its_sentence(fake: FakeCell) -> None:
    fake.detector.answers = lambda look, true: "no answer within 1.0 s"
    result = run_skill(Detect(), fake)
    assert (result.reason, result.message) == ("unavailable", "detector embedded: no answer within 1.0 s")


def test_doubtful_boxes_pass_with_nothing_found_for_sure_where_the_mission_says_so(fake: FakeCell) -> None:
    fake.detector.answers = lambda look, true: [Detection("duck", 0.4, (0, 0, 9, 9))]
    result = run_skill(Detect(doubtful="pass"), fake)
    detections = result.outputs["detections"]
    assert (result.status, detections.found, len(detections.doubtful)) == ("SUCCESS", (), 1)


def test_an_arm_in_the_way_may_be_looked_past(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    fake.camera.sees = lambda: False
    result = run_skill(Detect(hidden="pass"), fake)
    assert [found.label for found in result.outputs["detections"].found] == ["cube"]


def test_what_is_seen_of_things_behind_the_arm_is_not_believed(fake: FakeCell) -> None:
    behind, beside = (Detection("cube", 0.9, (x, 200, x + 20, 220)) for x in (300, 400))
    fake.detector.answers = lambda look, true: [behind, beside]
    fake.camera.hides.append((290, 190, 310, 230))
    assert run_skill(Detect(hidden="pass"), fake).outputs["detections"].found == (beside,)


def test_it_says_which_detector_answered_and_how_far_it_can_be_trusted(fake: FakeCell) -> None:
    detections = run_skill(Detect(), fake).outputs["detections"]
    assert (detections.detector, detections.reliability.misses) == ("embedded", 0.02)


@pytest.mark.parametrize(
    "box", [(math.nan, 0, 9, 9), (0, 0, math.inf, 9), (9, 0, 0, 9)], ids=["nan", "infinite", "inside out"]
)
def test_a_box_that_cannot_be_is_no_answer(fake: FakeCell, box: tuple[float, ...]) -> None:
    fake.detector.answers = lambda look, true: [Detection("duck", 0.9, box)]
    result = run_skill(Detect(), fake)
    assert result.reason == "unavailable"
    assert result.message.startswith("detector embedded gave a box that cannot be: duck 0.9 at (")
