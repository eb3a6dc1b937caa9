from __future__ import annotations

import numpy as np

from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.detect import Detect
from skills.localize import Localize


def test_positions_are_where_the_objects_stand(fake: FakeCell) -> None:
    cube, duck = fake.world.put("cube", 0.48, 0.12), fake.world.put("duck", 0.6, -0.2)
    detections = run_skill(Detect(), fake).outputs["detections"]
    targets = run_skill(Localize(detections=detections), fake).outputs["targets"]
    assert [target.item for target in targets] == ["cube-1", "duck-1"]
    for target, thing in zip(targets, (cube, duck), strict=True):
        assert np.allclose(target.position, thing.position, atol=1e-6)


def test_a_frame_from_before_a_missed_grasp_is_stale(fake: FakeCell, look) -> None:
    fake.world.put("cube", 0.5, 0.0)
    look()
    old = run_skill(Detect(), fake).outputs["detections"]
    fake.ledger.missed("cube-1")
    result = run_skill(Localize(detections=old), fake)
    assert result.reason == "stale"
    assert result.message == "frame 2 shows the table before change 1; look again"


def test_a_frame_stays_good_after_a_pick_elsewhere(fake: FakeCell, look) -> None:
    fake.world.put("cube", 0.45, -0.2)
    fake.world.put("duck", 0.6, 0.2)
    look()
    old = run_skill(Detect(), fake).outputs["detections"]
    fake.ledger.held("cube-1")
    assert run_skill(Localize(detections=old), fake).status == "SUCCESS"
