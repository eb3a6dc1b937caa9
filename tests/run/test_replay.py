"""A cell that replays recorded inputs, and continues on the cell inside."""

from __future__ import annotations

import pytest
from events import STEP, at, read, run_started
from executive.replay.replayed_cell import ReplayedCell

from executive.errors import Stopped
from executive.events import RunHalted, TimedEvent
from executive.run.replay import InputLog, Interruption
from executive.testing.fake_cell import FakeCell


def sense(tick: int, name: str, value: object, raised: str = "") -> TimedEvent:
    return at(tick, read(name, value, raised=raised))


START = [at(0, run_started()), sense(0, "clock", 0.0)]


def log(*events: TimedEvent) -> InputLog:
    return InputLog([*START, *events])


def test_questions_are_answered_from_the_log_and_commands_are_not_executed() -> None:
    fake = FakeCell()
    replayed = ReplayedCell(fake, log(sense(0, "tool.holding", True), sense(0, "command", None)))
    replayed.cell.arm.stop()
    assert (replayed.cell.tool.holding, fake.tool.holding) == (True, False)
    replayed.advance()
    assert (replayed.steps, fake.tick_count, replayed.cell.clock.now) == (1, 0, STEP)


def test_after_the_last_interruption_the_cell_inside_takes_over() -> None:
    fake = FakeCell()
    last = Interruption(1, "", False, 0)
    replayed = ReplayedCell(fake, log(sense(0, "tool.holding", True), sense(1, "tool.holding", False)), last)
    assert replayed.pending_interruption is None
    replayed.advance()
    assert (replayed.pending_interruption, replayed.cell.tool.holding) == (last, True)
    replayed.resume()
    assert (replayed.is_live, replayed.pending_interruption) == (True, None)
    assert not replayed.cell.tool.holding
    replayed.advance()
    assert replayed.steps == fake.tick_count == 2


@pytest.mark.parametrize("ticked", [False, True])
def test_it_ends_where_the_recorded_run_was_halted(ticked: bool) -> None:
    replayed = ReplayedCell(FakeCell(), log(at(1, RunHalted(ticked))))
    assert not replayed.has_run_ended
    replayed.advance()
    assert replayed.has_run_ended is not ticked
    if ticked:
        with pytest.raises(Stopped):
            replayed.advance()
    # The arm may brake afterwards.
    replayed.advance()
