from __future__ import annotations

import pytest

from executive.cells.fake.cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.wait import Wait


@pytest.mark.parametrize("seconds", [0.0, 0.1, 2.5])
def test_waiting_takes_its_time_on_the_runs_clock_and_moves_nothing(fake: FakeCell, seconds: float) -> None:
    assert run_skill(Wait(seconds=seconds), fake).status == "SUCCESS"
    assert (fake.cell.clock.now, fake.arm.commands) == (pytest.approx(seconds, abs=1 / 240), [])


def test_waiting_can_be_halted(fake: FakeCell) -> None:
    assert run_skill(Wait(seconds=60.0), fake, halt_at=24).status == "HALTED"
    assert fake.cell.clock.now == pytest.approx(0.1)
