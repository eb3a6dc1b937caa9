from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cells.fake.cell import FakeCell
from executive.errors import NoDepth
from executive.skill import SkillFailed
from executive.testing.run_skill import run_skill
from skills.detect import Detect
from skills.localize import Localize


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
    assert "its top is 80 mm above the table, and the top of a cube is at 50, 100, 106" in row.reason


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
    def locate(detection: Detection, frame: Frame) -> None:
        raise NoDepth(f"no depth at the {detection.label}")

    detections = unsure(fake)
    monkeypatch.setattr(type(fake.cell.localizer), "locate", staticmethod(locate))
    result = run_skill(Localize(detections=detections), fake)
    assert (result.reason, result.message) == ("no_depth", "no depth at the cube")
    assert fake.ledger.list_items() == []
