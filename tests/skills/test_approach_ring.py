"""Parts with a hole are touched on their ring, thin ones not below their middle."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell
from executive.mission.parse.cell_file import load_cell
from executive.testing.run_skill import run_skill
from skills.approach import Approach

RING = 0.01


@pytest.fixture
def fake(missions: Path) -> FakeCell:
    """A fake cell with an empty table, whose cubes have a hole and whose ducks are thin."""
    changes = {"kind": "fake", "table.objects": "[0, 0]"}
    changes |= {"objects.cube.ring": str(RING), "objects.duck.height": "0.008"}
    return FakeCell(
        load_cell(missions / "cells" / "overhead.yaml", {f"cell.{k}": v for k, v in changes.items()})
    )


def test_a_part_with_a_hole_is_touched_beside_it(fake: FakeCell, target: Target) -> None:
    assert run_skill(Approach(target=target), fake).status == "SUCCESS"
    distance = np.linalg.norm(fake.arm.tool_pose.position[:2] - target.position[:2])
    assert distance == pytest.approx(RING, abs=2e-4)


def test_further_attempts_go_round_the_ring(
    fake: FakeCell, target: Target, look: Callable[..., list[Target]]
) -> None:
    steps = []
    for _ in range(5):
        (target,) = look()
        run_skill(Approach(target=target), fake)
        steps.append(fake.arm.tool_pose.position[:2] - target.position[:2])
        fake.ledger.record_failed_pick(target.item)
    assert np.linalg.norm(steps, axis=1) == pytest.approx([RING] * 5, abs=2e-4)
    angles = sorted(math.atan2(y, x) for x, y in steps)
    gaps = np.diff([*angles, angles[0] + math.tau])
    assert math.radians(30) < gaps.min() <= gaps.max() < math.radians(150)


def test_nothing_is_felt_for_below_the_middle_of_a_thin_part(
    fake: FakeCell, look: Callable[..., list[Target]]
) -> None:
    fake.world.put("duck", 0.5, 0.0)
    (target,) = look()
    fake.world.objects.clear()
    result = run_skill(Approach(target=target), fake)
    assert (result.reason, result.message) == (
        "no_contact", "no contact down to 4 mm, duck-1 was expected at 8 mm",
    )  # fmt: skip
    assert fake.ledger.records[0].empty_probe_count == 0, "a thin part cannot be distinguished from the table"
