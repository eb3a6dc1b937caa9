from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executive.cell.detection import Detection
from executive.cells.fake.cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.detect import Detect

WEAK = Detection("duck", 0.4, (0, 0, 9, 9))
TORN = Detection("cube", 0.62, (0, 0, 9, 9), second_confidence=0.58)


def test_an_answer_becomes_visible_after_the_detectors_latency(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    result = run_skill(Detect(), fake)
    detections = result.outputs["detections"]
    assert (result.status, [found.label for found in detections.confident]) == ("SUCCESS", ["cube"])
    assert result.ticks == 12, "0.05 s at 240 Hz"
    assert (detections.detector, detections.error_rates.miss_rate) == ("embedded", 0.03)


@pytest.mark.parametrize(
    ("answer", "params", "found", "doubtful"),
    [
        ([], {}, 0, 0),
        ([Detection("cube", 0.9, (0, 0, 9, 9)), WEAK], {}, 1, 1),
        ([WEAK], {"doubtful": "pass"}, 0, 1),
    ],
)
def test_only_what_is_sure_is_found(
    fake: FakeCell, answer: list[Detection], params: dict[str, str], found: int, doubtful: int
) -> None:
    fake.detector.make_answer = lambda look, true: answer
    result = run_skill(Detect(**params), fake)
    detections = result.outputs["detections"]
    assert result.status == "SUCCESS"
    assert (len(detections.confident), len(detections.doubtful)) == (found, doubtful)


@pytest.mark.parametrize(
    ("answer", "reason", "message"),
    [
        ([WEAK], "unsure", "at best a duck with confidence 0.40, below the threshold 0.50"),
        ([TORN], "unsure", "at best a cube with confidence 0.62, and 0.58 for another class"),
        ("no answer within 1.0 s", "unavailable", "embedded: no answer within 1.0 s"),
        ([Detection("duck", 0.9, (9, 0, 0, 9))], "unavailable", "an invalid box: 'duck' 0.9 at ("),
        ([Detection("\x1b[31mduck", 0.9, (0, 0, 9, 9))], "unavailable", "box: '\\x1b[31mduck' 0.9 at ("),
        ([Detection("d" * 101, 0.9, (0, 0, 9, 9))], "unavailable", f"box: '{'d' * 100}' 0.9 at ("),
    ],
)
def test_an_answer_that_is_of_no_use_is_a_failure(
    fake: FakeCell, answer: Any, reason: str, message: str
) -> None:
    fake.detector.make_answer = lambda look, true: answer
    result = run_skill(Detect(), fake)
    assert (result.reason, message in result.message) == (reason, True)


@pytest.mark.parametrize(("x", "y", "status"), [(0.5, 0.0, "FAILURE"), (0.24, 0.48, "SUCCESS")])
def test_an_uncertain_detection_in_a_bin_is_no_failure(
    fake: FakeCell, x: float, y: float, status: str
) -> None:
    fake.world.put("cube", x, y)
    fake.detector.make_answer = lambda look, true: [replace(one, confidence=0.4) for one in true]
    result = run_skill(Detect(view="full"), fake)
    assert (result.status, result.reason) == (status, "unsure" if status == "FAILURE" else "")


def test_an_arm_in_the_way_may_be_looked_past(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    fake.camera.is_table_visible = lambda: False
    result = run_skill(Detect(), fake)
    assert (result.reason, result.ticks) == ("hidden", 0)
    result = run_skill(Detect(hidden="pass"), fake)
    assert [found.label for found in result.outputs["detections"].confident] == ["cube"]


def test_what_is_seen_of_things_behind_the_arm_is_not_believed(fake: FakeCell) -> None:
    behind, beside = (Detection("cube", 0.9, (x, 200, x + 20, 220)) for x in (300, 400))
    fake.detector.make_answer = lambda look, true: [behind, beside]
    fake.camera.occluded_regions.append((290, 190, 310, 230))
    assert run_skill(Detect(hidden="pass"), fake).outputs["detections"].confident == (beside,)


def test_a_moved_camera_is_noticed_in_every_look(fake: FakeCell) -> None:
    for displacement, reason in (("", ""), ("camera overhead was moved", "camera_moved"), ("", "")):
        fake.camera.displacement_message = displacement
        result = run_skill(Detect(), fake)
        assert (result.reason, result.message) == (reason, displacement)
