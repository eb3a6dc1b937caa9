"""What slips from the tool comes down where physics says, and the ledger knows at once."""

from __future__ import annotations

import numpy as np
import pytest
from at_hand import look, pick

from executive.cells.fake.cell import FakeCell
from executive.geometry import GRAVITY
from executive.manipulation.motions import (
    MAX_PREDICTABLE_SPEED,
    detect_and_record_drop,
    predict_landing,
)
from executive.testing.run_skill import run_skill
from skills.transit import Transit


def test_from_rest_it_falls_straight_down() -> None:
    assert np.allclose(predict_landing(np.array((0.4, 0.1, 0.3)), np.zeros(3), 0.05), (0.4, 0.1, 0.025))


def test_thrown_it_comes_down_farther_on() -> None:
    """A parabola: 0.2 m down take sqrt(2 * 0.2 / g)."""
    x = predict_landing(np.array((0.4, 0.1, 0.25)), np.array((1.0, 0.0, 0.0)), 0.05)[0]
    assert x == pytest.approx(0.4 + np.sqrt(0.4 / GRAVITY))


@pytest.mark.parametrize("up", [-0.5, 0.0, 0.5])
def test_its_flight_begins_with_the_velocity_of_the_tool(up: float) -> None:
    place, velocity, height = np.array((0.0, 0.0, 0.4)), np.array((0.3, -0.2, up)), 0.06
    x, y, z = predict_landing(place, velocity, height)
    time = x / 0.3
    assert y == pytest.approx(-0.2 * time)
    assert 0.4 + up * time - GRAVITY * time**2 / 2 == pytest.approx(height)
    assert z == height / 2


def test_what_touches_the_ground_already_stays_where_it_is() -> None:
    assert np.allclose(
        predict_landing(np.array((0.4, 0.1, 0.04)), np.array((1.0, 0, 0)), 0.05)[:2], (0.4, 0.1)
    )


@pytest.fixture
def held(fake: FakeCell) -> str:
    """A cube in the tool."""
    fake.world.put("cube", 0.5, 0.0)
    (target,) = look(fake)
    return pick(fake, target)


def test_a_drop_is_recorded_once(fake: FakeCell, held: str) -> None:
    assert not detect_and_record_drop(fake.cell, held)
    fake.tool.break_seal()
    assert detect_and_record_drop(fake.cell, held)
    assert detect_and_record_drop(fake.cell, held)
    (row,) = fake.ledger.list_items()
    assert (row.state, row.attempts) == ("dropped", 1)


@pytest.mark.parametrize(
    ("speed", "state"),
    [(0.0, "placed"), (MAX_PREDICTABLE_SPEED - 0.01, "placed"), (MAX_PREDICTABLE_SPEED + 0.01, "lost")],
)
def test_what_slips_away_over_its_bin_is_believed_there_unless_it_was_thrown(
    fake: FakeCell, held: str, monkeypatch: pytest.MonkeyPatch, speed: float, state: str
) -> None:
    run_skill(Transit(held=held, bin="red_bin"), fake)
    monkeypatch.setattr(fake.arm, "tool_velocity", np.array((0.0, speed, 0.0)))
    fake.tool.break_seal()
    assert detect_and_record_drop(fake.cell, held)
    fake.ledger.set_final_states(completed=True)
    assert [row.state for row in fake.ledger.list_items()] == [state]
