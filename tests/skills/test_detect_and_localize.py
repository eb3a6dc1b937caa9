"""Looks: detection, localization, and verification of items at their places."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from at_hand import intercept

from executive.cell.frame import Detection, Frame
from executive.errors import NoDepth
from executive.perception.localization import CellLocalizer
from executive.skill import SkillFailed
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.detect import Detect
from skills.localize import Localize

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
    intercept(fake, "camera.sees_table", lambda: False)
    result = run_skill(Detect(), fake)
    assert (result.reason, result.ticks) == ("hidden", 0)
    result = run_skill(Detect(hidden="pass"), fake)
    assert [found.label for found in result.outputs["detections"].confident] == ["cube"]


def test_a_moved_camera_is_noticed_in_every_look(fake: FakeCell) -> None:
    for displacement, reason in (("", ""), ("camera overhead was moved", "camera_moved"), ("", "")):
        faults = {reason: displacement} if reason else {}
        intercept(fake, "camera.find_faults", Mock(return_value=faults))
        result = run_skill(Detect(), fake)
        assert (result.reason, result.message) == (reason, displacement)


def test_objects_that_move_between_localization_and_update_make_the_frame_stale(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    skill = Localize(detections=run_skill(Detect(), fake).outputs["detections"])
    steps = skill.run(fake.cell)
    next(steps)
    assert fake.ledger.find_targets() == [], "the update is in the next control step"
    fake.ledger.invalidate_positions()
    with pytest.raises(SkillFailed, match="the robot may have moved objects after frame 1"):
        next(steps)
    assert fake.ledger.find_targets() == []


def test_a_halt_after_the_update_counts_the_look_once(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    skill = Localize(detections=run_skill(Detect(), fake).outputs["detections"])
    assert run_skill(skill, fake, halt_at=2).status == "HALTED"
    assert run_skill(skill, fake).ticks == 2
    assert [change.looks for change in fake.ledger.list_items()] == [1]


def look_in_depth(fake: FakeCell, height: float, *, times: int = 1) -> None:
    """Look and localize with a depth image that shows everything at one height over the table [m]."""
    for _ in range(times):
        detections = run_skill(Detect(view="full"), fake).outputs["detections"]
        frame = detections.frame
        depth = np.full(frame.image.shape[:2], frame.X_WC.position[2] - height)
        seen = replace(detections, frame=replace(frame, depth=depth))
        assert run_skill(Localize(detections=seen), fake).status == "SUCCESS"


def test_an_object_too_high_for_its_class_in_the_depth_image_contradicts_it(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    look_in_depth(fake, 0.08, times=3)
    (row,) = fake.ledger.list_items()
    assert row.state == "rejected"
    assert "its top is 80 mm above the table, and the top of a cube is at 50 mm" in row.reason


def unsure(fake: FakeCell):
    """A look whose detector is unsure of a cube on the table."""
    fake.world.put("cube", 0.5, 0.0)
    fake.detector.make_answer = lambda look, true: [replace(one, confidence=0.4) for one in true]
    return run_skill(Detect(doubtful="pass"), fake).outputs["detections"]


def test_what_the_detector_is_unsure_of_is_an_item_in_doubt_where_it_seems_to_be(fake: FakeCell) -> None:
    run_skill(Localize(detections=unsure(fake)), fake)
    (row,) = fake.ledger.list_items()
    assert (row.item, row.position) == ("cube-1", [0.5, 0.0, 0.025])
    assert fake.ledger.find_uncertain_items() == ["cube-1"]


def test_a_box_in_doubt_without_a_place_is_not_passed_over(
    fake: FakeCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def locate(localizer: CellLocalizer, detection: Detection, frame: Frame) -> None:
        raise NoDepth(f"no depth at the {detection.label}")

    detections = unsure(fake)
    monkeypatch.setattr(CellLocalizer, "locate", locate)
    result = run_skill(Localize(detections=detections), fake)
    assert (result.reason, result.message) == ("no_depth", "no depth at the cube")
    assert fake.ledger.list_items() == []
