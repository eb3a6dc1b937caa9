"""Pushes of an object away from its neighbours: direction, record, and reasons against a push."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from at_hand import look

from executive.mission.cell_file import load_cell
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.push import Push

PLACE = np.array((0.53, 0.0))


@pytest.fixture
def fingers(missions: Path) -> FakeCell:
    fake = FakeCell(load_cell(missions / "cells" / "iiwa_wsg50.yaml"))
    fake.world.objects.clear()
    fake.world.put("cube", *PLACE)
    return fake


def put_neighbours(fake: FakeCell, direction: tuple[float, float]) -> None:
    """Put spheres on both sides of the cube, nearer than the circle around it."""
    for sign in (1, -1):
        fake.world.put("sphere", *(PLACE + sign * 0.062 * np.array(direction)))


def test_a_push_leads_across_the_row_and_the_ledger_knows_the_new_place(fingers: FakeCell) -> None:
    put_neighbours(fingers, (0.7071, 0.7071))
    target = look(fingers)[0]
    result = run_skill(Push(target=target), fingers)
    assert result.status == "SUCCESS"
    displacement = fingers.ledger.describe("cube-1").position[:2] - PLACE
    assert abs(displacement @ (0.7071, 0.7071)) < 0.01
    assert 0.02 <= np.linalg.norm(displacement) < 0.1
    # The object has not moved in this cell without physics, and only a new look may permit a grasp.
    assert not fingers.ledger.is_fresh(target)
    assert run_skill(Push(target=target), fingers).reason == "stale"


def test_a_push_that_does_not_help_is_refused(fingers: FakeCell) -> None:
    result = run_skill(Push(target=look(fingers)[0]), fingers)
    assert (result.reason, result.commands) == ("blocked", [])
    assert "no neighbour of cube-1 is in the way" in result.message


def test_an_object_without_a_free_side_is_not_pushed(fingers: FakeCell) -> None:
    put_neighbours(fingers, (0.7071, 0.7071))
    put_neighbours(fingers, (0.7071, -0.7071))
    result = run_skill(Push(target=look(fingers)[0]), fingers)
    assert (result.reason, result.commands) == ("blocked", [])
    assert "no place with space for the fingers near cube-1" in result.message
