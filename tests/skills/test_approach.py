"""Approaches: contact, probes of the table, rings of parts with a hole."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from at_hand import look

from executive.drivers.fake import FakeTool
from executive.testing.fake_cell import FakeCell, load_empty_cell
from executive.testing.run_skill import run_skill
from skills.approach import Approach


def test_the_fourth_attempt_searches_for_an_object_almost_down_to_the_table(fake: FakeCell) -> None:
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look(fake)
    fake.world.objects.clear()
    messages = []
    for _ in range(4):
        current = replace(target, change_count=fake.ledger.change_count)
        messages.append(run_skill(Approach(target=current), fake).message)
    heights = [message.removeprefix("no contact down to ").split(" mm")[0] for message in messages]
    assert heights == ["35", "35", "35", "5"]
    assert [record.empty_probe_count for record in fake.ledger.records] == [1]


def test_a_probe_far_beside_the_middle_proves_nothing(fake: FakeCell) -> None:
    fake.world.put("duck", 0.5, 0.0)
    fake.world.put("sphere", 0.6, 0.1)
    _, target = look(fake)
    fake.world.objects.clear()
    for offset, empty_probe_count in ((0.02, 0), (0.0025, 1)):
        for _ in range(3):
            fake.ledger.record_failed_pick(target.item)
        current = replace(target, change_count=fake.ledger.change_count)
        run_skill(Approach(target=current, offset=offset), fake)
        assert fake.ledger.records[1].empty_probe_count == empty_probe_count


@pytest.mark.parametrize(
    ("is_touched", "reason", "message"),
    [
        (False, "contradicted", "cube-1 may be no cube: it was touched 21 mm above the table, and a cube is"),
        (True, "no_contact", "the top of cube-1 was expected at 50 mm; it was touched 21 mm above the table"),
    ],
)
def test_a_touch_that_only_the_fourth_attempt_can_make_is_no_touch_of_the_target(
    fake: FakeCell, is_touched: bool, reason: str, message: str
) -> None:
    thing = fake.world.put("cube", 0.5, 0.0)
    for _ in range(3):
        (target,) = look(fake)
    if is_touched:
        run_skill(Approach(target=target), fake)
    for _ in range(3):
        fake.ledger.record_failed_pick(target.item)
    thing.position[2] = -0.005
    result = run_skill(Approach(target=replace(target, change_count=fake.ledger.change_count)), fake)
    assert (result.reason, result.message[: len(message)]) == (reason, message)
    assert fake.ledger.describe(target.item).attempts == (4 if is_touched else 3)


RING = 0.01


@pytest.fixture
def parts() -> FakeCell:
    """A fake cell with an empty table, whose cubes have a hole and whose ducks are thin."""
    config = load_empty_cell()
    cube = config.objects["cube"].model_copy(update={"ring": RING})
    duck = config.objects["duck"].model_copy(update={"height": 0.008})
    objects = {**config.objects, "cube": cube, "duck": duck}
    return FakeCell(config.model_copy(update={"objects": objects}))


def test_further_attempts_go_round_the_ring(parts: FakeCell) -> None:
    parts.world.put("cube", 0.5, 0.0)
    steps = []
    for _ in range(5):
        (target,) = look(parts)
        run_skill(Approach(target=target), parts)
        steps.append(parts.arm.tool_pose.position[:2] - target.position[:2])
        parts.ledger.record_failed_pick(target.item)
    assert np.linalg.norm(steps, axis=1) == pytest.approx([RING] * 5, abs=3e-4)
    angles = sorted(math.atan2(y, x) for x, y in steps)
    gaps = np.diff([*angles, angles[0] + math.tau])
    assert math.radians(30) < gaps.min() <= gaps.max() < math.radians(150)


def test_nothing_is_felt_for_below_the_middle_of_a_thin_part(parts: FakeCell) -> None:
    parts.world.put("duck", 0.5, 0.0)
    (target,) = look(parts)
    parts.world.objects.clear()
    result = run_skill(Approach(target=target), parts)
    assert (result.reason, result.message[:23]) == ("no_contact", "no contact down to 4 mm")
    assert parts.ledger.records[0].empty_probe_count == 0, (
        "a thin part cannot be distinguished from the table"
    )


def test_a_contact_while_the_arm_is_still_fast_measures_nothing(fake: FakeCell) -> None:
    fake.world.put("duck", 0.5, 0.0)
    thing = fake.world.put("duck", 0.6, 0.1)
    run_skill(Approach(target=look(fake)[0]), fake)
    _, target = look(fake)
    thing.label = "sphere"
    thing.position[2] = 0.03
    result = run_skill(Approach(target=target), fake)
    assert (result.reason, "the next approach is slow" in result.message) == ("no_contact", True)
    again = replace(target, change_count=fake.ledger.change_count)
    assert run_skill(Approach(target=again), fake).reason == "contradicted"


def test_a_contact_sensor_that_feels_nothing_or_always_something_is_implausible(
    fake: FakeCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look(fake)
    for is_touching, failed_pick_count in ((True, 0), (False, 7)):
        monkeypatch.setattr(FakeTool, "touching", property(lambda tool, value=is_touching: value))
        for _ in range(failed_pick_count):
            fake.ledger.record_failed_pick(target.item)
        current = replace(target, change_count=fake.ledger.change_count)
        assert run_skill(Approach(target=current), fake).reason == "implausible"
